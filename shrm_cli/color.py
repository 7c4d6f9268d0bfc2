"""Linear RGB of one set of primaries as that of another.

Primaries and white are given as OpenEXR's attribute `chromaticities` has them: CIE x and y of red,
green, blue and white, 8 numbers.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Primaries = Sequence[float]

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""The primaries and the white of Rec.709 and sRGB."""
_SAME = 2e-3
"""How far numbers of the same primaries may be apart: files round them."""
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
"""From XYZ to the responses of cones that adapt to a white."""


def to_rec709(primaries: Primaries | None) -> Array | None:
    """The matrix from linear RGB of some primaries to that of Rec.709, shape (3, 3).

    Parameters
    ----------
    primaries : sequence of 8 float, optional

    Returns
    -------
    ndarray or None
        None where nothing is to be done: they are those of Rec.709, or not known, or impossible.
    """
    return None if primaries is None else _conversion(primaries, REC709)


def from_rec709(primaries: Primaries | None) -> Array | None:
    """The matrix from linear RGB of Rec.709 to that of some primaries, as `to_rec709` has it."""
    return None if primaries is None else _conversion(REC709, primaries)


def _conversion(source: Primaries, target: Primaries) -> Array | None:
    """The matrix between two sets of primaries; white stays white (Bradford's adaptation).

    References
    ----------
    SMPTE RP 177:1993 for the matrices to XYZ; Lam 1985 and ICC.1:2022, annex E, for Bradford's.
    """
    if len(source) != 8 or len(target) != 8 or not np.isfinite([*source, *target]).all():
        return None
    if np.allclose(source, target, rtol=0, atol=_SAME):
        return None
    try:
        first, second = _to_xyz(source), _to_xyz(target)
        whites = [_BRADFORD @ matrix.sum(axis=1) for matrix in (first, second)]
        adapted = np.linalg.solve(_BRADFORD, np.diag(whites[1] / whites[0]) @ _BRADFORD)
        result = np.linalg.solve(second, adapted @ first)
    except (np.linalg.LinAlgError, ZeroDivisionError):
        return None
    return result if np.isfinite(result).all() else None


def _to_xyz(primaries: Primaries) -> Array:
    """The matrix from linear RGB to XYZ, in which white has luminance 1."""
    points = np.reshape(primaries, (4, 2)).tolist()
    columns = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in points]).T
    return np.asarray(columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3]))
