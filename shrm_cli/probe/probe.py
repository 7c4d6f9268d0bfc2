"""A light probe: radiance on a lat-long, a cube or an angular map."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import ProbeError
from shrm_cli.probe.image_file import ImageFile, sha256
from shrm_cli.probe.layout import (
    Layout,
    check_shape,
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
from shrm_cli.sphere.cube import FACES, Orientation, cube_solid_angles
from shrm_cli.sphere.grids import (
    Sampling,
    angular_solid_angles,
    colatitude_weights,
    longitude_weights,
)
from shrm_cli.sphere.sampling import CubeSampler, sample_angular, sample_latlong

Array = NDArray[np.floating]
Grid = Literal["latlong", "cube", "angular"]

_MAX_PIXELS_IN_MEMORY = 2**27
_BLOCK_PIXELS = 2**20
_HOLE_ROWS = 32


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
        weights = colatitude_weights(self.height, self.sampling)[:, None]
        # On a border-sampled file the two end columns share one meridian's weight.
        weights = weights * (column[1] if self.sampling == "center" else column)
        for start in range(0, self.height, rows):
            stop = min(start + rows, self.height)
            pixels = file.read(start, stop)
            bad = find_nonfinite(pixels, start, self.report)
            if bad is not None and self.policy.fix_nonfinite:
                first = max(start - _HOLE_ROWS, 0)
                around = file.read(first, min(stop + _HOLE_ROWS, self.height))
                pixels = fill_nonfinite(self.name, around, wraps=True)[start - first :][: len(bad)]
            elif bad is not None:  # only counted: an error follows
                pixels = np.where(bad[..., None], np.float32(0), pixels)
            yield start, pixels, weights[start:stop]

    def _whole(self) -> Iterator[tuple[int, Array, Array]]:
        parts = []
        for file in self.files:
            part = file.read(0, file.height)
            find_nonfinite(part, 0, self.report)
            if not self.policy.fix_nonfinite:
                refuse_nonfinite(str(file.path), self.report)
            parts.append(part)
        image = np.concatenate(parts) if len(parts) > 1 else parts[0]
        if self.grid == "angular":
            weights = angular_solid_angles(self.width, self.sampling)
            images = [image]
        else:
            image = stack_faces(image, self.layout, self.orientation)
            weights = np.tile(cube_solid_angles(self.width, self.sampling), (6, 1))
            images = list(image.reshape(6, self.width, self.width, 3))
        if self.report.nonfinite:
            image = np.concatenate([fill_nonfinite(self.name, k, wraps=False) for k in images])
        yield 0, image, weights

    def radiance(self, directions: ArrayLike) -> Array:
        """Filtered radiance in world directions, shape (..., 3)."""
        inside = np.asarray(directions) @ self.matrix  # M^-1 d, as rows
        image = self.image()
        if self.grid == "cube":
            return np.maximum(CubeSampler(image, self.sampling)(inside), 0)
        sample = sample_latlong if self.grid == "latlong" else sample_angular
        return sample(image, inside, self.sampling)


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
    if "%" in Path(name).name and not Path(name).exists():
        files = _open_faces(name, options)
        layout: Layout = "faces"
    else:
        files = (ImageFile.open(name, options.linearize),)
        layout = options.layout or detect_layout(
            name, files[0].width, files[0].height, files[0].envmap
        )
    first = files[0]
    check_shape(name, layout, first.width, first.height)
    grid: Grid = layout if layout in ("latlong", "angular") else "cube"  # type: ignore[assignment]
    pixels = first.width * first.height * len(files)
    if grid != "latlong" and pixels > _MAX_PIXELS_IN_MEMORY:
        raise ProbeError(
            f"{name}: {pixels:,} pixels of a {layout} are more than {_MAX_PIXELS_IN_MEMORY:,}; "
            "scale it down or convert it to a lat-long"
        )
    height = first.height
    width = first.width
    if grid == "cube":
        width = _face_size(layout, first.width)
        height = 6 * width
    border = "border" if first.border_sampled else "center"
    return Probe(
        name,
        grid,
        width,
        height,
        options.sampling or border,  # type: ignore[arg-type]
        layout,
        options.orientation or default_orientation(layout, first.file_format),
        options.matrix(),
        options.pixels,
        first.chromaticities,
        files,
    )


def _face_size(layout: Layout, width: int) -> int:
    return width // {"strip": 6, "hcross": 4, "vcross": 3}.get(layout, 1)


def _open_faces(name: str, options: ReadOptions) -> tuple[ImageFile, ...]:
    folder, pattern = os.path.split(name)
    files = tuple(
        ImageFile.open(os.path.join(folder, pattern.replace("%", face)), options.linearize)
        for face in FACES
    )
    for file in files:
        if (file.width, file.height) != (files[0].width, files[0].height):
            raise ProbeError(
                f"{file.path}: {file.width} x {file.height} pixels, but {files[0].path} has "
                f"{files[0].width} x {files[0].height}"
            )
    return files
