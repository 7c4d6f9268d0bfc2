"""The energy that few orders capture of many materials (figure 5.7).

Figures and equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import compute_coefficients
from shrm_cli.progress import Progress
from shrm_cli.records import record

Array = NDArray[np.floating]

ORDER_F, ORDER_P = 30, 5
"""The order F and the largest order P of figure 5.7."""

_ACCURACY = 1e-3
"""The fraction of a BRDF's energy that the sampling of its coefficients may miss."""


@record(eq=False)
class MaterialEnergies:
    """The energy that orders capture of several BRDFs.

    Attributes
    ----------
    names : tuple of str
    order_f : int
    captured : ndarray, shape (materials, P+1)
        Fractions of the energy for P = 0, 1, and so on. A BRDF that does not depend on the view
        has the same fraction for all P.
    """

    names: tuple[str, ...]
    order_f: int
    captured: Array


def material_energies(
    brdfs: Sequence[Brdf],
    names: Sequence[str],
    order_f: int = ORDER_F,
    order_p: int = ORDER_P,
    progress: Progress | None = None,
) -> MaterialEnergies:
    """Compute the energy that F = `order_f` and P = 0 .. `order_p` capture (eq. 5.18).

    Parameters
    ----------
    brdfs : sequence of Brdf
    names : sequence of str
        A name for each BRDF.
    order_f, order_p : int
    progress : callable, optional
        Called with the number of BRDFs done and the number of all BRDFs.

    Raises
    ------
    BrdfError
        If a BRDF is anisotropic, or its coefficients do not converge.
    """
    rows = []
    for index, brdf in enumerate(brdfs):
        found = compute_coefficients(brdf, order_f, 0 if brdf.zonal else order_p, _ACCURACY)
        captured = found.captured()[order_f]
        rows.append(np.pad(captured, (0, order_p + 1 - len(captured)), mode="edge"))
        if progress is not None:
            progress(index + 1, len(brdfs))
    return MaterialEnergies(tuple(names), order_f, np.array(rows))
