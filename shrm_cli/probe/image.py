"""The images that hold a probe's pixels: what it asks of them, arrays, and how they lie in them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import ProbeError
from shrm_cli.records import handed_on, record
from shrm_cli.sphere.grid.base import Grid, grid_class
from shrm_cli.vocabulary import (
    CUBES,
    FACES,
    IMAGE_LAYOUTS,
    Layout,
    Orientation,
    Sampling,
    grid_name,
)

_NEARLY = 0.02
"""A lat-long may be so much of its width wider or narrower than 2:1 by rounding, or by mistake,
and always by a pixel."""
_ROWS_AT_ONCE = 256


class ProbeImage(Protocol):
    """An image whose pixels are read by rows, as often as they are needed."""

    @property
    def name(self) -> str:
        """What messages call the image."""

    @property
    def path(self) -> Path | None:
        """The file that the image is in, if there is one."""

    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    @property
    def file_format(self) -> str:
        """Where the pixels come from, such as ``"openexr"`` or ``"array"``."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of the image, a line each."""

    def facts(self) -> dict[str, Any]:
        """What was taken of the file, and how, for `shrm info`."""

    @property
    def largest(self) -> Array | None:
        """The radiance of the largest integers that it can hold, shape (3,); None of floats."""

    @property
    def given(self) -> Array | None:
        """The radiance that a reading gave a lamp that had been clipped, shape (3,), if any."""

    @property
    def row_multiple(self) -> int:
        """Rows that are cheapest to read together start at multiples of this."""

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1, a new float32 array of shape (rows, width, 3)."""

    def contents(self) -> Iterator[bytes]:
        """Yield, piece by piece, the bytes that tell this image from others."""


@record(eq=False)
class ImageOfImage:
    """An image that reads the pixels of another one, and is that image in all else."""

    image: ProbeImage

    name = handed_on("image", "name")
    path = handed_on("image", "path")
    width = handed_on("image", "width")
    height = handed_on("image", "height")
    file_format = handed_on("image", "file_format")
    notes = handed_on("image", "notes")
    largest = handed_on("image", "largest")
    given = handed_on("image", "given")
    row_multiple = handed_on("image", "row_multiple")
    facts = handed_on("image", "facts")
    contents = handed_on("image", "contents")

    def read(self, start: int, stop: int) -> Array:
        return self.image.read(start, stop)


@record(eq=False)
class ConvertedImage(ImageOfImage):
    """An image in other primaries."""

    matrix: Array
    """From linear RGB of the image to that of this one, shape (3, 3). Colors outside the new
    primaries have negative channels."""

    @property
    def largest(self) -> Array | None:
        return self._converted(self.image.largest)

    @property
    def given(self) -> Array | None:
        return self._converted(self.image.given)

    def _converted(self, color: Array | None) -> Array | None:
        return None if color is None else self.matrix @ color

    def read(self, start: int, stop: int) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):  # NaN and infinity are found later
            return self.image.read(start, stop) @ self.matrix.T.astype(np.float32)


@record(eq=False)
class ArrayImage:
    """An image in memory."""

    pixels: NDArray[np.float32]
    """Linear radiance, shape (H, W, 3) or (H, W). One channel serves as three."""
    name: str
    """What messages call the image."""

    path = None
    file_format = "array"
    notes = ()
    largest = given = None
    row_multiple = 1

    @classmethod
    def copy_of(cls, array: ArrayLike, name: str) -> "ArrayImage":
        """Make an image from a copy of an array.

        `array` is of a floating type and of shape (H, W, 3) or (H, W).
        """
        values = np.asarray(array)
        if values.ndim not in (2, 3) or values.shape[2:] not in ((), (3,)) or values.size == 0:
            raise ProbeError(
                f"{name}: an array of shape {values.shape} is no image; give (H, W, 3) or (H, W)"
            )
        if values.dtype.kind != "f":
            raise ProbeError(
                f"{name}: {values.dtype} values are not scene-linear radiance; give an array of "
                "floats"
            )
        with np.errstate(over="ignore"):  # what float32 cannot hold is infinite
            pixels = np.array(values, dtype=np.float32, order="C")
        if values.dtype.itemsize > pixels.itemsize:
            lost = np.isinf(pixels) & np.isfinite(values)
            if count := np.count_nonzero(lost):
                row, column = np.argwhere(lost)[0][:2]
                raise ProbeError(
                    f"{name}: {count:,} of its values are too large for 32-bit floats, the first "
                    f"at column {column}, row {row}; scale it down"
                )
        return cls(pixels, name)

    def facts(self) -> dict[str, Any]:
        """Nothing: an array is what it is."""
        return {}

    @property
    def width(self) -> int:
        return self.pixels.shape[1]

    @property
    def height(self) -> int:
        return self.pixels.shape[0]

    def read(self, start: int, stop: int) -> Array:
        rows = self.pixels[start:stop]
        return np.repeat(rows[..., None], 3, axis=-1) if rows.ndim == 2 else rows.copy()

    def contents(self) -> Iterator[bytes]:
        """Yield the pixels as little-endian float32, and the shape of the array as text."""
        for rows in slices(len(self.pixels), _ROWS_AT_ONCE):  # a copy of all takes as much again
            yield self.pixels[rows].astype("<f4", copy=False).tobytes()
        yield repr(self.pixels.shape).encode()


def detect_layout(name: str, width: int, height: int, envmap: str) -> Layout:
    """Layout of an image, from its attribute `envmap`, else from its aspect ratio.

    `envmap` is ``latlong``, ``cube`` or, of files of this program, ``angular``, or empty.
    """
    if envmap:
        return "openexr" if envmap == "cube" else envmap
    if width == height:
        raise ProbeError(
            f"{name}: a square image may be many things; give `layout` angular for a light-probe "
            "ball, or one name with % in place of +X, -X, ... for the six faces of a cube"
        )
    for layout in IMAGE_LAYOUTS:
        columns, rows = proportions(layout)
        if width * rows == height * columns:
            return layout
    cubes = [cube for cube in CUBES.values() if not cube.in_six_files]
    shapes = [
        " or ".join(f"{cube.columns}:{cube.rows}" for cube in cubes if cube.is_cross == is_cross)
        for is_cross in (False, True)
    ]
    raise ProbeError(
        f"{name}: {width} x {height} is no known layout (2:1 lat-long, {shapes[0]} cube, "
        f"{shapes[1]} cross); give `layout`{_of_latlongs(width, height)}"
    )


def _of_latlongs(width: int, height: int) -> str:
    """Say what makes a lat-long of an image that is nearly one, or a part of one."""
    if abs(width - 2 * height) <= max(_NEARLY * width, 1):
        return f", or scale it to {2 * height} x {height} if it is a lat-long"
    if width > 2 * height:
        even = width + width % 2
        whole = f"{even} x {even // 2}"
        return f", or put what is a part of a panorama into {whole} pixels, black elsewhere"
    return ""


def proportions(layout: Layout, images: int = 1) -> tuple[int, int]:
    """Width and height of a layout's image, in faces or in another unit."""
    if images > 1:
        return 1, 1
    if layout in CUBES:
        return CUBES[layout].columns, CUBES[layout].rows
    return grid_class(layout).proportions


def check_shape(name: str, layout: Layout, width: int, height: int, images: int = 1) -> None:
    """Check that an image's size suits its layout.

    `width` and `height` are those of each image. `images` are 1, or 6 where each face is an image
    of its own.
    """
    columns, rows = proportions(layout, images)
    size = width // columns
    if (width, height) != (columns * size, rows * size):
        if columns == rows:
            wanted = "a square image"
        elif layout in CUBES:
            wanted = f"{columns} x {rows} square faces"
        else:
            wanted = f"width = {columns / rows:g} x height"
        advice = _of_latlongs(width, height) if layout == "latlong" else ""
        raise ProbeError(
            f"{name}: {width} x {height} cannot be {layout}, which is {wanted}; give the `layout` "
            f"that it has{advice or ', or crop it'}"
        )
    if size < grid_class(grid_name(layout)).smallest:
        raise ProbeError(
            f"{name}: {width} x {height} is too small to be {layout}; use a larger one"
        )


def grid_of(layout: Layout, width: int, sampling: Sampling, images: int = 1) -> Grid:
    """The grid that the pixels of a layout are brought to.

    `width` is that of each image, which suits the layout. `images` are 1, or 6 where each face is
    an image of its own.
    """
    columns, _ = proportions(layout, images)
    return grid_class(grid_name(layout))(width // columns, sampling)


def clear_unused(image: Array, layout: Layout) -> None:
    """Set to 0, in place, the corners of a cross: whatever they hold, it is no radiance."""
    if layout not in CUBES:
        return
    size = image.shape[1] // CUBES[layout].columns
    for column, row in CUBES[layout].unused():
        image[row * size : (row + 1) * size, column * size : (column + 1) * size] = 0


def stack_faces(image: Array, layout: Layout, orientation: Orientation) -> Array:
    """An image of any arrangement as a stacked cube of OpenEXR's, shape (6N, N, channels).

    `image`, of shape (rows * N, columns * N, channels), holds the faces; for ``"faces"`` it is the
    six files stacked. `layout` is one of a cube. `orientation` is that of the faces in the image.
    """
    from shrm_cli.sphere.cube import reoriented

    if (layout, orientation) in (("openexr", "openexr"), ("faces", "openexr")):
        return image
    cube = CUBES[layout]
    size = image.shape[1] // cube.columns
    faces = np.empty((len(FACES), size, size, image.shape[2]), dtype=image.dtype)
    for face, (column, row, turned) in enumerate(cube.places):
        part = image[row * size : (row + 1) * size, column * size : (column + 1) * size]
        faces[face] = reoriented(part[::-1, ::-1] if turned else part, face, orientation)
    return faces.reshape(6 * size, size, -1)


def arrange_faces(stack: Array, layout: Layout, orientation: Orientation) -> Array:
    """A stacked cube of OpenEXR's orientation in any arrangement: the inverse of `stack_faces`.

    `stack` is of shape (6N, N, channels). `layout` is one of a cube; ``"faces"`` gives the six
    files stacked. `orientation` is that of the faces in the result.

    Returns an array of shape (rows * N, columns * N, channels): the corners of a cross are 0.
    """
    from shrm_cli.sphere.cube import reoriented

    cube = CUBES[layout]
    size = stack.shape[1]
    faces = stack.reshape(len(FACES), size, size, -1)
    image = np.zeros((cube.rows * size, cube.columns * size, faces.shape[-1]), dtype=stack.dtype)
    for face, (column, row, turned) in enumerate(cube.places):
        # Between the two orientations faces are only flipped: the way back is the way there.
        part = reoriented(faces[face], face, orientation)
        part = part[::-1, ::-1] if turned else part
        image[row * size : (row + 1) * size, column * size : (column + 1) * size] = part
    return image
