"""The header of a Radiance picture (.hdr, .pic), which says by what its pixels were multiplied.

Image libraries give the pixels as they are stored. Radiance's own programs take the header's word
that light is something else: what the pixels hold, divided by every factor that was applied.
"""

import math
from pathlib import Path

from shrm_cli.errors import ProbeError
from shrm_cli.records import record

_MAGIC = (b"#?RADIANCE", b"#?RGBE")
_LONGEST = 2**16
"""Bytes in which a header must end."""
_XYZE = "32-bit_rle_xyze"


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
