"""Lat-longs for engines that filter on import: turned to their centre, within half's range.

Our lat-longs have +Z in the centre and +X in the left quarter. Engines have another axis of the
same world in their centre, so that whole columns are moved and nothing is interpolated.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, over_channels, slices
from shrm_cli.errors import MapError
from shrm_cli.export.engine import Light, OutputFile, Package
from shrm_cli.export.pixels import FORMATS, TexelFormat, limited
from shrm_cli.files.image import probe_attributes, write_image
from shrm_cli.vocabulary import Precision

_HALF = FORMATS["rgba16f"]
"""Engines keep lat-longs in halves; what is beyond them would become infinite there."""
_FLOAT = replace(_HALF, title="32-bit float", largest=(np.inf,) * 3, dimmest=0.0)
"""Renderers keep them as they are. It is no format of texels, and packs none."""
_MOST = 100_000
"""Pixels that are encoded at a time, for which it takes 20 MB."""


def rolled(image: Array, degrees: int) -> Array:
    """Return a lat-long with another direction in its centre.

    `image`, of shape (N, 2 N, 3), is +Z in the centre, +X in the left quarter. `degrees` is a
    multiple of 90: the azimuth of the new centre, from +Z towards +X.
    """
    steps, rest = divmod(image.shape[1] * degrees, 360)
    if rest:
        raise MapError(
            f"{image.shape[1]} columns cannot be turned by {degrees} degrees; lower `size`"
        )
    return np.roll(image, steps, axis=1)


def add_exr(
    made: Package, name: str, image: Array, light: Light, precision: Precision = "half"
) -> None:
    """Add an OpenEXR lat-long to a package; it is refused where it is not finite.

    What halves cannot hold is clipped to them, but with the `precision` ``auto``, which is for
    programs that render 32-bit floats as they are: it writes these where halves do not suffice.
    """
    kept = _HALF if precision == "half" else _FLOAT
    within, attributes = _limited(made, name, image, kept), probe_attributes(light.chromaticities)
    write = partial(write_image, pixels=within, precision=precision, attributes=attributes)
    made.files.append(OutputFile(name, write))


def add_radiance(made: Package, name: str, image: Array) -> None:
    """Add a Radiance file (`.hdr`), RGBE without run lengths, to a package."""
    within = _limited(made, name, image, _HALF)
    height, width = within.shape[:2]
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    pixels = (rgbe(within[rows]).tobytes() for rows in slices(height, _MOST // width))
    made.add_bytes(name, header + b"".join(pixels))


def rgbe(image: Array) -> NDArray[np.uint8]:
    """Return Ward's shared-exponent pixels, shape (..., 4): ``(m + 0.5) 2^(e - 136)``.

    Readers differ in the half, so that values are rounded to the nearest mantissa itself.
    """
    values = np.asarray(image, dtype=float)
    largest = over_channels(np.maximum, values)
    _, exponent = np.frexp(largest)
    exponent = exponent + (np.rint(largest * np.exp2(8.0 - exponent)) > 255)
    mantissas = np.rint(values * np.exp2(8.0 - exponent)[..., None])
    pixels = np.concatenate([mantissas, (exponent + 128.0)[..., None]], axis=-1)
    pixels[largest < 1e-32] = 0
    return pixels.astype(np.uint8)


def _limited(made: Package, name: str, image: Array, kept: TexelFormat) -> Array:
    if not np.isfinite(image).all():
        raise MapError(f"{name}: pixels are not finite; its light is beyond 32-bit floats, dim it")
    within, clipped = limited(image, kept, "the lat-long")
    made.tell_clipped(name, kept, [clipped])
    return within
