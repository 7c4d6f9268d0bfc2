"""A light probe: radiance on a lat-long, a cube or an angular map."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import ProbeError
from shrm_cli.probe.image_file import ImageFile, sha256
from shrm_cli.probe.layout import (
    Layout,
    check_shape,
    clear_unused,
    default_orientation,
    detect_layout,
    stack_faces,
)
from shrm_cli.probe.pixels import (
    PixelPolicy,
    PixelReport,
    fill_nonfinite,
    find_nonfinite,
    refuse_nonfinite,
)
from shrm_cli.sphere.cube import FACES, cube_solid_angles
from shrm_cli.sphere.grids import angular_solid_angles, colatitude_weights, longitude_weights
from shrm_cli.sphere.sampling import CubeSampler, sample_angular, sample_latlong
from shrm_cli.vocabulary import Orientation, Sampling

Array = NDArray[np.floating]
Grid = Literal["latlong", "cube", "angular"]

_MAX_PIXELS_IN_MEMORY = {"cube": 2**27, "angular": 2**25}  # about 7 GB
_BLOCK_PIXELS = 2**20
_NOTHING_FINITE = "{}: nothing is finite to fill NaN or infinite pixels from; export it again"
_HOLE_ROWS = 32  # read around a block with holes, at first


@dataclass(frozen=True)
class ReadOptions:
    """How a file is to be understood; None leaves it to the file.

    Attributes
    ----------
    layout, orientation, sampling
        As `Layout`, `Orientation`, `Sampling`.
    yaw : float
        Turn about +Y, degrees, from +Z towards +X.
    mirror : bool
        Mirror x -> -x (before the yaw).
    up : {"y", "z"}
        ``z``: the file's +Z is up; it is turned to +Y first of all.
    linearize : bool
        Decode integer pixels as sRGB.
    pixels : PixelPolicy
    """

    layout: Layout | None = None
    orientation: Orientation | None = None
    sampling: Sampling | None = None
    yaw: float = 0.0
    mirror: bool = False
    up: Literal["y", "z"] = "y"
    linearize: bool = False
    pixels: PixelPolicy = field(default_factory=PixelPolicy)

    def matrix(self) -> Array:
        """Orthogonal matrix from the file's axes to world axes, shape (3, 3)."""
        a = np.radians(self.yaw)
        turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
        mirror = np.diag([-1.0 if self.mirror else 1.0, 1.0, 1.0])
        up = np.eye(3)
        if self.up == "z":
            up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        return turn @ mirror @ up


@dataclass(frozen=True)
class Probe:
    """A probe whose pixels are read on demand, and checked as they are.

    Attributes
    ----------
    name : str
        The file's name, as the user gave it.
    grid : {"latlong", "cube", "angular"}
    width, height : int
        Of the grid; a cube is N x 6N in OpenEXR's order and orientation, whatever it was in
        the file.
    sampling : {"center", "border"}
    layout : Layout
        Of the file.
    matrix : ndarray, shape (3, 3)
        From the grid's axes to world axes.
    chromaticities : tuple of 8 float, optional
    report : PixelReport
        Filled by reading.
    """

    name: str
    grid: Grid
    width: int
    height: int
    sampling: Sampling
    layout: Layout
    orientation: Orientation
    matrix: Array
    policy: PixelPolicy
    chromaticities: tuple[float, ...] | None
    files: tuple[ImageFile, ...]
    report: PixelReport = field(default_factory=PixelReport)

    def digest(self) -> str:
        """SHA-256 of the file's bytes; of six files, one after the other."""
        return sha256([file.path for file in self.files])

    def blocks(self) -> Iterator[tuple[int, Array, Array]]:
        """Yield the image in blocks of rows: first row, pixels, solid angles.

        Yields
        ------
        start : int
        pixels : ndarray of float32, shape (rows, width, 3)
            Finite and not negative.
        weights : ndarray, shape (rows, width) or (rows, 1)
            Solid angle of each pixel; Fejer's or Clenshaw-Curtis's rule on a lat-long.

        Raises
        ------
        ProbeError
            If the file is damaged, or has NaN or infinite pixels that are not to be filled.
        """
        self.report.clear()
        reader = self._latlong_rows if self.grid == "latlong" else self._whole
        for start, pixels, weights in reader():
            yield start, self.policy.apply(pixels, weights, self.report), weights
        if not self.policy.fix_nonfinite:
            refuse_nonfinite(self.name, self.report)

    def image(self) -> Array:
        """The whole grid, shape (height, width, 3)."""
        return np.concatenate([pixels for _, pixels, _ in self.blocks()])

    def _latlong_rows(self) -> Iterator[tuple[int, Array, Array]]:
        file = self.files[0]
        rows = max(_BLOCK_PIXELS // self.width, 1)
        rows = -(-rows // file.row_multiple) * file.row_multiple
        column = longitude_weights(self.width, self.sampling)
        if self.sampling == "center":  # every column weighs the same
            column = column[:1]
        weights = colatitude_weights(self.height, self.sampling)[:, None]
        for start in range(0, self.height, rows):
            stop = min(start + rows, self.height)
            pixels = file.read(start, stop)
            bad = find_nonfinite(pixels, start, self.report)
            if bad is not None and self.policy.fix_nonfinite:
                pixels = self._filled_rows(start, stop)
            elif bad is not None:  # only counted: an error follows
                pixels = np.where(bad[..., None], np.float32(0), pixels)
            yield start, pixels, weights[start:stop] * column

    def _filled_rows(self, start: int, stop: int) -> Array:
        """Rows of a lat-long without holes, the same however the image is cut into blocks.

        A pixel at depth k of a hole depends on the k rows above and below it, so as many are
        read as the deepest one needs.
        """
        margin = _HOLE_ROWS
        while True:
            first, last = max(start - margin, 0), min(stop + margin, self.height)
            whole = last - first == self.height
            around = fill_nonfinite(
                self.files[0].read(first, last), wraps=True, rounds=None if whole else margin
            )
            pixels = around[start - first : stop - first]
            if np.isfinite(pixels).all():
                return pixels
            if whole:
                raise ProbeError(_NOTHING_FINITE.format(self.name))
            margin *= 4

    def _whole(self) -> Iterator[tuple[int, Array, Array]]:
        angular = self.grid == "angular"
        if angular:
            weights = angular_solid_angles(self.width, self.sampling)
        else:
            weights = np.tile(cube_solid_angles(self.width, self.sampling), (6, 1))
        parts = []
        for file in self.files:
            part = file.read(0, file.height)
            if angular:
                part[weights == 0] = 0  # outside the rim
            clear_unused(part, self.layout)
            find_nonfinite(part, 0, self.report)
            if not self.policy.fix_nonfinite:
                refuse_nonfinite(str(file.path), self.report)
            parts.append(part)
        image = np.concatenate(parts) if len(parts) > 1 else parts[0]
        if not angular:
            image = stack_faces(image, self.layout, self.orientation)
        if self.report.nonfinite:
            square = (-1, self.width, self.width)
            pictures = zip(image.reshape(*square, 3), (weights > 0).reshape(square), strict=True)
            image = np.concatenate([fill_nonfinite(part, used=used) for part, used in pictures])
            if not np.isfinite(image).all():
                raise ProbeError(_NOTHING_FINITE.format(self.name))
        yield 0, image, weights

    def radiance(self, directions: ArrayLike) -> Array:
        """Filtered radiance in world directions, shape (..., 3); the image is read once."""
        inside = np.asarray(directions) @ self.matrix  # M^-1 d, as rows
        if self.grid == "cube":
            return np.maximum(self._sampler(inside), 0)
        sample = sample_latlong if self.grid == "latlong" else sample_angular
        return sample(self._image, inside, self.sampling)

    @cached_property
    def _image(self) -> Array:
        return self.image()

    @cached_property
    def _sampler(self) -> CubeSampler:
        return CubeSampler(self._image, self.sampling)


def open_probe(path: str | os.PathLike[str], options: ReadOptions | None = None) -> Probe:
    """Open a probe of any layout; its pixels are read when they are needed.

    Parameters
    ----------
    path : path-like
        An image file, or six of them with ``%`` in place of ``+X``, ``-X``, ...
    options : ReadOptions, optional

    Raises
    ------
    ProbeError
        If it is no usable image, or its layout is unknown.
    """
    options = options or ReadOptions()
    name = str(path)
    if "%" in os.path.basename(name) and not os.path.exists(name):
        if options.layout not in (None, "faces"):
            raise ProbeError(f"{name}: six files are not {options.layout}; leave --layout out")
        files = _open_faces(name, options)
        layout: Layout = "faces"
    elif options.layout == "faces":
        raise ProbeError(f"{name}: write % in place of +X, -X, ... to name the files of six faces")
    else:
        files = (ImageFile.open(name, options.linearize),)
        layout = options.layout or detect_layout(
            name, files[0].width, files[0].height, files[0].envmap
        )
    first = files[0]
    check_shape(name, layout, first.width, first.height)
    grid: Grid = layout if layout == "latlong" or layout == "angular" else "cube"
    count = first.width * first.height * len(files)
    if count > (limit := _MAX_PIXELS_IN_MEMORY.get(grid, count)):
        raise ProbeError(f"{name}: {count:,} {layout} pixels exceed {limit:,}; scale it down")
    width, height = first.width, first.height
    if grid == "cube":
        width //= {"strip": 6, "hcross": 4, "vcross": 3}.get(layout, 1)
        height = 6 * width
    sampling: Sampling = "border" if first.border_sampled else "center"
    return Probe(
        name,
        grid,
        width,
        height,
        options.sampling or sampling,
        layout,
        options.orientation or default_orientation(layout, first.file_format),
        options.matrix(),
        options.pixels,
        first.chromaticities,
        files,
    )


def face_paths(name: str) -> list[str]:
    """Names of the six files that a name with ``%`` stands for, in the order of `FACES`."""
    folder, pattern = os.path.split(name)
    return [os.path.join(folder, pattern.replace("%", face)) for face in FACES]


def _open_faces(name: str, options: ReadOptions) -> tuple[ImageFile, ...]:
    files = tuple(ImageFile.open(path, options.linearize) for path in face_paths(name))
    for file in files:
        if (file.width, file.height) != (files[0].width, files[0].height):
            raise ProbeError(
                f"{file.path}: {file.width} x {file.height} pixels, but {files[0].path} has "
                f"{files[0].width} x {files[0].height}; make all six the same"
            )
    return files
