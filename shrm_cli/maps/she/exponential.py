"""Spherical harmonic exponentials: glossy reflections of any roughness from 33 coefficients.

The light that a GGX surface reflects is a product of two functions of direction, each the
exponential of a spherical harmonic series whose degrees roughness attenuates::

    E = albedo(N.V) exp(sum_lm a_l p_lm Y_lm(d) + sum_lm b_l q_lm Y_lm(h) - c)

Two laws say what d, h, a and b are:

``paper``
    That of Silvennoinen et al.: d = R, h half way between R and N, ``a_l = b_l =
    exp(-l (l+1) alpha / 2)``, a von Mises-Fisher distribution of ``kappa = 1 / alpha`` (eq. 12).
    The coefficients hold the albedo too, so c = 0 and only Fresnel's tail (eq. 15) is multiplied:
    ``f0 + (1 - f0) bias``.
``lobe``
    The von Mises-Fisher distribution takes after the lobe: d is the lobe's mean direction, and
    ``1 / kappa = -ln |mean|``, which makes its first moment the lobe's own, for any roughness,
    view and f0. The half vector h of d and N turns half as far, so ``b_l = exp(-l (l+1) /
    (8 kappa))``. The albedo is the environment-BRDF, so that a uniform light is reflected exactly.
    Blurring keeps the mean of the light, but not that of its logarithm: ``c = sum_l>0 (a_l^2
    |p_l|^2 + b_l^2 |q_l|^2) / (8 pi)``, half the variance of the exponent over the sphere, keeps
    the mean of its exponential, to second order.

References
----------
Silvennoinen, Sloan, Iwanicki and Nowrouzezahrai 2025, Spherical harmonic exponentials for
efficient glossy reflections, eq. 5, 9-12 and 15.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.base import Color
from shrm_cli.brdf.environment.lobe_moments import LobeMoments, mean_vectors, whole_lobe
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import EngineMap, Shaded
from shrm_cli.sphere.directions import bisector, reflect
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.vocabulary import Law, Sampling

Array = NDArray[np.floating]

_LARGEST_EXPONENT = 80.0  # exp() of it is still a number in single precision


class Form(Protocol):
    """What decides on the rows: the orders of the factors, and the law."""

    @property
    def order_p(self) -> int: ...
    @property
    def order_q(self) -> int: ...
    @property
    def law(self) -> Law: ...


@dataclass(frozen=True)
class SphericalHarmonicExponential(EngineMap):
    """Factors P and Q of the light that GGX reflects.

    Attributes
    ----------
    p_coefficients : ndarray, shape ((P+1)^2, 3)
        Of the logarithm of P, index l(l+1)+m.
    q_coefficients : ndarray, shape ((Q+1)^2 - 1, 3)
        Of the logarithm of Q, without its constant, which P has; index l(l+1)+m - 1.
    ggx_alpha : tuple of 2 float
        The range that it was fitted to; alpha is the square of the perceptual roughness.
    info : MapInfo
    law : {"lobe", "paper"}
        What attenuates the degrees; see the module.
    """

    p_coefficients: Array
    q_coefficients: Array
    ggx_alpha: tuple[float, float]
    info: MapInfo
    law: Law = "lobe"

    representation = "she"
    center = "reflection"
    sampling: ClassVar[Sampling] = "center"
    size = 1

    def __post_init__(self) -> None:
        p, q = self.p_coefficients.shape, self.q_coefficients.shape
        if p != ((self.order_p + 1) ** 2, 3) or q != ((self.order_q + 1) ** 2 - 1, 3):
            raise ValueError(f"coefficients of shapes {p} and {q}")

    @property
    def order_p(self) -> int:
        return order_of(len(self.p_coefficients))

    @property
    def order_q(self) -> int:
        return order_of(len(self.q_coefficients) + 1)

    @property
    def roughness_range(self) -> tuple[float, float]:
        """The roots of `ggx_alpha`."""
        low, high = self.ggx_alpha
        return float(np.sqrt(low)), float(np.sqrt(high))

    def images(self) -> tuple[()]:
        """It has none: its coefficients are all."""
        return ()

    @property
    def coefficients(self) -> Array:
        """Those of P, then those of Q, shape ((P+1)^2 + (Q+1)^2 - 1, 3)."""
        return np.concatenate([self.p_coefficients, self.q_coefficients])

    def shaded(self, roughness: float, f0: Color) -> "ShadedExponential":
        """What a surface of one roughness (perceptual) and normal reflectance reflects.

        Raises
        ------
        MapError
            If they are outside 0 .. 1.
        """
        return ShadedExponential(self, roughness, f0)


@dataclass(frozen=True)
class ShadedExponential(Shaded):
    """A GGX surface under the light of a `SphericalHarmonicExponential`."""

    light: SphericalHarmonicExponential

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance.

        Parameters
        ----------
        normals, views : array_like, shape (..., 3), broadcastable
            Unit, world axes; views point to the viewer.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        normals, views = np.broadcast_arrays(
            np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        )
        moments = self._moments.at(np.sum(normals * views, axis=-1))
        result = np.empty(normals.shape)
        for f0 in set(self.f0):
            channels = [k for k in range(3) if self.f0[k] == f0]
            series = exponent_series(self.light, normals, views, self.roughness, moments, f0)
            own = self.light.coefficients[:, channels]
            exponent = np.minimum(series.exponent(own), _LARGEST_EXPONENT)
            result[..., channels] = series.albedo[..., None] * np.exp(exponent)
        return result

    @cached_property
    def _moments(self) -> LobeMoments:
        return LobeMoments(self.roughness)


@dataclass(frozen=True)
class ExponentSeries:
    """What the coefficients are multiplied by at some normals and views.

    Attributes
    ----------
    rows, variances : ndarray, shape (..., k)
        The exponent is ``rows @ x - variances @ x^2``.
    albedo : ndarray, shape (...)
        What multiplies the exponential.
    """

    rows: Array
    variances: Array
    albedo: Array

    def exponent(self, coefficients: Array) -> Array:
        """Shape (..., channels), from coefficients of shape (k, channels)."""
        return self.rows @ coefficients - self.variances @ coefficients**2


def exponent_series(
    form: Form, normals: Array, views: Array, roughness: float, moments: Array, f0: float
) -> ExponentSeries:
    """The exponent's series at normals and views.

    Parameters
    ----------
    form : SphericalHarmonicExponential, or its orders and law
    normals, views : ndarray, shape (..., 3)
        Unit, world axes.
    roughness : float
        Perceptual.
    moments : ndarray, shape (2, 3, ...)
        `lobe_moments` there.
    f0 : float
    """
    if form.law == "paper":
        direction = reflect(views, normals)
        spread = of_q = np.full((*direction.shape[:-1], 1), roughness**2)
        albedo = f0 + (1 - f0) * moments[1, 0]  # eq. 15
    else:
        albedo, mean = whole_lobe(moments, f0)
        direction = mean_vectors(mean, normals, views)
        length = np.linalg.norm(direction, axis=-1, keepdims=True)
        direction = direction / length
        spread = -np.log(length)  # 1 / kappa
        of_q = spread / 4
    half = bisector(direction, normals)
    p, q = _attenuation(form.order_p, spread), _attenuation(form.order_q, of_q)[..., 1:]
    rows = np.concatenate(
        [
            p * real_harmonics(form.order_p, direction),
            q * real_harmonics(form.order_q, half)[..., 1:],
        ],
        axis=-1,
    )
    if form.law == "paper":
        return ExponentSeries(rows, np.zeros_like(rows), albedo)
    variances = np.concatenate([p, q], axis=-1) ** 2 / (8 * np.pi)
    variances[..., 0] = 0.0
    return ExponentSeries(rows, variances, albedo)


def _attenuation(order: int, spread: Array) -> Array:
    """``exp(-l (l+1) spread / 2)`` (eq. 12) of every coefficient, for spreads (..., 1)."""
    l = degrees(order)  # noqa: E741
    return np.exp(-spread / 2 * (l * (l + 1)))
