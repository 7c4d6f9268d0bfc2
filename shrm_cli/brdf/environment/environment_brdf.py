"""The environment BRDF of GGX: what it reflects of a white, uniform environment.

It is made of the first moments of the lobe: how much light it reflects, and from where on average.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import progress
from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.environment.material_albedo import (
    ViewTable,
    albedo_table,
    half_vectors,
    unit_rule,
)
from shrm_cli.brdf.models.charlie import Charlie
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.vectors import GRAZING, fifth_power
from shrm_cli.errors import BrdfError, MapError

_SLOPES = 40  # nodes of each half of the integral over the slope of the half vector
_AZIMUTHS = 16  # and of the integral over its azimuth
_VIEWS_AT_ONCE = 8  # so few that their samples stay in the processor's cache
_NEAR_NORMAL = 1 - 1e-9  # the largest N.V for which T.L / sin(theta_v) can be computed
_LEAST_ALPHA = 1e-8  # smaller values would look the same, but divide by zero


def lobe_moments(roughness: float, cosines: ArrayLike) -> Array:
    """Integrate 1, N.L and T.L over GGX's lobe, without Fresnel's term and with Schlick's tail.

    The lobe is ``f_DV N.L``, where f_DV is GGX as in `shrm_cli.brdf.models.ggx` with 1 in the
    place of Fresnel's term, or this times ``(1 - V.H)^5``. T is the tangent towards which a mirror
    reflects the view, ``R = (N.V) N + sin(theta_v) T``. All integrals are exact to 1e-5, at any
    roughness and down to N.V = 1e-5.

    `cosines`, of shape (n,), are N.V; values below 1e-5 count as 1e-5.

    Returns an array of shape (2, 3, n), indexed [without Fresnel's term or with the tail; 1, N.L or
    T.L; view].
    """
    if not 0 <= roughness <= 1:
        raise MapError(f"roughness {roughness:g} is outside 0 .. 1")
    view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
    if roughness == 0:
        mirror = np.stack([np.ones_like(view), view, np.sqrt(1 - view**2)])
        return np.stack([mirror, mirror * fifth_power(1 - view)])
    alpha = max(roughness**2, _LEAST_ALPHA)
    result = np.empty((2, 3, len(view)))
    for part in slices(len(view), _VIEWS_AT_ONCE):
        result[..., part] = _integrals(alpha, view[part, None])
    return result


def _integrals(alpha: float, view: Array) -> Array:
    """Compute `lobe_moments` by Gauss and Legendre's rule, for N.V of shape (n, 1).

    They are over the half vector H instead of L, with ``dL = 4 V.H dH``.
    """
    sine = np.sqrt(1 - view**2)
    x, measure, end = half_vectors(alpha, view, _SLOPES)
    slope = alpha * np.sinh(x)
    # With y = sinh(x), D cos(theta_h) dH = 2 y / (1 + y^2)^2 dy dphi / (2 pi).
    measure *= 2 * np.tanh(x) / np.cosh(x) ** 2
    azimuths, azimuth_weights = (each[:, None, None] for each in unit_rule(_AZIMUTHS))
    along = np.cos(end * azimuths) * slope  # the component of H / N.H towards the view
    facing = along * sine + view  # V.H / N.H
    cosine2 = 1 / (1 + slope**2)
    turned = 2 * cosine2 * facing
    light = np.maximum(turned - view, 0.0)  # N.L
    forward = sine - turned * along  # T.L
    a2 = alpha**2
    masking = np.sqrt(a2 + (1 - a2) * view**2)
    shadowing = np.sqrt(a2 + (1 - a2) * light**2)
    base = 2 * measure * end / np.pi * azimuth_weights * light * facing
    base /= np.maximum(light * masking + view * shadowing, np.finfo(float).tiny)
    tail = base * fifth_power(1 - np.minimum(facing * np.sqrt(cosine2), 1.0))
    result = np.empty((2, 3, len(view)))
    for kind, values in enumerate((base, tail)):
        result[kind, 0] = values.sum(axis=(0, 2))
        result[kind, 1] = np.einsum("pnx,pnx->n", values, light)
        result[kind, 2] = np.einsum("pnx,pnx->n", values, forward)
    return result


class LobeMoments(ViewTable):
    """The moments of one roughness, tabulated over N.V for rendering.

    Interpolated values differ from those of `lobe_moments` by 2e-5 at most, at any roughness.
    """

    def __init__(self, roughness: float) -> None:
        if not 0 <= roughness <= 1:
            raise MapError(f"roughness {roughness:g} is outside 0 .. 1")
        super().__init__(max(roughness**2, _LEAST_ALPHA))
        self.roughness = roughness

    def at(self, cosines: ArrayLike) -> Array:
        """Interpolate `lobe_moments` at N.V of shape (...); the result is of shape (2, 3, ...)."""
        view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
        moments = self.interpolated(self._table, view)
        moments[:, 2] *= np.sqrt(1 - view**2)
        return moments

    def totals(self, cosines: ArrayLike) -> Array:
        """Interpolate only the integrals of 1, shape (2, ...)."""
        view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
        return self.interpolated(self._table[:, 0], view)

    @cached_property
    def _table(self) -> Array:
        """The moments at the nodes; those of T.L are divided by sin(theta_v).

        The quotient is smooth at sin(theta_v) = 0, where T.L is not.
        """
        view = np.clip(self.nodes, GRAZING, _NEAR_NORMAL)
        table = lobe_moments(self.roughness, view)
        table[:, 2] /= np.sqrt(1 - view**2)
        return table


def whole_lobe(moments: Array, f0: float) -> tuple[Array, Array]:
    """Compute albedo and mean direction of the lobe with Schlick's term for one f0.

    Schlick's term is ``f0 + (1 - f0) (1 - V.H)^5``.

    `moments`, of shape (2, 3, ...), are as `lobe_moments` returns them.

    Returns `albedo` of shape (...); and `mean` of shape (2, ...), N.L and T.L, averaged over the
    lobe; the vector is never longer than 1. Where nothing is reflected, as by a mirror of f0 = 0
    seen along its normal, it is the mean without Schlick's term.
    """
    whole = f0 * moments[0] + (1 - f0) * moments[1]
    lobe = np.where(whole[0] > 0, whole, moments[0])
    mean = lobe[1:] / lobe[0]
    # Where next to nothing is reflected, a ratio of interpolated values may be longer than 1.
    return whole[0], mean / np.maximum(np.hypot(*mean), 1.0)


def mean_vectors(mean: Array, normals: Array, views: Array) -> Array:
    """Turn means N.L and T.L, shape (2, ...), into vectors in world axes, shape (..., 3)."""
    tangents = np.sum(normals * views, axis=-1, keepdims=True) * normals - views
    # Where V = N there is no tangent, but no component along it either.
    length = np.linalg.norm(tangents, axis=-1, keepdims=True)
    tangents = tangents / np.where(length > 0, length, 1.0)
    return np.asarray(mean[0][..., None] * normals + mean[1][..., None] * tangents)


def environment_table(size: int, multiscatter: bool = False) -> Array:
    """Compute the split sum's table of every roughness, or "DFG", shape (size, size, 2).

    GGX's directional albedo is ``f0 * scale + bias``. With ``f_DV`` as of `lobe_moments`, the bias
    is the integral of ``f_DV (1 - V.H)^5 N.L`` over the hemisphere of L, and scale + bias is that
    of ``f_DV N.L``.

    `size` is the number of rows, over the roughness, and of columns, over N.V. Both are sampled at
    texel centers, ``(k + 0.5) / size``. The first row is the smoothest. `multiscatter` is what the
    two channels R and G hold. If False, they hold scale and bias, and a surface reflects ``f0 * R +
    G`` of a uniform environment. If True, they hold bias and scale + bias, as in Filament, and a
    surface reflects ``mix(R, G, f0) * (1 + f0 * (1 / G - 1))``, which includes the light that meets
    several facets.

    References: Karis 2013, "Real Shading in Unreal Engine 4" (scale and bias); eq. 5 to 7 and 15 of
    Silvennoinen et al. 2025. Lagarde and Golubev 2018, in Filament (multiple scattering, with which
    a surface of f0 = 1 loses nothing); Turquin 2019 (the same form; here with Fresnel's term at
    normal incidence).
    """
    table = np.empty((size, size, 2))
    moments = moments_table(size)
    total, bias = moments[..., 0], moments[..., 3]
    table[..., 0], table[..., 1] = (bias, total) if multiscatter else (total - bias, bias)
    return table


def columns_table(kind: str, size: int) -> Array:
    """Compute `environment_table` with a third column, shape (size, size, 3).

    `kind`, a key of `environment.file.MEANINGS`, says what the third column is: the light that
    single scattering loses where f0 is 1, ``1 - E`` with ``E = scale + bias``; it as a part of E;
    or the albedo of cloth, after scale and bias, or after the columns for multiple scattering.

    References: Fdez-Aguera 2019, "A Multiple-Scattering Microfacet Model for Real-Time Image Based
    Lighting"; Turquin 2019, "Practical multiple scattering compensation for microfacet models".
    """
    two = environment_table(size, kind == "filament")
    albedo = two.sum(axis=-1)
    if kind == "fdez-aguera":
        third = 1 - albedo
    elif kind == "turquin":
        third = (1 - albedo) / albedo
    else:
        third = albedo_table(Charlie(visibility="neubelt"), size)[..., 0]
    return np.concatenate([two, third[..., None]], axis=-1)


def moments_table(size: int) -> Array:
    """Compute the moments of the lobe of every roughness: the table of SH exponentials.

    Returns an array of shape (size, size, 6): the integrals of 1, N.L and T.L / sin(theta_v) over
    the lobe without Fresnel's term, then with Schlick's tail; see `lobe_moments`. The quotient
    multiplies ``(N.V) N - V``, whose length is sin(theta_v), so that what lies across the normal
    vanishes where N = V however the table is filtered, and nothing is normalized there.
    """
    centers = (np.arange(size) + 0.5) / size
    sines = np.sqrt(1 - centers**2)
    table = np.empty((size, size, 6))
    for row, roughness in enumerate(centers.tolist()):
        moments = lobe_moments(roughness, centers)
        moments[:, 2] /= sines
        table[row] = moments.reshape(6, size).T
        progress.report(row + 1, size)
    return table


class DirectionalAlbedo(LobeMoments):
    """The environment BRDF of one roughness, tabulated over N.V for rendering."""

    def scale_bias(self, cosines: ArrayLike) -> tuple[Array, Array]:
        """Interpolate scale and bias at N.V, each of the shape of `cosines`."""
        total, bias = self.totals(cosines)
        return total - bias, bias

    def __call__(self, cosines: ArrayLike, f0: ArrayLike) -> Array:
        """Interpolate the directional albedo, ``f0 * scale + bias``, shape (..., 3).

        `cosines`, of shape (...), are N.V. `f0`, of shape (3,), is the reflectance at normal
        incidence, linear RGB.
        """
        scale, bias = self.scale_bias(cosines)
        return scale[..., None] * np.asarray(f0, dtype=float) + bias[..., None]


AZIMUTHS = 0.0, np.pi / 4, np.pi / 2
"""Views along the stretched axis, between both, and across it."""
_TURNS = 192
"""Nodes of the integral over the azimuth of the slope of the half vector of brushed GGX."""


def brushed_totals(alphas: tuple[float, float], cosines: ArrayLike, azimuth: float) -> Array:
    """Integrate GGX's lobe without Fresnel's term, and with ``(1 - V.H)^5``.

    The integral is over the slopes of half vectors, which have the length ``sinh(x)`` where the
    alphas are the units of length. Along a ray of slopes light comes from above up to a root of a
    quadratic equation.

    `alphas` are along x and y. `cosines`, of shape (n,), are N.V; values below 1e-5 count as 1e-5.
    `azimuth` is that of the view from the x axis, radians.

    Returns an array of shape (2, n): exact to 5e-5 down to N.V = 0.004.
    """
    view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
    result = np.empty((2, len(view)))
    for part in slices(len(view), _VIEWS_AT_ONCE):
        result[:, part] = _totals(alphas, view[part, None, None], azimuth)
    return result


def _totals(alphas: tuple[float, float], z: Array, azimuth: float) -> Array:
    """Compute `brushed_totals` for N.V of shape (n, 1, 1)."""
    ax, ay = alphas
    sine = np.sqrt(1 - z**2)
    x, y = sine * np.cos(azimuth), sine * np.sin(azimuth)
    # Seen along or across the tangent, both sides of the plane of the view reflect the same.
    sides, first = (2, azimuth) if azimuth in (AZIMUTHS[0], AZIMUTHS[-1]) else (1, 0.0)
    turns = first + (np.arange(_TURNS // sides)[:, None] + 0.5) * 2 * np.pi / _TURNS
    unit_x, unit_y = ax * np.cos(turns), ay * np.sin(turns)
    along, square = unit_x * x + unit_y * y, unit_x**2 + unit_y**2
    # N.L > 0 is ``z + 2 along t - z square t^2 > 0``; the form of the root does not cancel.
    root = np.sqrt(along**2 + z**2 * square)
    positive = (along + root) / (z * square)
    negative = z / np.maximum(root - along, np.finfo(float).tiny)
    end = np.arcsinh(np.where(along > 0, positive, negative))
    nodes, weights = unit_rule(_SLOPES)
    steps = end * nodes
    length = np.sinh(steps)
    facing = z + along * length  # V.H / N.H
    cosine2 = 1 / (1 + square * length**2)
    scale = 2 * cosine2 * facing
    light = [scale * unit_x * length - x, scale * unit_y * length - y]
    height = np.maximum(scale - z, 0.0)
    masking = np.sqrt((ax * x) ** 2 + (ay * y) ** 2 + z**2)
    shadowing = np.sqrt((ax * light[0]) ** 2 + (ay * light[1]) ** 2 + height**2)
    # With t = sinh(x), D cos(theta_h) dH = 2 t / (1 + t^2)^2 dt dphi / (2 pi).
    measure = end * weights * (2 * sides / _TURNS) * length / np.cosh(steps) ** 3
    both = np.maximum(height * masking + z * shadowing, np.finfo(float).tiny)
    base = measure * 2 * facing * height / both
    tail = base * fifth_power(1 - np.minimum(facing * np.sqrt(cosine2), 1.0))
    return np.stack([base.sum(axis=(1, 2)), tail.sum(axis=(1, 2))])


def brushed_table(brdf: Ggx, size: int) -> Array:
    """Compute scale and bias of f0 for every roughness, in three azimuths of the view.

    Between the azimuths both are quadratic in ``w = cos(2 phi)``, which is 1, 0 and -1 there.

    `brdf` is one whose anisotropy, and the mapping of it, all rows have. `size` is the number of
    rows, over the perceptual roughness, and of columns, over N.V.

    Returns an array of shape (size, size, 6): scale and bias along, between and across.
    """
    usual = Ggx().values
    if any(brdf.values.get(key) != value for key, value in usual.items()):
        raise BrdfError(
            f"{brdf!r}: all roughnesses are made, for any f0; give only anisotropy and mapping"
        )
    centers = (np.arange(size) + 0.5) / size
    table = np.empty((size, size, 6))
    for row, roughness in enumerate(centers.tolist()):
        alphas = brdf.at_roughness(roughness).alphas
        for column, azimuth in enumerate(AZIMUTHS):
            total, bias = brushed_totals(alphas, centers, azimuth)
            table[row, :, 2 * column : 2 * column + 2] = np.stack([total - bias, bias], axis=-1)
        progress.report(row + 1, size)
    return table
