"""Which roughness each level of a split sum has, by the mappings that engines use."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.vocabulary import MAX_LEVELS, MIN_ROUGHNESS, LevelMapping

_LEAST_STEP = 1e-5
"""The least difference of roughness between two levels. Files hold roughnesses as 32-bit floats,
so that smaller differences could be lost."""
DEFAULT_LEVELS: dict[LevelMapping, int] = {"linear": 8, "filament": 5, "unreal": 6}
"""The number of levels that each mapping has by default. With 8 ``linear`` levels, the second, of
roughness 0.14, is the sharpest that an expansion of order 256 still resolves, which takes a third
of a second. The other numbers are those of the engines: Filament has 5, and Unreal has 8 mips for
a face of 128, of which the 2 beyond roughness 1 are left out."""

# Functions of the roughness that grow by the same amount from each level to the next.
_POSITIONS: dict[str, Callable[[Array], Array]] = {
    "linear": lambda roughness: roughness,
    "filament": lambda roughness: roughness * (2 - roughness),
    "unreal": np.log2,
}


def level_roughnesses(count: int, mapping: LevelMapping) -> tuple[float, ...]:
    """Return the perceptual roughness of each of K levels, rising to 1.

    The roughness r of level k, from 0 to K - 1, is

    - ``linear``: ``k / (K-1)``;
    - ``filament``: ``1 - sqrt(1 - k / (K-1))``, which a shader inverts by ``k = (K-1) r (2 - r)``;
    - ``unreal``: ``2^((k - K + 1) / 1.2)``, which a shader inverts by ``k = K - 1 + 1.2 log2(r)``.
      This is Unreal's own mapping for a chain of K + 2 mips, without the last two mips, which are
      beyond roughness 1.

    `count` is the number K of levels. A single level has roughness 1.

    References: Filament: lodToPerceptualRoughness of cmgen, prefilteredRadiance of
    light_indirect.fs. Unreal Engine: ComputeReflectionCaptureMipFromRoughness.
    """
    if not 1 <= count <= MAX_LEVELS:
        raise MapError(f"a split sum has 1 to {MAX_LEVELS} levels, not {count}")
    if count == 1:
        return (1.0,)
    steps = np.arange(count) / (count - 1)
    if mapping == "unreal":
        values = 2.0 ** ((steps - 1) * (count - 1) / 1.2)
    else:
        values = steps if mapping == "linear" else 1 - np.sqrt(1 - steps)
    return check_roughnesses([float(value) for value in values], mapping)


def check_roughnesses(values: Sequence[float], mapping: LevelMapping) -> tuple[float, ...]:
    """Check that levels of these perceptual roughnesses can be made, and return them."""
    if not 1 <= len(values) <= MAX_LEVELS:
        raise MapError(f"a split sum has 1 to {MAX_LEVELS} levels, not {len(values)}")
    for value in values:
        if value == 0 and mapping == "unreal":
            raise MapError("the mapping unreal is logarithmic: it has no level of roughness 0")
        if not (value == 0 or MIN_ROUGHNESS <= value <= 1):
            raise MapError(
                f"a level of roughness {value:.3g} cannot be made; take 0, or {MIN_ROUGHNESS:g} "
                "to 1, or fewer levels"
            )
    if any(high - low < _LEAST_STEP for low, high in pairwise(values)):
        raise MapError(f"the roughnesses of the levels must rise, by {_LEAST_STEP:g} at least")
    return tuple(values)


def blend(roughness: float, levels: Sequence[float], mapping: LevelMapping) -> tuple[int, float]:
    """Choose the two levels that an engine mixes for a roughness, and their weights.

    The weights are linear in the mapping's own position. A roughness below that of the first level
    takes the first level alone, and one beyond that of the last level takes the last alone.

    `levels` are the perceptual roughnesses of the levels, rising.

    Returns `level`, the index of the lower level; and `weight`, the weight of the next level, in 0
    .. 1; the lower level has the rest.
    """
    if roughness <= levels[0]:
        return 0, 0.0
    if roughness >= levels[-1]:
        return len(levels) - 1, 0.0
    low = int(np.searchsorted(levels, roughness, side="right")) - 1
    values = np.array([levels[low], levels[low + 1], roughness])
    start, end, at = _POSITIONS[mapping](values).tolist()
    return low, (at - start) / (end - start)


def level_numbers(roughness: Array, levels: Sequence[float], mapping: LevelMapping) -> Array:
    """Return the places of many roughnesses among the levels: 1.25 is a quarter of level 2."""
    position = _POSITIONS[mapping]
    within = np.clip(np.asarray(roughness, dtype=float), levels[0], levels[-1])
    return np.interp(position(within), position(np.array(levels)), np.arange(len(levels)))
