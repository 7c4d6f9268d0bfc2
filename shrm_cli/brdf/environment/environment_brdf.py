"""The environment-BRDF of GGX: what a white, uniform environment has it reflect."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.environment.lobe_moments import LobeMoments, lobe_moments
from shrm_cli.errors import MapError

Array = NDArray[np.floating]


def environment_brdf(roughness: float, cosines: ArrayLike) -> tuple[Array, Array]:
    """Scale and bias of GGX's directional albedo, ``f0 * scale + bias``.

    The BRDF is that of `shrm_cli.brdf.models.ggx`: correlated Smith, Schlick's Fresnel term, and
    ``ggx_alpha = roughness^2``. With ``f_DV`` the BRDF without Fresnel's term, the bias is the
    integral of ``f_DV (1 - V.H)^5 N.L`` over the hemisphere of L, and scale + bias that of
    ``f_DV N.L``. Both are exact to 1e-5, at any roughness and down to N.V = 1e-5.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.
    cosines : array_like, shape (n,)
        N.V; those below 1e-5 count as that.

    Returns
    -------
    scale, bias : ndarray, shape (n,)

    Raises
    ------
    MapError
        If the roughness is outside 0 .. 1.

    References
    ----------
    Karis 2013, Real shading in Unreal Engine 4; Silvennoinen et al. 2025, eq. 5-7 and 15.
    """
    total, bias = lobe_moments(roughness, cosines)[:, 0]
    return total - bias, bias


def environment_table(
    size: int, multiscatter: bool = False, progress: Callable[[int, int], object] | None = None
) -> Array:
    """The environment-BRDF of every roughness: the look-up table of the split sum ("DFG").

    Parameters
    ----------
    size : int
        Rows of roughness, columns of N.V, both at texel centres, ``(k + 0.5) / size``; the first
        row is the smoothest.
    multiscatter : bool
        What the two channels hold. False: scale and bias; the surface reflects ``f0 * R + G`` of
        a uniform environment. True: bias and scale + bias, as Filament has them; with the light
        that meets several facets, it reflects ``mix(R, G, f0) * (1 + f0 * (1 / G - 1))``.
    progress : callable, optional
        Called with rows done and rows in all.

    Returns
    -------
    ndarray, shape (size, size, 2)

    References
    ----------
    Multiple scattering: Lagarde & Golubev 2018, as Filament has it; a surface of f0 = 1 loses
    nothing. It is the form of Turquin 2019, with Fresnel's term at normal incidence.
    """
    table = np.empty((size, size, 2))
    moments = moments_table(size, progress)
    total, bias = moments[..., 0], moments[..., 3]
    table[..., 0], table[..., 1] = (bias, total) if multiscatter else (total - bias, bias)
    return table


def moments_table(size: int, progress: Callable[[int, int], object] | None = None) -> Array:
    """The first moments of every roughness's lobe: the look-up table of SH exponentials.

    Parameters
    ----------
    size : int
        As in `environment_table`.
    progress : callable, optional
        Called with rows done and rows in all.

    Returns
    -------
    ndarray, shape (size, size, 6)
        Integrals of 1, N.L and T.L without Fresnel's term, then with Schlick's tail; see
        `lobe_moments`.
    """
    centres = (np.arange(size) + 0.5) / size
    table = np.empty((size, size, 6))
    for row, roughness in enumerate(centres.tolist()):
        table[row] = lobe_moments(roughness, centres).reshape(6, size).T
        if progress is not None:
            progress(row + 1, size)
    return table


class DirectionalAlbedo:
    """The environment-BRDF of one roughness, tabulated over N.V for rendering.

    Interpolated values are those of `environment_brdf` to 2e-5.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.

    Raises
    ------
    MapError
        If it is outside 0 .. 1.
    """

    def __init__(self, roughness: float) -> None:
        if not 0 <= roughness <= 1:
            raise MapError(f"roughness {roughness:g} is outside 0 .. 1")
        self.roughness = roughness
        self._moments = LobeMoments(roughness)

    def scale_bias(self, cosines: ArrayLike) -> tuple[Array, Array]:
        """Scale and bias at N.V, each of the shape of `cosines`."""
        total, bias = self._moments.totals(cosines)
        return total - bias, bias

    def __call__(self, cosines: ArrayLike, f0: ArrayLike) -> Array:
        """Directional albedo ``f0 * scale + bias``.

        Parameters
        ----------
        cosines : array_like, shape (...)
            N.V.
        f0 : array_like, shape (3,)
            Reflectance at normal incidence, linear RGB.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        scale, bias = self.scale_bias(cosines)
        return scale[..., None] * np.asarray(f0, dtype=float) + bias[..., None]
