"""Lines through the colours of a block: what the formats of blocks have in common.

A block interpolates numbers that are nearly logarithms of light. In that space it gets the line
through its colours, or two lines for the better of some partitions. Ends come from principal
components, then from least squares.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.records import record

_MOVES = 4

Floats = NDArray[np.float32]
Members = NDArray[np.bool_]
Whole = NDArray[np.int64]


@record
class Space:
    """How a format makes numbers of light."""

    numbers: Callable[[Floats], Floats]
    light: Callable[[Floats], Floats]
    """`numbers` and `light`: from light to numbers, and back."""
    octave: float
    """How much a number grows, about, where the light doubles."""
    fractions: Mapping[int, Floats]
    """Where the steps of a line lie between its ends, by how many there are."""


@record
class Texels:
    """What is looked for: numbers as blocks interpolate them, and weights."""

    space: Space
    light: Floats
    values: Floats
    weights: Floats
    """`values` and `weights`: a difference squared, times its weight, is an error squared relative
    to the texel's light, shape (3, 16, n)."""

    @classmethod
    def of(cls, blocks: Array, space: Space) -> "Texels":
        """Return the texels of blocks of light, shape (3, 16, n)."""
        light = blocks.astype(np.float32)
        # An octave is a factor of 2: a step of a number is its log(2) / octave of a channel.
        weights = relative_weights(light) * (light**2 + 1e-5 * (light**2).sum(axis=0) + 1e-20)
        weights = (weights * (np.log(2) / space.octave) ** 2).astype(np.float32)
        return cls(space, light, space.numbers(light), weights)

    def by_light(self) -> "Texels":
        """Return the same, weighted by which errors are those of the light itself."""
        squares = self.light**2
        weights = squares + np.float32(1e-6) * squares.mean(axis=(0, 1))
        return Texels(self.space, self.light, self.values, weights)

    def chosen(self, texel: Whole) -> "Texels":
        """Return one texel of each block."""
        every = np.arange(len(texel))
        light, values, weights = (
            each[:, texel, every] for each in (self.light, self.values, self.weights)
        )
        return Texels(self.space, light, values, weights)

    def __getitem__(self, which: Whole) -> "Texels":
        light, values, weights = (
            each[..., which] for each in (self.light, self.values, self.weights)
        )
        return Texels(self.space, light, values, weights)


def relative_weights(light: Floats) -> Floats:
    """Return by what squared errors of light are multiplied, shape (16, n).

    This is halfway between errors that are relative to the light of each texel, and those that
    are relative to the mean of the block: bright texels of a block count more.
    """
    norm = np.sqrt((light * light).sum(axis=0)) + np.float32(1e-7)
    return 1 / (16 * norm * norm.mean(axis=0))


def scaled(texels: Texels) -> tuple[Floats, Floats, Floats]:
    """Return weights of texels, mean weights of channels, and values by their roots."""
    of_texel = texels.weights.sum(axis=0)
    of_texel /= of_texel.mean(axis=0)
    root = np.sqrt(texels.weights.mean(axis=1))
    return of_texel, root, texels.values * root[:, None]


def line(texels: Texels, members: Members, count: int) -> Floats:
    """Return the ends of the best line through the texels of a set: shape (2, 3, n)."""
    weight, root, values = scaled(texels)
    weight = weight * members
    weight = weight / np.maximum(weight.sum(axis=0), np.float32(1e-12))
    middle = (values * weight).sum(axis=1)
    off = values - middle[:, None]
    matrix = np.einsum("itn,jtn->nij", off * weight, off, optimize=True)
    for _ in range(3):  # its eighth power leaves little but the main axis
        matrix = matrix / np.maximum(
            np.trace(matrix, axis1=1, axis2=2), np.float32(1e-20)
        )[:, None, None]  # fmt: skip
        matrix = matrix @ matrix
    largest = np.argmax(np.einsum("nii->ni", matrix), axis=1)
    axis = matrix[np.arange(len(largest)), :, largest].T
    axis = axis / np.maximum(np.sqrt((axis * axis).sum(axis=0)), np.float32(1e-20))
    along = (off * axis[:, None]).sum(axis=0)
    low = np.where(members, along, np.float32(np.inf)).min(axis=0)
    high = np.where(members, along, np.float32(-np.inf)).max(axis=0)
    ends = np.stack([(middle + axis * each) / root for each in (low, high)]).astype(np.float32)
    for _ in range(2):
        at = texels.space.fractions[count][steps(texels, ends, count)]
        ends = solved(texels.values, texels.weights * members, at, ends)
    return ends


def solved(values: Floats, weights: Floats, at: Floats, ends: Floats) -> Floats:
    """Return the ends of lines that suit values best, by least squares: shape (2, 3, n).

    `values` and `weights` are each of shape (3, 16, n). `at`, of shape (16, n), is where the values
    lie: 0 at the first end, 1 at the last. `ends`, of shape (2, 3, n), are what stays where all
    values lie at one place.
    """
    weights = weights / weights.sum(axis=1, keepdims=True)
    far = weights * at
    a, c = (weights * (1 - at) ** 2).sum(axis=1), (far * at).sum(axis=1)
    b = far.sum(axis=1) - c
    y = (far * values).sum(axis=1)
    x = (weights * values).sum(axis=1) - y
    determinant = a * c - b * b
    is_sound = determinant > 1e-4
    divisor = np.where(is_sound, determinant, np.float32(1))
    moved = np.stack([c * x - b * y, a * y - b * x]) / divisor
    return np.where(is_sound, moved, ends).clip(0, 65535)


def along(texels: Texels, first: Floats, last: Floats) -> Floats:
    """Return where on their lines texels lie: 0 at the first end, 1 at the last."""
    way = last - first
    weighted = texels.weights * way
    length = (weighted * way).sum(axis=0)
    return ((texels.values - first) * weighted).sum(axis=0) / np.maximum(length, np.float32(1e-20))


def steps(texels: Texels, ends: Floats, count: int) -> Whole:
    """Return the steps of a line that lie nearest to texels, for ends of shape (2, 3, n)."""
    at = along(texels, ends[0][:, None], ends[1][:, None])
    return np.rint(np.clip(at, 0, 1) * (count - 1)).astype(np.int64)


def is_steep(texels: Texels) -> NDArray[np.bool_]:
    """Tell which blocks hold the edge of a lamp: their light differs by a factor of 8 and more."""
    green = texels.values[1]
    return green.max(axis=0) - green.min(axis=0) > 3 * texels.space.octave


def balanced(light: Callable[[Whole], Floats], wanted: Floats, indices: Whole, count: int) -> Whole:
    """Return the steps of texels, some moved by one so that blocks keep their light and energy.

    The steps of a steep line are coarse, and what its bright texels lose to rounding is a part of
    a lamp. Of all moves by one, the one is taken that leaves the least.

    `light` tells what decoders make of steps of shape (16, n): shape (k, 16, n). `wanted` is of
    shape (k, 16, n).
    """
    every = np.arange(indices.shape[-1])
    for _ in range(_MOVES):
        moved = [np.clip(indices + step, 0, count - 1) for step in (0, -1, 1)]
        here, *others = (light(at) - wanted for at in moved)
        whole = here.sum(axis=1, keepdims=True)
        added = []  # by each move to the squared errors of texels and of the energy
        for each in (here, *others):
            change = each**2 - here**2 + (whole + each - here) ** 2 - whole**2
            added.append(change.sum(axis=0))
        best = np.stack(added).reshape(-1, every.size).argmin(axis=0)
        step, texel = best // 16, best % 16
        indices = indices.copy()
        indices[texel, every] = np.stack(moved)[step, texel, every]
    return indices


def squared_error(texels: Texels, values: Floats) -> Floats:
    """Return the weighted squared error of blocks that read as values: shape (n,)."""
    return ((values - texels.values) ** 2 * texels.weights).sum(axis=(0, 1))


def between(ends: Floats, at: Floats, on_second: Members) -> Floats:
    """Return the values of texels, by where they lie between the ends of one line or two.

    `ends` are of shape (2 or 4, 3, n). `at`, of shape (16, n), is 0 at the first end of a line, 1
    at its last.
    """
    first = np.where(on_second, ends[-2][:, None], ends[0][:, None])
    last = np.where(on_second, ends[-1][:, None], ends[1][:, None])
    return first + at * (last - first)


# ---- the few blocks of a level that hold most of its error: the edges of lamps -------------------
# Their light falls off by a factor of up to 1000 within 4 texels, for which a line has 8 or 16
# steps. So they are searched for longer, and by the light itself in place of its logarithm: the
# dark texels beside a lamp give way to the bright ones.

STARTS = tuple(k / 20 for k in range(20))
"""Where on its line the dark end of a try begins."""
_ROUNDS = 4
_SHARE = 0.005**2
"""A block with more than this part of the square of a level's light in error may hold a lamp."""
_BRIGHT = 4.0
_MUCH = 1e-3
"""`_BRIGHT` and `_MUCH`: it does if the square of its light is so many times the mean of all blocks
as well, or this part of the level's. Where light is too dim for the steps of a format, every block
is in error, and no search makes that less."""
_AT_ONCE = 256
"""Blocks that are searched for at once: each takes 0.15 MB of UASTC HDR, and 1.4 of BC6H."""


@record
class Found:
    """Blocks that are ready."""

    data: NDArray[np.uint8]
    """Shape (n, 16)."""
    error: Floats
    """What blocks are compared by, shape (n,)."""
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
    squares = (blocks**2).sum(axis=(0, 1))
    whole = squares.sum()
    bright = min(_BRIGHT / squares.size, _MUCH) * whole
    lamps = np.flatnonzero((found.off > _SHARE * whole) & (squares > bright))
    for some in slices(lamps.size, _AT_ONCE):
        found.data[lamps[some]] = search(blocks[..., lamps[some]]).data
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
