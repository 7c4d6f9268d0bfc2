"""The table of representations: what `--to` names, and how each is made from an SHRM."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.cabral import Cabral
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.kautz_mccool import KautzMcCool
from shrm_cli.maps.explicit.light_field import LightField
from shrm_cli.maps.explicit.tabulate import tabulate
from shrm_cli.maps.light_map import EngineMap
from shrm_cli.maps.shrm.compressed import CompressedShrm
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import Frame

EXPLICIT: dict[str, type[ExplicitMap]] = {
    model.representation: model for model in (Cabral, KautzMcCool, LightField)
}
REPRESENTATIONS = (Shrm.representation, *EXPLICIT)
"""Those that an SHRM becomes."""

_PAIRS = 4096
"""Of central directions and views at which the error of a tabulated sum is measured."""

BrdfMap = Shrm | CompressedShrm | SummedShrm | ExplicitMap
Map = BrdfMap | EngineMap


@dataclass(frozen=True)
class Compression:
    """How far an SHRM is compressed by its principal components.

    Attributes
    ----------
    count : int, optional
        Components to keep.
    tolerance : float
        Without `count`: the relative RMS error that may be added.
    """

    count: int | None = None
    tolerance: float = 0.0


def represent(
    shrm: Shrm,
    representation: str,
    view_count: int | None = None,
    compression: Compression | None = None,
) -> BrdfMap:
    """An SHRM in another representation.

    Parameters
    ----------
    shrm : Shrm
    representation : str
        One of `REPRESENTATIONS`.
    view_count : int, optional
        Samples along an axis of the view of an explicit map.
    compression : Compression, optional
        Of an SHRM.

    Raises
    ------
    MapError
        If the result would be too large.
    """
    if representation in EXPLICIT:
        return EXPLICIT[representation].from_shrm(shrm, view_count)
    if compression is None:
        return shrm
    return CompressedShrm.from_shrm(shrm, compression.count, compression.tolerance)


def tabulate_sum(
    summed: SummedShrm, representation: str, view_count: int | None = None
) -> ExplicitMap:
    """A sum of terms as an explicit map over the mirror direction.

    Parameters
    ----------
    summed : SummedShrm
    representation : str
        One of `EXPLICIT`.
    view_count : int, optional
        Samples along an axis of the view.

    Raises
    ------
    MapError
        If the result would be too large.
    """
    kind = EXPLICIT[representation]
    if view_count is None:
        view_count = kind.default_view_count(max(summed.info.order_p, 1))
    made = tabulate(
        kind, summed, "reflection", summed.info, summed.size, view_count, summed.sampling
    )
    centers = spiral_directions(_PAIRS)
    views = np.random.default_rng(0).permutation(centers)
    exact = summed.central_radiance(centers, views)
    error = np.sum((made.central_radiance(centers, views) - exact) ** 2)
    added = np.sqrt(error / max(float(np.sum(exact**2)), 1e-300))
    info = replace(summed.info, added_error=float(np.hypot(summed.info.added_error, added)))
    return replace(made, info=info)


def as_shrm(reflection_map: Map, frame: Frame = "global", order_p: int | None = None) -> Shrm:
    """The SHRM that a map holds, or that fits it best.

    Parameters
    ----------
    reflection_map : Map
    frame : {"global", "local"}
    order_p : int, optional
        Of the result; that of the map by default. An SHRM can only lose orders.

    Raises
    ------
    MapError
        If the map does not determine so high an order.
    """
    if isinstance(reflection_map, SummedShrm):
        raise MapError(
            "a sum of terms about different centres has no single SHRM; prefilter again with "
            "--no-split, or convert it to explicit maps"
        )
    if isinstance(reflection_map, EngineMap):
        raise MapError(
            f"a map of representation {reflection_map.representation} has no SHRM; prefilter the "
            "probe for a BRDF"
        )
    if isinstance(reflection_map, ExplicitMap):
        return reflection_map.to_shrm(order_p).to_frame(frame)
    if isinstance(reflection_map, CompressedShrm):
        reflection_map = reflection_map.expand()
    if order_p is not None and order_p > reflection_map.order_p:
        raise MapError(
            f"an SHRM of order P = {reflection_map.order_p} has nothing of order {order_p}; "
            "lower --order-p"
        )
    return reflection_map.truncated(order_p).to_frame(frame)


def map_count(reflection_map: Map) -> int:
    """How many RGB cubes a map stores; an SH exponential has none."""
    if isinstance(reflection_map, EngineMap):
        return len(reflection_map.images())
    if isinstance(reflection_map, SummedShrm):
        return sum(map_count(term) for term in reflection_map.terms)
    if not isinstance(reflection_map, Shrm):
        return reflection_map.count
    every = reflection_map.order_p + 1
    return every if reflection_map.azimuth_free else every**2


def is_exact_in_half(reflection_map: Map) -> bool:
    """Whether half-precision floats hold every value of a map as it is."""
    if isinstance(reflection_map, EngineMap):
        return all(_is_exact(image) for image in reflection_map.images())
    if isinstance(reflection_map, SummedShrm):
        return all(is_exact_in_half(term) for term in reflection_map.terms)
    if isinstance(reflection_map, ExplicitMap):
        return all(_is_exact(image) for image in reflection_map.images)
    if isinstance(reflection_map, CompressedShrm):
        return _is_exact(reflection_map.components)
    return _is_exact(reflection_map.coefficients)


def _is_exact(values: NDArray[np.floating]) -> bool:
    with np.errstate(over="ignore"):
        return bool(np.array_equal(values.astype(np.float16), values))
