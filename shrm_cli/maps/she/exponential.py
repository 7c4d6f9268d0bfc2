"""Spherical harmonic exponentials: glossy reflections of any roughness from 33 coefficients.

The light that a GGX surface reflects is a product of two functions of direction, each the
exponential of a spherical harmonic series whose degrees roughness attenuates::

    E = albedo(N.V) exp(sum_lm a_l p_lm Y_lm(d) + sum_lm b_l q_lm Y_lm(h) - c)

The first sum is the logarithm of the factor P, the second that of the factor Q. The coefficients
p_lm and q_lm are fitted to the light. A law says what d, h, a, b, c and the albedo are; there are
two:

``paper``
    The law of Silvennoinen et al.: d is the mirror direction R, and h is half way between R and N.
    The degrees are attenuated by a von Mises-Fisher distribution of ``kappa = 1 / alpha``, ``a_l =
    b_l = exp(-l (l+1) alpha / 2)`` (eq. 12). The coefficients hold the albedo for f0 = 1 too, so
    c = 0, and only the factor for Fresnel's tail (eq. 15) is multiplied: ``f0 + (1 - f0) bias``.
``lobe``
    The von Mises-Fisher distribution takes after the lobe of GGX: d is the lobe's mean direction,
    and ``1 / kappa = -ln |mean|``, which gives it the lobe's own first moment for any roughness,
    view and f0. The half vector h of d and N turns half as far as d, so ``b_l = exp(-l (l+1) /
    (8 kappa))``. The albedo is the environment-BRDF, so that a uniform light is reflected exactly.
    Blurring keeps the mean of the light, but not the mean of its logarithm. Therefore ``c =
    sum_l>0 (a_l^2 |p_l|^2 + b_l^2 |q_l|^2) / (8 pi)``, half the variance of the exponent over the
    sphere, which keeps the mean of the exponential to second order.

Equations here are those of Silvennoinen et al. 2025.

References: Silvennoinen, Sloan, Iwanicki and Nowrouzezahrai 2025, Spherical harmonic exponentials
for efficient glossy reflections, eq. 5, 9-12 and 15.
"""

from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color
from shrm_cli.brdf.environment.environment_brdf import LobeMoments, mean_vectors, whole_lobe
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.kinds import LightMap, Shaded
from shrm_cli.records import record
from shrm_cli.sphere.directions import as_directions, bisector, reflect
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import LAWS, Law, Sampling

LARGEST_EXPONENT = 80.0
"""Larger exponents count as this one, whose exponential is still finite in single precision."""


@record(eq=False)
class SphericalHarmonicExponential(LightMap):
    """The light that GGX surfaces reflect, as the logarithms of two factors P and Q."""

    p_coefficients: Array
    """Coefficients of the logarithm of P, index l(l+1)+m, shape ((P+1)^2, 3)."""
    q_coefficients: Array
    """Coefficients of the logarithm of Q without its constant, which is part of that of P; index
    l(l+1)+m - 1, shape ((Q+1)^2 - 1, 3)."""
    ggx_alpha: tuple[float, float]
    """The range of GGX's alpha that the coefficients were fitted to; alpha is the square of the
    perceptual roughness."""
    info: MapInfo
    law: Law = "lobe"
    """How roughness and view attenuate the degrees; see the module."""

    representation = "she"
    natural_precision = "float"  # a few hundred bytes, and its numbers are exponents
    center = "reflection"
    sampling: ClassVar[Sampling] = "center"
    size = 1

    def __post_init__(self) -> None:
        p, q = self.p_coefficients.shape, self.q_coefficients.shape
        if p != ((self.order_p + 1) ** 2, 3) or q != ((self.order_q + 1) ** 2 - 1, 3):
            raise ValueError(f"coefficients of shapes {p} and {q}")
        if self.law not in LAWS:
            raise ValueError(f"law {self.law!r} is not one of {', '.join(LAWS)}")

    @property
    def order_p(self) -> int:
        return order_of(len(self.p_coefficients))

    @property
    def order_q(self) -> int:
        return order_of(len(self.q_coefficients) + 1)

    @property
    def roughness_range(self) -> tuple[float, float]:
        low, high = self.ggx_alpha
        return float(np.sqrt(low)), float(np.sqrt(high))

    def mixed(self, matrix: Array, info: MapInfo) -> "SphericalHarmonicExponential":
        """Refuse: a sum of exponentials is the exponential of no such series."""
        raise MapError(
            f"{self.what} holds logarithms, whose channels cannot be mixed; prefilter its probe "
            "with `working`"
        )

    def turned(self, matrix: ArrayLike) -> "SphericalHarmonicExponential":
        no_constant = np.zeros((1, 3))
        q = transform_coefficients(np.concatenate([no_constant, self.q_coefficients]), matrix)[1:]
        p = transform_coefficients(self.p_coefficients, matrix)
        return replace(self, p_coefficients=p, q_coefficients=q, info=self.info.turned(matrix))

    def details(self) -> dict[str, Any]:
        return {
            "p_order": self.order_p,
            "q_order": self.order_q,
            "coefficients": len(self.coefficients),
            "roughness": list(self.roughness_range),
            "ggx_alpha": list(self.ggx_alpha),
            "law": self.law,
            "p_coefficients": self.p_coefficients.tolist(),
            "q_coefficients": self.q_coefficients.tolist(),
            "fit_residual": self.info.fit_residual,
        }

    @property
    def coefficients(self) -> Array:
        """The coefficients of P, then those of Q, shape ((P+1)^2 + (Q+1)^2 - 1, 3)."""
        return np.concatenate([self.p_coefficients, self.q_coefficients])

    def surface(self, roughness: float, f0: Color, *brush: float | None) -> "ShadedExponential":
        return ShadedExponential(self, roughness, f0)


@record
class ShadedExponential(Shaded):
    """A GGX surface under the light of a `SphericalHarmonicExponential`."""

    light: SphericalHarmonicExponential

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        normals, views = np.broadcast_arrays(*as_directions(normals=normals, views=views))
        moments = self._moments.at(np.sum(normals * views, axis=-1))
        result = np.empty(normals.shape)
        for f0 in set(self.f0):
            channels = [k for k in range(3) if self.f0[k] == f0]
            series = exponent_series(self.light, normals, views, self.roughness, moments, f0)
            own = self.light.coefficients[:, channels]
            exponent = np.minimum(series.exponent(own), LARGEST_EXPONENT)
            result[..., channels] = series.albedo[..., None] * np.exp(exponent)
        return result

    @cached_property
    def _moments(self) -> LobeMoments:
        return LobeMoments(self.roughness)


@record(eq=False)
class ExponentSeries:
    """The numbers that the coefficients are multiplied by at some normals and views."""

    rows: Array
    variances: Array
    """`rows` and `variances`: the exponent of k coefficients x is ``rows @ x - variances @ x^2``,
    shape (..., k)."""
    albedo: Array
    """The factor that multiplies the exponential, shape (...)."""

    def exponent(self, coefficients: Array) -> Array:
        """Return exponents, shape (..., channels), for coefficients of shape (k, channels)."""
        return self.rows @ coefficients - self.variances @ coefficients**2


def exponent_series(
    factors: SphericalHarmonicExponential,
    normals: Array,
    views: Array,
    roughness: float,
    moments: Array,
    f0: float,
) -> ExponentSeries:
    """Compute the numbers that the coefficients are multiplied by at normals and views.

    Of `factors` the orders and the law count. `normals` and `views`, each of shape (..., 3), are
    unit vectors in world axes; views point to the viewer.
    `moments`, of shape (2, 3, ...), are the moments of GGX's lobe at these N.V, as `lobe_moments`
    returns them. `f0` is the reflectance at normal incidence.
    """
    if factors.law == "paper":
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
    p, q = _attenuation(factors.order_p, spread), _attenuation(factors.order_q, of_q)[..., 1:]
    rows = np.concatenate(
        [
            p * real_harmonics(factors.order_p, direction),
            q * real_harmonics(factors.order_q, half)[..., 1:],
        ],
        axis=-1,
    )
    if factors.law == "paper":
        return ExponentSeries(rows, np.zeros_like(rows), albedo)
    variances = np.concatenate([p, q], axis=-1) ** 2 / (8 * np.pi)
    variances[..., 0] = 0.0
    return ExponentSeries(rows, variances, albedo)


def _attenuation(order: int, spread: Array) -> Array:
    """Compute ``exp(-l (l+1) spread / 2)`` (eq. 12) of every coefficient, for spreads (..., 1)."""
    l = degrees(order)  # noqa: E741
    return np.exp(-spread / 2 * (l * (l + 1)))
