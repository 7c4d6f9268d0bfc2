"""From packed texels back to light, by other code than what packs them.

Of BC6H this is OpenImageIO, of ASTC Arm's decoder. UASTC HDR is rewritten as BC6H first, which has
coarser ends.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import astc, uastc
from shrm_cli.export.dds import dds_image
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.files.openimageio import image_of


def decoded(data: bytes, texels: TexelFormat, count: int, size: int) -> Array:
    """Return the light of packed images as a decoder sees it, shape (count, size, size, 3).

    Parameters
    ----------
    count, size : int
        The number of images, which are squares, and the texels along their edges.
    """
    if texels.name in ("bc6h", "uastc"):
        data = uastc.to_bc6h(data) if texels.name == "uastc" else data
        image = image_of(dds_image(data, count * size, size), ".dds")
        return image.reshape(count, size, size, 3)
    if texels.edge > 1:
        each = len(data) // count
        images = (data[at : at + each] for at in range(0, len(data), each))
        return np.stack([astc.decode(image, size, size, texels.edge) for image in images])
    if texels.name == "rgba16f":
        values = np.frombuffer(data, "<f2").reshape(count, size, size, 4)[..., :3]
        return values.astype(float)
    words = np.frombuffer(data, "<u4").reshape(count, size, size)
    if texels.name == "rgb9e5":
        mantissas = np.stack([words >> shift & 511 for shift in (0, 9, 18)], axis=-1)
        return np.ldexp(mantissas.astype(float), (words >> 27).astype(int)[..., None] - 24)
    # Unsigned floats are half floats without a sign and without their last bits.
    channels = [(words & 2047) << 4, (words >> 11 & 2047) << 4, (words >> 22) << 5]
    return np.stack(channels, axis=-1).astype(np.uint16).view(np.float16).astype(float)
