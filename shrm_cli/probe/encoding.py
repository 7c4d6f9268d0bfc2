"""What the header of an image file says: which part of it is the light, and what its numbers are.

Files of renderers hold many pictures: parts, layers (``albedo.R``), views. One of them may be the
light beyond doubt; where none is, all are listed, and the user names one.

The header of a Radiance picture (.hdr, .pic) says by what its pixels were multiplied. Image
libraries give the pixels as they are stored. Radiance's own programs take the header's word that
light is something else: what the pixels hold, divided by every factor that was applied.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import srgb_to_linear
from shrm_cli.errors import ProbeError
from shrm_cli.files.exr_header import MOST_PARTS
from shrm_cli.files.openimageio import quiet
from shrm_cli.files.parts import sound_primaries
from shrm_cli.messages import first_of
from shrm_cli.records import record

_MAGIC = (b"#?RADIANCE", b"#?RGBE")
LONGEST = 2**16
"""Bytes in which a header must end."""
_XYZE = "32-bit_rle_xyze"
Curve = Callable[[Array], Array]
_FILM = ("dpx", "cineon")
"""Formats of scanned film, whose integers are logarithms of densities if nothing else is said."""


@record
class Encoding:
    """How the numbers of an image file become linear radiance."""

    name: str = "linear"
    """What the file holds, such as ``"linear"``, ``"sRGB"`` or ``"gamma 2.2"``."""
    curve: Curve | None = None
    """It makes the numbers linear; None where they are."""
    applied: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """What red, green and blue were multiplied by before they were stored."""
    primaries: tuple[float, ...] | None = None
    """CIE x and y of red, green, blue and white."""
    pixel_aspect: float = 1.0
    """What the file says of the shape of its pixels; 1 is square."""
    notes: tuple[str, ...] = ()
    """What a user should know, a line each."""

    def linear(self, pixels: Array) -> Array:
        """Linear radiance of pixels as they are stored, float32, shape (..., 3)."""
        if self.curve is not None:
            pixels = self.curve(pixels).astype(np.float32)
        if self.applied != (1.0, 1.0, 1.0):
            pixels = np.divide(pixels, np.asarray(self.applied, dtype=np.float32))
        return pixels


def radiance_encoding(path: Path) -> Encoding | None:
    """What the header of a Radiance picture says of its numbers; None where a file is none.

    They were multiplied by the product of all EXPOSURE and COLORCORR. PIXASPECT is the height of a
    pixel over its width.

    References: Ward, The RADIANCE Picture File Format; `GAMMA` is Walter's, of his rgbe.c.
    """
    with open(path, "rb") as stream:
        text = stream.read(LONGEST)
    if not text.startswith(_MAGIC):
        return None
    applied = [1.0, 1.0, 1.0]
    primaries, aspect, gamma = None, 1.0, 1.0
    for line in text.splitlines():
        if not line:  # the end of the header
            break
        key, _, value = line.decode("latin-1").partition("=")
        # A line that begins with a tab belongs to a picture that this one was made from.
        if key == "FORMAT" and value.strip() == _XYZE:
            raise ProbeError(
                f"{path}: its pixels are CIE XYZ (FORMAT={_XYZE}), not RGB; Radiance's "
                "ra_xyze -r converts it"
            )
        factors = [1.0, 1.0, 1.0]
        if key == "EXPOSURE":
            factors = _numbers(path, key, value, 1) * 3
        elif key == "COLORCORR":
            factors = _numbers(path, key, value, 3)
        elif key == "PRIMARIES":
            primaries = tuple(_numbers(path, key, value, 8, positive=False))
        elif key == "PIXASPECT":
            aspect *= _numbers(path, key, value, 1)[0]
        elif key == "GAMMA":
            (gamma,) = _numbers(path, key, value, 1)
        applied = [product * factor for product, factor in zip(applied, factors, strict=True)]
    red, green, blue = applied
    if not all(1e-30 < product < 1e30 for product in applied):
        raise ProbeError(
            f"{path}: its EXPOSURE and COLORCORR multiply to {red:g}, which is no "
            "exposure; correct its header"
        )
    if abs(gamma - 1) > 1e-3:
        raise ProbeError(
            f"{path}: GAMMA={gamma:g} of its header says that its pixels are not linear; "
            "export it as linear, or correct the header"
        )
    notes: tuple[str, ...] = ()
    if applied != [1.0, 1.0, 1.0]:
        factors = applied[: 1 if red == green == blue else 3]
        notes = (
            f"its pixels were divided by {'/'.join(f'{each:.6g}' for each in factors)}: EXPOSURE "
            "and COLORCORR of its header say that they had been multiplied by that",
        )
    return Encoding(
        applied=(red, green, blue), primaries=primaries, pixel_aspect=aspect, notes=notes
    )


def _numbers(path: Path, key: str, text: str, count: int, positive: bool = True) -> list[float]:
    """The `count` finite numbers of a line of the header."""
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        values = []
    good = len(values) == count and all(math.isfinite(value) for value in values)
    if not good or (positive and min(values) <= 0):
        kind = "positive " if positive else ""
        wanted = f"{count} {kind}numbers" if count > 1 else f"a {kind}number"
        raise ProbeError(
            f"{path}: {key}={text.strip()[:40]!r} of its header is not {wanted}; correct it"
        )
    return values


def encoding_of(path: Path, spec: Any, file_format: str, integers: bool) -> Encoding:
    """What a file says of its own numbers, but for Radiance pictures.

    `file_format` is OpenImageIO's name of the format. `integers` tells whether the pixels are
    integers, which are decoded.
    """
    aspect = spec.get_float_attribute("PixelAspectRatio", 1.0)
    primaries = sound_primaries(spec.getattribute("chromaticities")) or _of_profile(
        path, spec, file_format
    )
    if not integers:
        return Encoding(primaries=primaries, pixel_aspect=aspect)
    name, curve = _integer_curve(path, spec, file_format)
    return Encoding(name, curve, primaries=primaries, pixel_aspect=aspect)


def _of_profile(path: Path, spec: Any, file_format: str) -> tuple[float, ...] | None:
    """The primaries that an ICC profile or the chunks of a PNG tell."""
    profile = _profile(spec)
    if profile is None and file_format != "png":
        return None  # without loading what reads profiles
    from shrm_cli.probe.icc import png_primaries, profile_primaries

    found = profile_primaries(profile) if profile is not None else None
    if file_format != "png":
        return found
    return png_primaries(path, found is not None) or found


def _profile(spec: Any) -> bytes | None:
    profile = spec.getattribute("ICCProfile")
    is_there = isinstance(profile, np.ndarray) and profile.dtype == np.uint8
    return profile.tobytes() if is_there else None


def _integer_curve(path: Path, spec: Any, file_format: str) -> tuple[str, Curve | None]:
    """Name and curve of the encoding of integer pixels; sRGB where the file says nothing."""
    from shrm_cli.probe.icc import linear_curve

    space = spec.get_string_attribute("oiio:ColorSpace")
    transfer = spec.get_string_attribute("dpx:Transfer")
    if file_format in _FILM and transfer != "Linear":
        raise ProbeError(
            f"{path}: {file_format} of transfer {transfer or 'logarithmic'!r}: not sRGB; convert "
            "it to linear light and EXR first"
        )
    profile = _profile(spec)
    curve = linear_curve(profile) if profile is not None else None
    if curve is not None:
        return "ICC profile", curve
    exponent = spec.get_float_attribute("oiio:Gamma", 0.0)
    power = re.match(r"g(\d\d)_", space)
    if exponent <= 0 and power:
        exponent = int(power[1]) / 10
    if exponent > 0:
        return f"gamma {exponent:.3g}", lambda values: np.maximum(values, 0) ** exponent
    if space.lower().startswith("lin"):
        return "linear", None
    if space and not space.lower().startswith("srgb"):
        raise ProbeError(
            f"{path}: its integers are encoded as {space[:40]}, which is not read here; convert "
            "it to linear light and EXR first"
        )
    return "sRGB", srgb_to_linear


_COLORS = (("R", "G", "B"), ("RED", "GREEN", "BLUE"))
_ALPHA = ("A", "ALPHA")
_DEPTH = ("Z", "ZBACK", "DEPTH")
_LIGHT = ("beauty", "combined", "rgba", "rgb", "color", "colour", "c", "main", "default")
"""Names that renderers give to the picture itself."""
_NO_LIGHT = (
    "albedo", "depth", "id", "mask", "matte", "motion", "n", "normal", "normals", "p", "position",
    "uv", "vector", "velocity", "z",
)  # fmt: skip
"""Names of what is no light, whatever its channels are called."""
_MOST_LISTED = 12


@record
class Layer:
    """Three channels, or one that serves as three, of a part of a file."""

    index: int
    """The number of the part."""
    part: str
    layer: str
    """`part` and `layer`: their names; empty where they have none."""
    channels: tuple[int, int, int]
    """Indices of red, green and blue among the part's channels."""
    names: tuple[str, ...]
    """What the file calls them, each once."""
    is_color: bool
    """Whether their names say that they are colors or luminance."""

    @property
    def label(self) -> str:
        """What tells it from the others of its file, for messages."""
        words = [f"part {self.part}"] if self.part else []
        return " ".join([*words, f"layer {self.layer}"] if self.layer else words) or "no name"

    @property
    def words(self) -> set[str]:
        """The components of its part's and layer's names, in small letters."""
        return {word for name in (self.part, self.layer) for word in name.lower().split(".")}


@quiet
def choose_layer(path: Path, source: Any, part: str | None, layer: str | None) -> Layer:
    """The light of a file that was opened, which is left at its part.

    `part` is the name or number, from 0, of the part that is wanted. `layer` is the name of the
    layer or view that is wanted.
    """
    found = list(_layers(path, source, part))
    found = [each for each in found if each.is_color] or found
    chosen = _named(path, found, layer) if layer is not None else _unambiguous(path, found)
    source.seek_subimage(chosen.index, 0)
    return chosen


def _layers(path: Path, source: Any, part: str | None) -> Iterator[Layer]:
    """All layers with colors of all parts, or of the one that is wanted."""
    is_exr = source.format_name() == "openexr"
    known, specs = [], []
    any_layer = False
    index = 0
    while index < MOST_PARTS and source.seek_subimage(index, 0):
        spec = source.spec()
        name = spec.get_string_attribute("oiio:subimagename") if is_exr else ""
        known.append(name or str(index))
        if part is None or part in (name, str(index)):
            layers = list(_of_part(index, name, spec))
            any_layer = any_layer or bool(layers)
            yield from layers
            specs.append(spec)
        index += 1
        if not is_exr and part is None:
            break  # the pages of other files are thumbnails, or steps of an animation
    with suppress(UnicodeDecodeError):  # it may quote the file's bytes
        source.geterror()  # of the part that is not there
    if not specs:
        raise ProbeError(f"{path}: no part {part}; it has {_listed(known)}")
    if not any_layer:
        raise _no_color(path, [name for spec in specs for name in spec.channelnames])


def _texts(value: object) -> tuple[str, ...]:
    """The texts of an attribute; none if it is anything else than a list of texts."""
    if isinstance(value, str):
        return (value,)
    is_list = isinstance(value, tuple) and all(isinstance(each, str) for each in value)
    return value if is_list else ()  # type: ignore[return-value]


def _of_part(index: int, part: str, spec: Any) -> Iterator[Layer]:
    """The layers with colors of a part."""
    names = spec.channelnames
    views = _texts(spec.getattribute("multiView"))
    layers: dict[str, dict[str, int]] = {"": {}}
    lone = []
    for number, name in enumerate(names):
        prefix, _, channel = name.rpartition(".")
        layers.setdefault(prefix, {}).setdefault(channel.upper(), number)
        if channel.upper() not in (*_ALPHA, *_DEPTH):
            lone.append(number)
    for prefix, channels in layers.items():
        # OpenEXR leaves the name of the first view out of its channels' names.
        own = views[0] if len(views) > 1 and not prefix else prefix
        indices = _colors(channels)
        if indices is not None:
            chosen = tuple(dict.fromkeys(names[k] for k in indices))
            yield Layer(index, part, own, indices, chosen, True)
    if len(lone) == 1 and _colors({names[lone[0]].upper().rpartition(".")[2]: 0}) is None:
        only = lone[0]
        yield Layer(index, part, "", (only, only, only), (names[only],), False)


def _colors(channels: dict[str, int]) -> tuple[int, int, int] | None:
    """Indices of red, green and blue of a layer, or of its luminance three times."""
    for red, green, blue in _COLORS:
        if channels.keys() >= {red, green, blue}:
            return channels[red], channels[green], channels[blue]
    if "Y" in channels and not channels.keys() & {"X", "RY", "BY"}:
        return channels["Y"], channels["Y"], channels["Y"]
    return None


def _named(path: Path, found: list[Layer], name: str) -> Layer:
    same = [each for each in found if each.layer == name]
    same = same or [each for each in found if each.layer.lower() == name.lower()]
    if not same:
        raise ProbeError(f"{path}: no layer {name}; it has {_listed(e.label for e in found)}")
    if len(same) > 1:
        raise ProbeError(
            f"{path}: several parts have a layer {name}: {_listed(e.label for e in same)}; give "
            "`part`"
        )
    return same[0]


def _unambiguous(path: Path, found: list[Layer]) -> Layer:
    """The layer that is light beyond doubt."""
    candidates = found
    if len(candidates) > 1:
        candidates = [each for each in found if not each.words & set(_NO_LIGHT)]
    for narrower in (
        [each for each in candidates if not each.part and not each.layer],
        [each for each in candidates if each.words & set(_LIGHT)],
    ):
        if len(candidates) > 1 and narrower:
            candidates = narrower
    if len(candidates) == 1:
        return candidates[0]
    parts = len({each.index for each in found})
    given = " and ".join(["`part`"] * (parts > 1) + ["`layer`"] * (len(found) > parts))
    raise ProbeError(
        f"{path}: its light may be any of {_listed(each.label for each in found)}; give {given}"
    )


def _no_color(path: Path, names: list[str]) -> ProbeError:
    """Why channels hold no light."""
    channels = {name.upper().rpartition(".")[2] for name in names}
    if channels >= {"RY", "BY"}:
        return ProbeError(f"{path}: luminance-chroma pixels (Y, RY, BY); convert it to RGB")
    if channels & set(_DEPTH) and channels <= {*_DEPTH, *_ALPHA}:
        return ProbeError(f"{path}: {_listed(names)} is depth, not light; name the picture itself")
    return ProbeError(
        f"{path}: no R, G and B channels, nor a single one, among {_listed(names)}; export it as "
        "RGB"
    )


def _listed(names: Iterable[str]) -> str:
    """Names with commas between, not too many."""
    return first_of(list(names), _MOST_LISTED)
