"""Image files of every type that OpenImageIO reads, opened lazily and read by rows."""

import math
import mmap
import os
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import are_unset
from shrm_cli.errors import ProbeError
from shrm_cli.files.openimageio import last_noise, oiio, quiet
from shrm_cli.probe.encoding import Encoding, Layer, choose_layer, encoding_of, radiance_encoding
from shrm_cli.probe.reader import Reader, check_file, open_input
from shrm_cli.records import record
from shrm_cli.vocabulary import PROXY_ATTRIBUTE, RECIPE_ATTRIBUTE

MAX_PIXELS = 2**29
"""The most pixels that an image may have."""
_MOST_OF_A_PICTURE = 2**26
"""The most pixels of an image that is read whole: sums and weights of photographs take 1.6 GB."""

if TYPE_CHECKING:
    from shrm_cli.probe.proxy import ProxyBox
    from shrm_cli.probe.radiance_runs import OldRuns

_FLOAT_FORMATS = ("half", "float", "double")
MAX_TILE_PIXELS = 2**22
"""The most pixels of a tile that is larger than its image: tiles are held as a whole."""
_BAND_PIXELS, _BAND_ROWS = 2**22, 128
"""Rows of tiles with more pixels than this are not handed out at once, but by so many rows."""
_UPRIGHT = (0, 1)
"""Values of Exif's Orientation that leave an image as it is; 0 is "not known"."""
_UNKNOWN_TYPE = "could not find a format reader"
"""What OpenImageIO says of files whose suffix and content it does not know."""
_FOR_ENGINES = (b"\xabKTX ", b"\x86\x16\x87\x96")
"""What KTX files, and Babylon.js's ``.env``, begin with."""
_NO_PROBES = {
    "shrm:representation": ("a map that shrm made", "name the probe"),
    "shrm:table": ("a table that shrm made", "name the probe"),
    "shrm:brdf_table": ("a table of a BRDF", "it belongs to `brdf`"),
    "shrm:textures": ("textures that shrm made of a map", "name the probe"),
}
"""What images with these attributes are, and what to do."""
_ENVMAPS = {"LatLong Environment": "latlong", "CubeFace Environment": "cube"}
"""The layouts of what OpenImageIO calls environments."""
_UNSET = "zeros, which are no colors: taken for Rec.709"
"""What `shrm info` says of primaries that nobody has filled in."""


@dataclass
class _Held:
    """Decoded rows of tiles that are too tall to be decoded again for every block of rows."""

    rows: tuple[int, int] | None = None
    pixels: Any = None


@record(eq=False)
class ImageFile:
    """A `ProbeImage` in a file that was opened: its header, and its pixels on demand."""

    path: Path
    width: int
    height: int
    """`width` and `height`: the size of the canvas that `read` fills: the data window where the
    file is an environment map, the display window of other files (what a data window leaves out is
    black)."""
    envmap: str
    """What its own attribute says that it is: ``latlong``, ``cube``, ``angular`` or nothing."""
    border_sampled: bool
    """Whether edge pixels lie on the poles, the seam and the cube's edges."""
    file_format: str
    """OpenImageIO's name of the format, such as ``"openexr"``."""
    encoding: Encoding
    """How its numbers become linear radiance."""
    layer: Layer
    """Which of its parts and layers is read."""
    notes: tuple[str, ...]
    """What a user should know of the file, a line each."""
    _reader: Reader
    _offset: tuple[int, int]
    _held: _Held = field(default_factory=_Held, compare=False, repr=False)

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str],
        linearize: bool = False,
        part: str | None = None,
        layer: str | None = None,
    ) -> "ImageFile":
        """Open a file and check what can be checked without its pixels.

        `linearize` tells whether to decode integer pixels as the file says, or else as sRGB; they
        are refused otherwise. `part` and `layer` say which of several to read; see `choose_layer`.
        """
        path = check_file(path)
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if not _is_whole(data):
                raise ProbeError(f"{path}: damaged or truncated; copy or export it again")
        radiance = radiance_encoding(path)
        source = _opened(path)
        file_format = source.format_name()
        _refuse_others(path, source.spec(), file_format)
        chosen = choose_layer(path, source, part, layer)
        spec = source.spec()
        envmap = _ENVMAPS.get(spec.get_string_attribute("textureformat"), "")
        if spec.get_string_attribute("shrm:layout") == "angular":  # its shape tells nothing
            envmap = "angular"
        width, height, offset = _canvas(spec, bool(envmap))
        _check_picture(path, spec, width, height)
        formats = {str(spec.channelformat(k)) for k in chosen.channels}
        integers = formats.difference(_FLOAT_FORMATS)
        if integers and not linearize:
            raise ProbeError(
                f"{path}: {min(integers)} pixels are not scene-linear radiance; give `linearize` "
                "to decode them as sRGB, or use an HDR file"
            )
        encoding = radiance or encoding_of(path, spec, file_format, bool(integers))
        covered = _covered(spec, width, height, offset)
        notes = list(encoding.notes)
        if covered < 1:
            notes.append(
                f"{1 - covered:.3g} of the picture lies outside its data window and counts as black"
            )
        return cls(
            path, width, height, envmap, bool(spec.get_int_attribute("oiio:sampleborder")),
            file_format, encoding, chosen, tuple(notes), Reader(path, source), offset,
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        """What another process is given of it, which opens the file itself, and a copy, too."""
        if not self.path.exists():  # as where it was unpacked for a moment
            raise ProbeError(f"{self.path}: gone, so that no other process can open it")
        kept = {each.name: getattr(self, each.name) for each in fields(self)}
        return {**kept, "path": self.path.absolute(), "_held": _Held()}

    @property
    def name(self) -> str:
        """The path, as text."""
        return str(self.path)

    @property
    def is_float(self) -> bool:
        """Whether all channels that are read are floats."""
        spec = self._reader.spec
        return all(str(spec.channelformat(k)) in _FLOAT_FORMATS for k in self.layer.channels)

    @property
    def largest(self) -> Array | None:
        """The radiance of the largest integers that it can hold, shape (3,); None of floats."""
        return None if self.is_float else self.encoding.linear(np.ones(3, np.float32))

    @property
    def given(self) -> Array | None:
        """The radiance that `shrm probe unclip` gave its lamp, shape (3,); None of other files."""
        text = self._reader.spec.get_string_attribute(RECIPE_ATTRIBUTE)
        if not text:
            return None
        from shrm_cli.files.recipe import unclipped_radiance

        radiance = unclipped_radiance(text)
        return None if radiance is None else np.array(radiance)

    def number(self, name: str) -> float | None:
        """A number of the header, such as Exif's ``ExposureTime``; None where it has none."""
        value = self._reader.spec.getattribute(name)
        return float(value) if isinstance(value, int | float) else None

    @property
    def chromaticities(self) -> tuple[float, ...] | None:
        """CIE x and y of red, green, blue and white, where the file tells them."""
        return self.encoding.primaries

    @property
    def proxy(self) -> "ProxyBox | None":
        """Where it was captured, and the box around that, where the file tells them."""
        text = self._reader.spec.get_string_attribute(PROXY_ATTRIBUTE)
        if not text:
            return None
        from shrm_cli.probe.proxy import ProxyBox

        return ProxyBox.of_text(text)

    @property
    def row_multiple(self) -> int:
        height = max(1, int(self._reader.spec.tile_height))
        return height if height * self.width <= _BAND_PIXELS else math.gcd(height, _BAND_ROWS)

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1 of the canvas, float32 RGB, shape (rows, width, 3)."""
        spec = self._reader.spec
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

    def whole(self) -> Array:
        """All pixels, as `read` has them."""
        pixels = self.read(0, self.height)
        if not np.isfinite(pixels).all():
            raise ProbeError(f"{self.path}: it holds numbers that are not finite; export it again")
        return pixels

    def facts(self) -> dict[str, Any]:
        """Which part, layer and channels are read, and how their numbers are encoded."""
        named = {"part": self.layer.part, "layer": self.layer.layer}
        return {
            **{key: name for key, name in named.items() if name},
            "channels": list(self.layer.names),
            "encoding": self.encoding.name,
            **({"primaries_in_file": _UNSET} if are_unset(self.chromaticities) else {}),
        }

    def contents(self) -> Iterator[bytes]:
        return file_bytes(self.path)

    @quiet
    def _read_data(self, start: int, stop: int) -> Array:
        """Rows of the data window, shape (rows, its width, 3)."""
        spec = self._reader.spec
        channels = self.layer.channels
        begin, end = min(channels), max(channels) + 1
        if spec.tile_width:
            pixels = self._tile_rows(start, stop, begin, end)
        elif self._repeated is not None:
            pixels = self._repeated.read(start, stop)[..., begin:end]
        else:
            pixels = self._reader.source.read_scanlines(
                self.layer.index, 0, spec.y + start, spec.y + stop, spec.z, begin, end, "float"
            )
        if pixels is None:
            raise ProbeError(f"{self.path}: damaged or truncated; copy or export it again")
        pixels = pixels.reshape(stop - start, spec.width, -1).astype(np.float32, copy=False)
        chosen = [channel - begin for channel in channels]
        if chosen != list(range(pixels.shape[-1])):
            pixels = pixels[..., chosen]
        return self.encoding.linear(pixels)

    @cached_property
    def _repeated(self) -> "OldRuns | None":
        """The pixels of a Radiance picture of the oldest run lengths."""
        if self.file_format != "hdr":
            return None
        from shrm_cli.probe.radiance_runs import OldRuns

        return OldRuns.of(self.path, self.width, self.height)

    def _tile_rows(self, start: int, stop: int, begin: int, end: int) -> Array | None:
        """Rows of a tiled image, (rows, width, channels); None where the file is damaged.

        What has been decoded of tall tiles is held as it is stored, until the last row is read.
        """
        spec, held = self._reader.spec, self._held
        low = start // spec.tile_height * spec.tile_height
        high = min(-(-stop // spec.tile_height) * spec.tile_height, spec.height)
        pixels = held.pixels if held.rows == (low, high) else None
        held.rows, held.pixels = None, None  # or two of them would be in memory
        if pixels is None:
            is_half = all(str(spec.channelformat(k)) == "half" for k in range(begin, end))
            pixels = self._reader.source.read_tiles(
                self.layer.index, 0, spec.x, spec.x + spec.width, spec.y + low, spec.y + high,
                spec.z, spec.z + 1, begin, end, "half" if is_half else "float",
            )  # fmt: skip
            if pixels is None:
                return None
            pixels = pixels.reshape(high - low, spec.width, -1)
        if spec.tile_height * spec.width > _BAND_PIXELS and stop < high:
            held.rows, held.pixels = (low, high), pixels
        return np.asarray(pixels[start - low : stop - low])


def file_bytes(path: Path) -> Iterator[bytes]:
    """Yield the bytes of a file, piece by piece."""
    with open(path, "rb") as stream:
        while block := stream.read(2**20):
            yield block


def is_image_name(name: str) -> bool:
    """Whether a name ends as those of images do that OpenImageIO reads, or has no suffix."""
    suffix = Path(name).suffix.lower().removeprefix(".")
    if suffix == "exr":
        return True  # without loading OpenImageIO
    formats = oiio.get_string_attribute("extension_list").split(";")
    return not suffix or any(suffix in each.rpartition(":")[2].split(",") for each in formats)


def is_stage(name: str) -> bool:
    """Whether a file is a stage of USD, by its suffix."""
    return name.lower().endswith((".usda", ".usd", ".usdc", ".usdz"))


def is_light_file(name: str) -> bool:
    """Whether a name is that of a light file, which is no image but names some."""
    return name.lower().endswith(".toml")


def open_picture(
    path: str | os.PathLike[str], linearize: bool = False, as_stored: bool = False
) -> ImageFile:
    """Open an image that is no probe, such as a photograph or a texture, to be read `whole`.

    `linearize` tells whether to decode integers; they are refused otherwise. `as_stored` tells
    whether to leave all numbers as they are stored, integers as parts of the largest.
    """
    opened = ImageFile.open(path, linearize or as_stored)
    if opened.width * opened.height > _MOST_OF_A_PICTURE:
        raise ProbeError(
            f"{path}: {opened.width} x {opened.height} pixels are more than "
            f"{_MOST_OF_A_PICTURE:,}; scale it down"
        )
    return replace(opened, encoding=Encoding()) if as_stored else opened


def _archive(path: Path) -> str:
    """Say what an archive holds that is given in the place of a probe, and where it belongs."""
    from shrm_cli.files import npz

    if npz.holds(path, {"reflected", "direct", "box", "settings"}):
        return "a grid of probes, not one; shrm render draws what stands among them"
    if npz.holds(path, {"vectors", "albedo", "settings"}):
        return "what a mesh does to light, not light; give it to `transfer` of shrm render"
    return "an archive, not an image; tables belong to `brdf`"


def _opened(path: Path) -> Any:
    """Return OpenImageIO's reader of a file, or tell why there is none."""
    source = open_input(path)
    if source is not None:
        return source
    from zipfile import is_zipfile  # slow to load, and rarely needed

    try:
        why = _reason(oiio.geterror(), path)  # an error that is not fetched is printed
    except UnicodeDecodeError:  # the library quotes the file's bytes
        why = "damaged"
    if is_zipfile(path):  # of which that reason says nothing
        raise ProbeError(f"{path}: {_archive(path)}")
    with open(path, "rb") as stream:  # tables in .npz are ZIPs, which may be cut
        start = stream.read(5)
    if start.startswith(_FOR_ENGINES):
        raise ProbeError(
            f"{path}: a file for engines, not an image that is read; name the probe or the map "
            "that it was made of"
        )
    if start.startswith(b"PK\x03\x04"):
        raise ProbeError(
            f"{path}: a damaged or truncated archive, not an image; copy it again; tables "
            "belong to `brdf`"
        )
    if _UNKNOWN_TYPE in why and path.suffix:
        raise ProbeError(
            f"{path}: {path.suffix} is no type of image that is read; give .exr, .hdr or another "
            "one"
        )
    raise ProbeError(f"{path}: not an image that can be read ({why}); copy or export it again")


def _refuse_others(path: Path, spec: Any, file_format: str) -> None:
    """Refuse files that are not what their name says, and what shrm makes that is no probe."""
    if path.suffix.lower() == ".exr" and file_format != "openexr":
        raise ProbeError(f"{path}: named .exr, but it is a {file_format} file; rename it")
    for attribute, (what, advice) in _NO_PROBES.items():
        if spec.getattribute(attribute) is not None:
            raise ProbeError(f"{path}: {what}, not a light probe; {advice}")


def _check_picture(path: Path, spec: Any, width: int, height: int) -> None:
    """Refuse a picture that is no upright rectangle of radiance, or too large.

    `width` and `height` are those of its canvas.
    """
    if spec.deep:
        raise ProbeError(f"{path}: a deep image has no single radiance; flatten it first")
    if (turned := spec.get_int_attribute("Orientation", 1)) not in _UPRIGHT:
        raise ProbeError(
            f"{path}: stored turned or mirrored (Orientation {turned}); oiiotool --reorient makes "
            "it upright"
        )
    if min(spec.width, spec.height, width, height) < 1:
        raise ProbeError(f"{path}: the image has no pixels ({width} x {height})")
    if max(width * height, spec.width * spec.height) > MAX_PIXELS:
        raise ProbeError(
            f"{path}: {width} x {height} pixels are more than {MAX_PIXELS:,}; scale it down"
        )
    if spec.tile_width * spec.tile_height > max(MAX_TILE_PIXELS, spec.width * spec.height):
        raise ProbeError(
            f"{path}: its tiles of {spec.tile_width} x {spec.tile_height} are larger than the "
            "image; export it again"
        )


def _is_whole(data: mmap.mmap) -> bool:
    """Whether a PNG, JPEG or FITS file is complete; True for other files.

    The libraries that read them are no judges of that: one writes to stderr, the others make up
    what is missing.
    """
    if data[:9] == b"SIMPLE  =":  # FITS: records of this length alone
        return len(data) % 2880 == 0
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


def _canvas(spec: Any, is_envmap: bool) -> tuple[int, int, tuple[int, int]]:
    """Width and height of the image proper, and where its stored pixels begin in it (x, y)."""
    if is_envmap or (spec.full_width, spec.full_height) == (0, 0):
        return spec.width, spec.height, (0, 0)
    return spec.full_width, spec.full_height, (spec.x - spec.full_x, spec.y - spec.full_y)


def _covered(spec: Any, width: int, height: int, offset: tuple[int, int]) -> float:
    """The share of the canvas that stored pixels cover."""
    left, top = offset
    columns = min(left + spec.width, width) - max(left, 0)
    rows = min(top + spec.height, height) - max(top, 0)
    return max(columns, 0) * max(rows, 0) / (width * height)


def _reason(message: str, path: Path) -> str:
    """The first line of a library's message, without its own file name and error codes."""
    lines = [line.strip() for line in (message or last_noise()).splitlines() if line.strip()]
    if not lines:
        return "no reason was given"
    line = lines[0].replace(f"EXR Error ({path}): ", "").replace(f'("{path}")', "")
    return re.sub(r"\b[A-Z]+_ERR_\w+ |: magic .*", "", line).strip().rstrip(".")
