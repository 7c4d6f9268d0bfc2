"""Split sums for `choose`; see `shrm_cli.maps.offers`."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.environment.lobe import perceptual_roughness
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import BrdfError
from shrm_cli.maps.info import record_of, spec_of
from shrm_cli.maps.offers import LookUp, Setting
from shrm_cli.maps.options import counted
from shrm_cli.maps.shader.cost import brushed_cost, even_cost, split_sum_cost
from shrm_cli.maps.size import stored_bytes
from shrm_cli.maps.splitsum.prefilter import split_material
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.vocabulary import EVEN_LOOK_UPS, NO_TAPS, TAP_COUNTS

_SIZES: tuple[dict[str, int], ...] = ({"size": 16}, {"size": 32}, {"size": 64}, {})
"""The sizes of split sums of a single level; the last has its own."""


def settings(brdf: Brdf) -> list[Setting]:
    """Return the whole chain and single levels of a roughness, or brushed GGX's chain."""
    if not isinstance(brdf, Ggx):
        return _of_material(brdf)
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


def _of_material(brdf: Brdf) -> list[Setting]:
    """Return the chain and single levels of another BRDF; none where no split sum is of it."""
    names = brdf.roughness_names
    if not (
        brdf.isotropic and all(isinstance(brdf.values.get(each), float | int) for each in names)
    ):
        return []
    others = {name: value for name, value in brdf.values.items() if name not in names}
    material = type(brdf)(**others)
    try:
        split_material(material)
    except BrdfError:
        return []
    chain, own = {"brdf": spec_of(record_of(material))}, (perceptual_roughness(brdf),)
    levels = [Setting({**chain, "levels": own, **size}) for size in _SIZES]
    return [Setting(chain), *levels]


def look_up(made: SplitSum, brdf: Brdf, taps: int | None) -> LookUp:
    """Return what the code of a map takes, by so many look-ups where the lobe lies."""
    stored = sum(stored_bytes(level.shape[1], 1) for level in made.levels)
    what = f"{counted(len(made.levels), 'level')} of {made.size}"
    if not taps:
        return LookUp(what, stored, split_sum_cost())
    cost = even_cost(taps) if brdf.isotropic else brushed_cost(taps)
    return LookUp(f"{what}, {counted(taps, 'tap')}", stored, cost)
