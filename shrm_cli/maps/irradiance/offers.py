"""Irradiance for `choose`; see `shrm_cli.maps.offers`."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.offers import FLOATS, LookUp, Setting
from shrm_cli.maps.shader.cost import irradiance_cost

_ORDERS = 2, 4, 8
"""Nine coefficients, 25 and 81."""


def settings(brdf: Brdf) -> list[Setting]:
    """Return some orders, for what is diffuse."""
    is_diffuse = isinstance(brdf, Lambertian)
    return [Setting({"order_f": order}) for order in _ORDERS] if is_diffuse else []


def look_up(made: Irradiance, brdf: Brdf, taps: int | None) -> LookUp:
    """Return what the code of a map takes."""
    stored = FLOATS * len(made.coefficients)
    return LookUp(f"order {made.order_f}", stored, irradiance_cost(made.order_f))
