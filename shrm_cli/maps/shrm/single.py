"""One SHRM of an expansion, of a whole BRDF or a term of a sum, and the time that it takes."""

from dataclasses import replace

import numpy as np

from shrm_cli.maps.expansion import Expansion
from shrm_cli.maps.provenance import provenance
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, foretell
from shrm_cli.vocabulary import Frame, Sampling

# Seconds of one processor for each series, that is a coefficient map of one colour, measured from
# F = 36 to 320 and P = 2 to 28. The time of the series and of their texels grows with the cube of
# the order F + P, and that of packing with the number of values.
_COUPLING, _MOST_TERMS = 6e-10, 10  # for each term of order P; sums over rings replace many
_SYNTHESIS = 3e-9
_STORED_VALUE = 1.5e-7


def from_expansion(
    expansion: Expansion,
    probe: Probe,
    frame: Frame = "global",
    sampling: Sampling = "center",
    dtype: type = np.float64,
    progress: Progress | None = None,
) -> Shrm:
    """Make the SHRM of an expansion.

    Parameters
    ----------
    expansion : Expansion
    probe : Probe
        The probe of the expansion's light.
    frame, sampling, dtype
        The form of the map, as `Shrm.from_coefficients` takes it.
    progress : callable, optional
        The same.
    """
    orders, brdf = expansion.orders, expansion.brdf
    foretell(progress, making_seconds(expansion.carried, orders.order_p, expansion.size))
    info = replace(
        provenance(probe, brdf, orders),
        predicted_error=expansion.error,
        filter_error=expansion.filter_error(sampling),
        carried=expansion.carried,
    )
    return Shrm.from_coefficients(
        expansion.lighting.coefficients,
        expansion.kept, brdf.center, info, expansion.size, frame, sampling, dtype, progress,
    )  # fmt: skip


def making_seconds(order_f: int, order_p: int, size: int) -> float:
    """Estimate the seconds until an SHRM is made and written.

    Parameters
    ----------
    order_f : int
        The order F to which the light is carried.
    order_p : int
        The order P.
    size : int
        Texels along a face's edge.

    Returns
    -------
    float
        Within a factor of 2 where the rates were measured, if no other work is going on there.
    """
    series = 3 * (order_p + 1) ** 2
    coupling = _COUPLING * min(order_p, _MOST_TERMS)
    made = series * (order_f + order_p) ** 3 * (coupling + _SYNTHESIS)
    return made + series * 6 * size**2 * _STORED_VALUE
