"""Lines of text drawn as images, in the font of OpenImageIO."""

from bisect import bisect_left
from collections.abc import Callable

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import OutputError
from shrm_cli.files.openimageio import oiio

_ELLIPSIS = "..."  # the font has no single character for an ellipsis


def shorten(text: str, fits: Callable[[str], bool]) -> str:
    """Shorten a text in its middle until it fits, to nothing if not even the ellipsis does.

    `fits` says whether a text is short enough.
    """
    if fits(text):
        return text

    def keep(count: int) -> str:
        return text[: count - count // 2] + _ELLIPSIS + text[len(text) - count // 2 :]

    too_many = bisect_left(range(len(text)), True, key=lambda count: not fits(keep(count)))
    return keep(too_many - 1) if too_many else ""


def text_coverage(text: str, font_size: int, width: int, height: int) -> Array:
    """Draw a line of text in the middle of a strip.

    The text is shortened in its middle if it is too wide. `font_size` is the height of the font,
    pixels. `width` and `height` are those of the strip, pixels.

    Returns an array of float32 of shape (height, width, 1): the fraction of each pixel that the
    text covers. Raises OutputError if OpenImageIO cannot draw text.
    """
    # The name of a file may hold bytes that are not text.
    text = text.encode("utf-8", "replace").decode()
    text = shorten(text, lambda part: _width(part, font_size) <= width)
    strip = oiio.ImageBufAlgo.zero(oiio.ROI(0, width, 0, height, 0, 1, 0, 1))
    left = (width - _width(text, font_size)) // 2
    # The empty name of a font stands for the one that OpenImageIO's package contains.
    if not oiio.ImageBufAlgo.render_text(strip, left, height * 5 // 8, text, font_size, "", (1,)):
        raise OutputError(f"labels cannot be drawn ({strip.geterror()})")
    return np.asarray(strip.get_pixels(oiio.FLOAT))


def _width(text: str, font_size: int) -> int:
    return oiio.ImageBufAlgo.text_size(text, font_size, "").xend
