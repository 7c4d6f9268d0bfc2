"""The few blocks of a level that hold most of its error: the edges of lamps.

Their light falls off by a factor of up to 1000 within 4 texels, for which a line has 8 or 16 steps.
So they are searched for longer, and by the light itself in place of its logarithm: the dark texels
beside a lamp give way to the bright ones.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks.lines import Floats, Members, Texels, Whole
from shrm_cli.records import record

STARTS = tuple(k / 20 for k in range(20))
"""Where on its line the dark end of a try begins."""
_ROUNDS = 4
_SHARE = 0.005**2
"""A block with more than this part of the square of a level's light in error holds a lamp."""


@record
class Found:
    """Blocks that are ready."""

    data: NDArray[np.uint8]
    """Shape (n, 16)."""
    error: Floats
    """By which blocks are compared, shape (n,)."""
    off: Floats
    """Squared errors of their light, shape (n,)."""

    def replace(self, which: Whole, tried: "Found") -> None:
        """Take those of some blocks that are better."""
        better = tried.error < self.error[which]
        for old, new in zip(self.arrays, tried.arrays, strict=True):
            old[which[better]] = new[better]

    @property
    def arrays(self) -> tuple[Any, ...]:
        return self.data, self.error, self.off


def best(found: Found, tries: int) -> Found:
    """Return the best of some tries, of which all blocks of each stand behind each other."""
    count = len(found.data) // tries
    which = found.error.reshape(tries, count).argmin(axis=0) * count + np.arange(count)
    return Found(*(each[which] for each in found.arrays))


Encoder = Callable[[Array], Found]


def with_lamps(blocks: Array, found: Found, search: Encoder) -> NDArray[np.uint8]:
    """Return blocks with those of lamps searched for again."""
    lamps = np.flatnonzero(found.off > _SHARE * (blocks**2).sum())
    if lamps.size:
        found.data[lamps] = search(blocks[..., lamps]).data
    return found.data


def light_error(light: Floats, wanted: Floats) -> Floats:
    """Return the squared errors of the texels and the energy of blocks: shape (n,).

    `light` and `wanted`, each of shape (k, 16, n), are what is read, and what should be.
    """
    off = light - wanted
    return (off**2).sum(axis=(0, 1)) + (off.sum(axis=1) ** 2).sum(axis=0)


def nearest(texels: Texels, ends: Floats, count: int) -> Whole:
    """Return the steps of a line whose light is nearest to that of texels, shape (16, n).

    `ends` are of shape (2, 3, n). `count` is the number of steps of the line.
    """
    return step_errors(texels, ends, count).argmin(axis=0)


def step_errors(texels: Texels, ends: Floats, count: int) -> Floats:
    """Return the squared errors of light of each step of a line at each texel: (count, 16, n)."""
    off = np.empty((count, *texels.light.shape[1:]), dtype=np.float32)
    for k, at in enumerate(texels.space.fractions[count]):
        light = texels.space.light(ends[0] + at * (ends[1] - ends[0]))
        off[k] = ((light[:, None] - texels.light) ** 2).sum(axis=0)
    return off


def refined(texels: Texels, members: Members, ends: Floats, count: int, start: ArrayLike) -> Floats:
    """Return ends whose steps suit the light of the members of a line, by Gauss and Newton.

    The end that is darker begins somewhere on the line, at one start for all or one for each.
    """
    is_turned = ends[0].sum(axis=0) > ends[1].sum(axis=0)
    ends = np.where(is_turned, ends[::-1], ends)
    ends = np.stack([ends[0] + np.asarray(start, np.float32) * (ends[1] - ends[0]), ends[1]])
    octave = np.float32(texels.space.octave)
    for _ in range(_ROUNDS):
        at = texels.space.fractions[count][nearest(texels, ends, count)]
        light = texels.space.light(ends[0][:, None] + at * (ends[1] - ends[0])[:, None])
        slope = light * np.float32(np.log(2)) / octave + np.float32(1e-9)
        step = ((texels.light - light) / slope).clip(-octave, octave)
        weight = slope**2 * members
        weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), np.float32(1e-30))
        near, far = weight * (1 - at), weight * at
        a, b, c = ((w * part).sum(axis=1) for w, part in ((near, 1 - at), (near, at), (far, at)))
        x, y = (near * step).sum(axis=1), (far * step).sum(axis=1)
        determinant = a * c - b * b
        is_sound = determinant > 1e-5
        divisor = np.where(is_sound, determinant, np.float32(1))
        moved = np.stack([c * x - b * y, a * y - b * x]) / divisor
        ends = (ends + np.where(is_sound, moved, 0).clip(-octave, octave)).clip(0, 65535)
    return ends
