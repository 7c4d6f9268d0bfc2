"""BC6H: blocks of 4 x 4 texels in 16 bytes, for light.

The format interpolates the bits of half floats, which are nearly logarithms. So does the search:
in that space each block gets the line through its colours, and where one line is too coarse, two
lines for the better of 32 partitions. Ends come from principal components, then from least
squares, and are written in the finest mode that holds them. Errors are weighted so that they are
relative to the light of their texel, and bright texels of a block count more: the dark ones beside
a lamp are outshone.

References
----------
The Khronos Data Format Specification 1.3, section 20.2 (BPTC).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks.bc6h_modes import ANCHORS, MODES, PARTITIONS, Mode, Whole, pack
from shrm_cli.parallel import in_order
from shrm_cli.records import record

LARGEST = 65504.0
"""The largest value of a texel."""
_CHUNK = 4096
"""Blocks of a job."""
_TRIES = 2
"""Partitions that are tried for each block that gets two lines."""
_FINE = 0.002**2
"""Where the squared relative error of one line is smaller, two are not tried."""
_HALVES = 1024 / np.log(2)
"""Steps of half floats in a factor of e, about."""

Floats = NDArray[np.float32]
Members = NDArray[np.bool_]


@record
class _Texels:
    """What is looked for: numbers between 0 and 65536 as blocks interpolate them, and weights.

    Attributes
    ----------
    values, weights : ndarray, shape (3, 16, n)
        A difference squared, times its weight, is an error squared relative to the texel's light.
    """

    values: Floats
    weights: Floats

    def __getitem__(self, which: Whole) -> "_Texels":
        return _Texels(self.values[..., which], self.weights[..., which])


@record
class _Found:
    """Blocks that are ready: the bytes, and the error of each, shape (n, 16) and (n,)."""

    data: NDArray[np.uint8]
    error: Floats


def encode(image: Array) -> bytes:
    """Return the blocks of an image, row by row.

    Parameters
    ----------
    image : ndarray, shape (M, N, 3)
        Values from 0 to `LARGEST`; M and N are multiples of 4.
    """
    rows, columns = image.shape[0] // 4, image.shape[1] // 4
    blocks = image.reshape(rows, 4, columns, 4, 3).transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
    jobs = [blocks[..., at : at + _CHUNK] for at in range(0, blocks.shape[-1], _CHUNK)]
    return b"".join(each.tobytes() for each in in_order(_encoded, jobs))


def _encoded(blocks: Array) -> NDArray[np.uint8]:
    """Return blocks of shape (3, 16, n) as bytes, shape (n, 16)."""
    texels = _texels(blocks)
    whole = np.zeros(blocks.shape[-1], dtype=np.int64)
    found = _with_lines(texels, whole, 1)
    coarse = np.flatnonzero(found.error > _FINE)
    if coarse.size:
        harder = texels[coarse]
        for partition in _partitions(harder):
            tried = _with_lines(harder, partition, 2)
            better = tried.error < found.error[coarse]
            found.data[coarse[better]] = tried.data[better]
            found.error[coarse[better]] = tried.error[better]
    return found.data


def _texels(blocks: Array) -> _Texels:
    """Return blocks of light in the space that they are interpolated in."""
    light = np.minimum(blocks, LARGEST).astype(np.float32)
    steps = light.astype(np.float16).view(np.uint16).astype(np.float32)
    norm = np.sqrt((light * light).sum(axis=0)) + np.float32(1e-7)
    # Bright texels of a block count more: within it, the error is that of the light itself.
    importance = (norm / norm.mean(axis=0)) ** 2
    relative = (light / norm) ** 2 + np.float32(1e-5)
    weights = relative * importance * np.float32((31 / 64 / _HALVES) ** 2 / 16)
    return _Texels((steps + np.float32(0.5)) * np.float32(64 / 31), weights)


def _scaled(texels: _Texels) -> tuple[Floats, Floats, Floats]:
    """Return weights of texels, mean weights of channels, and values by their roots."""
    of_texel = texels.weights.sum(axis=0)
    of_texel /= of_texel.mean(axis=0)
    root = np.sqrt(texels.weights.mean(axis=1))
    return of_texel, root, texels.values * root[:, None]


def _partitions(texels: _Texels) -> Iterator[Whole]:
    """Yield for each block the partitions whose two lines should fit best, the best first."""
    weight, _, values = _scaled(texels)
    values = values - values.mean(axis=1, keepdims=True)
    red, green, blue = values
    terms = np.stack(
        [np.ones_like(red), red, green, blue, red * red, green * green, blue * blue,
         red * green, red * blue, green * blue]
    ) * weight  # fmt: skip
    second = np.matmul(PARTITIONS.astype(np.float32), terms)  # shape (10, 32, n)
    total = terms.sum(axis=1)[:, None]
    cost = _beside_a_line(second) + _beside_a_line(total - second)
    order = np.argpartition(cost, range(_TRIES), axis=0)
    yield from order[:_TRIES].astype(np.int64)


def _beside_a_line(sums: Floats) -> Floats:
    """Return the squared distances from the best line through points, about, and their rounding.

    The sum of the two smaller eigenvalues of the covariance is about the sum of its principal
    minors over its trace; along the line stand 8 points, which leaves a 49th of the trace.
    """
    count, sx, sy, sz, xx, yy, zz, xy, xz, yz = sums
    scale = 1 / np.maximum(count, np.float32(1e-6))
    xx, yy, zz = xx - sx * sx * scale, yy - sy * sy * scale, zz - sz * sz * scale
    xy, xz, yz = xy - sx * sy * scale, xz - sx * sz * scale, yz - sy * sz * scale
    minors = xx * yy + yy * zz + xx * zz - xy * xy - xz * xz - yz * yz
    trace = np.maximum(xx + yy + zz, np.float32(1e-12))
    return np.maximum(minors, 0) / trace + trace / np.float32(49)


def _with_lines(texels: _Texels, partition: Whole, lines: int) -> _Found:
    """Return blocks of one or two lines."""
    count = 16 if lines == 1 else 8
    every = np.arange(len(partition))
    if lines == 1:
        sets = [np.ones((16, len(partition)), dtype=bool)]
        anchors = [np.zeros_like(partition)]
    else:
        second = PARTITIONS[partition].T
        sets, anchors = [~second, second], [np.zeros_like(partition), ANCHORS[partition]]
    ends = []
    for members, anchor in zip(sets, anchors, strict=True):
        first, last = _line(texels, members, count)
        # The number of the anchor has no highest bit, so it lies in the first half of its line.
        at = _along(_Texels(texels.values[:, anchor, every], texels.weights[:, anchor, every]),
                    first, last)  # fmt: skip
        is_late = at > 0.5
        ends += [np.where(is_late, last, first), np.where(is_late, first, last)]
    written, mode = _written(np.stack(ends), lines)
    whole = _unquantized(written, mode)
    indices = np.zeros((16, len(partition)), dtype=np.int64)
    for k, (members, anchor) in enumerate(zip(sets, anchors, strict=True)):
        at = _along(texels, whole[2 * k, :, None], whole[2 * k + 1, :, None])
        near = np.rint(np.clip(at, 0, 1) * (count - 1)).astype(np.int64)
        near[anchor, every] = np.minimum(near[anchor, every], count // 2 - 1)
        indices = np.where(members, near, indices)
    on_second = np.zeros_like(indices, dtype=bool) if lines == 1 else sets[1]
    bright = np.flatnonzero(_is_steep(texels))
    if bright.size:
        indices[:, bright] = _balanced(
            texels[bright], whole[..., bright], indices[:, bright], on_second[:, bright], count
        )
        for anchor in anchors:
            indices[anchor, every] = np.minimum(indices[anchor, every], count // 2 - 1)
    error = _error(texels, whole, indices, sets, count)
    data = np.empty((len(partition), 16), dtype=np.uint8)
    for k, each in enumerate(MODES):
        here = np.flatnonzero(mode == k)
        if here.size:
            packed = _differences(each, written[..., here])
            data[here] = pack(each, packed, indices[:, here], partition[here])
    return _Found(data, error)


def _line(texels: _Texels, members: Members, count: int) -> tuple[Floats, Floats]:
    """Return the ends of the best line through the texels of a set: shape (3, n) each."""
    weight, root, values = _scaled(texels)
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
    texels: _Texels, members: Members, count: int, first: Floats, last: Floats
) -> tuple[Floats, Floats]:
    """Return the ends that suit the texels best where they lie now."""
    near = np.clip(_along(texels, first[:, None], last[:, None]), 0, 1) * (count - 1)
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


def _along(texels: _Texels, first: Floats, last: Floats) -> Floats:
    """Return where on their lines texels lie: 0 at the first end, 1 at the last."""
    line = last - first
    weighted = texels.weights * line
    length = (weighted * line).sum(axis=0)
    return ((texels.values - first) * weighted).sum(axis=0) / np.maximum(length, np.float32(1e-20))


def _written(ends: Floats, lines: int) -> tuple[Whole, Whole]:
    """Return the ends as numbers of the finest mode that holds them, and the index of that mode."""
    best = np.zeros(ends.shape, dtype=np.int64)
    mode = np.zeros(ends.shape[-1], dtype=np.int64)
    for k, each in enumerate(MODES):
        if each.lines != lines:
            continue
        near = np.clip(ends / 2.0 ** (16 - each.bits), 0, 2**each.bits - 1).astype(np.int64)
        half = np.array([1 << bits - 1 for bits in each.differences])[:, None]
        apart = near[1:] - near[0]
        holds = ((apart >= -half) & (apart < half)).all(axis=(0, 1)) | each.is_whole
        best = np.where(holds, near, best)
        mode = np.where(holds, k, mode)
    return best, mode


def _differences(mode: Mode, written: Whole) -> Whole:
    """Return ends as a mode writes them."""
    return written if mode.is_whole else np.concatenate([written[:1], written[1:] - written[0]])


def _unquantized(written: Whole, mode: Whole) -> Floats:
    """Return ends between 0 and 65535, as decoders take them."""
    bits = np.array([each.bits for each in MODES])[mode]
    middle = ((written << 16) + 0x8000) >> bits
    extreme = np.where(written == 0, 0, np.where(written == (1 << bits) - 1, 0xFFFF, middle))
    return np.where(bits == 16, written, extreme).astype(np.float32)


def _is_steep(texels: _Texels) -> NDArray[np.bool_]:
    """Tell which blocks hold the edge of a lamp: their light differs by a factor of 8 and more."""
    green = texels.values[1]
    return green.max(axis=0) - green.min(axis=0) > 3 * 1024 * 64 / 31


def _balanced(
    texels: _Texels, ends: Floats, indices: Whole, on_second: Members, count: int
) -> Whole:
    """Return the numbers of texels, some moved by one so that blocks keep their energy.

    The steps of a steep line are coarse, and what its bright texels lose to rounding is a part of
    a lamp. Of all moves by one, the one is taken that leaves the least.
    """
    wanted = _light(texels.values).sum(axis=(0, 1))
    first = np.where(on_second, ends[-2][:, None], ends[0][:, None])
    last = np.where(on_second, ends[-1][:, None], ends[1][:, None])

    def energy(at: Whole) -> Floats:
        part = at.astype(np.float32) / np.float32(count - 1)
        return _light(first + part * (last - first)).sum(axis=0)

    every = np.arange(indices.shape[-1])
    for _ in range(2):
        now = energy(indices)
        moved = [np.clip(indices + step, 0, count - 1) for step in (0, -1, 1)]
        left = np.abs(now.sum(axis=0) - wanted + np.stack([energy(at) - now for at in moved]))
        best = left.reshape(-1, left.shape[-1]).argmin(axis=0)
        step, texel = best // 16, best % 16
        indices = indices.copy()
        indices[texel, every] = np.stack(moved)[step, texel, every]
    return indices


def _light(values: Floats) -> Floats:
    """Return the light of numbers as they are interpolated."""
    steps = np.clip(values * np.float32(31 / 64), 0, 31743).astype(np.uint16)
    return steps.view(np.float16).astype(np.float32)


def _error(
    texels: _Texels, ends: Floats, indices: Whole, sets: list[Members], count: int
) -> Floats:
    """Return the weighted squared error of blocks: shape (n,)."""
    at = indices.astype(np.float32) / np.float32(count - 1)
    error = np.zeros(indices.shape[-1], dtype=np.float32)
    for k, members in enumerate(sets):
        first, last = ends[2 * k, :, None], ends[2 * k + 1, :, None]
        off = first + at * (last - first) - texels.values
        error += (off * off * texels.weights * members).sum(axis=(0, 1))
    return error
