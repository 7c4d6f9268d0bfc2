"""SH exponentials for `choose`; see `shrm_cli.maps.offers`."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.maps.offers import FLOATS, LookUp, Setting
from shrm_cli.maps.shader.cost import exponential_cost
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential


def settings(brdf: Brdf) -> list[Setting]:
    """Return the one that is fitted to the roughness of GGX alone."""
    if not (isinstance(brdf, Ggx) and brdf.surface is not None):
        return []
    own, _ = brdf.surface
    return [Setting({"roughness": (own, own)})]


def look_up(made: SphericalHarmonicExponential, brdf: Brdf, taps: int | None) -> LookUp:
    """Return what the code of a map takes, for the reflectance of the BRDF."""
    is_grey = len(set(brdf.color("f0"))) == 1
    cost = exponential_cost(made.order_p, made.order_q, is_grey)
    what = f"orders {made.order_p} and {made.order_q}"
    return LookUp(what, FLOATS * len(made.coefficients), cost)
