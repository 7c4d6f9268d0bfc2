"""Packed floating-point texels: RGBA16F, R11F_G11F_B10F and RGB9E5.

All of them are unsigned here, because radiance is. Values are rounded to the nearest that a format
holds. What it cannot hold is clipped, and counted in a `Clipped`, so that nobody loses a sun
without a word.

References: The Khronos Data Format Specification 1.3, sections 10.2 to 10.4; OpenGL's extensions
EXT_packed_float and EXT_texture_shared_exponent.
"""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, over_channels
from shrm_cli.errors import MapError
from shrm_cli.files.png import png_of_lines
from shrm_cli.messages import percent
from shrm_cli.records import record
from shrm_cli.vocabulary import LARGEST_HALF, SEEN_FLOOR

Words = NDArray[np.unsignedinteger]


@record
class TexelFormat:
    """A packed format of RGB texels."""

    name: str
    """One of `vocabulary.TEXEL_FORMATS`."""
    title: str
    """The name that graphics interfaces give it."""
    largest: tuple[float, float, float]
    """The largest finite value of red, green and blue."""
    size: int
    """Bytes of a texel, or of a block of texels."""
    pack: Callable[[Array], Words]
    """From values within range, shape (..., 3), to words of the machine's byte order: uint32 of
    shape (...), or uint16 of shape (..., 4); bytes of blocks."""
    edge: int = 1
    """Texels along an edge of a block."""
    dimmest: float = 6e-7
    """Where its steps are a tenth of the value; light whose mean is below it is lost. Those of half
    precision by default."""


@record
class Clipped:
    """What a format could not hold of one image."""

    what: str
    """The image, such as ``"level 0"``."""
    above: int
    below: int
    """`above` and `below`: texels with a channel above the largest value, and with a negative
    one."""
    most: float
    least: float
    """`most` and `least`: the largest and the least value that there was."""
    texels: int
    mean: float
    """`texels` and `mean`: how many there are, and their mean value."""


def limited(image: Array, chosen: TexelFormat, what: str) -> tuple[Array, Clipped]:
    """Return an image within the range of a format, and tell what was clipped."""
    largest = np.array(chosen.largest, image.dtype)
    above = int(np.count_nonzero(over_channels(np.logical_or, image > largest)))
    below = int(np.count_nonzero(over_channels(np.logical_or, image < 0)))
    clipped = Clipped(
        what, above, below, float(image.max()), float(image.min()), image.size // 3,
        float(image.mean(dtype=float)),
    )  # fmt: skip
    return np.clip(image, 0, largest), clipped


def encoded(image: Array, chosen: TexelFormat, what: str) -> tuple[bytes, Clipped]:
    """Encode an image, little-endian, and tell what was clipped.

    `image`, of shape (..., 3), is linear radiance. The texels are written in the order of the
    array.
    """
    broken = int(np.count_nonzero(~over_channels(np.logical_and, np.isfinite(image))))
    if broken:
        raise MapError(
            f"{what}: {broken} texels are not finite; its light is beyond 32-bit floats, dim it"
        )
    within, clipped = limited(np.asarray(image, dtype=float), chosen, what)
    words = chosen.pack(within)
    return words.astype(words.dtype.newbyteorder("<"), copy=False).tobytes(), clipped


CURE = "dim them with `clamp`"
"""What a warning about clipped texels says to do, where nobody knows what they are of."""
_LAMPS = 0.1
"""Where more of an image's texels are clipped they are no lamps: all light is too bright."""


def clip_warning(file: str, chosen: TexelFormat, found: Iterable[Clipped]) -> str | None:
    """Return one line about everything that a file cannot hold; None if there is nothing."""
    found = list(found)
    bright = [each for each in found if each.above]
    dark = [each for each in found if each.below]
    parts = []
    if bright:
        most = max(each.most for each in bright)
        where = ", ".join(f"{each.above} of {each.what}" for each in bright)
        all_of_it = any(each.above > _LAMPS * each.texels for each in bright)
        parts.append(
            f"texels brighter than {chosen.title} holds ({min(chosen.largest):g}) were clipped: "
            f"{where}, the brightest {most:.6g}; {_scaled(found) if all_of_it else CURE}"
        )
    if any(0 < each.mean < chosen.dimmest for each in found):
        parts.append(
            f"the light is too dim for {chosen.title}, whose steps are coarse below "
            f"{chosen.dimmest:g}; {_scaled(found)}"
        )
    if dark:
        least = min(each.least for each in dark)
        where = ", ".join(f"{each.below} of {each.what}" for each in dark)
        parts.append(f"negative texels became 0: {where}, the least {least:.3g}")
    return f"{file}: {'; '.join(parts)}" if parts else None


def _scaled(found: Sequence[Clipped]) -> str:
    """Say how light whose mean is far from 1 comes into the range of a format."""
    power = -round(math.log10(max(each.mean for each in found)))
    return (
        f"scale the light by 1e{power}, as by shrm light edit PROBE --scale 1e{power} "
        f"-o NAME.toml, and its intensity in the engine by 1e{-power}"
    )


def _pack_half(values: Array) -> Words:
    """Pack to RGBA16F with alpha 1: uint16, shape (..., 4)."""
    # Numpy rounds to the nearest, and values within 65504 do not become infinite.
    texels = np.ones((*values.shape[:-1], 4), dtype=np.float16)
    texels[..., :3] = values
    return texels.view(np.uint16)


def _pack_unsigned_floats(values: Array) -> Words:
    """Pack to R11F_G11F_B10F: red in the lowest 11 bits, green, and blue in the highest 10."""
    red, green = (_small_float(values[..., k], 6) for k in (0, 1))
    return red | green << np.uint32(11) | _small_float(values[..., 2], 5) << np.uint32(22)


def _small_float(values: Array, mantissa_bits: int) -> NDArray[np.uint32]:
    """Return floats of 5 bits of exponent, bias 15, and no sign, rounded to the nearest even."""
    values = np.asarray(values, dtype=float)
    _, exponent = np.frexp(values)  # a value is below 2^exponent, and half of that at least
    exponent = np.where(values > 0, exponent, -14)
    steps = np.exp2(np.maximum(exponent - 1, -14) - mantissa_bits)
    whole = np.rint(values / steps).astype(np.uint32)
    # The hidden bit adds one to the exponent; denormal numbers have none. A mantissa that is
    # rounded up to the next power of two adds one as well, which is right.
    biased = np.maximum(exponent + 14, 1).astype(np.uint32) - np.uint32(1)
    return (biased << np.uint32(mantissa_bits)) + whole


def _pack_shared_exponent(values: Array) -> Words:
    """Pack to RGB9E5: three mantissas of 9 bits, red lowest, and the exponent in the highest 5."""
    values = np.asarray(values, dtype=float)
    largest = over_channels(np.maximum, values)
    _, exponent = np.frexp(largest)  # the largest is below 2^exponent
    shared = np.where(largest > 0, np.maximum(exponent, -15) + 15, 0)
    # Rounding may carry the largest mantissa to 512, which needs the next exponent.
    shared += np.rint(largest / np.exp2(shared - 24.0)) > 511
    mantissas = np.rint(values / np.exp2(shared - 24.0)[..., None]).astype(np.uint32)
    red, green, blue = (mantissas[..., k] for k in range(3))
    return (
        red
        | green << np.uint32(9)
        | blue << np.uint32(18)
        | (shared.astype(np.uint32) << np.uint32(27))
    )


FORMATS = {
    each.name: each
    for each in (
        TexelFormat("rgba16f", "RGBA16F", (LARGEST_HALF,) * 3, 8, _pack_half),
        TexelFormat(
            "r11g11b10",
            "R11F_G11F_B10F",
            (65024.0, 65024.0, 64512.0),
            4,
            _pack_unsigned_floats,
            dimmest=2e-5,
        ),
        TexelFormat("rgb9e5", "RGB9E5", (65408.0,) * 3, 4, _pack_shared_exponent),
    )
}
"""The formats by name."""


# ---- what packing loses --------------------------------------------------------------------------

_TILE = 16
"""Texels along an edge of the tiles in which lamps are sought."""
_LAMP = 0.01
"""A tile with this part of a level's light holds a lamp."""


@record
class Loss:
    """The differences between a level and what is read of it again, as parts of 1."""

    what: str
    """The level, such as ``"level 0"``."""
    rms: float
    """Root mean square of the differences, relative to that of the light."""
    p95: float
    """95 % of the texels differ by less, relative to their own light, which counts as `SEEN_FLOOR`
    of the level's mean at least."""
    lamp: float
    """The largest change of the energy of a lamp; 0 without lamps."""

    @property
    def worst(self) -> float:
        """The largest of the three."""
        return max(self.rms, self.p95, self.lamp)

    def facts(self) -> dict[str, object]:
        """Return the numbers for ``--json``."""
        return {"image": self.what, "rms": self.rms, "p95": self.p95, "lamp": self.lamp}


def loss(what: str, light: Array, read: Array) -> Loss:
    """Compare what is read with the light, shape (6, N, N, 3) both.

    Light counts as 0 where it is negative: `Clipped` tells of that, and no format could hold it.
    Squares of bright light are beyond 32-bit floats.
    """
    light = np.maximum(light, 0, dtype=float)
    off = np.sqrt(((read - light) ** 2).sum(axis=-1))
    norm = np.sqrt((light**2).sum(axis=-1))
    whole = float(np.sqrt((norm**2).mean()))
    if whole == 0:
        return Loss(what, 0.0 if not off.any() else np.inf, 0.0, 0.0)
    relative = off / np.maximum(norm, SEEN_FLOOR * float(norm.mean()))
    rms = float(np.sqrt((off**2).mean())) / whole
    return Loss(what, rms, float(np.percentile(relative, 95)), _lamps(light, read))


def _lamps(light: Array, read: Array) -> float:
    """Return the largest relative change of a tile's energy, among those that hold lamps."""
    edge = light.shape[1]
    starts = np.arange(0, edge, _TILE)
    before, after = (
        np.add.reduceat(np.add.reduceat(each.sum(axis=-1), starts, axis=1), starts, axis=2)
        for each in (light, read)
    )
    # Of few tiles many hold that much light, and no lamp.
    is_lamp = before > max(_LAMP, 10 / before.size) * before.sum()
    if not is_lamp.any():
        return 0.0
    return float(np.abs(after[is_lamp] / before[is_lamp] - 1).max())


def sentence(file: str, losses: Sequence[Loss]) -> str:
    """Return a sentence about what is lost in a file."""
    levels = ", ".join(f"{percent(each.rms)}/{percent(each.p95)}" for each in losses)
    lamp = max(each.lamp for each in losses)
    lamps = f"; lamps keep their energy within {percent(lamp)} %" if lamp else ""
    return f"{file}: packing changes its levels by {levels} % (RMS/95th percentile){lamps}"


# ---- RGBD: radiance up to 255 in the four bytes of a pixel, as Babylon.js defines it -------------
# A pixel holds a divisor D in its alpha and ``(c D)^(1/2.2)`` in its colours, all as bytes. A
# reader takes ``rgb^2.2 / D``. D is 1 for what a display could show, and falls to 1/255 at radiance
# 255, which is the most that a pixel can hold.
#
# References: Babylon.js, helperFunctions: toRGBD and fromRGBD.


LARGEST = 255.0
"""The largest radiance that a pixel can hold."""
_GAMMA = 2.2


def rgbd_pictures(data: bytes, size: int) -> list[bytes]:
    """Return PNG files of the faces of a level, `size` texels wide, whose texels are packed.

    The pictures stand on their heads: Babylon.js, and glTF's image-based light with it, counts the
    rows of a face as those of other textures, from below.
    """
    pixels = np.frombuffer(data, np.uint8).reshape(-1, size, size, 4)[:, ::-1]
    return [rgba_png(face) for face in pixels]


def _pack_rgbd(radiance: Array) -> NDArray[np.uint8]:
    """Encode linear radiance within 0 .. 255 in bytes, shape (..., 4)."""
    radiance = np.asarray(radiance, dtype=np.float64)
    peak = np.maximum(radiance.max(axis=-1, keepdims=True), 1.0)
    divisor = np.floor(LARGEST / peak)
    colors = np.rint(255 * (radiance * divisor / 255) ** (1 / _GAMMA))
    return np.concatenate([colors, divisor], axis=-1).astype(np.uint8)


RGBD = TexelFormat("rgbd", "RGBD", (LARGEST,) * 3, 4, _pack_rgbd, dimmest=5e-3)


# ---- RGBP: radiance up to 64 in four bytes, as PlayCanvas defines it -----------------------------


def _pack_rgbp(radiance: Array) -> NDArray[np.uint8]:
    """Encode linear radiance within 0 .. 64 in bytes: ``(rgb (8 - 7 a))^2``, shape (..., 4)."""
    roots = np.sqrt(np.asarray(radiance, dtype=np.float64))
    peak = np.maximum(roots.max(axis=-1, keepdims=True), 1.0)
    alpha = np.floor(255 * (8 - np.minimum(peak, 8.0)) / 7)
    colors = np.rint(255 * roots / (8 - 7 * alpha / 255))
    return np.concatenate([colors, alpha], axis=-1).astype(np.uint8)


RGBP = TexelFormat("rgbp", "RGBP", (64.0,) * 3, 4, _pack_rgbp, dimmest=5e-3)
PICTURES = {each.name: each for each in (RGBD, RGBP)}
"""The formats of pictures of 8 bits by name."""


def rgba_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return a PNG file of pixels whose alpha is no opacity.

    Image libraries multiply colours with alpha on their way into or out of a file, which would
    destroy RGBD; here bytes stay as they are. Each row is stored as its difference to that above.

    `pixels` are of shape (H, W, 4).
    """
    height, width, _ = pixels.shape
    rows = pixels.reshape(height, 4 * width)
    above = np.vstack([np.zeros_like(rows[:1]), rows[:-1]])
    filtered = np.full((height, 1 + 4 * width), 2, dtype=np.uint8)  # the filter "up"
    filtered[:, 1:] = rows - above
    return png_of_lines(width, filtered, 9)
