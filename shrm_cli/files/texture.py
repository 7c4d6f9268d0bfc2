"""The pixels of textures, and their mean, for materials that are even where the texture is not.

Textures may come from anywhere: only files of a few formats, and of a bounded size, reach the
library that reads them, and only from the folder of the file that names them or from below it.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import srgb_to_linear
from shrm_cli.files.exr_header import why_too_much
from shrm_cli.files.openimageio import oiio, quiet
from shrm_cli.files.whole import note, scratch_folder

_BEGINNINGS = {
    b"\x89PNG\r\n\x1a\n": ".png",
    b"\xff\xd8\xff": ".jpg",
    b"v/1\x01": ".exr",
    b"#?RA": ".hdr",
    b"#?RG": ".hdr",
    b"II*\0": ".tif",
    b"MM\0*": ".tif",
}
"""How files of the formats that are read begin, and what their names end with."""
_MOST_BYTES = 2**28
"""The most bytes of a texture's file, and of its pixels in memory."""

_NO_NUMBERS = "a texture has pixels that are no numbers; export it again"


def referenced_file(name: str, path: str, what: str = "texture") -> Path:
    """Return the file that another file names, which lies in that one's folder or below it.

    `path` is what it is called there, with slashes.

    Raises ValueError if it leads elsewhere, or there is no such file.
    """
    shown = repr(path[:80])
    parts = path.split("/")
    if ".." in parts or path.startswith("/") or any(each in path for each in ":\\\0%") or not path:
        raise ValueError(f"the {what} {shown} is not in its folder; copy it there")
    folder = Path(name).parent
    found = folder / path
    try:
        real = os.path.realpath(found)
        if os.path.commonpath([real, os.path.realpath(folder)]) != os.path.realpath(folder):
            raise ValueError(f"the {what} {shown} is not in its folder; copy it there")
        if not os.path.isfile(real):
            raise ValueError(f"the {what} {shown} is missing; copy it")
    except OSError as error:  # such as a name too long
        raise ValueError(f"the {what} {shown} cannot be read ({error.strerror})") from error
    return found


def mean_color(texture: Path | bytes, is_srgb: bool) -> Array:
    """Return the mean of a texture's pixels.

    `is_srgb` tells whether integers of colors are encoded as sRGB has it; alpha never is, nor are
    floats, as those of EXR.

    Returns an array of shape (4,): linear red, green, blue, and alpha. A channel that is missing is
    as the first one; alpha is 1 then. Raises ValueError if it cannot be read, with why and what to
    do.
    """
    pixels, is_float = _stored(texture)
    pixels, is_srgb = pixels.reshape(-1, pixels.shape[2]), is_srgb and not is_float
    channels = pixels.shape[1]
    alpha = _mean(pixels[:, -1], False) if channels in (2, 4) else 1.0
    found = [_mean(pixels[:, k if channels > 2 else 0], is_srgb) for k in range(3)]
    return np.array([*found, alpha])


def read_texture(texture: Path | bytes, is_srgb: bool) -> Array:
    """Return a texture's pixels, shape (height, width, 4), linear, of 32-bit floats.

    `is_srgb` is as of `mean_color`.
    """
    pixels, is_float = _stored(texture)
    is_srgb = is_srgb and not is_float
    count = pixels.shape[2]
    result = np.ones((*pixels.shape[:2], 4), dtype=np.float32)
    for channel in range(3):
        result[..., channel] = _linear(pixels[..., channel if count > 2 else 0], is_srgb)
    if count in (2, 4):
        result[..., 3] = _linear(pixels[..., -1], False)
    if not np.isfinite(result).all():
        raise ValueError(_NO_NUMBERS)
    return result


def _linear(channel: Array, is_srgb: bool) -> Array:
    """Return a channel as linear floats; of bytes, 0 .. 1."""
    values = _values(channel, is_srgb)
    return values[channel] if channel.dtype == np.uint8 else values


def _values(channel: Array, is_srgb: bool) -> Array:
    """Return linear floats: those that the 256 bytes stand for, or those of the channel itself."""
    values = np.arange(256) / 255 if channel.dtype == np.uint8 else channel.astype(float)
    return srgb_to_linear(values) if is_srgb else values


def _mean(channel: Array, is_srgb: bool) -> float:
    """Return the mean of a channel, of bytes by how often each of them is there."""
    weights = np.bincount(channel, minlength=256) if channel.dtype == np.uint8 else None
    mean = float(np.average(_values(channel, is_srgb), weights=weights))
    if not np.isfinite(mean):
        raise ValueError(_NO_NUMBERS)
    return mean


@contextmanager
def _file(texture: Path | bytes) -> Iterator[Path]:
    """Context manager that yields the path of a texture, which begins as it should."""
    if isinstance(texture, bytes):
        with scratch_folder() as folder:
            copy = folder / f"texture{_suffix(texture[:8])}"
            copy.write_bytes(texture)
            yield copy
        return
    note(texture)
    try:
        if texture.stat().st_size > _MOST_BYTES:
            raise ValueError(f"{texture.name} is larger than {_MOST_BYTES:,} bytes; scale it down")
        with open(texture, "rb") as stream:
            suffix = _suffix(stream.read(8))
    except OSError as error:
        raise ValueError(f"{texture.name} cannot be read ({error.strerror})") from error
    if suffix == ".exr" and why_too_much(texture):
        raise ValueError(f"{texture.name} claims more than it holds; export it again")
    yield texture


def _suffix(head: bytes) -> str:
    for start, suffix in _BEGINNINGS.items():
        if head.startswith(start):
            return suffix
    raise ValueError("a texture is neither PNG, JPEG, TIFF, EXR nor Radiance; convert it")


def _stored(texture: Path | bytes) -> tuple[Array, bool]:
    """Return the pixels as they are stored, shape (height, width, channels), and if as floats."""
    with _file(texture) as path:
        return _pixels(path)


@quiet
def _pixels(path: Path) -> tuple[Array, bool]:
    """Return the pixels, 8-bit integers as they are and others as floats, and if they are such."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(os.fspath(path), config)
    if source is None:
        oiio.geterror()
        raise ValueError(f"{path.name} cannot be read; export it again")
    try:
        spec = source.spec()
        kind = "uint8" if str(spec.format) == "uint8" else "float"
        channels = min(spec.nchannels, 4)
        size = spec.width * spec.height * spec.depth * channels * (1 if kind == "uint8" else 4)
        if not 0 < size <= _MOST_BYTES:
            raise ValueError(f"{path.name}: {spec.width} x {spec.height} pixels; scale it down")
        pixels = source.read_image(0, 0, 0, channels, kind)
        if pixels is None:
            source.geterror()
            raise ValueError(f"{path.name} is damaged; export it again")
    finally:
        source.close()
    shape = spec.height * spec.depth, spec.width, channels
    return np.asarray(pixels).reshape(shape), str(spec.format) in ("half", "float", "double")
