"""What a probe asks of the images that hold its pixels, and images that are arrays."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.records import record


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
    def row_multiple(self) -> int:
        """Rows that are cheapest to read together start at multiples of this."""

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1, a new float32 array of shape (rows, width, 3)."""

    def contents(self) -> Iterator[bytes]:
        """Yield, piece by piece, the bytes that tell this image from others."""


@record(eq=False)
class ImageOfImage:
    """An image that reads the pixels of another one, and is that image in all else.

    Attributes
    ----------
    image : ProbeImage
    """

    image: ProbeImage

    @property
    def name(self) -> str:
        return self.image.name

    @property
    def path(self) -> Path | None:
        return self.image.path

    @property
    def width(self) -> int:
        return self.image.width

    @property
    def height(self) -> int:
        return self.image.height

    @property
    def file_format(self) -> str:
        return self.image.file_format

    @property
    def notes(self) -> tuple[str, ...]:
        return self.image.notes

    @property
    def row_multiple(self) -> int:
        return self.image.row_multiple

    def facts(self) -> dict[str, Any]:
        """What was taken of the file."""
        return self.image.facts()

    def contents(self) -> Iterator[bytes]:
        """Yield, piece by piece, the bytes that tell this image from others."""
        return self.image.contents()

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1, a new float32 array of shape (rows, width, 3)."""
        return self.image.read(start, stop)


@record(eq=False)
class ConvertedImage(ImageOfImage):
    """An image in other primaries.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        From linear RGB of the image to that of this one. Colors outside the new primaries have
        negative channels.
    """

    matrix: Array

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1, a new float32 array of shape (rows, width, 3)."""
        with np.errstate(over="ignore", invalid="ignore"):  # NaN and infinity are found later
            return self.image.read(start, stop) @ self.matrix.T.astype(np.float32)


@record(eq=False)
class ArrayImage:
    """An image in memory.

    Attributes
    ----------
    pixels : ndarray of float32, shape (H, W, 3) or (H, W)
        Linear radiance. One channel serves as three.
    name : str
        What messages call the image.
    """

    pixels: NDArray[np.float32]
    name: str

    path = None
    file_format = "array"
    notes = ()
    row_multiple = 1

    @classmethod
    def copy_of(cls, array: ArrayLike, name: str) -> "ArrayImage":
        """Make an image from a copy of an array.

        Parameters
        ----------
        array : array_like of a floating type, shape (H, W, 3) or (H, W)
        name : str

        Raises
        ------
        ProbeError
            If it cannot be radiance.
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
        with np.errstate(over="ignore"):  # what float32 cannot hold is infinite, and is refused
            return cls(np.array(values, dtype=np.float32, order="C"), name)

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
        """Rows `start` .. `stop` - 1, a new float32 array of shape (rows, width, 3)."""
        rows = self.pixels[start:stop]
        return np.repeat(rows[..., None], 3, axis=-1) if rows.ndim == 2 else rows.copy()

    def contents(self) -> Iterator[bytes]:
        """Yield the pixels as little-endian float32, and the shape of the array as text."""
        yield self.pixels.astype("<f4", copy=False).tobytes()
        yield repr(self.pixels.shape).encode()


def digest(images: tuple[ProbeImage, ...]) -> str:
    """SHA-256 of the contents of images, one after the other."""
    result = hashlib.sha256()
    for image in images:
        for piece in image.contents():
            result.update(piece)
    return result.hexdigest()
