"""The irradiance map: a few lighting coefficients, and the irradiance E(N) that they make.

Equations 4.x are those of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for
Forward and Inverse Rendering" (2002).
"""

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.window import Window
from shrm_cli.maps.kinds import FixedMap, HarmonicLight, ReflectionMap
from shrm_cli.maps.size import choose_size
from shrm_cli.records import record
from shrm_cli.sphere.extremes import lowest, series_values
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import MAX_CUBE_SIZE, Sampling

POLYNOMIAL_ORDER = 2
"""The largest order at which E is a quadratic polynomial of the normal (eq. 4.14 to 4.16)."""


def lambert_factors(order: int) -> Array:
    """Return the factors A_l of the clamped cosine, ``E_lm = A_l L_lm``, shape (order+1,).

    They are pi, 2 pi / 3, pi / 4, 0, -pi / 24, ...

    `order` is the largest degree l.

    References: Eq. 4.11. Its factorials ``l! / (2^l (l/2)!^2)`` are computed by the ratio ``(l - 1)
    / l`` of one to the one before.
    """
    factors = np.zeros(order + 1)
    central = 1.0
    for degree in range(0, order + 1, 2):
        if degree:
            central *= (degree - 1) / degree
        sign = 1 if degree % 4 == 2 else -1
        factors[degree] = sign * 2 * np.pi * central / ((degree + 2) * (degree - 1))
    if order >= 1:
        factors[1] = 2 * np.pi / 3
    return factors


def irradiance_energies(power: ArrayLike) -> Array:
    """Return ``A_l^2 sum_m L_lm^2``; their sum is the integral of E^2, shape (order+1, 3).

    `power`, of shape (order+1, 3), is ``sum_m L_lm^2`` of each degree and channel.
    """
    power = np.asarray(power)
    return lambert_factors(len(power) - 1)[:, None] ** 2 * power


def matrix_constants() -> tuple[float, float, float, float, float]:
    """Return c1 .. c5 of eq. 4.15: products of A_l and constants of the harmonics (eq. 4.5)."""
    a0, a1, a2 = lambert_factors(2).tolist()
    constant, linear = np.sqrt(1 / (4 * np.pi)), np.sqrt(3 / (4 * np.pi))
    mixed, zonal = np.sqrt(15 / (4 * np.pi)), np.sqrt(5 / (16 * np.pi))
    # Y_22 is mixed / 2 (x^2 - y^2) and Y_20 is zonal (3 z^2 - 1). The matrix is symmetric, so
    # products of two different coordinates occur twice.
    c1, c2, c3 = a2 * mixed / 2, a1 * linear / 2, 3 * a2 * zonal
    return float(c1), float(c2), float(c3), float(a0 * constant), float(a2 * zonal)


@record(eq=False)
class Irradiance(FixedMap, ReflectionMap):
    """The irradiance of a surface as a function of its normal."""

    coefficients: Array
    """Lighting coefficients L_lm (eq. 4.13) times the window's factors, index l(l+1)+m, shape
    ((F+1)^2, 3)."""
    info: MapInfo
    size: int = 0
    """Texels along a face's edge of the cube that is written with the coefficients; `choose_size`
    chooses it by default."""
    sampling: Sampling = "center"
    window: Window = field(default_factory=Window)
    """The factors that the coefficients were multiplied with."""

    representation = "irradiance"
    center = "normal"
    is_white = True

    def __post_init__(self) -> None:
        if self.coefficients.shape != ((self.order_f + 1) ** 2, 3):
            raise ValueError(f"lighting coefficients of shape {self.coefficients.shape}")
        if len(self.window.factors) not in (0, self.order_f + 1):
            raise ValueError(f"{len(self.window.factors)} factors for order {self.order_f}")
        if not self.size:
            object.__setattr__(self, "size", choose_size(self.order_f))

    @property
    def order_f(self) -> int:
        return order_of(len(self.coefficients))

    @property
    def harmonic_light(self) -> HarmonicLight:
        return HarmonicLight(self.coefficients)

    @property
    def takes_windows(self) -> bool:
        """Whether a window can damp the degrees."""
        return True

    def irradiance(self, normals: ArrayLike) -> Array:
        """Return the irradiance E(N), without a factor 1/pi (eq. 4.10).

        `normals`, of shape (..., 3), are unit vectors in world axes.

        Returns an array of shape (..., 3).
        """
        normals = np.asarray(normals, dtype=float)
        values = series_values(self.series, normals.reshape(-1, 3))
        return values.reshape(normals.shape)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return the radiance E / pi of a white Lambertian surface, whatever the views are."""
        normals = np.asarray(normals, dtype=float)
        shape = np.broadcast_shapes(normals.shape, np.shape(views))
        return np.broadcast_to(self.irradiance(normals) / np.pi, shape)

    def cube(self) -> Array:
        """Return E(N) at the texels of an OpenEXR cube, shape (6N, N, 3)."""
        planes = synthesize_cube(self.series, self.size, self.sampling)
        return np.moveaxis(planes, 0, -1)

    @property
    def cube_count(self) -> int:
        return 1

    def planes(self) -> tuple[Array]:
        """Return the cube of E(N), which is made from the coefficients."""
        return (self.cube(),)

    def with_planes(
        self, planes: Sequence[Array], sampling: Sampling, info: MapInfo
    ) -> "Irradiance":
        """Return the same coefficients with the size and the sampling of another cube.

        The cube's texels are not kept, because the coefficients make them.
        """
        (cube,) = planes
        return replace(self, size=cube.shape[1], sampling=sampling, info=info)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> "Irradiance":
        """Return the map with another size or sampling; the coefficients make its cube anew."""
        if size is not None and size > MAX_CUBE_SIZE:
            raise MapError(f"a map of size {size} is larger than {MAX_CUBE_SIZE}; lower `size`")
        return replace(self, size=size or self.size, sampling=sampling or self.sampling)

    def windowed(self, window: Window, info: MapInfo) -> "Irradiance":
        """Return the map, which has no window yet, with its degrees times a window's factors."""
        windowed = window.apply(self.coefficients)
        return replace(self, coefficients=windowed, info=info, window=window)

    def mixed(self, matrix: Array, info: MapInfo) -> "Irradiance":
        return replace(self, coefficients=self.coefficients @ matrix.T, info=info)

    def turned(self, matrix: ArrayLike) -> "Irradiance":
        """Return the map of the same light turned, exactly; see `Map.turned`."""
        turned = transform_coefficients(self.coefficients, matrix)
        return replace(self, coefficients=turned, info=self.info.turned(matrix))

    def summary(self) -> dict[str, Any]:
        return {
            **super().summary(),
            "size": self.size,
            "sampling": self.sampling,
            "order_f": self.order_f,
            "coefficients": len(self.coefficients),
        }

    def details(self) -> dict[str, Any]:
        return {
            "window": self.window.summary(self.order_f),
            "minimum_irradiance": self.minimum(),
            **self.numbers(),
            "predicted_error": self.info.predicted_error,
            "added_error": self.info.added_error,
        }

    def numbers(self) -> dict[str, Any]:
        """Return the coefficients, and up to order 2 the matrices of eq. 4.15, for JSON."""
        is_polynomial = self.order_f <= POLYNOMIAL_ORDER
        return {
            "lighting_coefficients": self.coefficients.tolist(),
            "irradiance_matrices": self.matrices().tolist() if is_polynomial else None,
        }

    def matrices(self) -> Array:
        """Return the matrix M of each channel, shape (3, 4, 4).

        ``E = (x y z 1) M (x y z 1)^T`` for a unit normal (eq. 4.14, 4.15).

        Raises MapError if the map's order is above 2, where E is not a quadratic polynomial.
        """
        c1, c2, c3, c4, c5 = matrix_constants()
        l00, l1_1, l10, l11, l2_2, l2_1, l20, l21, l22 = self.nine()
        rows = [
            [c1 * l22, c1 * l2_2, c1 * l21, c2 * l11],
            [c1 * l2_2, -c1 * l22, c1 * l2_1, c2 * l1_1],
            [c1 * l21, c1 * l2_1, c3 * l20, c2 * l10],
            [c2 * l11, c2 * l1_1, c2 * l10, c4 * l00 - c5 * l20],
        ]
        return np.moveaxis(np.array(rows), -1, 0)

    def nine(self) -> Array:
        """Return nine coefficients, shape (9, 3); those beyond the map's order are 0."""
        if self.order_f > POLYNOMIAL_ORDER:
            raise MapError(
                f"an irradiance map of order F = {self.order_f} is no quadratic polynomial of the "
                "normal; matrices need `order_f` 2 or less"
            )
        result = np.zeros(((POLYNOMIAL_ORDER + 1) ** 2, 3))
        result[: len(self.coefficients)] = self.coefficients
        return result

    def minimum(self) -> float:
        """Return the least irradiance of any normal and channel."""
        return float(lowest(self.series)[1].min())

    @cached_property
    def series(self) -> Array:
        """The coefficients of the irradiance, ``E_lm = A_l L_lm`` (eq. 4.8), shape ((F+1)^2, 3)."""
        factors = lambert_factors(self.order_f)[degrees(self.order_f)]
        return factors[:, None] * self.coefficients
