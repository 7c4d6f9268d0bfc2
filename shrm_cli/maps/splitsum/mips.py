"""Split sums as mip chains: levels whose sizes halve, and all levels that a mip-mapped file has.

Readers choose a level by its number, so that a level's roughness follows from its place. Containers
with mip maps ask for every size down to one pixel: below the split sum's last level, which has
roughness 1 in a whole chain, its light is averaged over ever larger pixels.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.splitsum.roughness import DEFAULT_LEVELS
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.sphere.grid.latlong import latlong_directions, latlong_points
from shrm_cli.sphere.quadrature import cell_edges
from shrm_cli.vocabulary import LevelMapping, Sampling

_SAMPLES = 16
"""Samples along the edge of a pixel that light is averaged over."""


def power_of_two(size: int) -> int:
    """Return the largest power of two that is no larger than a size."""
    return 1 << (size.bit_length() - 1)


def default_mips(size: int, mapping: LevelMapping) -> int:
    """Return how many levels halve down to one texel; Unreal's mapping is not sharp enough for
    all of them, and keeps its own number at most.
    """
    every = size.bit_length()
    return min(every, DEFAULT_LEVELS[mapping]) if mapping == "unreal" else every


def mip_sizes(size: int, count: int) -> tuple[int, ...]:
    """Return the sizes of levels that halve."""
    if size != power_of_two(size):
        raise MapError(
            f"levels of {size} texels do not halve down to one; take `size` {power_of_two(size)}"
        )
    if count > size.bit_length():
        raise MapError(
            f"{size} texels halve into {size.bit_length()} levels, not {count}; lower `levels` or "
            "raise `size`"
        )
    return tuple(size >> k for k in range(count))


def mip_chain(split: Map, path: str) -> SplitSum:
    """Return a map whose levels are those of a mip chain."""
    if not isinstance(split, SplitSum):
        raise MapError(f"{path}: {split.what}; mip chains are made of split sums")
    sizes = [level.shape[1] for level in split.levels]
    halving = sizes == [split.size >> k for k in range(len(sizes))]
    if not halving or split.size != power_of_two(split.size) or split.sampling != "center":
        told = ", ".join(str(size) for size in sizes)
        raise MapError(
            f"{path}: its levels of {told} texels are no mip chain; make it by shrm prefilter "
            "PROBE --to splitsum --mips"
        )
    return split


def cube_mips(split: SplitSum) -> list[Array]:
    """Return all levels of a mip-mapped image of OpenEXR's stacked cube.

    Returns the split sum's own levels, unchanged, shape (6 N >> k, N >> k, 3); then ever smaller
    averages of the last one, down to one pixel. Two of them, of 1 x 3 pixels and of one, are no
    cubes any more: the container wants them.
    """
    levels = list(split.levels)
    while levels[-1].shape[1] > 1:
        size = levels[-1].shape[1] // 2
        levels.append(levels[-1].reshape(6 * size, 2, size, 2, 3).mean(axis=(1, 3)))
    while len(levels[-1]) > 1:
        last = levels[-1]
        halves = len(last) // 2
        levels.append(last[: 2 * halves].reshape(halves, 2, 1, 3).mean(axis=1))
    levels[-1] = levels[-3].mean(axis=0, keepdims=True)  # all six faces, and not two of them
    return levels


def latlong_mips(split: SplitSum, height: int, sampling: Sampling = "center") -> list[Array]:
    """Return all levels of a mip-mapped lat-long.

    `split` is that of levels that halve. `height` is the number of rows of the first level, a power
    of two, at least as many as the split sum has levels.

    Returns images of shape (height >> k, 2 height >> k, 3), and one pixel in the end: the split
    sum's level k, interpolated at the pixels' directions; beyond its levels the last one, averaged
    over each pixel.
    """
    least = 2 ** (len(split.levels) - 1)
    if height < least or height != power_of_two(height):
        raise MapError(
            f"{height} rows do not halve into the {len(split.levels)} levels of the split sum; "
            f"take `size` {max(least, power_of_two(height))}"
        )
    levels = []
    for level in range(len(split.levels)):
        levels.append(split.sampled(level, latlong_directions(2 * height, height, sampling)))
        height //= 2
    while height:
        levels.append(_averaged(split, 2 * height, height, sampling))
        height //= 2
    levels.append(_averaged(split, 1, 1, "center"))
    return levels


def _averaged(split: SplitSum, width: int, height: int, sampling: Sampling) -> Array:
    """Return the light of the last level, averaged over the solid angles of a lat-long's pixels."""
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    down = cell_edges(height, sampling)
    down = (down[:-1, None] + np.diff(down)[:, None] * steps).ravel()
    # Columns wrap around, so that those of a border-sampled image reach beyond its edges, too.
    step = 2 / (width - 1) if sampling == "border" and width > 1 else 2 / width
    first = -1.0 if sampling == "border" and width > 1 else -1 + step / 2
    across = (first + step * (np.arange(width)[:, None] + steps - 0.5)).ravel()
    weights = np.sin((down + 1) * np.pi / 2)[:, None, None]
    light = split.sampled(len(split.levels) - 1, latlong_points(across, down[:, None])) * weights
    blocks = light.reshape(height, _SAMPLES, width, _SAMPLES, 3).sum(axis=(1, 3))
    return blocks / (weights.reshape(height, -1).sum(axis=1)[:, None, None] * _SAMPLES)
