"""Many materials beside each other: the energy that few orders capture of each (figure 5.7)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import compute_coefficients

Array = NDArray[np.floating]

ORDER_F, ORDER_P = 30, 5
"""Of figure 5.7."""
_ACCURACY = 1e-3


@dataclass(frozen=True)
class MaterialEnergies:
    """The energy that orders capture of several BRDFs.

    Attributes
    ----------
    names : tuple of str
    order_f : int
    captured : ndarray, shape (materials, P+1)
        Fractions of the energy, for P = 0, 1, ...; a BRDF that does not depend on the view has
        the same for all.
    """

    names: tuple[str, ...]
    order_f: int
    captured: Array


def material_energies(
    brdfs: Sequence[Brdf],
    names: Sequence[str],
    order_f: int = ORDER_F,
    order_p: int = ORDER_P,
    progress: Callable[[int, int], None] | None = None,
) -> MaterialEnergies:
    """Energy that F = `order_f` and P = 0 .. `order_p` capture of each BRDF (eq. 5.18).

    Parameters
    ----------
    brdfs : sequence of Brdf
    names : sequence of str
    order_f, order_p : int
    progress : callable, optional
        Called with BRDFs done, and BRDFs in all.

    Raises
    ------
    BrdfError
        If the coefficients of one do not converge.
    """
    rows = []
    for index, brdf in enumerate(brdfs):
        found = compute_coefficients(brdf, order_f, 0 if brdf.zonal else order_p, _ACCURACY)
        captured = found.captured()[order_f]
        rows.append(np.pad(captured, (0, order_p + 1 - len(captured)), mode="edge"))
        if progress is not None:
            progress(index + 1, len(brdfs))
    return MaterialEnergies(tuple(names), order_f, np.array(rows))
