"""Linear pictures, brighter or darker."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.files.picture import Picture


def expose(pixels: ArrayLike, exposure: float) -> Picture:
    """Radiance times ``2**exposure`` (the exposure value, EV, in stops)."""
    with np.errstate(over="ignore"):  # writers refuse infinite values, or clip them
        return np.asarray(pixels, dtype=np.float32) * np.float32(2.0**exposure)
