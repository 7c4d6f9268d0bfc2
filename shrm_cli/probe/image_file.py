"""Image files of every type that OpenImageIO reads, opened lazily and read by rows."""

import mmap
import os
import re
import stat
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from shrm_cli.errors import ProbeError
from shrm_cli.files.exr_header import excess
from shrm_cli.files.inputs import note
from shrm_cli.files.noise import caught, last_noise, quiet
from shrm_cli.files.parts import sound_primaries

Array = NDArray[np.floating]

MAX_PIXELS = 2**29
"""The most pixels that an image may have."""
_FLOAT_FORMATS = ("half", "float", "double")
_UPRIGHT = (0, 1)
"""Values of Exif's Orientation that leave an image as it is; 0 is "not known"."""


@dataclass(frozen=True)
class ImageFile:
    """A `ProbeImage` in a file that was opened: its header, and its pixels on demand.

    Attributes
    ----------
    path : Path
    width, height : int
        The size of the canvas that `read` fills: the data window where the file is an environment
        map, the display window of other files (what a data window leaves out is black).
    envmap : {"latlong", "cube", ""}
        What the file's own attribute says that it is.
    border_sampled : bool
        Whether edge pixels lie on the poles, the seam and the cube's edges.
    file_format : str
        OpenImageIO's name of the format, such as ``"openexr"``.
    chromaticities : tuple of 8 float, optional
        x and y of red, green, blue and white.
    linearize : bool
        Whether the pixels are decoded as sRGB.
    """

    path: Path
    width: int
    height: int
    envmap: str
    border_sampled: bool
    file_format: str
    chromaticities: tuple[float, ...] | None
    linearize: bool
    _input: Any
    _offset: tuple[int, int]
    _channels: tuple[int, ...]

    @classmethod
    def open(cls, path: str | os.PathLike[str], linearize: bool = False) -> "ImageFile":
        """Open a file and check what can be checked without its pixels.

        Parameters
        ----------
        path : path-like
        linearize : bool
            Whether to decode integer pixels as sRGB; they are refused otherwise.

        Raises
        ------
        ProbeError
            If there is no such image, or it is not usable as radiance.
        """
        path = Path(path)
        _check_file(path)
        note(path)
        with caught():
            source = oiio.ImageInput.open(str(path), _reading_hints())
        if source is None:
            if is_zipfile(path):  # the reasons that images cannot be read say nothing of it
                raise ProbeError(f"{path}: an archive, not an image; tables belong to `brdf`")
            raise ProbeError(
                f"{path}: not an image that can be read ({_reason(_last_error(), path)}); "
                "copy or export it again"
            )
        spec, file_format = source.spec(), source.format_name()
        if path.suffix.lower() == ".exr" and file_format != "openexr":
            raise ProbeError(f"{path}: named .exr, but it is a {file_format} file; rename it")
        if spec.getattribute("shrm:representation") is not None:
            raise ProbeError(f"{path}: a map that shrm made, not a light probe; name the probe")
        if spec.getattribute("shrm:table") is not None:
            raise ProbeError(f"{path}: a table that shrm made, not a light probe; name the probe")
        if spec.getattribute("shrm:brdf_table") is not None:
            raise ProbeError(f"{path}: a table of a BRDF, not a light probe; it belongs to `brdf`")
        if spec.deep:
            raise ProbeError(f"{path}: a deep image has no single radiance; flatten it first")
        if spec.get_int_attribute("Orientation", 1) not in _UPRIGHT:
            raise ProbeError(
                f"{path}: stored turned or mirrored (Orientation "
                f"{spec.get_int_attribute('Orientation')}); oiiotool --reorient makes it upright"
            )
        envmap = {"LatLong Environment": "latlong", "CubeFace Environment": "cube"}.get(
            spec.get_string_attribute("textureformat"), ""
        )
        width, height, offset = _canvas(spec, bool(envmap))
        if spec.width < 1 or spec.height < 1 or width < 1 or height < 1:
            raise ProbeError(f"{path}: the image has no pixels ({width} x {height})")
        if max(width * height, spec.width * spec.height) > MAX_PIXELS:
            raise ProbeError(
                f"{path}: {width} x {height} pixels are more than {MAX_PIXELS:,}; scale it down"
            )
        channels = _color_channels(path, spec.channelnames)
        integers = {str(spec.channelformat(k)) for k in channels}.difference(_FLOAT_FORMATS)
        if integers and not linearize:
            raise ProbeError(
                f"{path}: {min(integers)} pixels are not scene-linear radiance; give `linearize` "
                "to decode them as sRGB, or use an HDR file"
            )
        return cls(
            path,
            width,
            height,
            envmap,
            bool(spec.get_int_attribute("oiio:sampleborder")),
            file_format,
            sound_primaries(spec.getattribute("chromaticities")),
            bool(integers),
            source,
            offset,
            channels,
        )

    @property
    def name(self) -> str:
        """The path, as text."""
        return str(self.path)

    @property
    def row_multiple(self) -> int:
        """Rows that are cheapest to read together start at multiples of this."""
        return max(1, int(self._input.spec().tile_height))

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1 of the canvas, float32 RGB, shape (rows, width, 3)."""
        spec = self._input.spec()
        left, top = self._offset
        first, last = max(start - top, 0), min(stop - top, spec.height)
        if (left, top) == (0, 0) and (spec.width, spec.height) == (self.width, self.height):
            return self._read_data(first, last)
        canvas = np.zeros((stop - start, self.width, 3), dtype=np.float32)
        if first < last:
            data = self._read_data(first, last)
            here, there = max(left, 0), max(-left, 0)
            count = min(self.width - here, spec.width - there)
            rows = slice(first + top - start, last + top - start)
            canvas[rows, here : here + count] = data[:, there : there + count]
        return canvas

    def contents(self) -> Iterator[bytes]:
        """Yield the bytes of the file."""
        with open(self.path, "rb") as stream:
            while block := stream.read(2**20):
                yield block

    @quiet
    def _read_data(self, start: int, stop: int) -> Array:
        """Rows of the data window, shape (rows, its width, 3)."""
        spec = self._input.spec()
        begin, end = min(self._channels), max(self._channels) + 1
        if spec.tile_width:
            low = start // spec.tile_height * spec.tile_height
            high = min(-(-stop // spec.tile_height) * spec.tile_height, spec.height)
            pixels = self._input.read_tiles(
                0, 0, spec.x, spec.x + spec.width, spec.y + low, spec.y + high,
                spec.z, spec.z + 1, begin, end, oiio.FLOAT,
            )  # fmt: skip
            pixels = None if pixels is None else pixels.reshape(high - low, spec.width, -1)
            pixels = None if pixels is None else pixels[start - low : stop - low]
        else:
            pixels = self._input.read_scanlines(
                0, 0, spec.y + start, spec.y + stop, spec.z, begin, end, oiio.FLOAT
            )
        if pixels is None:
            raise ProbeError(f"{self.path}: damaged or truncated; copy or export it again")
        pixels = pixels.reshape(stop - start, spec.width, -1)
        chosen = [channel - begin for channel in self._channels]
        if chosen != list(range(pixels.shape[-1])):
            pixels = pixels[..., chosen]
        return _srgb_to_linear(pixels) if self.linearize else pixels


def _check_file(path: Path) -> None:
    """Refuse what would block, mislead, or make noise when an image library opens it."""
    try:
        str(path).encode()  # image libraries take no other names
        status = os.stat(path)
    except UnicodeEncodeError:
        raise ProbeError(f"{path}: its name is not UTF-8; rename it") from None
    except FileNotFoundError:
        raise ProbeError(f"{path}: no such file; check its name") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "a name that no file can have"
        raise ProbeError(f"{path}: cannot be opened ({reason}); check its name") from None
    if stat.S_ISDIR(status.st_mode):
        raise ProbeError(f"{path}: a directory; name an image file")
    if not stat.S_ISREG(status.st_mode):
        raise ProbeError(f"{path}: not a regular file; name an image file")
    if not os.access(path, os.R_OK):
        raise ProbeError(f"{path}: no permission to read it; change its mode")
    if status.st_size == 0:
        raise ProbeError(f"{path}: the file is empty; copy or export it again")
    if much := excess(path):
        raise ProbeError(f"{path}: {much}, which is too much; export it again")
    with open(path, "rb") as stream, mmap.mmap(stream.fileno(), 0, prot=mmap.PROT_READ) as data:
        if not _is_whole(data):
            raise ProbeError(f"{path}: damaged or truncated; copy or export it again")


def _is_whole(data: mmap.mmap) -> bool:
    """Whether a PNG or JPEG file is complete; True for other files.

    The libraries that read them are no judges of that: one writes to stderr, the other makes up
    missing pixels.
    """
    if data[:2] == b"\xff\xd8":  # JPEG: the end of the image follows the last start of a scan
        return data.rfind(b"\xff\xd9") > data.rfind(b"\xff\xda")
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        return True
    start = 8
    while start + 12 <= len(data):
        end = start + 8 + int.from_bytes(data[start : start + 4], "big")
        if zlib.crc32(data[start + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return False
        if data[start + 4 : start + 8] == b"IEND":
            return True
        start = end + 4
    return False


def _reading_hints() -> Any:
    """What OpenImageIO is asked to leave as it is, or to turn upright."""
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # or color comes multiplied by alpha
    hints.attribute("pnm:pfmflip", 1)  # PFM stores its bottom row first
    return hints


def _canvas(spec: Any, is_envmap: bool) -> tuple[int, int, tuple[int, int]]:
    """Width and height of the image proper, and where its stored pixels begin in it (x, y)."""
    if is_envmap or (spec.full_width, spec.full_height) == (0, 0):
        return spec.width, spec.height, (0, 0)
    return spec.full_width, spec.full_height, (spec.x - spec.full_x, spec.y - spec.full_y)


def _color_channels(path: Path, names: tuple[str, ...]) -> tuple[int, ...]:
    """Indices of the channels that are red, green and blue.

    One channel serves as three, and alpha is ignored. Of several layers (``diffuse.R``) the one
    without a name is taken, else the first in the file's order.
    """
    layers: dict[str, dict[str, int]] = {"": {}}
    colors = []
    for index, name in enumerate(names):
        layer, _, channel = name.upper().rpartition(".")
        layers.setdefault(layer, {}).setdefault(channel, index)
        if channel not in ("A", "ALPHA"):
            colors.append(index)
    for channels in layers.values():
        for wanted in (("R", "G", "B"), ("RED", "GREEN", "BLUE")):
            if channels.keys() >= set(wanted):
                return tuple(channels[channel] for channel in wanted)
    if len(colors) == 1:
        return (colors[0],) * 3
    for channels in layers.values():
        if channels.keys() >= {"RY", "BY"}:
            raise ProbeError(f"{path}: luminance-chroma pixels (Y, RY, BY); convert it to RGB")
        if "Y" in channels and "X" not in channels:
            return (channels["Y"],) * 3
    raise ProbeError(
        f"{path}: no R, G and B channels, nor a single one, among {', '.join(names[:8])}; "
        "export it as RGB"
    )


def _last_error() -> str:
    """What OpenImageIO last said about a file."""
    try:
        return str(oiio.geterror())
    except UnicodeDecodeError:  # the library quotes the file's bytes
        return "damaged"


def _reason(message: str, path: Path) -> str:
    """The first line of a library's message, without its own file name and error codes."""
    lines = [line.strip() for line in (message or last_noise()).splitlines() if line.strip()]
    if not lines:
        return "no reason was given"
    line = lines[0].replace(f"EXR Error ({path}): ", "").replace(f'("{path}")', "")
    return re.sub(r"\b[A-Z]+_ERR_\w+ |: magic .*", "", line).strip().rstrip(".")


def _srgb_to_linear(values: Array) -> Array:
    """Linear values from those encoded as sRGB has it (IEC 61966-2-1), as float32."""
    return np.where(
        values <= 0.04045, values / 12.92, ((np.maximum(values, 0) + 0.055) / 1.055) ** 2.4
    ).astype(np.float32)
