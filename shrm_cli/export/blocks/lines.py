"""Lines through the colours of a block: what the formats of blocks have in common.

A block interpolates numbers that are nearly logarithms of light. In that space it gets the line
through its colours, or two lines for the better of some partitions. Ends come from principal
components, then from least squares.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.records import record

_MOVES = 4

Floats = NDArray[np.float32]
Members = NDArray[np.bool_]
Whole = NDArray[np.int64]


@record
class Space:
    """How a format makes numbers of light.

    Attributes
    ----------
    numbers, light : callable
        From light to numbers, and back.
    octave : int
        How much a number grows, about, where the light doubles.
    """

    numbers: Callable[[Floats], Floats]
    light: Callable[[Floats], Floats]
    octave: float


@record
class Texels:
    """What is looked for: numbers as blocks interpolate them, and weights.

    Attributes
    ----------
    space : Space
    values, weights : ndarray, shape (3, 16, n)
        A difference squared, times its weight, is an error squared relative to the texel's light.
    """

    space: Space
    light: Floats
    values: Floats
    weights: Floats

    @classmethod
    def of(cls, blocks: Array, space: Space) -> "Texels":
        """Return the texels of blocks of light, shape (3, 16, n)."""
        light = blocks.astype(np.float32)
        norm = np.sqrt((light * light).sum(axis=0)) + np.float32(1e-7)
        # Bright texels of a block count more: within it, the error is that of the light itself.
        importance = (norm / norm.mean(axis=0)) ** 2
        relative = (light / norm) ** 2 + np.float32(1e-5)
        weights = relative * importance * np.float32((np.log(2) / space.octave) ** 2 / 16)
        return cls(space, light, space.numbers(light), weights)

    @property
    def scale(self) -> Floats:
        """What weighted errors are multiplied with to be those of light, about: shape (n,)."""
        norm: Floats = np.sqrt((self.light * self.light).sum(axis=0)).mean(axis=0)
        return 16 * norm**2

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


def scaled(texels: Texels) -> tuple[Floats, Floats, Floats]:
    """Return weights of texels, mean weights of channels, and values by their roots."""
    of_texel = texels.weights.sum(axis=0)
    of_texel /= of_texel.mean(axis=0)
    root = np.sqrt(texels.weights.mean(axis=1))
    return of_texel, root, texels.values * root[:, None]


def line(texels: Texels, members: Members, count: int) -> tuple[Floats, Floats]:
    """Return the ends of the best line through the texels of a set: shape (3, n) each."""
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
    first, last = (middle + axis * low) / root, (middle + axis * high) / root
    for _ in range(2):
        first, last = _by_least_squares(texels, members, count, first, last)
    return first, last


def _by_least_squares(
    texels: Texels, members: Members, count: int, first: Floats, last: Floats
) -> tuple[Floats, Floats]:
    """Return the ends that suit the texels best where they lie now."""
    near = np.clip(along(texels, first[:, None], last[:, None]), 0, 1) * (count - 1)
    at = np.rint(near).astype(np.float32) / np.float32(count - 1)
    weight = texels.weights * members / (texels.weights * members).sum(axis=1, keepdims=True)
    far = weight * at
    a, c = (weight * (1 - at) ** 2).sum(axis=1), (far * at).sum(axis=1)
    b = far.sum(axis=1) - c
    y = (far * texels.values).sum(axis=1)
    x = (weight * texels.values).sum(axis=1) - y
    determinant = a * c - b * b
    is_sound = determinant > 1e-4
    divisor = np.where(is_sound, determinant, np.float32(1))
    return (
        np.where(is_sound, (c * x - b * y) / divisor, first).clip(0, 65535),
        np.where(is_sound, (a * y - b * x) / divisor, last).clip(0, 65535),
    )


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


def balanced(texels: Texels, ends: Floats, indices: Whole, on_second: Members, count: int) -> Whole:
    """Return the steps of texels, some moved by one so that blocks keep their light and energy.

    The steps of a steep line are coarse, and what its bright texels lose to rounding is a part of
    a lamp. Of all moves by one, the one is taken that leaves the least.
    """

    def off(at: Whole) -> Floats:
        return texels.space.light(between(ends, at, on_second, count)) - texels.light

    every = np.arange(indices.shape[-1])
    for _ in range(_MOVES):
        moved = [np.clip(indices + step, 0, count - 1) for step in (0, -1, 1)]
        here, *others = (off(at) for at in moved)
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
    error: Floats = ((values - texels.values) ** 2 * texels.weights).sum(axis=(0, 1))
    return error


def between(ends: Floats, indices: Whole, on_second: Members, count: int) -> Floats:
    """Return the values of texels by their steps: ends of one line or two, shape (2 or 4, 3, n)."""
    first = np.where(on_second, ends[-2][:, None], ends[0][:, None])
    last = np.where(on_second, ends[-1][:, None], ends[1][:, None])
    values: Floats = first + indices.astype(np.float32) / np.float32(count - 1) * (last - first)
    return values
