"""The environment BRDF of GGX: what it reflects of a white, uniform environment."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.lobe_moments import LobeMoments, lobe_moments
from shrm_cli.brdf.environment.material_albedo import albedo_table
from shrm_cli.brdf.models.charlie import Charlie
from shrm_cli.errors import MapError
from shrm_cli.progress import Progress


def environment_brdf(roughness: float, cosines: ArrayLike) -> tuple[Array, Array]:
    """Compute scale and bias of GGX's directional albedo, ``f0 * scale + bias``.

    The BRDF is that of `shrm_cli.brdf.models.ggx`, with Smith's G for correlated heights, Schlick's
    Fresnel term, and ``ggx_alpha = roughness^2``. If ``f_DV`` is the BRDF without Fresnel's term,
    the bias is the integral of ``f_DV (1 - V.H)^5 N.L`` over the hemisphere of L, and scale + bias
    is the integral of ``f_DV N.L``. Both are exact to 1e-5, at any roughness and down to N.V =
    1e-5.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.
    cosines : array_like, shape (n,)
        N.V; values below 1e-5 count as 1e-5.

    Returns
    -------
    scale, bias : ndarray, shape (n,)

    Raises
    ------
    MapError
        If the roughness is outside 0 .. 1.

    References
    ----------
    Karis 2013, "Real Shading in Unreal Engine 4" (scale and bias); eq. 5 to 7 and 15 of
    Silvennoinen et al. 2025.
    """
    total, bias = lobe_moments(roughness, cosines)[:, 0]
    return total - bias, bias


def environment_table(
    size: int, multiscatter: bool = False, progress: Progress | None = None
) -> Array:
    """Compute the environment BRDF of every roughness: the split sum's table, or "DFG".

    Parameters
    ----------
    size : int
        The number of rows, over the roughness, and of columns, over N.V. Both are sampled at
        texel centers, ``(k + 0.5) / size``. The first row is the smoothest.
    multiscatter : bool
        What the two channels R and G hold. If False, they hold scale and bias, and a surface
        reflects ``f0 * R + G`` of a uniform environment. If True, they hold bias and scale +
        bias, as in Filament, and a surface reflects ``mix(R, G, f0) * (1 + f0 * (1 / G - 1))``,
        which includes the light that meets several facets.
    progress : callable, optional
        Called with rows done and rows in all.

    Returns
    -------
    ndarray, shape (size, size, 2)

    References
    ----------
    Lagarde and Golubev 2018, in Filament (multiple scattering, with which a surface of f0 = 1
    loses nothing); Turquin 2019 (the same form; here with Fresnel's term at normal incidence).
    """
    table = np.empty((size, size, 2))
    moments = moments_table(size, progress)
    total, bias = moments[..., 0], moments[..., 3]
    table[..., 0], table[..., 1] = (bias, total) if multiscatter else (total - bias, bias)
    return table


def columns_table(kind: str, size: int, progress: Progress | None = None) -> Array:
    """Compute a table of three columns, two of which are those of `environment_table`.

    Parameters
    ----------
    kind : {"fdez-aguera", "turquin", "gltf", "filament"}
        The third column is the light that single scattering loses where f0 is 1, ``1 - E`` with
        ``E = scale + bias``; it as a part of E; or the albedo of cloth, after scale and bias, or
        after the columns for multiple scattering.
    size, progress
        As of `environment_table`.

    Returns
    -------
    ndarray, shape (size, size, 3)

    References
    ----------
    Fdez-Aguera 2019, "A Multiple-Scattering Microfacet Model for Real-Time Image Based Lighting";
    Turquin 2019, "Practical multiple scattering compensation for microfacet models".
    """
    two = environment_table(size, kind == "filament", progress)
    albedo = two.sum(axis=-1)
    if kind == "fdez-aguera":
        third = 1 - albedo
    elif kind == "turquin":
        third = (1 - albedo) / albedo
    else:
        third = albedo_table(Charlie(visibility="neubelt"), size, progress)[..., 0]
    return np.concatenate([two, third[..., None]], axis=-1)


def moments_table(size: int, progress: Progress | None = None) -> Array:
    """Compute the moments of the lobe of every roughness: the table of SH exponentials.

    Parameters
    ----------
    size : int
        As in `environment_table`.
    progress : callable, optional
        Called with rows done and rows in all.

    Returns
    -------
    ndarray, shape (size, size, 6)
        The integrals of 1, N.L and T.L / sin(theta_v) over the lobe without Fresnel's term, then
        with Schlick's tail; see `lobe_moments`. The quotient multiplies ``(N.V) N - V``, whose
        length is sin(theta_v), so that what lies across the normal vanishes where N = V however
        the table is filtered, and nothing is normalized there.
    """
    centers = (np.arange(size) + 0.5) / size
    sines = np.sqrt(1 - centers**2)
    table = np.empty((size, size, 6))
    for row, roughness in enumerate(centers.tolist()):
        moments = lobe_moments(roughness, centers)
        moments[:, 2] /= sines
        table[row] = moments.reshape(6, size).T
        if progress is not None:
            progress(row + 1, size)
    return table


class DirectionalAlbedo:
    """The environment BRDF of one roughness, tabulated over N.V for rendering.

    Interpolated values differ from those of `environment_brdf` by 2e-5 at most.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.

    Raises
    ------
    MapError
        If the roughness is outside 0 .. 1.
    """

    def __init__(self, roughness: float) -> None:
        if not 0 <= roughness <= 1:
            raise MapError(f"roughness {roughness:g} is outside 0 .. 1")
        self.roughness = roughness
        self._moments = LobeMoments(roughness)

    def scale_bias(self, cosines: ArrayLike) -> tuple[Array, Array]:
        """Interpolate scale and bias at N.V, each of the shape of `cosines`."""
        total, bias = self._moments.totals(cosines)
        return total - bias, bias

    def __call__(self, cosines: ArrayLike, f0: ArrayLike) -> Array:
        """Interpolate the directional albedo, ``f0 * scale + bias``.

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
