"""Evaluation of BRDFs that are defined above the horizon only, as measured ones are."""

from collections.abc import Callable

import numpy as np

from shrm_cli.arrays import Array

_PAIRS_AT_ONCE = 2**14
"""Arrays of so many pairs of directions stay in the processor's cache."""


def evaluate_above(kernel: Callable[[Array, Array], Array], light: Array, view: Array) -> Array:
    """Evaluate a function where both directions are above the horizon; elsewhere the value is 0.

    Parameters
    ----------
    kernel : callable
        Takes directions to the light and to the viewer, shape (n, 3) each, and returns values of
        shape (n, 3).
    light, view : ndarray, shape (..., 3), broadcastable
        Unit vectors in the frame of the normal, z = N.

    Returns
    -------
    ndarray, shape (..., 3)
        The values, in the precision of the directions.
    """
    dtype = np.result_type(light, view, np.float32)
    above = (light[..., 2] > 0) & (view[..., 2] > 0)
    shape = above.shape
    lights, views = (
        [np.broadcast_to(v[..., k], shape).reshape(-1) for k in range(3)] for v in (light, view)
    )
    values = np.zeros((above.size, 3), dtype=dtype)
    found = np.flatnonzero(above)
    for start in range(0, len(found), _PAIRS_AT_ONCE):
        part = found[start : start + _PAIRS_AT_ONCE]
        # Kernels compute with whole components, so that each of them is gathered on its own.
        pair = (np.stack([x.take(part) for x in xyz]).astype(dtype) for xyz in (lights, views))
        values[part] = kernel(*(xyz.T for xyz in pair))
    return values.reshape(*shape, 3)
