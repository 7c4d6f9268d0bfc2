"""The exposure of linear pictures, which makes them brighter or darker."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.files.picture import Picture


def expose(pixels: ArrayLike, exposure: float) -> Picture:
    """Multiply radiance by ``2**exposure``; the exposure value (EV) is in stops."""
    with np.errstate(over="ignore"):  # writers refuse or clip infinite values
        return np.asarray(pixels, dtype=np.float32) * np.float32(2.0**exposure)
