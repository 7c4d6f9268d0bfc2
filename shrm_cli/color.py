"""Linear RGB of one set of primaries as that of another.

Primaries and white are given as OpenEXR's attribute `chromaticities` has them: CIE x and y of red,
green, blue and white, 8 numbers. Light whose primaries nobody states is taken for Rec.709.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.vocabulary import PRIMARIES

Primaries = Sequence[float]

REC709 = PRIMARIES["rec709"]
"""The primaries and the white of Rec.709 and sRGB."""
_SAME = 2e-3
"""How far numbers of the same primaries may be apart: files round them."""
_TITLES = {
    "rec709": "Rec.709", "rec2020": "Rec.2020", "p3": "P3", "dci-p3": "DCI-P3",
    "adobe": "Adobe RGB", "acescg": "ACEScg", "aces2065-1": "ACES2065-1", "xyz": "CIE XYZ",
}  # fmt: skip
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
"""From XYZ to the responses of cones that adapt to a white."""


def conversion(source: Primaries | None, target: Primaries | None) -> Array | None:
    """The matrix from linear RGB of some primaries to that of others; white stays white.

    Where `source` or `target` is None, it is Rec.709. The numbers of CIE XYZ are taken to be
    relative to D65, as renderers write them; adaptation between other whites is Bradford's.

    Returns an array of shape (3, 3), or None where nothing is to be done: both are the same, or one
    of them is impossible.

    References: SMPTE RP 177:1993 for the matrices to XYZ; Lam 1985 and ICC.1:2022, annex E, for
    Bradford's.
    """
    source, target = (REC709 if each is None else each for each in (source, target))
    if same_primaries(source, target):
        return None
    first, second = _to_xyz(source), _to_xyz(target)
    if first is None or second is None:
        return None
    adapted = adaptation(_white(source), _white(target))
    result = np.linalg.solve(second, adapted @ first)
    return result if np.isfinite(result).all() else None


def adaptation(source: Array, target: Array) -> Array:
    """Bradford's matrix that makes one white another; XYZ of both, of shape (3,)."""
    before, after = _BRADFORD @ source, _BRADFORD @ target
    with np.errstate(all="ignore"):  # files hold anything; what is not finite is found later
        return np.linalg.solve(_BRADFORD, np.diag(after / before) @ _BRADFORD)


def mix_channels(values: Array, matrix: Array) -> Array:
    """A matrix times each three values, in an array of shape (..., 3 n), of the array's type."""
    mixed = values.reshape(*values.shape[:-1], -1, 3) @ matrix.T.astype(values.dtype)
    return np.asarray(mixed.reshape(values.shape))


def to_rec709(primaries: Primaries | None) -> Array | None:
    """The matrix from linear RGB of some primaries to that of Rec.709; see `conversion`."""
    return conversion(primaries, REC709)


def from_rec709(primaries: Primaries | None) -> Array | None:
    """The matrix from linear RGB of Rec.709 to that of some primaries; see `conversion`."""
    return conversion(REC709, primaries)


def srgb_to_linear(values: Array) -> Array:
    """Linear values from those encoded as sRGB has it (IEC 61966-2-1)."""
    return np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    )


def same_primaries(one: Primaries | None, other: Primaries | None) -> bool:
    """Whether two sets of primaries are the same but for rounding; None is Rec.709."""
    one, other = (REC709 if each is None else each for each in (one, other))
    return len(one) == len(other) and bool(np.allclose(one, other, rtol=0, atol=_SAME))


def is_possible(primaries: Primaries) -> bool:
    """Whether numbers are primaries and a white that light can be converted from and to."""
    return fault_of(primaries) is None


def are_unset(primaries: tuple[float, ...] | None) -> bool:
    """Whether all of a file's primaries are zero, a field that its writer has not filled in."""
    return primaries is not None and not any(primaries)


def fault_of(primaries: Primaries) -> str | None:
    """Why numbers are no primaries and white of light, in a few words; None if they are.

    Blue may have a y below 0, as that of ACES2065-1 and of cameras has.
    """
    if len(primaries) != 8 or not np.isfinite(primaries).all():
        return "they are not eight finite numbers, x and y of red, green, blue and white"
    if primaries[7] <= 0:
        return f"their white has y = {primaries[7]:g}"
    for name, y in (("red", primaries[1]), ("green", primaries[3])):
        if y < 0:
            return f"their {name} has y = {y:g}"
    red, green, blue, white = np.reshape(primaries, (4, 2)).astype(float)
    with np.errstate(all="ignore"):
        parts = np.array([_turn(green, blue, white), _turn(blue, red, white)])
        parts = np.append(parts, _turn(red, green, white)) / _turn(red, green, blue)
    if not (np.isfinite(parts).all() and _to_xyz(primaries) is not None):
        return "red, green and blue are on one line"
    return None if (parts > 0).all() else "white is not between red, green and blue"


def _turn(first: Array, second: Array, third: Array) -> float:
    """Twice the area of a triangle, below 0 if its corners go round clockwise."""
    one, other = second - first, third - first
    return float(one[0] * other[1] - one[1] * other[0])


def title_of(primaries: Primaries | None) -> str:
    """What messages call primaries: their name, or ``"primaries of its own"``."""
    for name, known in PRIMARIES.items():
        if same_primaries(primaries, known):
            return _TITLES[name]
    return "primaries of its own"


def luminance_weights(primaries: Primaries | None) -> Array:
    """Weights of linear R, G and B in the luminance, shape (3,), whose sum is 1."""
    return np.asarray(xyz_matrix(primaries)[1])


def xyz_matrix(primaries: Primaries | None) -> Array:
    """The matrix from linear RGB to CIE XYZ, in which white has Y = 1, shape (3, 3).

    Primaries that are not stated, or that nothing can have, count as Rec.709.

    References: SMPTE RP 177:1993.
    """
    matrix = None if primaries is None else _to_xyz(primaries)
    return xyz_matrix(REC709) if matrix is None else matrix


def _to_xyz(primaries: Primaries) -> Array | None:
    """The matrix from linear RGB to XYZ, in which white has luminance 1; None for no primaries."""
    if len(primaries) != 8 or not np.isfinite(primaries).all():
        return None
    x, y = np.reshape(primaries, (4, 2)).T
    columns = np.array([x, y, 1 - x - y])
    with np.errstate(all="ignore"):
        white = columns[:, 3] / y[3]
        try:
            result = columns[:, :3] * np.linalg.solve(columns[:, :3], white)
        except np.linalg.LinAlgError:
            return None
    return result if np.isfinite(result).all() and np.linalg.matrix_rank(result) == 3 else None


def _white(primaries: Primaries) -> Array:
    """XYZ of the white that is adapted to: D65 for XYZ itself, which has no white of its own."""
    if same_primaries(primaries, PRIMARIES["xyz"]):
        primaries = REC709
    x, y = primaries[6:]
    return np.array([x / y, 1.0, (1 - x - y) / y])
