"""OpenEXR files of one or more parts: opened with care, written whole or not at all."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO as oiio
from numpy.typing import NDArray

from shrm_cli import settings
from shrm_cli.errors import MapError, OutputError
from shrm_cli.files.whole import replacing
from shrm_cli.vocabulary import MAX_ORDER_P

Array = NDArray[np.floating]

_HALF_MAX = float(np.finfo(np.float16).max)
_FLOAT_MAX = float(np.finfo(np.float32).max)
_HALF_OVERFLOW = _HALF_MAX + 16  # from here on rounding to the nearest half gives infinity


# OpenImageIO's own limit refuses SHRMs of high orders; what is too much to load, readers refuse.
oiio.attribute("limits:channels", 3 * (MAX_ORDER_P + 1) ** 2)


@dataclass(frozen=True)
class Part:
    """One part of a file.

    Attributes
    ----------
    channels : dict of str to ndarray, shape (H, W)
    header : dict
        Attributes; ``name`` among them where there are several parts.
    """

    channels: dict[str, Array]
    header: dict[str, Any] = field(default_factory=dict)


def write_parts(path: str | os.PathLike[str], parts: Sequence[Part], precision: str) -> str:
    """Write a file, whole or not at all.

    Parameters
    ----------
    path : path-like
    parts : sequence of Part
    precision : {"auto", "half", "float"}
        ``auto`` is half unless a value exceeds its range.

    Returns
    -------
    str
        The pixel type written, ``"half"`` or ``"float"``.

    Raises
    ------
    OutputError
        If half would overflow, or the file cannot be written.
    """
    chosen = choose_precision(
        path, (p for part in parts for p in part.channels.values()), precision
    )
    dtype = np.float32 if chosen == "float" else np.float16
    common = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    stored = [
        OpenEXR.Part(
            {**common, **part.header},
            # OpenEXR ignores strides: planes must be contiguous.
            {name: np.ascontiguousarray(plane, dtype) for name, plane in part.channels.items()},
        )
        for part in parts
    ]
    with replacing(path) as temporary:
        try:
            with OpenEXR.File(stored, num_threads=settings.current().threads or -1) as file:
                file.write(str(temporary))
        except RuntimeError as error:  # the library's words end with the system's
            raise OSError(0, str(error).rpartition('". ')[2].rstrip(".")) from error
    return chosen


def choose_precision(path: str | os.PathLike[str], planes: Iterable[Array], precision: str) -> str:
    """The pixel type that a ``precision`` stands for with these values; see `write_parts`."""
    largest = 0.0
    for plane in planes:
        # A NaN is larger than nothing, and stays.
        high = float(max(plane.max(), -plane.min())) if plane.size else 0.0
        largest = largest if high <= largest else high
        if not largest <= _FLOAT_MAX:
            raise OutputError(f"{path}: a value is not finite in 32-bit float; dim the light")
    overflows = largest >= _HALF_OVERFLOW
    if precision == "half" and overflows:
        raise OutputError(
            f"{path}: the value {largest:.6g} overflows half ({_HALF_MAX:.0f}); use --precision "
            "auto or float"
        )
    return "float" if precision == "float" or overflows else "half"


def open_map(path: str | os.PathLike[str]) -> Any:
    """The OpenEXR file of that name, as OpenImageIO's ImageInput.

    Raises
    ------
    MapError
        If it is missing, no regular file, or no OpenEXR file.
    """
    if not Path(path).exists():
        raise MapError(f"{path}: no such file")
    if not Path(path).is_file():  # to open a pipe would block
        kind = "a directory" if Path(path).is_dir() else "not a regular file"
        raise MapError(f"{path}: {kind}; name a map")
    source = open_image(path)
    if source is None or source.format_name() != "openexr":
        raise MapError(f"{path}: not an OpenEXR file, or a damaged one; shrm prefilter makes maps")
    return source


def open_image(path: str | os.PathLike[str]) -> Any:
    """The image, or None; never an error left for the library to print at the end."""
    try:
        source = oiio.ImageInput.open(os.fspath(path))
    except TypeError:  # a name that is not UTF-8
        return None
    with suppress(UnicodeDecodeError):
        oiio.geterror()
    return source


def part_specs(source: Any) -> Iterator[Any]:
    """The specifications of the parts of an open file, one after the other."""
    index = 0
    while source.seek_subimage(index, 0):
        yield source.spec()
        index += 1
    with suppress(UnicodeDecodeError):
        source.geterror()


def has_channels(spec: Any, names: Sequence[str]) -> bool:
    """Whether a part holds just these channels, of half or float."""
    numbers = {str(spec.channelformat(k)) for k in range(spec.nchannels)}
    return sorted(spec.channelnames) == sorted(names) and numbers <= {"half", "float"}


def read_channels(
    path: str | os.PathLike[str], source: Any, part: int, names: Sequence[str]
) -> Array:
    """`read_pixels` of some channels by name, shape (H, W, len(names)).

    Raises
    ------
    MapError
    """
    pixels = read_pixels(path, source, part)
    held = list(source.spec().channelnames)
    return pixels[..., [held.index(name) for name in names]]


def read_pixels(path: str | os.PathLike[str], source: Any, part: int) -> Array:
    """Pixels of a part, shape (H, W, channels), float32 and finite.

    Raises
    ------
    MapError
    """
    source.seek_subimage(part, 0)
    pixels = source.read_image(part, 0, 0, source.spec().nchannels, oiio.FLOAT)
    if pixels is None:
        raise MapError(f"{path}: damaged or truncated; make it again with shrm prefilter")
    if not np.isfinite(pixels).all():
        raise MapError(f"{path}: holds NaN or infinite coefficients; make it again")
    return np.asarray(pixels)
