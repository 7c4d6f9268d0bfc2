"""Lat-longs for engines that filter on import: turned to their centre, within half's range.

Our lat-longs have +Z in the centre and +X in the left quarter. Engines have another axis of the
same world in their centre, so that whole columns are moved and nothing is interpolated.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.export.engine import Light, OutputFile, Package
from shrm_cli.export.pixels import FORMATS, Clipped, clip_warning
from shrm_cli.files.image import probe_attributes, write_image

Array = NDArray[np.floating]

_HALF = FORMATS["rgba16f"]
"""Engines keep lat-longs in halves; what is beyond them would become infinite there."""


def rolled(image: Array, degrees: int) -> Array:
    """Return a lat-long with another direction in its centre.

    Parameters
    ----------
    image : ndarray, shape (N, 2 N, 3)
        +Z in the centre, +X in the left quarter.
    degrees : int
        A multiple of 90: the azimuth of the new centre, from +Z towards +X.

    Raises
    ------
    MapError
        If the columns are not a whole number of such parts.
    """
    steps, rest = divmod(image.shape[1] * degrees, 360)
    if rest:
        raise MapError(
            f"{image.shape[1]} columns cannot be turned by {degrees} degrees; lower `size`"
        )
    return np.roll(image, steps, axis=1)


def clipped(image: Array) -> tuple[Array, Clipped]:
    """Return a lat-long within half's range, and what was clipped."""
    limited = np.clip(image, 0, _HALF.largest)
    above = int(np.count_nonzero((image > _HALF.largest[0]).any(axis=-1)))
    below = int(np.count_nonzero((image < 0).any(axis=-1)))
    return limited, Clipped("the lat-long", above, below, float(image.max()), float(image.min()))


def add_exr(made: Package, name: str, image: Array, light: Light) -> None:
    """Add an OpenEXR lat-long of halves to a package; it is refused where it is not finite."""
    limited = _limited(made, name, image)

    def write(path: Path) -> object:
        return write_image(path, limited, "half", probe_attributes(light.chromaticities))

    made.files.append(OutputFile(name, write))


def add_radiance(made: Package, name: str, image: Array) -> None:
    """Add a Radiance file (`.hdr`), RGBE without run lengths, to a package."""
    limited = _limited(made, name, image)
    height, width = limited.shape[:2]
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    made.add_bytes(name, header + rgbe(limited).tobytes())


def rgbe(image: Array) -> NDArray[np.uint8]:
    """Return Ward's shared-exponent pixels, shape (..., 4): ``(m + 0.5) 2^(e - 136)``.

    Readers differ in the half, so that values are rounded to the nearest mantissa itself.
    """
    values = np.asarray(image, dtype=float)
    largest = values.max(axis=-1)
    _, exponent = np.frexp(largest)
    exponent = exponent + (np.rint(largest * np.exp2(8.0 - exponent)) > 255)
    mantissas = np.rint(values * np.exp2(8.0 - exponent)[..., None])
    pixels = np.concatenate([mantissas, (exponent + 128.0)[..., None]], axis=-1)
    pixels[largest < 1e-32] = 0
    return pixels.astype(np.uint8)


def _limited(made: Package, name: str, image: Array) -> Array:
    if not np.isfinite(image).all():
        raise MapError(f"{name}: pixels are not finite; its light is beyond 32-bit floats, dim it")
    limited, found = clipped(image)
    warning = clip_warning(name, _HALF, [found])
    if warning is not None:
        made.warnings.append(warning)
    return limited
