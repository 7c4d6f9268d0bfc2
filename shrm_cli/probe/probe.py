"""A light probe: radiance on a grid, whose pixels are read from images or arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import conversion
from shrm_cli.errors import ProbeError
from shrm_cli.messages import known_arguments
from shrm_cli.probe.image import (
    ArrayImage,
    ConvertedImage,
    ProbeImage,
    check_shape,
    detect_layout,
    grid_of,
)
from shrm_cli.probe.options import ColorReading, ReadOptions
from shrm_cli.probe.pixels import Block, PixelPolicy, PixelReport, read_blocks
from shrm_cli.records import Displayed, record
from shrm_cli.sphere.directions import as_directions
from shrm_cli.sphere.grid.base import Grid, Sampler
from shrm_cli.vocabulary import (
    COARSE_ROWS,
    CUBES,
    Layout,
    Orientation,
    Sampling,
    default_orientation,
)

if TYPE_CHECKING:
    from shrm_cli.probe.proxy import ProxyBox


@record(eq=False)
class Probe(Displayed):
    """A probe whose pixels are read on demand, and checked as they are.

    `probe.open.open_probe` makes one from files, `Probe.from_array` from pixels in memory.

    Attributes
    ----------
    name : str
        What messages and maps call it: the file's name, as the user gave it.
    grid : Grid
        Where its pixels lie. A cube is N x 6N in OpenEXR's order and orientation, whatever it was
        in the images.
    layout : Layout
        Of the images.
    orientation : {"openexr", "gl"}, optional
        Of the faces of a cube in the images; None where there are no faces.
    matrix : ndarray, shape (3, 3)
        From the grid's axes to world axes.
    policy : PixelPolicy
        What is done about pixels that cannot be radiance.
    chromaticities : tuple of 8 float, optional
        x and y of red, green, blue and white.
    images : tuple of ProbeImage
        What the pixels are read from: one image, or six faces.
    report : PixelReport
        What the pixels needed. Reading fills it.
    colors : mapping of str to list of 8 float
        What was said of its colors beside the images, for records: ``primaries`` that the numbers
        were taken to have, ``working`` that they were converted to.
    proxy : ProxyBox, optional
        Where it was captured, and the box that stands for the room around that, in world axes.

    Examples
    --------
    >>> white = shrm.Probe.from_array(np.ones((16, 32, 3), np.float32), layout="latlong")
    >>> white.radiance([0, 1, 0]).tolist()
    [1.0, 1.0, 1.0]
    """

    name: str
    grid: Grid
    layout: Layout
    orientation: Orientation | None
    matrix: Array
    policy: PixelPolicy
    chromaticities: tuple[float, ...] | None
    images: tuple[ProbeImage, ...]
    report: PixelReport = field(default_factory=PixelReport)
    colors: Mapping[str, list[float]] = field(default_factory=dict)
    proxy: ProxyBox | None = None

    @classmethod
    @known_arguments
    def from_array(
        cls,
        array: ArrayLike,
        layout: Layout | None = None,
        *,
        name: str = "array",
        orientation: Orientation | None = None,
        sampling: Sampling | None = None,
        yaw: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        mirror: bool = False,
        up: Literal["y", "z"] = "y",
        clamp: float | None = None,
        fix_nonfinite: bool = False,
        chromaticities: tuple[float, ...] | None = None,
        primaries: str | Sequence[float] | None = None,
        working: str | Sequence[float] | None = None,
    ) -> Probe:
        """Make a probe from pixels in memory, which are copied.

        Parameters
        ----------
        array : array_like of a floating type, shape (H, W, 3) or (H, W)
            Linear radiance; one channel serves as three.
        layout : Layout, optional
            By default it follows from the shape, where that tells. ``"faces"`` is the six faces
            stacked.
        name : str
            What messages and maps call the probe.
        orientation, sampling, yaw, pitch, roll, mirror, up
            As `ReadOptions` has them.
        clamp, fix_nonfinite
            As `PixelPolicy` has them.
        chromaticities : tuple of 8 float, optional
            x and y of red, green, blue and white, for the maps that are made of the probe.
        primaries, working
            As `ReadOptions` has them; `primaries` is another way to give `chromaticities`.

        Raises
        ------
        ProbeError
            If the array is no image, its shape does not suit the layout, or another argument has
            a value that it cannot have.
        ArgumentError
            If there is no such argument.
        """
        policy = PixelPolicy(fix_nonfinite, clamp)
        options = ReadOptions(
            layout, orientation, sampling, yaw, mirror, up, pixels=policy, pitch=pitch, roll=roll,
            primaries=primaries, working=working,
        )  # fmt: skip
        if chromaticities is not None and np.shape(chromaticities) != (8,):
            raise ProbeError(f"{name}: `chromaticities` must be 8 numbers, not {chromaticities!r}")
        image = ArrayImage.copy_of(array, name)
        found = layout or detect_layout(name, image.width, image.height, "")
        stated = None if chromaticities is None else tuple(map(float, chromaticities))
        return make_probe(name, (image,), found, "center", options, stated)

    def within(self, box: ArrayLike | None, at: ArrayLike | None = None) -> Self:
        """Return the probe in another proxy box.

        Parameters
        ----------
        box : array_like of 6 numbers, optional
            Two corners, the lesser first, world axes; those that it has by default.
        at : array_like, shape (3,), optional
            Where it was captured; by default where it says, or else in the middle of the box.

        Raises
        ------
        ProbeError
            If the box is flat, the place is not in it, or there is no box.
        """
        if box is None and at is None:
            return self
        from shrm_cli.probe.proxy import ProxyBox

        if box is None and self.proxy is None:
            raise ProbeError(f"{self.name}: `at` needs the box around the place; give `box`")
        known = None if self.proxy is None else (self.proxy.low, self.proxy.high)
        low, high = np.reshape(known if box is None else box, (2, 3))  # type: ignore[arg-type]
        if at is None and self.proxy is not None:
            at = self.proxy.at
        return replace(self, proxy=ProxyBox.of(low, high, at))

    @property
    def width(self) -> int:
        """Columns of the grid."""
        return self.grid.shape[1]

    @property
    def height(self) -> int:
        """Rows of the grid."""
        return self.grid.shape[0]

    @property
    def sampling(self) -> Sampling:
        """Where the edge pixels of the grid lie."""
        return self.grid.sampling

    @property
    def paths(self) -> list[Path]:
        """The files that the pixels are read from; none for an array."""
        return [image.path for image in self.images if image.path is not None]

    def digest(self) -> str:
        """SHA-256 of the bytes of the files, one after the other, or of the array and its shape."""
        result = hashlib.sha256()
        for image in self.images:
            for piece in image.contents():
                result.update(piece)
        return result.hexdigest()

    def reading(self) -> dict[str, Any]:
        """How the images are understood: what the options of `open_probe` came to, for records.

        What is as it is in most probes is left out: upright axes, and pixels that are taken as
        they are.
        """
        found: dict[str, Any] = {"layout": self.layout, "sampling": self.sampling}
        facts = self.images[0].facts()
        found |= {name: facts[name] for name in ("part", "layer") if name in facts}
        if self.orientation is not None:
            found["orientation"] = self.orientation
        if not np.array_equal(self.matrix, np.eye(3)):
            found["axes"] = np.round(self.matrix, 9).tolist()
        if self.policy.fix_nonfinite:
            found["fix_nonfinite"] = True
        if self.policy.clamp is not None:
            found["clamp"] = float(self.policy.clamp)
        if self.proxy is not None:
            found["proxy"] = self.proxy.record()
        return {**found, **self.colors}

    def warnings(self, white: bool = True) -> list[str]:
        """What a user should know of its pixels as far as they have been read, with its name.

        `white` tells whether to say that integers end at white.
        """
        return [f"{self.name}: {line}" for line in self.report.warnings(white)]

    @property
    def may_be_coarse(self) -> bool:
        """Whether its pixels are larger than those that maps of sharp lobes are made of."""
        return self.grid.resolution < COARSE_ROWS

    def blocks(self) -> Iterator[Block]:
        """Yield the image in blocks of rows: first row, pixels, weights.

        Yields
        ------
        start : int
        pixels : ndarray of float32, shape (rows, width, 3)
            Finite and not negative.
        weights : ndarray, shape (rows, width) or (rows, 1)
            Solid angle of each pixel, or the weight of a more exact rule; see `Grid.weights`.

        Raises
        ------
        ProbeError
            If the file is damaged, or has NaN or infinite pixels that are not to be filled.
        """
        self.report.clear()
        largest = self.images[0].largest
        for start, pixels, weights in read_blocks(self):
            if largest is not None:
                self.report.add_white(pixels, weights, largest)
            yield start, self.policy.apply(pixels, weights, self.report), weights

    def in_primaries(self, primaries: tuple[float, ...] | None) -> Probe:
        """The same probe in other primaries; None is Rec.709."""
        matrix = conversion(self.chromaticities, primaries)
        return self if matrix is None else self.multiplied(matrix, primaries)

    def multiplied(self, matrix: Array, primaries: tuple[float, ...] | None) -> Probe:
        """The probe of pixels multiplied by a matrix, shape (3, 3), which has these primaries."""
        images = tuple(ConvertedImage(image, matrix) for image in self.images)
        return replace(self, images=images, chromaticities=primaries)

    def image(self) -> Array:
        """The whole grid, a new array of shape (height, width, 3)."""
        image = np.empty((self.height, self.width, 3), dtype=np.float32)
        # To join the blocks afterwards would take twice as much. The last one is followed by the
        # refusal of pixels that are not finite, so that no loop may end before that.
        for start, pixels, _ in self.blocks():
            if len(pixels) == self.height:
                image = pixels
            else:
                image[start : start + len(pixels)] = pixels
        return image

    def radiance(self, directions: ArrayLike) -> Array:
        """Filtered radiance in world directions, shape (..., 3); the image is read once."""
        (outside,) = as_directions(directions=directions)
        inside = outside @ self.matrix  # M^-1 d, as rows
        return np.maximum(self._sampler(inside), 0)  # a cubic filter overshoots

    @cached_property
    def _sampler(self) -> Sampler:
        return self.grid.sampler(self.image())


def make_probe(
    name: str,
    images: tuple[ProbeImage, ...],
    layout: Layout,
    sampling: Sampling,
    options: ReadOptions,
    chromaticities: tuple[float, ...] | None,
    proxy: ProxyBox | None = None,
) -> Probe:
    """Make a probe from images, after checks of their size.

    `images` is one image, or six faces. `sampling`, `chromaticities` and `proxy` are what the
    images say of themselves; the options overrule the sampling.
    """
    first = images[0]
    check_shape(name, layout, first.width, first.height, len(images))
    grid = grid_of(layout, first.width, options.sampling or sampling, len(images))
    count = first.width * first.height * len(images)
    if grid.most_pixels is not None and count > grid.most_pixels:
        raise ProbeError(
            f"{name}: {count:,} {layout} pixels exceed {grid.most_pixels:,}; scale it down"
        )
    orientation: Orientation | None = None
    if layout in CUBES:
        # A cube in a DDS file is stacked, but comes from a graphics API.
        own: Orientation = "gl" if first.file_format == "dds" else default_orientation(layout)
        orientation = options.orientation or own
    notes = tuple(dict.fromkeys(note for image in images for note in image.notes))
    colors, matrix = ColorReading.of(chromaticities, options), options.matrix()
    turned = None if proxy is None else proxy.turned(matrix)
    if proxy is not None and turned is None:
        notes += ("its proxy box is left out, for it is not turned by right angles",)
    return Probe(
        name, grid, layout, orientation, matrix, options.pixels, colors.chromaticities,
        colors.converted(images), PixelReport(notes=(*notes, *colors.notes)), colors.record, turned,
    )  # fmt: skip
