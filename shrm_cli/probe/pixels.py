"""The pixels of images: read in blocks of rows, and mended where they cannot be radiance."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, over_channels
from shrm_cli.errors import ProbeError
from shrm_cli.messages import percent
from shrm_cli.probe.image import clear_unused, stack_faces
from shrm_cli.records import record
from shrm_cli.sphere.cube import reoriented

if TYPE_CHECKING:
    from shrm_cli.probe.probe import Probe

CLIPPED = 4
"""So many pixels that end where their file does were clipped: fewer are glints."""
CONVERTED = 1e-5
"""How far other primaries may round white."""


@dataclass
class PixelReport:
    """What the pixels of a probe needed, gathered while they are read."""

    nonfinite: int = 0
    """Pixels with a NaN or infinite channel."""
    first_nonfinite: tuple[int, int] | None = None
    """Column and row of the first."""
    negative: int = 0
    minimum: float = 0.0
    """`negative` and `minimum`: pixels with a negative channel, and the least value."""
    clamped: int = 0
    """Pixels that `clamp` dimmed."""
    energy_removed: float = 0.0
    energy: float = 0.0
    """`energy_removed` and `energy`: the integral of radiance over the sphere, channels added: what
    clamping took, and what there was before."""
    white: int = 0
    white_area: float = 0.0
    """`white` and `white_area`: pixels that have the largest integer in all channels, and their
    solid angle; none of floats."""
    notes: tuple[str, ...] = ()

    def clear(self) -> None:
        """Start again, as before the first pixel; the notes stay."""
        for field in fields(self):
            if field.name != "notes":
                setattr(self, field.name, field.default)

    def add_white(self, pixels: Array, weights: Array, largest: Array) -> None:
        """Count the pixels that are white, as cameras leave what is brighter; see `apply`.

        `largest` is the radiance of the largest integers, shape (3,).
        """
        is_white = over_channels(np.logical_and, pixels >= (1 - CONVERTED) * largest)
        self.white += int(np.count_nonzero(is_white))
        self.white_area += float(np.broadcast_to(weights, is_white.shape)[is_white].sum())

    @property
    def is_clipped(self) -> bool:
        """Whether so many pixels are white that light was cut off there."""
        return self.white >= CLIPPED

    def warnings(self, white: bool = True) -> list[str]:
        """One line for each thing that a user should know; of white pixels only if asked."""
        lines = list(self.notes)
        if white and self.is_clipped:
            lines.append(
                f"{percent(self.white_area / (4 * np.pi))}% of the sphere is white, the end of its "
                "integers, where light may be far brighter; shrm probe unclip mends a sun by a "
                "reading"
            )
        if self.nonfinite:
            lines.append(
                _pluralized(self.nonfinite, "NaN or infinite pixel was filled from neighbours")
            )
        if self.negative:
            told = _pluralized(self.negative, "pixel with negative radiance was clamped to 0")
            lines.append(f"{told} (minimum {self.minimum:.6g})")
        if self.clamped:
            share = self.energy_removed / self.energy if self.energy else 0.0
            told = _pluralized(self.clamped, "pixel was clamped")
            lines.append(f"{told}, which removed {share:.3%} of the energy")
        if self.energy == 0:
            lines.append("the probe is black")
        return lines


@record
class PixelPolicy:
    """How pixels are checked and changed."""

    fix_nonfinite: bool = False
    """Replace NaN and infinite pixels by the mean of their finite neighbors."""
    clamp: float | None = None
    """Largest radiance of a channel. Brighter pixels are scaled down as a whole, which keeps their
    hue."""

    def apply(self, pixels: Array, weights: Array, report: PixelReport) -> Array:
        """Finite pixels without negative radiance, clamped if asked, shape (rows, columns, 3).

        `pixels`, of shape (rows, columns, 3), are left as they are. `weights`, of shape (rows,
        columns) or (rows, 1), are solid angles. `report` is what is added to.
        """
        if pixels.size and pixels.min() < 0:
            report.negative += int(np.count_nonzero(over_channels(np.minimum, pixels) < 0))
            report.minimum = min(report.minimum, float(pixels.min()))
            pixels = np.maximum(pixels, 0)
        energy = _energy(pixels, weights)
        report.energy += energy
        if self.clamp is not None:
            brightest = over_channels(np.maximum, pixels)
            over = brightest > self.clamp
            if over.any():
                report.clamped += int(np.count_nonzero(over))
                scale = np.where(over, self.clamp / np.where(over, brightest, 1), 1)
                pixels = (pixels * scale[..., None]).astype(pixels.dtype)
                report.energy_removed += energy - _energy(pixels, weights)
        return pixels


def find_nonfinite(pixels: Array, first_row: int, report: PixelReport) -> NDArray[np.bool_] | None:
    """Find the pixels of a block that are NaN or infinite, and count them in the report.

    `first_row` is where the block begins in its image.

    Returns an array of bool of shape (rows, columns), or None where all pixels are finite.
    """
    # One pass in the common case: a sum is finite if every term is, short of overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(pixels.sum()):
            return None
    bad = ~_finite(pixels)
    if not bad.any():
        return None
    report.nonfinite += int(np.count_nonzero(bad))
    if report.first_nonfinite is None:
        row, column = (int(k[0]) for k in np.nonzero(bad))
        report.first_nonfinite = column, row + first_row
    return bad


def refuse_nonfinite(name: str, report: PixelReport) -> None:
    """Raise if any pixel was found to be NaN or infinite."""
    if report.first_nonfinite is not None:
        column, row = report.first_nonfinite
        told = _pluralized(report.nonfinite, "pixel is NaN or infinite")
        raise ProbeError(
            f"{name}: {told}, the first at column {column}, row {row}; give `fix_nonfinite` to "
            "fill them"
        )


def _pluralized(count: int, said: str) -> str:
    """Return what is said of so many pixels, of what is said of one: "1 pixel was clamped"."""
    if count != 1:
        for one, many in (("pixel", "pixels"), (" was ", " were "), (" is ", " are ")):
            said = said.replace(one, many, 1)
    return f"{count:,} {said}"


def refuse_overflow(name: str, numbers: Array) -> None:
    """Raise if numbers that follow from the light of a probe are beyond 32-bit floats."""
    if not (np.abs(numbers) <= np.finfo(np.float32).max).all():  # which no NaN is, either
        raise ProbeError(f"{name}: its light is beyond 32-bit floats; dim it, or give `clamp`")


def fill_nonfinite(
    pixels: Array,
    wraps: bool = False,
    used: NDArray[np.bool_] | None = None,
    rounds: int | None = None,
) -> Array:
    """Replace each NaN or infinite pixel by the mean of its finite neighbors.

    Larger holes are filled from their rim inwards, one pixel in each round.

    `pixels` are of shape (H, W, 3). `wraps` tells whether the left and right edges are beside each
    other, as in a lat-long. `used`, of shape (H, W), holds the pixels that hold radiance; no others
    are filled or filled from. `rounds` is how deep to fill; what lies deeper stays as it is. By
    default no depth is too great.

    If no used pixel is finite, nothing can be filled.
    """
    pixels = pixels.copy()
    good = _finite(pixels)
    bad = ~good
    if used is not None:
        good &= used
        bad &= used
    height, width = bad.shape
    while bad.any() and good.any() and rounds != 0:
        rows, columns = np.nonzero(bad)
        total, count = np.zeros((len(rows), 3)), np.zeros(len(rows))
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                y, x = rows + dy, columns + dx
                if wraps:
                    x = x % width
                inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
                y, x = np.where(inside, y, 0), np.where(inside, x, 0)
                known = inside & good[y, x]
                total[known] += pixels[y[known], x[known]]
                count[known] += 1
        filled = count > 0
        if not filled.any():  # out of reach of the good ones
            break
        at = rows[filled], columns[filled]
        pixels[at] = total[filled] / count[filled, None]
        good[at], bad[at] = True, False
        if rounds is not None:
            rounds -= 1
    return pixels


def _finite(pixels: Array) -> NDArray[np.bool_]:
    """Which pixels are finite in every channel."""
    return over_channels(np.logical_and, np.isfinite(pixels))


def _energy(pixels: Array, weights: Array) -> float:
    """Integral of the radiance, channels added."""
    if weights.shape[1] == 1:
        return float(pixels.sum(axis=(1, 2), dtype=float) @ weights[:, 0])
    # Whole faces of a cube arrive at once; a few rows at a time they need no memory beside them.
    rows = zip(pixels, weights, strict=True)
    return float(sum(row.sum(axis=1, dtype=float) @ own for row, own in rows))


Block = tuple[int, Array, Array]
"""First row, pixels of shape (rows, width, 3), weights as `Grid.weights` has them."""

_BLOCK_PIXELS = 2**20
_NOTHING_FINITE = "{}: nothing is finite to fill NaN or infinite pixels from; export it again"
_SMALL_FACE = 1024
"""Texels along the edge of the largest face of a cube that is read as a whole, which is faster."""
_HOLE_ROWS = 32
"""Rows that are read before and behind a block with holes, at first."""


def read_blocks(probe: "Probe") -> Iterator[Block]:
    """Yield the image in blocks of rows, by faces, or as a whole where it cannot be cut.

    What the pixels needed is added to the probe's report. Its policy tells whether NaN and infinite
    ones are filled or refused, and is not applied otherwise.
    """
    if probe.grid.most_pixels is None:
        return _by_rows(probe)
    if probe.layout == "faces" and len(probe.images) > 1 and probe.grid.size > _SMALL_FACE:
        return _by_faces(probe)
    return _whole(probe)


def _by_faces(probe: "Probe") -> Iterator[Block]:
    """Yield one face after the other, each from an image of its own."""
    for face, image in enumerate(probe.images):
        pixels = image.read(0, image.height)
        bad = find_nonfinite(pixels, 0, probe.report)
        if bad is not None and not probe.policy.fix_nonfinite:
            refuse_nonfinite(image.name, probe.report)
        if bad is not None:
            pixels = fill_nonfinite(pixels)
            if not np.isfinite(pixels).all():
                raise ProbeError(_NOTHING_FINITE.format(image.name))
        pixels = reoriented(pixels, face, probe.orientation or "openexr")
        start = face * probe.grid.size
        yield start, pixels, probe.grid.weights(start, start + probe.grid.size)


def _by_rows(probe: "Probe") -> Iterator[Block]:
    """Yield blocks of rows of a single image.

    NaN and infinite pixels that are not to be filled are counted here, all of them, and
    refused at the end.
    """
    image = probe.images[0]
    height, width = probe.grid.shape
    rows = max(_BLOCK_PIXELS // width, 1)
    rows = -(-rows // image.row_multiple) * image.row_multiple
    for start in range(0, height, rows):
        stop = min(start + rows, height)
        pixels = image.read(start, stop)
        bad = find_nonfinite(pixels, start, probe.report)
        if bad is not None and probe.policy.fix_nonfinite:
            pixels = _filled_rows(probe, start, stop)
        elif bad is not None:
            pixels = np.where(bad[..., None], np.float32(0), pixels)
        yield start, pixels, probe.grid.weights(start, stop)
    if not probe.policy.fix_nonfinite:
        refuse_nonfinite(probe.name, probe.report)


def _filled_rows(probe: "Probe", start: int, stop: int) -> Array:
    """Rows without holes, the same however the image is cut into blocks.

    A pixel at depth k of a hole depends on the k rows above and below it, so as many are
    read as the deepest one needs.
    """
    height = probe.grid.shape[0]
    margin = _HOLE_ROWS
    while True:
        first, last = max(start - margin, 0), min(stop + margin, height)
        is_whole = last - first == height
        around = fill_nonfinite(
            probe.images[0].read(first, last),
            wraps=probe.grid.wraps,
            rounds=None if is_whole else margin,
        )
        pixels = around[start - first : stop - first]
        if np.isfinite(pixels).all():
            return pixels
        if is_whole:
            raise ProbeError(_NOTHING_FINITE.format(probe.name))
        margin *= 4


def _whole(probe: "Probe") -> Iterator[Block]:
    """Yield all images as one block."""
    used = probe.grid.used()
    parts = []
    for image in probe.images:
        part = image.read(0, image.height)
        if used is not None:
            part[~used] = 0
        clear_unused(part, probe.layout)
        find_nonfinite(part, 0, probe.report)
        if not probe.policy.fix_nonfinite:
            refuse_nonfinite(image.name, probe.report)
        parts.append(part)
    pixels = np.concatenate(parts) if len(parts) > 1 else parts[0]
    del parts, part  # or the image would be in memory twice
    if probe.orientation is not None:
        pixels = stack_faces(pixels, probe.layout, probe.orientation)
    if probe.report.nonfinite:
        pixels = _filled(probe, pixels, used)
    yield 0, pixels, probe.grid.weights()


def _filled(probe: "Probe", pixels: Array, used: NDArray[np.bool_] | None) -> Array:
    """The whole image without holes; each of the grid's faces is filled from itself."""
    height, width = probe.grid.shape
    used = np.ones((height, width), dtype=bool) if used is None else used
    faces = probe.grid.faces
    pictures = pixels.reshape(faces, height // faces, width, 3)
    masks = used.reshape(faces, height // faces, width)
    filled = np.concatenate(
        [
            fill_nonfinite(part, probe.grid.wraps, mask)
            for part, mask in zip(pictures, masks, strict=True)
        ]
    )
    if not np.isfinite(filled).all():
        raise ProbeError(_NOTHING_FINITE.format(probe.name))
    return filled
