"""Shading many frames of a glossy mesh: light and view may move, or either of them stands still.

The light that a vertex reflects is ``sum_ij c_i(v) M_ij L_j`` (Kautz et al. 2002): M is the
vertex's transfer matrix, or the rotation into its frame where nothing casts a shadow, c the product
function of the BRDF at the view in that frame. What stands still is multiplied once:

`General`
    Nothing stands still.
`FixedLight`
    ``sum_j M_ij L_j`` is kept for each vertex, folded with the product function.
`FixedView`
    ``sum_i c_i(v) M_ij`` is kept: a vector for each vertex, of which a frame is one product.

The 25 coefficients c_i in three colours are smooth functions of the view, and much alike. So they
are written as ``c_i(v) = sum_k u_k(v) S_ki`` with a few functions u_k, by singular values, and only
those are looked up for each vertex and frame.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.sphere.parabolic import parabolic_directions
from shrm_cli.sphere.rotation import rotate_each_into_frame, rotate_into_frames
from shrm_cli.transfer.shading import Product, fitted

Array = NDArray[np.floating]

TOLERANCE = 1e-3
"""Relative RMS error of the product function that leaving out functions of the view may cause."""
LIGHT_TOLERANCE = 1e-2
"""Relative RMS error of the light that is reflected, of one light that stands still."""
_SIZE = 128
"""Texels along the edges of the maps of these functions, as many as the product texture has."""
_ROUNDING = 1e-3
"""How far from the last texel, in texels, the last pair of texels to filter between begins."""

_ROUNDING_GREY = 1e-6
"""The relative difference between channels that rounding makes."""


class ViewMaps:
    """Functions of the view in a surface's frame, as parabolic maps that are looked up together.

    Parameters
    ----------
    planes : ndarray, shape (k, texels)
        Their values in the directions of `parabolic_directions`.
    """

    def __init__(self, planes: Array) -> None:
        # A texel and the one to its right are one complex number: two of four texels to filter
        # between are found by one look-up, and the real part of a product weighs them.
        self._pairs = np.empty(planes.shape, np.complex64)
        self._pairs.real, self._pairs.imag = planes, np.roll(planes, -1, axis=1)

    def __len__(self) -> int:
        return len(self._pairs)

    def at(self, local_views: Array) -> Array:
        """Return the functions, filtered between four texels, at views.

        Parameters
        ----------
        local_views : ndarray of float32, shape (3, v)
            Unit vectors in the vertices' frames.

        Returns
        -------
        ndarray of float32, shape (k, v)
            0 for views from below the horizon.
        """
        facing = np.flatnonzero(local_views[2] > 0)
        x, y, z = local_views[:, facing]
        scale = np.float32(_SIZE / 2) / (1 + z)
        last = _SIZE - 1 - _ROUNDING
        across = np.clip(x * scale + np.float32((_SIZE - 1) / 2), 0, last)
        down = np.clip(y * scale + np.float32((_SIZE - 1) / 2), 0, last)
        column, row = across.astype(np.intp), down.astype(np.intp)
        right, below = (across - column).astype(np.float32), (down - row).astype(np.float32)
        pairs = ((1 - right) - 1j * right).astype(np.complex64)
        first = row * _SIZE + column
        above = self._pairs.take(first, axis=1)
        above *= pairs * (1 - below)
        values = self._pairs.take(first + _SIZE, axis=1)
        values *= pairs * below
        values += above
        result = np.zeros((len(self), local_views.shape[1]), np.float32)
        result[:, facing] = values.real
        return result


class ViewFunctions:
    """The product function of a BRDF by few functions of the view, u_k.

    Parameters
    ----------
    product : Product
    tolerance : float
        Relative RMS error that may be caused.

    Attributes
    ----------
    maps : ViewMaps
        The functions u_k, which are orthonormal over the texels.
    series : ndarray, shape (k, n, 3)
        S_ki.
    error : float
        The relative RMS error that was caused.
    """

    def __init__(self, product: Product, tolerance: float = TOLERANCE) -> None:
        texels = parabolic_directions(_SIZE).reshape(-1, 3)
        values = np.asarray(product.values(texels), dtype=float)
        values = np.broadcast_to(values, (*values.shape[:-1], 3))  # grey ones have one channel
        flat = values.reshape(len(texels), -1)
        kept, self.error = principal_axes(flat.T @ flat, tolerance)
        lengths = np.linalg.norm(flat @ kept, axis=0)
        self.series = (kept * lengths).T.reshape(-1, *values.shape[1:])
        self._planes = (flat @ kept / lengths).T
        self.maps = ViewMaps(self._planes)

    def combined(self, weights: Array) -> ViewMaps:
        """Return sums of the functions, by weights of shape (sums, k)."""
        return ViewMaps(weights @ self._planes)


def principal_axes(gram: Array, tolerance: float) -> tuple[Array, float]:
    """Return the fewest axes of vectors whose projections lack no more than a relative RMS error.

    Parameters
    ----------
    gram : ndarray, shape (n, n)
        The sum of the vectors' products with themselves.
    tolerance : float

    Returns
    -------
    axes : ndarray, shape (n, kept)
        Orthonormal columns.
    error : float
        The relative RMS error of the projections.
    """
    energies, axes = np.linalg.eigh(gram)
    energies, axes = np.maximum(energies[::-1], 0), axes[:, ::-1]
    total = max(float(energies.sum()), np.finfo(float).tiny)
    left = np.append(np.cumsum(energies[::-1])[::-1][1:], 0) / total
    count = int(np.argmax(left <= tolerance**2)) + 1
    return axes[:, :count], float(np.sqrt(left[count - 1]))


class General:
    """Shading where light and view move.

    Parameters
    ----------
    functions : ViewFunctions
    frames : ndarray, shape (v, 3, 3)
        The vertices' axes x', y', z' as rows, in world axes.
    matrices : ndarray, shape (v, n, n, 1 or 3), optional
        Transfer matrices; without them nothing casts a shadow.
    """

    def __init__(
        self, functions: ViewFunctions, frames: Array, matrices: Array | None = None
    ) -> None:
        self.functions, self._matrices = functions, matrices
        self._own_frames = frames
        # Planes of one component each, in which a frame's work runs along the vertices.
        self._axes = np.ascontiguousarray(np.moveaxis(frames, 0, -1), dtype=np.float32)
        self._count = functions.series.shape[1]

    def colors(self, lighting: ArrayLike, views: ArrayLike) -> Array:
        """Return the radiance of each vertex, shape (v, 3).

        Parameters
        ----------
        lighting : array_like, shape (m, 3)
            Coefficients of the light in world axes.
        views : array_like, shape (3,) or (v, 3)
            Unit vectors to the viewer, world axes: one for all vertices, or one for each.
        """
        arriving = self.arriving(lighting)
        return np.einsum("vic,vic->vc", self.products(views)[:, : arriving.shape[1]], arriving)

    def arriving(self, lighting: ArrayLike) -> Array:
        """Return coefficients of the light that arrives, in the vertices' frames, (v, n, 3)."""
        if self._matrices is None:
            light = fitted(lighting, self._count)
            return np.moveaxis(rotate_into_frames(light, self._own_frames), -1, 0)
        vertices, size, _, channels = self._matrices.shape
        light = fitted(lighting, size).astype(np.float32)
        if channels == 3:
            found = np.einsum("vijc,jc->vic", self._matrices, light)
        else:
            found = (self._matrices.reshape(-1, size) @ light).reshape(vertices, size, 3)
        return found[:, : self._count]

    def products(self, views: ArrayLike) -> Array:
        """Return the product function at the views, shape (v, n, 3)."""
        series = self.functions.series.astype(np.float32)
        flat = self.functions.maps.at(self.local(views)).T @ series.reshape(len(series), -1)
        return flat.reshape(-1, *series.shape[1:])

    def local(self, views: ArrayLike) -> Array:
        """Return views in the vertices' frames, shape (3, v)."""
        views = np.asarray(views, dtype=np.float32)
        return views @ self._axes if views.ndim == 1 else np.einsum("awv,vw->av", self._axes, views)

    def sent(self, products: Array) -> Array:
        """Return ``sum_i c_i M_ij``: what a vertex sends of each coefficient of the light.

        Parameters
        ----------
        products : ndarray, shape (v, n, 3)
            As `products` returns them.

        Returns
        -------
        ndarray, shape (v, m, 3)
        """
        if self._matrices is None:
            turned = np.swapaxes(self._own_frames, 1, 2)
            found = rotate_each_into_frame(np.moveaxis(products, 0, -1), turned)
            return np.moveaxis(found, -1, 0)
        terms = min(products.shape[1], self._matrices.shape[1])
        every = [
            products[:, None, :terms, c] @ self._matrices[:, :terms, :, c % self._matrices.shape[3]]
            for c in range(3)
        ]
        return np.concatenate(every, axis=1).swapaxes(1, 2)


class FixedLight:
    """Shading where only the view moves.

    What the vertices reflect of one light is more alike than what they could reflect of any. So
    the functions of the view are combined anew, to the fewest that this light needs.

    Parameters
    ----------
    general : General
    lighting : array_like, shape (m, 3)
    tolerance : float
        Relative RMS error of the reflected light, over all vertices and views, that may be caused.

    Attributes
    ----------
    maps : ViewMaps
        The functions that are looked up.
    error : float
        The relative RMS error that was caused, as it is predicted.
    """

    def __init__(
        self, general: General, lighting: ArrayLike, tolerance: float = LIGHT_TOLERANCE
    ) -> None:
        self._general = general
        arriving = general.arriving(lighting)
        series = general.functions.series[:, : arriving.shape[1]]
        folded = np.einsum("kic,vic->ckv", series, arriving, optimize=True)
        axes, self.error = principal_axes(np.einsum("ckv,clv->kl", folded, folded), tolerance)
        self.maps = general.functions.combined(axes.T)
        self._folded = np.ascontiguousarray(axes.T @ folded, dtype=np.float32)

    def colors(self, views: ArrayLike) -> Array:
        """Return the radiance of each vertex, shape (v, 3); `views` as of `General.colors`."""
        values = self.maps.at(self._general.local(views))
        return np.einsum("kv,ckv->cv", values, self._folded).T


class FixedView:
    """Shading where only the light moves.

    Parameters
    ----------
    general : General
    views : array_like, shape (3,) or (v, 3)
    """

    def __init__(self, general: General, views: ArrayLike) -> None:
        sent = np.moveaxis(general.sent(general.products(views)), -1, 0)
        # What is grey sends the same of each channel, but for rounding.
        most = _ROUNDING_GREY * np.abs(sent).max(initial=0)
        is_grey = all(np.abs(sent[c] - sent[0]).max(initial=0) <= most for c in (1, 2))
        self._sent = np.ascontiguousarray(sent[: 1 if is_grey else 3], dtype=np.float32)

    def colors(self, lighting: ArrayLike) -> Array:
        """Return the radiance of each vertex, shape (v, 3); `lighting` as of `General.colors`."""
        light = fitted(lighting, self._sent.shape[2]).astype(np.float32)
        if len(self._sent) == 1:
            return self._sent[0] @ light
        channels = zip(self._sent, np.ascontiguousarray(light.T), strict=True)
        return np.stack([sent @ coefficients for sent, coefficients in channels], axis=1)
