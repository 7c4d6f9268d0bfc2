"""Which level of a split sum belongs to which roughness, as engines have it."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.vocabulary import MAX_LEVELS, MIN_ROUGHNESS, LevelMapping

_LEAST_STEP = 1e-5  # files hold them in single precision
DEFAULT_LEVELS: dict[LevelMapping, int] = {"linear": 8, "filament": 5, "unreal": 6}
"""``linear``: the second level, of roughness 0.14, is the sharpest that an expansion of order 256,
which takes a third of a second, still resolves. The others are what the engines have: Filament's
5, and Unreal's 8 mips of a face of 128 but for those beyond roughness 1."""

# A position that grows by the same amount from level to level, up to scale and shift.
_POSITIONS: dict[str, Callable[[float], float]] = {
    "linear": lambda roughness: roughness,
    "filament": lambda roughness: roughness * (2 - roughness),
    "unreal": lambda roughness: float(np.log2(roughness)),
}


def level_roughnesses(count: int, mapping: LevelMapping) -> tuple[float, ...]:
    """Perceptual roughness of each of `count` levels, rising to 1.

    With k from 0 to K - 1: ``linear`` is ``k / (K-1)``; ``filament`` ``1 - sqrt(1 - k / (K-1))``,
    which a shader inverts by ``k = (K-1) r (2 - r)``; ``unreal`` ``2^((k - K + 1) / 1.2)``,
    inverted by ``k = K - 1 + 1.2 log2(r)``, which is Unreal's own for a chain of K + 2 mips: the
    last two, beyond roughness 1, are left out.

    Parameters
    ----------
    count : int
        K; 1 is the level of roughness 1.
    mapping : {"linear", "filament", "unreal"}

    Raises
    ------
    MapError
        If there would be none or too many, or the first would be sharper than can be integrated.

    References
    ----------
    Filament: lodToPerceptualRoughness of cmgen, prefilteredRadiance of light_indirect.fs. Unreal
    Engine: ComputeReflectionCaptureMipFromRoughness.
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
    """Roughnesses of levels that rise and can be baked.

    Raises
    ------
    MapError
    """
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
    """The level below a roughness, and the weight of the next, 0 .. 1, as an engine mixes them.

    Linear in the mapping's own position; below the first level it is the first, beyond the last
    the last.

    Parameters
    ----------
    roughness : float
    levels : sequence of float
        Rising.
    mapping : {"linear", "filament", "unreal"}
    """
    if roughness <= levels[0]:
        return 0, 0.0
    if roughness >= levels[-1]:
        return len(levels) - 1, 0.0
    low = int(np.searchsorted(levels, roughness, side="right")) - 1
    position = _POSITIONS[mapping]
    start, end = position(levels[low]), position(levels[low + 1])
    return low, (position(roughness) - start) / (end - start)
