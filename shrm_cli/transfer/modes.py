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

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.sphere.parabolic import parabolic_directions
from shrm_cli.sphere.rotation import rotate_each_into_frame, rotate_into_frames
from shrm_cli.transfer.shading import Product, arriving_light, fitted

TOLERANCE = 1e-3
"""Relative RMS error of the product function that leaving out functions of the view may cause."""
LIGHT_TOLERANCE = 1e-2
"""Relative RMS error of the light that is reflected, of one light that stands still."""
_SIZE = 128
"""Texels along the edges of the maps of these functions, as many as the product texture has."""
_ROUNDING = 1e-3
"""How far from the last texel, in texels, the last pair of texels to filter between begins."""
_FINER = 4
"""How much finer maps are of which one texel is taken instead of four."""
_TINY = np.finfo(float).tiny
_VERTICES_AT_ONCE = 2**12
"""Vertices that are looked up at a time, so that what is found of them stays in the cache."""


class ViewMaps:
    """Functions of the view in a surface's frame, as parabolic maps that are looked up together.

    Parameters
    ----------
    planes : ndarray, shape (k, texels)
        Their values in the directions of `parabolic_directions`.
    """

    def __init__(self, planes: Array) -> None:
        # Each texel's row holds all functions in the four texels to filter between, so that one
        # look-up, which copies one stretch of memory, finds all that a view needs.
        texels = planes.T.astype(np.float32)
        square = texels.reshape(_SIZE, _SIZE, -1)
        right, below = np.roll(square, -1, axis=1), np.roll(square, -1, axis=0)
        both = np.roll(right, -1, axis=0)
        self._fours = np.stack([square, right, below, both], axis=2).reshape(len(texels), -1)
        self._count = texels.shape[1]

    def __len__(self) -> int:
        return self._count

    def at(self, local_views: Array) -> Array:
        """Return the functions, filtered between four texels, at views.

        Parameters
        ----------
        local_views : ndarray of float32, shape (3, v)
            Unit vectors in the vertices' frames.

        Returns
        -------
        ndarray of float32, shape (v, k)
            0 for views from below the horizon.
        """
        result = np.zeros((local_views.shape[1], len(self)), np.float32)
        for vertices, values in self.seen(local_views):
            result[vertices] = values
        return result

    def seen(self, local_views: Array) -> Iterator[tuple[NDArray[np.intp], Array]]:
        """Yield which vertices are seen, and the functions there, some thousands at a time.

        Parameters
        ----------
        local_views : ndarray of float32, shape (3, v)
            As `at` takes them.

        Yields
        ------
        vertices : ndarray, shape (s,)
            Indices of vertices whose views come from above the horizon.
        values : ndarray of float32, shape (s, k)
        """
        facing = np.flatnonzero(local_views[2] > 0)
        for start in range(0, len(facing), _VERTICES_AT_ONCE):
            vertices = facing[start : start + _VERTICES_AT_ONCE]
            yield vertices, self._filtered(local_views.take(vertices, axis=1))

    def _filtered(self, above: Array) -> Array:
        """Return the functions at views from above the horizon, shape (v, k)."""
        middle, last = np.float32((_SIZE - 1) / 2), np.float32(_SIZE - 1 - _ROUNDING)
        places = above[:2] * (np.float32(_SIZE / 2) / (1 + above[2])) + middle
        np.clip(places, 0, last, out=places)
        first = np.floor(places)
        (right, below), (column, row) = places - first, first
        weights = np.empty((len(row), 4), np.float32)
        weights[:, 3] = both = right * below
        weights[:, 2] = below - both
        weights[:, 1] = right - both
        weights[:, 0] = 1 - right - below + both
        fours = self._fours.take((row * _SIZE + column).astype(np.intp), axis=0)
        return np.einsum("vt,vtk->vk", weights, fours.reshape(len(row), 4, -1))


class FineViewMaps(ViewMaps):
    """The same from one texel of finer maps: a third of the work, and an error that is known.

    They take 1 MiB for each function.

    Parameters
    ----------
    planes : ndarray, shape (k, texels)
        As `ViewMaps` takes them; finer texels lie between four of theirs.

    Attributes
    ----------
    errors : ndarray, shape (k,)
        The squared error that taking one texel causes, summed over the coarser texels.
    """

    def __init__(self, planes: Array) -> None:
        size = _SIZE * _FINER
        place = np.clip((np.arange(size) + 0.5) / _FINER - 0.5, 0, _SIZE - 1)
        shares = np.maximum(1 - np.abs(place[:, None] - np.arange(_SIZE)), 0)
        fine = shares @ planes.reshape(-1, _SIZE, _SIZE) @ shares.T
        # A texel's values lie evenly about its middle's, within half a step to its neighbours'.
        steps = sum((np.diff(fine, axis=axis) ** 2).sum(axis=(1, 2)) for axis in (1, 2))
        self.errors = steps / 12 / _FINER**2
        self._texels = np.ascontiguousarray(fine.reshape(len(fine), -1).T, dtype=np.float32)
        self._count = len(fine)

    def _filtered(self, above: Array) -> Array:
        size = _SIZE * _FINER
        places = above[:2] * (np.float32(size / 2) / (1 + above[2])) + np.float32(size / 2)
        np.clip(places, 0, size - 1, out=places)
        column, row = np.floor(places)
        return self._texels.take((row * size + column).astype(np.intp), axis=0)


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
    planes : ndarray, shape (k, texels)
        The functions' values in the directions of `parabolic_directions`.
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
        self.planes = (flat @ kept / lengths).T
        self.maps = ViewMaps(self.planes)


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
    total = max(float(energies.sum()), _TINY)
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
        return arriving_light(self._matrices, lighting)[:, : self._count]

    def products(self, views: ArrayLike) -> Array:
        """Return the product function at the views, shape (v, n, 3)."""
        series = self.functions.series.astype(np.float32)
        flat = self.functions.maps.at(self.local(views)) @ series.reshape(len(series), -1)
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
    the functions of the view are combined anew, to the fewest that this light needs, and looked up
    in finer maps without a filter where that is as exact as asked for.

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
        # Half of the squared error is for functions left out, half for what one texel misses.
        share = tolerance * np.sqrt(0.5)
        axes, left = principal_axes(np.einsum("ckv,clv->kl", folded, folded), share)
        planes, kept = axes.T @ general.functions.planes, axes.T @ folded
        strengths = (kept**2).sum(axis=(0, 2))
        fine = FineViewMaps(planes)
        missed = float(np.sqrt(fine.errors @ strengths / max(strengths.sum(), _TINY)))
        is_fine = missed <= share
        self.maps = fine if is_fine else ViewMaps(planes)
        self.error = float(np.hypot(left, missed)) if is_fine else left
        self._folded = np.ascontiguousarray(np.moveaxis(kept, -1, 0), dtype=np.float32)

    def colors(self, views: ArrayLike) -> Array:
        """Return the radiance of each vertex, shape (v, 3); `views` as of `General.colors`."""
        result = np.zeros(self._folded.shape[:2], np.float32)
        for vertices, values in self.maps.seen(self._general.local(views)):
            folded = self._folded.take(vertices, axis=0)
            result[vertices] = np.einsum("vk,vck->vc", values, folded)
        return result


class FixedView:
    """Shading where only the light moves.

    What a vertex sends in red, green and blue is more alike than three vectors need be: that of
    a grey BRDF is one vector, and that of a metal whose reflectance goes to white two. So the
    channels are mixed from the fewest vectors that they need, and vertices that face away, which
    send nothing, have none.

    Parameters
    ----------
    general : General
    views : array_like, shape (3,) or (v, 3)
    tolerance : float
        Relative RMS error of what is sent, over all vertices, that mixing may cause.

    Attributes
    ----------
    mixing : ndarray, shape (3, kept)
        How the channels are mixed from the vectors that are kept.
    error : float
        The relative RMS error that was caused.
    """

    def __init__(self, general: General, views: ArrayLike, tolerance: float = TOLERANCE) -> None:
        sent = general.sent(general.products(views))
        seen = sent.any(axis=(1, 2))
        flat = np.moveaxis(sent[seen], -1, 0).astype(float)
        channels = flat.reshape(3, -1)
        self.mixing, self.error = principal_axes(channels @ channels.T, tolerance)
        kept = np.einsum("ck,cvj->kjv", self.mixing, flat)
        # One more column of zeros is the colour of all vertices that are not seen.
        self._sent = np.zeros((kept.shape[0] * kept.shape[1], kept.shape[2] + 1), np.float32)
        self._sent[:, :-1] = kept.reshape(len(self._sent), -1)
        self._columns = np.where(seen, np.cumsum(seen) - 1, kept.shape[2])
        self._count = kept.shape[1]

    def colors(self, lighting: ArrayLike) -> Array:
        """Return the radiance of each vertex, shape (v, 3); `lighting` as of `General.colors`."""
        light = fitted(lighting, self._count).T
        mixed = (self.mixing[:, :, None] * light[:, None]).reshape(3, -1).astype(np.float32)
        return (mixed @ self._sent).take(self._columns, axis=1).T
