"""One SHRM of an expansion: of a whole BRDF, or of a term of a sum."""

from dataclasses import replace

import numpy as np

from shrm_cli.maps.expansion import Expansion
from shrm_cli.maps.provenance import provenance
from shrm_cli.maps.shrm.seconds import making_seconds
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, foretell
from shrm_cli.vocabulary import Frame, Sampling


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
