"""How much light GGX reflects, and from where on average: the first moments of its lobe."""

from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.vectors import GRAZING, fifth_power
from shrm_cli.errors import MapError
from shrm_cli.sphere.quadrature import gauss_legendre

Array = NDArray[np.floating]

_SLOPES = 40
_AZIMUTHS = 16
_VIEWS_AT_ONCE = 8  # whose samples stay in the processor's cache
_TABLE = 129
_NEAR_NORMAL = 1 - 1e-9  # where T.L / sin(theta_v) has still a meaning
_LEAST_ALPHA = 1e-8  # a smaller one changes nothing that can be seen, but would divide by zero


def lobe_moments(roughness: float, cosines: ArrayLike) -> Array:
    """Integrals over GGX's lobe of 1, N.L and T.L, without Fresnel's term and with Schlick's tail.

    The lobe is ``f_DV N.L``, GGX as in `brdf.models.ggx` with Fresnel's term 1, or that times
    ``(1 - V.H)^5``. T is the tangent towards which a mirror sends the view: R = N.V N + sin T.
    All are exact to 1e-5, at any roughness and down to N.V = 1e-5.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.
    cosines : array_like, shape (n,)
        N.V; those below 1e-5 count as that.

    Returns
    -------
    ndarray, shape (2, 3, n)
        ``[base or tail, (1, N.L, T.L)]``.

    Raises
    ------
    MapError
        If the roughness is outside 0 .. 1.
    """
    if not 0 <= roughness <= 1:
        raise MapError(f"roughness {roughness:g} is outside 0 .. 1")
    view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
    if roughness == 0:
        mirror = np.stack([np.ones_like(view), view, np.sqrt(1 - view**2)])
        return np.stack([mirror, mirror * fifth_power(1 - view)])
    alpha = max(roughness**2, _LEAST_ALPHA)
    result = np.empty((2, 3, len(view)))
    for start in range(0, len(view), _VIEWS_AT_ONCE):
        part = slice(start, start + _VIEWS_AT_ONCE)
        result[..., part] = _integrals(alpha, view[part, None])
    return result


def _integrals(alpha: float, view: Array) -> Array:
    """`lobe_moments` by Gauss and Legendre's rule over the half vector, from N.V of shape (n, 1).

    Over the half vector H instead of L, ``dL = 4 V.H dH``: by its slope ``t = tan(theta_h) =
    alpha sinh(x)``, which flattens D and resolves all scales, and its azimuth from the view. L is
    above the surface where ``cos(phi) > N.V (t^2 - 1) / (2 t sin(theta_v))``: at all azimuths up
    to the slope ``(1 - sin(theta_v)) / N.V``, and at none beyond ``(1 + sin(theta_v)) / N.V``.
    Nodes lie dense at both, where the range of azimuths changes like a square root.
    """
    sine = np.sqrt(1 - view**2)
    first, second = np.arcsinh(view / (1 + sine) / alpha), np.arcsinh((1 + sine) / view / alpha)
    nodes, weights = _rule(_SLOPES)
    eased, eased_weights = nodes**2 * (3 - 2 * nodes), weights * 6 * nodes * (1 - nodes)
    span = second - first
    x = np.concatenate([first * nodes, first + span * eased], axis=1)
    measure = np.concatenate([first * weights, span * eased_weights], axis=1)
    slope = alpha * np.sinh(x)
    # D cos(theta_h) dH = 2 y / (1 + y^2)^2 dy dphi / (2 pi) with y = sinh(x).
    measure *= 2 * np.tanh(x) / np.cosh(x) ** 2
    limit = view * (slope**2 - 1) / np.maximum(2 * slope * sine, np.finfo(float).tiny)
    end = np.arccos(np.clip(limit, -1.0, 1.0))
    azimuths, azimuth_weights = (each[:, None, None] for each in _rule(_AZIMUTHS))
    along = np.cos(end * azimuths) * slope  # of H / N.H, towards the view
    facing = along * sine + view  # V.H / N.H
    cosine2 = 1 / (1 + slope**2)
    turned = 2 * cosine2 * facing
    height = np.maximum(turned - view, 0.0)  # N.L
    forward = sine - turned * along  # T.L
    a2 = alpha**2
    masking = np.sqrt(a2 + (1 - a2) * view**2)
    shadowing = np.sqrt(a2 + (1 - a2) * height**2)
    base = 2 * measure * end / np.pi * azimuth_weights * height * facing
    base /= np.maximum(height * masking + view * shadowing, np.finfo(float).tiny)
    tail = base * fifth_power(1 - np.minimum(facing * np.sqrt(cosine2), 1.0))
    result = np.empty((2, 3, len(view)))
    for kind, values in enumerate((base, tail)):
        result[kind, 0] = values.sum(axis=(0, 2))
        result[kind, 1] = np.einsum("pnx,pnx->n", values, height)
        result[kind, 2] = np.einsum("pnx,pnx->n", values, forward)
    return result


@lru_cache
def _rule(count: int) -> tuple[Array, Array]:
    """Gauss and Legendre's rule on 0 .. 1."""
    nodes, weights = gauss_legendre(count)
    return (nodes + 1) / 2, weights / 2


class LobeMoments:
    """The moments of one roughness, tabulated over N.V for rendering.

    Interpolated values are those of `lobe_moments` to 2e-5, at any roughness.

    Parameters
    ----------
    roughness : float
        Perceptual, in 0 .. 1.
    """

    def __init__(self, roughness: float) -> None:
        self.roughness = roughness

    def at(self, cosines: ArrayLike) -> Array:
        """`lobe_moments` at N.V of shape (...), shape (2, 3, ...)."""
        view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
        moments = self._interpolated(self._table, view)
        moments[:, 2] *= np.sqrt(1 - view**2)
        return moments

    def totals(self, cosines: ArrayLike) -> Array:
        """The integrals of 1 alone, shape (2, ...)."""
        view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
        return self._interpolated(self._table[:, 0], view)

    def _interpolated(self, table: Array, view: Array) -> Array:
        """Of each row of a table, the cubic polynomial through the four nodes that are nearest."""
        position = (_TABLE - 1) * self._position(view)
        node = np.clip(position.astype(int), 1, _TABLE - 3)
        t = position - node
        result = table[..., node - 1] * (-t * (t - 1) * (t - 2) / 6)
        result += table[..., node] * ((t + 1) * (t - 1) * (t - 2) / 2)
        result += table[..., node + 1] * (-(t + 1) * t * (t - 2) / 2)
        result += table[..., node + 2] * ((t + 1) * t * (t - 1) / 6)
        return np.asarray(result)

    def _position(self, view: Array) -> Array:
        """Of N.V in the table, 0 .. 1: dense where it is less than alpha, as much as elsewhere."""
        first, last = self._ends
        return (np.arcsinh(np.sqrt(view / self._scale)) - first) / (last - first)

    @property
    def _scale(self) -> float:
        return 0.3 * max(self.roughness**2, _LEAST_ALPHA)

    @property
    def _ends(self) -> tuple[float, float]:
        first, last = np.arcsinh(np.sqrt(np.array([GRAZING, 1.0]) / self._scale)).tolist()
        return first, last

    @cached_property
    def _table(self) -> Array:
        """Rows of equal steps in `_position`; T.L over sin(theta_v), which is smooth at 0."""
        nodes = self._scale * np.sinh(np.linspace(*self._ends, _TABLE)) ** 2
        view = np.clip(nodes, GRAZING, _NEAR_NORMAL)
        table = lobe_moments(self.roughness, view)
        table[:, 2] /= np.sqrt(1 - view**2)
        return table


def whole_lobe(moments: Array, f0: float) -> tuple[Array, Array]:
    """Albedo and mean direction of the lobe with Schlick's term, ``f0 + (1 - f0) (1 - V.H)^5``.

    Parameters
    ----------
    moments : ndarray, shape (2, 3, ...)
        As `lobe_moments` has them.
    f0 : float
        Reflectance at normal incidence.

    Returns
    -------
    albedo : ndarray, shape (...)
    mean : ndarray, shape (2, ...)
        N.L and T.L, averaged over the lobe; never longer than 1. Where nothing is reflected, as
        a mirror of f0 = 0 seen along its normal, it is the mean without Schlick's term.
    """
    whole = f0 * moments[0] + (1 - f0) * moments[1]
    lobe = np.where(whole[0] > 0, whole, moments[0])
    mean = lobe[1:] / lobe[0]
    # A ratio of interpolated values may be longer, where next to nothing is reflected.
    return whole[0], mean / np.maximum(np.hypot(*mean), 1.0)


def mean_vectors(mean: Array, normals: Array, views: Array) -> Array:
    """Mean vectors of lobes in world axes, shape (..., 3), from their N.L and T.L, (2, ...)."""
    tangents = np.sum(normals * views, axis=-1, keepdims=True) * normals - views
    # Where V = N there is no tangent, and no component along it either.
    length = np.linalg.norm(tangents, axis=-1, keepdims=True)
    tangents = tangents / np.where(length > 0, length, 1.0)
    return np.asarray(mean[0][..., None] * normals + mean[1][..., None] * tangents)
