"""Cabral's maps for `choose`; see `shrm_cli.maps.offers`."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.offers import LookUp, Setting
from shrm_cli.maps.options import counted
from shrm_cli.maps.shader.cost import cabral_cost
from shrm_cli.maps.size import stored_bytes

_MOST_BYTES = 2 * 10**6
"""Twelve views miss so much of what is glossy that more texels help nothing: 27 % in a studio at a
roughness of .3 with 24 texels along an edge as with 96."""


def settings(brdf: Brdf) -> list[Setting]:
    """Return one of few bytes, of what is not brushed."""
    return [Setting({"max_size": _MOST_BYTES})] if brdf.isotropic else []


def look_up(made: ExplicitMap, brdf: Brdf, taps: int | None) -> LookUp:
    """Return what the code of a map takes."""
    planes = made.planes()
    stored = sum(stored_bytes(each.shape[1], 1) for each in planes)
    what = f"{counted(len(planes), 'cube')} of {made.size}"
    return LookUp(what, stored, cabral_cost(made.center))
