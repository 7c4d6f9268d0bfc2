"""Colours of a mesh's vertices under any light, with their shadows and reflections."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.transfer.transfer import Transfer

_VERTICES_AT_ONCE = 2**13
"""Vertices whose products are in memory at a time."""


class Product(Protocol):
    """What is asked of `maps.product.product.ProductTexture`."""

    def values(self, local_views: Array) -> Array:
        """Coefficients c_i(v) of views in the surface's frame, shape (..., n, 3)."""


def fitted(lighting: ArrayLike, count: int) -> Array:
    """Return coefficients to another order, cut off or followed by 0, shape (count, 3).

    `lighting` is of shape (m, 3). `count` is how many coefficients are asked for.
    """
    lighting = np.asarray(lighting, dtype=float)
    result = np.zeros((count, 3))
    result[: len(lighting)] = lighting[:count]
    return result


def diffuse_colors(
    transfer: Transfer, lighting: ArrayLike, albedo: ArrayLike | None = None
) -> Array:
    """Return the radiance of a diffuse surface, ``albedo / pi`` times its irradiance, shape (v, 3).

    `lighting`, of shape (m, 3), holds coefficients of the light in world axes, of any order, index
    l(l+1)+m. `albedo`, of shape (1 or 3,) or (v, 1 or 3), is that of the transfer by default.
    """
    vectors = transfer.vectors
    light = fitted(lighting, vectors.shape[1])
    if vectors.shape[2] == 1:
        irradiance = vectors[..., 0] @ light
    else:
        irradiance = np.einsum("vjc,jc->vc", vectors, light)
    return irradiance * np.asarray(transfer.albedo if albedo is None else albedo) / np.pi


def _arriving_light(matrices: Array, lighting: ArrayLike) -> Array:
    """Return coefficients of the radiance that arrives at vertices, in their frames: (k, n, 3).

    The transfer matrices of these vertices have the shape (k, n, n, 1 or 3).
    """
    count, size, _, channels = matrices.shape
    light = fitted(lighting, size).astype(matrices.dtype)
    if channels == 1:
        # One product with a tall matrix is faster than one for each vertex.
        return (matrices.reshape(-1, size) @ light).reshape(count, size, 3)
    return np.einsum("vijc,jc->vic", matrices, light)


def glossy_colors(
    transfer: Transfer, product: Product, lighting: ArrayLike, views: ArrayLike
) -> Array:
    """Return the radiance of a glossy surface towards a viewer.

    `transfer` has matrices. `product` is the product function of the surface's BRDF. `lighting`, of
    shape (m, 3), is as `diffuse_colors` takes it. `views`, of shape (3,) or (v, 3), are unit
    vectors to the viewer in world axes.

    Returns an array of shape (v, 3): 0 where a vertex faces away. Raises TransferError if the
    transfer has no matrices.
    """
    transfer.check_glossy()
    assert transfer.matrices is not None
    assert transfer.frames is not None
    count = len(transfer.vectors)
    views = np.broadcast_to(np.asarray(views, dtype=float), (count, 3))
    result = np.zeros((count, 3))
    for part in slices(count, _VERTICES_AT_ONCE):
        arriving = _arriving_light(transfer.matrices[part], lighting)
        local = np.einsum("vij,vj->vi", transfer.frames[part], views[part])
        facing = local[:, 2] > 0
        values = product.values(local[facing])
        terms = min(values.shape[1], arriving.shape[1])
        result[part][facing] = np.einsum("vic,vic->vc", values[:, :terms], arriving[facing, :terms])
    return result
