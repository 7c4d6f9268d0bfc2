"""A map with what is known of its error, and what both domains need to make one."""

from dataclasses import dataclass
from typing import Any

from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.representations import EXPLICIT, Map, map_count
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.orders import Orders
from shrm_cli.probe.probe import Probe


@dataclass(frozen=True)
class Baked:
    """A map, and what is known of its error.

    Attributes
    ----------
    map : Map
    orders : Orders
    error_bound : float or None
        Conservative relative RMS error (eq. 5.19) of the orders; None where the map was not
        made from them.
    """

    map: Map
    orders: Orders
    error_bound: float | None

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        info = self.map.info
        return {
            "representation": self.map.representation,
            "frame": self.map.frame,
            "center": self.map.center,
            "size": self.map.size,
            "sampling": self.map.sampling,
            "maps": map_count(self.map),
            "domain": info.domain,
            "order_f": info.order_f,
            "order_p": info.order_p,
            "epsilon": info.tolerance,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "error_bound": self.error_bound,
            "brdf": info.brdf,
            "probe": info.probe,
            "probe_sha256": info.probe_sha256,
        }


def check_memory(
    orders: Orders, size: int | None, representation: str, view_count: int | None
) -> None:
    """Refuse before the work what could not be kept in memory."""
    check_size(orders.order_f, orders.order_p, size)
    if representation in EXPLICIT:
        kind = EXPLICIT[representation]
        views = kind.default_view_count(orders.order_p) if view_count is None else view_count
        size = choose_size(orders.order_f) if size is None else size
        kind.check_memory(size, kind.image_count(views))


def provenance(probe: Probe, brdf: Brdf, orders: Orders) -> MapInfo:
    """What a map remembers, but for its errors."""
    return MapInfo(
        orders.order_f,
        orders.order_p,
        orders.tolerance,
        orders.captured,
        0.0,
        {"name": brdf.name, "parameters": dict(brdf.values)},
        probe.name.replace("\\", "/").rsplit("/", 1)[-1],
        probe.digest(),
        probe.chromaticities,
    )
