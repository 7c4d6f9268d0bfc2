"""Textures as small integers times a power of two for each texel, which deflate makes small.

A texel's numbers are rounded to a share of their length, so that shadows keep as much as lamps do.
The coefficients of a map of harmonics at a texel have one length, because what is seen there is
their sum: high degrees, most of which are weak, become zeros.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.records import record

_BITS = {True: 9, False: 8}
"""Of the length of a texel, which is between 2^(bits - 1) and 2^bits steps; more bits where that is
the length of many layers."""
_LOWEST = -30
"""Exponent of the darkest texels; 16-bit floats end at 2^-24."""


@record(eq=False)
class Rounded:
    """A texture in integers.

    Attributes
    ----------
    steps : ndarray of uint16, shape (3, layers, H, W)
        Whole numbers of steps; 0, -1, 1, -2, .. are counted as 0, 1, 2, 3, ..
    exponents : ndarray of int8, shape (1 or layers, H, W)
        The step of a texel is ``2^exponent``.
    error : float
        RMS of what rounding changed, each texel relative to its length.
    """

    steps: NDArray[np.uint16]
    exponents: NDArray[np.int8]
    error: float


def rounded(values: NDArray[np.float32], shared: bool) -> Rounded:
    """Round a texture, shape (layers, H, W, 3).

    Parameters
    ----------
    values : ndarray
        Finite, and no larger than 16-bit floats are.
    shared : bool
        Whether the layers of a texel have one length.
    """
    square = np.einsum("lhwc,lhwc->lhw", values, values, dtype=float)
    length = np.sqrt(square.sum(axis=0, keepdims=True) if shared else square)
    exponents = np.full(length.shape, _LOWEST)
    lit = length > 2.0**_LOWEST
    exponents[lit] = np.ceil(np.log2(length[lit]))
    exponents -= _BITS[shared]
    step = np.exp2(exponents)[..., None]
    whole = np.rint(values / step)
    apart = np.einsum("lhwc->hw" if shared else "lhwc->lhw", (whole * step - values) ** 2)
    relative = apart.reshape(length.shape)[lit] / length[lit] ** 2
    error = float(np.sqrt(relative.mean())) if lit.any() else 0.0
    signed = whole.astype(np.int16)
    steps = ((signed << 1) ^ (signed >> 15)).astype(np.uint16)
    return Rounded(np.moveaxis(steps, -1, 0), exponents.astype(np.int8), error)
