"""An image file in memory, read by OpenImageIO."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.files.openimageio import oiio, quiet
from shrm_cli.files.whole import scratch_folder


@quiet
def image_of(data: bytes, suffix: str) -> Array:
    """Return the red, green and blue of a file's bytes, shape (M, N, 3).

    Its Python bindings read from disk alone, hence the scratch file.
    """
    with scratch_folder() as folder:
        path = folder / f"image{suffix}"
        path.write_bytes(data)
        image = np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT), dtype=float)
    return image[..., :3]
