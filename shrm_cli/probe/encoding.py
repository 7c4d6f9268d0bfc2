"""How the numbers of an image file become linear radiance, as its header says.

The header of a Radiance picture (.hdr, .pic) says by what its pixels were multiplied. Image
libraries give the pixels as they are stored. Radiance's own programs take the header's word that
light is something else: what the pixels hold, divided by every factor that was applied.
"""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import srgb_to_linear
from shrm_cli.errors import ProbeError
from shrm_cli.files.parts import sound_primaries
from shrm_cli.records import record

_MAGIC = (b"#?RADIANCE", b"#?RGBE")
_LONGEST = 2**16
"""Bytes in which a header must end."""
_XYZE = "32-bit_rle_xyze"
Curve = Callable[[Array], Array]
_SQUARE = 0.01
"""How far the aspect ratio of a square pixel may be from 1."""
_FILM = ("dpx", "cineon")
"""Formats of scanned film, whose integers are logarithms of densities if nothing else is said."""


@record
class RadianceHeader:
    """What the header of a Radiance picture says of its numbers.

    Attributes
    ----------
    applied : tuple of 3 float
        By what red, green and blue were multiplied: the product of all EXPOSURE and COLORCORR.
    primaries : tuple of 8 float, optional
        CIE x and y of red, green, blue and white.
    pixel_aspect : float
        Height of a pixel over its width, as PIXASPECT has it.
    gamma : float
        What the pixels were raised to the inverse of; 1 where they are linear.

    References
    ----------
    Ward, The RADIANCE Picture File Format; `GAMMA` is Walter's, of his rgbe.c.
    """

    applied: tuple[float, float, float] = (1.0, 1.0, 1.0)
    primaries: tuple[float, ...] | None = None
    pixel_aspect: float = 1.0
    gamma: float = 1.0

    @classmethod
    def read(cls, path: Path) -> "RadianceHeader | None":
        """Read the header of a file; None where it is no Radiance picture.

        Raises
        ------
        ProbeError
            If the pixels are XYZ, or a number of the header cannot be one.
        """
        with open(path, "rb") as stream:
            text = stream.read(_LONGEST)
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
            if key == "EXPOSURE":
                factors = _numbers(path, key, value, 1) * 3
            elif key == "COLORCORR":
                factors = _numbers(path, key, value, 3)
            else:
                factors = [1.0, 1.0, 1.0]
            applied = [product * factor for product, factor in zip(applied, factors, strict=True)]
            if key == "PRIMARIES":
                primaries = tuple(_numbers(path, key, value, 8, positive=False))
            elif key == "PIXASPECT":
                (one,) = _numbers(path, key, value, 1)
                aspect *= one
            elif key == "GAMMA":
                (gamma,) = _numbers(path, key, value, 1)
        if not all(1e-30 < product < 1e30 for product in applied):
            raise ProbeError(
                f"{path}: its EXPOSURE and COLORCORR multiply to {applied[0]:g}, which is no "
                "exposure; correct its header"
            )
        return cls((applied[0], applied[1], applied[2]), primaries, aspect, gamma)


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


@record
class Encoding:
    """How the numbers of an image file become linear radiance.

    Attributes
    ----------
    name : str
        What the file holds, such as ``"linear"``, ``"sRGB"`` or ``"gamma 2.2"``.
    curve : callable, optional
        From the numbers to linear ones; None where they are linear.
    applied : tuple of 3 float
        By what red, green and blue were multiplied before they were stored.
    primaries : tuple of 8 float, optional
        CIE x and y of red, green, blue and white.
    pixel_aspect : float
        What the file says of the shape of its pixels; 1 is square.
    notes : tuple of str
        What a user should know, a line each.
    """

    name: str = "linear"
    curve: Curve | None = None
    applied: tuple[float, float, float] = (1.0, 1.0, 1.0)
    primaries: tuple[float, ...] | None = None
    pixel_aspect: float = 1.0
    notes: tuple[str, ...] = ()

    @property
    def has_square_pixels(self) -> bool:
        return abs(self.pixel_aspect - 1) <= _SQUARE

    def linear(self, pixels: Array) -> Array:
        """Linear radiance of pixels as they are stored, float32, shape (..., 3)."""
        if self.curve is not None:
            pixels = self.curve(pixels).astype(np.float32)
        if self.applied != (1.0, 1.0, 1.0):
            pixels = np.divide(pixels, np.asarray(self.applied, dtype=np.float32))
        return pixels


def encoding_of(
    path: Path, spec: Any, file_format: str, header: RadianceHeader | None, integers: bool
) -> Encoding:
    """What a file says of its own numbers.

    Parameters
    ----------
    path : Path
    spec : OpenImageIO.ImageSpec
    file_format : str
        OpenImageIO's name of the format.
    header : RadianceHeader, optional
        Of a Radiance picture.
    integers : bool
        Whether the pixels are integers, which are decoded.

    Raises
    ------
    ProbeError
        If the numbers are encoded in a way that is not known here.
    """
    aspect = spec.get_float_attribute("PixelAspectRatio", 1.0)
    if header is not None:
        return _radiance(path, header)
    primaries = sound_primaries(spec.getattribute("chromaticities")) or _of_profile(
        path, spec, file_format
    )
    if not integers:
        return Encoding(primaries=primaries, pixel_aspect=aspect)
    name, curve = _integer_curve(path, spec, file_format)
    return Encoding(name, curve, primaries=primaries, pixel_aspect=aspect)


def _of_profile(path: Path, spec: Any, file_format: str) -> tuple[float, ...] | None:
    """The primaries that an ICC profile or the chunks of a PNG tell."""
    profile = spec.getattribute("ICCProfile")
    is_there = isinstance(profile, np.ndarray) and profile.dtype == np.uint8
    found = None
    if is_there:
        from shrm_cli.probe.icc import profile_primaries

        found = profile_primaries(profile.tobytes())
    if file_format != "png":
        return found
    from shrm_cli.probe.icc import png_primaries

    return png_primaries(path, found is not None) or found


def _radiance(path: Path, header: RadianceHeader) -> Encoding:
    """The encoding that the header of a Radiance picture tells."""
    if abs(header.gamma - 1) > 1e-3:
        raise ProbeError(
            f"{path}: GAMMA={header.gamma:g} of its header says that its pixels are not linear; "
            "export it as linear, or correct the header"
        )
    notes = []
    if header.applied != (1.0, 1.0, 1.0):
        is_grey = len(set(header.applied)) == 1
        factors = "/".join(f"{each:.6g}" for each in header.applied[: 1 if is_grey else 3])
        notes.append(
            f"its pixels were divided by {factors}: EXPOSURE and COLORCORR of its header say "
            "that they had been multiplied by that"
        )
    return Encoding(
        applied=header.applied,
        primaries=header.primaries,
        pixel_aspect=header.pixel_aspect,
        notes=tuple(notes),
    )


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
    profile = spec.getattribute("ICCProfile")
    if isinstance(profile, np.ndarray) and profile.dtype == np.uint8:
        curve = linear_curve(profile.tobytes())
        if curve is not None:
            return "ICC profile", curve
    gamma = spec.get_float_attribute("oiio:Gamma", 0.0)
    power = re.match(r"g(\d\d)_", space)
    if gamma > 0 or power:
        exponent = gamma if gamma > 0 else int(power[1]) / 10 if power else 1.0
        return f"gamma {exponent:.3g}", lambda values: np.maximum(values, 0) ** exponent
    if space.lower().startswith("lin"):
        return "linear", None
    if space and not space.lower().startswith("srgb"):
        raise ProbeError(
            f"{path}: its integers are encoded as {space[:40]}, which is not read here; convert "
            "it to linear light and EXR first"
        )
    return "sRGB", srgb_to_linear
