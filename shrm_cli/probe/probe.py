"""A light probe: radiance on a grid, from image files or from arrays."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.color import conversion
from shrm_cli.errors import ProbeError
from shrm_cli.files.exr_header import says_map
from shrm_cli.probe.image import (
    ArrayImage,
    ConvertedImage,
    ProbeImage,
    check_shape,
    detect_layout,
    digest,
    grid_of,
)
from shrm_cli.probe.image_file import ImageFile, check_file, is_image_name
from shrm_cli.probe.options import ColorReading, ReadKeywords, ReadOptions, with_keywords
from shrm_cli.probe.pixels import Block, BlockReader, PixelPolicy, PixelReport
from shrm_cli.records import Displayed, record
from shrm_cli.sphere.grid.base import Grid, Sampler
from shrm_cli.vocabulary import CUBES, FACES, Layout, Orientation, Sampling, default_orientation

if TYPE_CHECKING:
    from shrm_cli.probe.dds_file import DdsFile
    from shrm_cli.probe.proxy import ProxyBox

_DDS = b"DDS "
"""The bytes that a DDS file begins with."""


@record(eq=False)
class Probe(Displayed):
    """A probe whose pixels are read on demand, and checked as they are.

    `open_probe` makes one from files, `Probe.from_array` from pixels in memory.

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
        return _make_probe(name, (image,), found, "center", options, stated)

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
        return digest(self.images)

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
        reader = BlockReader(
            self.name, self.images, self.layout, self.orientation, self.grid,
            self.policy.fix_nonfinite, self.report,
        )  # fmt: skip
        for start, pixels, weights in reader.blocks():
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
        inside = np.asarray(directions) @ self.matrix  # M^-1 d, as rows
        return np.maximum(self._sampler(inside), 0)  # a cubic filter overshoots

    @cached_property
    def _sampler(self) -> Sampler:
        return self.grid.sampler(self.image())


def open_probe(
    path: str | os.PathLike[str],
    options: ReadOptions | None = None,
    **keywords: Unpack[ReadKeywords],
) -> Probe:
    """Open a probe of any layout; its pixels are read when they are needed.

    Parameters
    ----------
    path : path-like
        An image file, six of them with ``%`` in place of ``+X``, ``-X``, ..., a light file
        (``.toml``), which names probes and circular lights, a stage of USD (``.usda``, ``.usdz``,
        ...), or a file of harmonic coefficients, see `shrm_cli.probe.series`.
    options : ReadOptions, optional
        How the file is to be understood.
    **keywords
        Attributes of `ReadOptions`, or `clamp` and `fix_nonfinite` of its `PixelPolicy`; they
        replace those of `options`.

    Raises
    ------
    ProbeError
        If it is no usable image, its layout is unknown, or a keyword or its value is.

    Examples
    --------
    >>> probe = shrm.open_probe("probes/studio.exr", yaw=30)
    >>> probe.layout, probe.height
    ('latlong', 256)
    """
    options = with_keywords(options or ReadOptions(), keywords)
    return _opened(str(path), options).within(options.box, options.at)


def _opened(name: str, options: ReadOptions) -> Probe:
    """Open a probe, whose box is the one that its file tells."""
    if is_light_file(name) or is_stage(name):
        from shrm_cli.probe.light_file import open_light_file

        return open_light_file(name, options)
    if _may_hold_series(name):
        from shrm_cli.probe.series import holds_series, open_series

        if holds_series(name):
            return open_series(name, options)
    if "%" in os.path.basename(name) and not os.path.exists(name):
        if options.layout not in (None, "faces"):
            raise ProbeError(f"{name}: six files are not {options.layout}; leave `layout` out")
        files = _open_faces(name, options)
        layout: Layout = "faces"
    elif options.layout == "faces":
        raise ProbeError(f"{name}: write % in place of +X, -X, ... to name the files of six faces")
    elif not is_image_name(name) and (probe := _open_by_package(name, options)) is not None:
        return probe
    else:
        files = (_open_file(name, options),)
        layout = options.layout or _layout_of(files[0])
    first = files[0]
    sampling: Sampling = "border" if first.border_sampled else "center"
    return _make_probe(name, files, layout, sampling, options, first.chromaticities, first.proxy)


def is_light_file(name: str) -> bool:
    """Whether a name is that of a light file, by its suffix."""
    return name.lower().endswith(".toml")


def is_stage(name: str) -> bool:
    """Whether a name is that of a stage of USD, by its suffix."""
    return name.lower().endswith((".usda", ".usd", ".usdc", ".usdz"))


def _may_hold_series(name: str) -> bool:
    """Whether a file may hold coefficients of light, which is found out by more modules."""
    suffix = Path(name).suffix.lower()
    if suffix != ".exr":
        return suffix in (".txt", ".npy", ".json")
    with suppress(OSError):  # its reader says what is wrong with it
        return os.path.isfile(name) and says_map(name)
    return False


def _make_probe(
    name: str,
    images: tuple[ProbeImage, ...],
    layout: Layout,
    sampling: Sampling,
    options: ReadOptions,
    chromaticities: tuple[float, ...] | None,
    proxy: ProxyBox | None = None,
) -> Probe:
    """Make a probe from images, after checks of their size.

    `sampling` is what the images say of themselves; the options overrule it.
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


def _open_file(name: str, options: ReadOptions) -> ImageFile | DdsFile:
    """Open an image as the options have it."""
    path = check_file(name)
    dds = _open_dds(path)
    if dds is None:
        return ImageFile.open(path, options.linearize, options.part, options.layer)
    if options.part is not None or options.layer is not None:
        raise ProbeError(f"{name}: a DDS file has no parts or layers; leave `part` and `layer` out")
    return dds


def _open_by_package(name: str, options: ReadOptions) -> Probe | None:
    """Open a file that an installed package reads; None where none does."""
    from shrm_cli.probe.reader import read_by_package

    read = read_by_package(name)
    if read is None:
        return None
    image, said = read
    layout = options.layout or said.get("layout")
    layout = layout or detect_layout(name, image.width, image.height, "")
    options = replace(options, orientation=options.orientation or said.get("orientation"))
    sampling: Sampling = said.get("sampling", "center")
    return _make_probe(name, (image,), layout, sampling, options, said.get("chromaticities"))


def _open_dds(path: Path) -> DdsFile | None:
    """Open a file as a DDS file; None where it is none that is read here."""
    with open(path, "rb") as stream:
        if stream.read(len(_DDS)) != _DDS:
            return None
    from shrm_cli.probe.dds_file import DdsFile  # most probes are none

    return DdsFile.open(path)


def _layout_of(file: ImageFile | DdsFile) -> Layout:
    """The layout of a file that nobody named, which follows from its shape."""
    aspect = file.encoding.pixel_aspect
    if not file.envmap and not file.encoding.has_square_pixels:
        raise ProbeError(
            f"{file.name}: its pixels are not square (aspect {aspect:.3g}), so that "
            f"{file.width} x {file.height} does not tell its layout; give `layout`, or resample it"
        )
    return detect_layout(file.name, file.width, file.height, file.envmap)


def face_paths(name: str) -> list[str]:
    """Names of the six files that a name with ``%`` stands for, in the order of `FACES`."""
    folder, pattern = os.path.split(name)
    return [os.path.join(folder, pattern.replace("%", face)) for face in FACES]


def _open_faces(name: str, options: ReadOptions) -> tuple[ImageFile | DdsFile, ...]:
    """Open the six files that a name with ``%`` stands for, which must be of one size."""
    files = tuple(_open_file(path, options) for path in face_paths(name))
    for file in files:
        if (file.width, file.height) != (files[0].width, files[0].height):
            raise ProbeError(
                f"{file.path}: {file.width} x {file.height} pixels, but {files[0].path} has "
                f"{files[0].width} x {files[0].height}; make all six the same"
            )
    return files


AnyProbe = Probe | str | os.PathLike[str] | NDArray[np.floating]
"""A probe, the name of its file, or its pixels."""


def as_probe(probe: AnyProbe) -> Probe:
    """A probe from itself, from the name of its file, or from its pixels.

    Files and pixels are understood as `open_probe` and `Probe.from_array` do without options.

    Raises
    ------
    ProbeError
    """
    if isinstance(probe, Probe):
        return probe
    if isinstance(probe, np.ndarray):
        return Probe.from_array(probe)
    return open_probe(probe)
