"""Split sums for `choose`; see `shrm_cli.maps.offers`."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.maps.offers import LookUp, Setting
from shrm_cli.maps.options import counted
from shrm_cli.maps.shader.cost import brushed_cost, even_cost, split_sum_cost
from shrm_cli.maps.size import stored_bytes
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.vocabulary import EVEN_LOOK_UPS, NO_TAPS, TAP_COUNTS

_SIZES: tuple[dict[str, int], ...] = ({"size": 16}, {"size": 32}, {"size": 64}, {})
"""The sizes of split sums of a single level; the last has its own."""


def settings(brdf: Brdf) -> list[Setting]:
    """Return the whole chain and single levels of a roughness of GGX, or brushed GGX's chain."""
    if not isinstance(brdf, Ggx):
        return []
    found = []
    if brdf.surface is not None:
        own, _ = brdf.surface
        found = [
            Setting({}, taps=EVEN_LOOK_UPS),
            *(Setting({"levels": (own,), **size}, taps=(NO_TAPS,)) for size in _SIZES),
        ]
    if not brdf.isotropic and brdf.brushed_surface is not None:
        found.append(Setting({}, taps=TAP_COUNTS))
    return found


def look_up(made: SplitSum, brdf: Brdf, taps: int | None) -> LookUp:
    """Return what the code of a map takes, by so many look-ups where the lobe lies."""
    stored = sum(stored_bytes(level.shape[1], 1) for level in made.levels)
    what = f"{counted(len(made.levels), 'level')} of {made.size}"
    if not taps:
        return LookUp(what, stored, split_sum_cost())
    cost = even_cost(taps) if brdf.isotropic else brushed_cost(taps)
    return LookUp(f"{what}, {counted(taps, 'tap')}", stored, cost)
