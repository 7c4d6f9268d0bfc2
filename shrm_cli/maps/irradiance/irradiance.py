"""The irradiance map: a few lighting coefficients, and the irradiance E(N) that they make.

Equations 4.x are those of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for
Forward and Inverse Rendering" (2002).
"""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, relative_difference
from shrm_cli.color import luminance_weights
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.window import Window
from shrm_cli.maps.kinds import FixedMap, HarmonicLight, ReflectionMap
from shrm_cli.maps.size import choose_size
from shrm_cli.records import record
from shrm_cli.sphere.directions import as_directions
from shrm_cli.sphere.extremes import lowest, series_values
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import Sampling

POLYNOMIAL_ORDER = 2
"""The largest order at which E is a quadratic polynomial of the normal (eq. 4.14 to 4.16)."""


def lambert_factors(order: int) -> Array:
    """Return the factors A_l of the clamped cosine, ``E_lm = A_l L_lm``, shape (order+1,).

    They are pi, 2 pi / 3, pi / 4, 0, -pi / 24, ...

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
    """Return ``A_l^2 sum_m L_lm^2``; their sum is the integral of E^2, shape (order+1, 3)."""
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
    against_negatives = "take `window` auto"

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
        (normals,) = as_directions(normals=normals)
        values = series_values(self.series, normals.reshape(-1, 3))
        return values.reshape(normals.shape)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return the radiance E / pi of a white Lambertian surface, whatever the views are."""
        normals, views = as_directions(normals=normals, views=views)
        shape = np.broadcast_shapes(normals.shape, views.shape)
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
        """Return the same coefficients with the size and the sampling of another cube."""
        (cube,) = planes
        return replace(self, size=cube.shape[1], sampling=sampling, info=info)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> "Irradiance":
        """Return the map with another size or sampling; the coefficients make its cube anew."""
        size, sampling = self._asked(size, sampling)
        return replace(self, size=size, sampling=sampling)

    def windowed(self, window: Window, info: MapInfo) -> "Irradiance":
        """Return the map, which has no window yet, with its degrees times a window's factors."""
        windowed = window.apply(self.coefficients)
        return replace(self, coefficients=windowed, info=info, window=window)

    def mixed(self, matrix: Array, info: MapInfo) -> "Irradiance":
        return replace(self, coefficients=self.coefficients @ matrix.T, info=info)

    def turned(self, matrix: ArrayLike) -> "Irradiance":
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


# ---- five numbers a channel: linear harmonics and one zonal harmonic of degree 2 -----------------
# Light that comes from one side mostly has a degree 2 that is nearly zonal about the direction of
# its degree 1. ZH3 keeps of its five coefficients the one of that zonal harmonic:
#
#     L(d) = L00 Y00 + L1 . d sqrt(3 / 4 pi) + z sqrt(5 / 16 pi) (3 (a . d)^2 - 1)
#
# a is the axis, the direction of the degree 1 of the luminance, and z is a channel's zonal
# coefficient, the projection of its degree 2. The forms are
#
# zh3
#     The axis is shared by the channels: it follows from the linear coefficients.
# zh3-channel
#     Each channel has the direction of its own degree 1 as axis.
# zh3-hallucinated
#     z is guessed from the linear coefficients, which then are all that a reader needs:
#     z = L00 r (0.08 + 0.6 r), with r the part of the channel's degree 1 along the shared axis,
#     divided by L00.
#
# References: Roughton, Sloan, Silvennoinen, Iwanicki and Shirley 2024, ZH3: Quadratic Zonal
# Harmonics.


FORMS = ("zh3", "zh3-channel", "zh3-hallucinated")
"""The forms with a zonal degree 2."""
_LINEAR, _QUADRATIC = slice(1, 4), slice(4, 9)
_TO_XYZ = [2, 0, 1]
"""Degree 1 is stored as y, z, x."""
_LEAST = 1e-6
"""The least degree 1, beside degree 0, that has a direction; weaker ones get no degree 2."""


@record(eq=False)
class Zh3(Irradiance):
    """An irradiance map whose degree 2 is zonal; `coefficients` hold it as five numbers too."""

    form: str = "zh3"
    """See the module. One of "zh3", "zh3-channel" and "zh3-hallucinated"."""
    axes: Array = field(default_factory=lambda: np.tile([0.0, 0.0, 1.0], (3, 1)))
    """The unit axis of each channel in world axes, a row each, shape (3, 3)."""
    zonal: Array = field(default_factory=lambda: np.zeros(3))
    """The zonal coefficient z of each channel, shape (3,)."""

    def windowed(self, window: Window, info: MapInfo) -> "Zh3":
        """Return the map with a window, unless its zonal coefficients follow from the others."""
        if not self.takes_windows:
            raise MapError("`window` does not apply to `form` zh3-hallucinated; take `form` zh3")
        made = super().windowed(window, info)
        return replace(made, zonal=self.zonal * window.factors[2])  # type: ignore[return-value,call-arg]

    def turned(self, matrix: ArrayLike) -> "Zh3":
        return replace(super().turned(matrix), axes=self.axes @ np.asarray(matrix).T)  # type: ignore[return-value,call-arg]

    def mixed(self, matrix: Array, info: MapInfo) -> "Zh3":
        """Return the map with other channels, unless these have axes of their own."""
        if self.form == "zh3-channel":
            raise MapError(
                f"{self.what} and `form` zh3-channel has an axis for each channel, which cannot be "
                "mixed; convert it to `form` sh, or prefilter its probe with `working`"
            )
        made = super().mixed(matrix, info)
        # What was guessed in the old primaries is no guess in the new ones.
        return replace(made, form="zh3", zonal=matrix @ self.zonal)  # type: ignore[return-value,call-arg]

    def summary(self) -> dict[str, Any]:
        count = 5 if self.takes_windows else 4  # numbers that a reader needs of each channel
        return {**super().summary(), "form": self.form, "coefficients": count}

    @property
    def takes_windows(self) -> bool:
        """Whether degree 2 is a number of its own, which a window can damp, and no guess."""
        return self.form != "zh3-hallucinated"

    def numbers(self) -> dict[str, Any]:
        """Return what `Irradiance.numbers` does, and the axes and zonal coefficients, for JSON."""
        own = {"axes": self.axes.tolist(), "zonal": self.zonal.tolist()}
        return {**super().numbers(), "zh3": own}


def in_form(source: Irradiance, form: str) -> Irradiance:
    """Return an irradiance map in another form.

    `form` is one of `FORMS`; ``sh`` keeps all coefficients, those of a ZH3 too.

    The `added_error` of the result includes the relative RMS change of the irradiance.
    """
    plain = Irradiance(
        source.coefficients, source.info, source.size, source.sampling, source.window
    )
    if form == "sh":
        return plain
    if source.order_f != 2:
        raise MapError(f"`form` {form} is made of order F = 2, not {source.order_f}")
    if form == "zh3-hallucinated" and source.window.factors:
        raise MapError(
            "its `window` has damped what `form` zh3-hallucinated guesses from; take `form` zh3, "
            "or prefilter the probe in this form"
        )
    coefficients = source.coefficients
    vectors = coefficients[_LINEAR][_TO_XYZ].T
    if form == "zh3-channel":
        axes = np.array([_direction(*each) for each in zip(vectors, coefficients[0], strict=True)])
    else:
        weights = luminance_weights(source.info.chromaticities)
        axes = np.tile(_direction(weights @ vectors, weights @ coefficients[0]), (3, 1))
    if form == "zh3-hallucinated":
        mean, along = coefficients[0], np.abs(np.sum(axes * vectors, axis=1))
        ratio = np.divide(along, mean, out=np.zeros(3), where=mean > 0)
        zonal = mean * ratio * (0.08 + 0.6 * ratio)
    else:
        zonal = np.einsum("cm,mc->c", zonal_harmonics(axes), coefficients[_QUADRATIC])
    made = np.concatenate([coefficients[:4], (zonal[:, None] * zonal_harmonics(axes)).T])
    change = relative_difference(replace(plain, coefficients=made).series, plain.series)
    info = with_change(source.info, change)
    return Zh3(made, info, source.size, source.sampling, source.window, form, axes, zonal)


def with_change(info: MapInfo, change: float) -> MapInfo:
    """Return the record of irradiance that was changed by a part of the degrees that it has.

    Its errors are relative to the irradiance of all degrees.
    """
    kept = math.sqrt(max(1 - info.predicted_error**2, 0.0))
    return replace(info, added_error=math.hypot(info.added_error, kept * change))


def zonal_harmonics(axes: Array) -> Array:
    """Return the coefficients of unit zonal harmonics of degree 2 about axes, shape (n, 5)."""
    is_axis = np.any(axes != 0, axis=-1, keepdims=True)
    return np.where(is_axis, np.sqrt(4 * np.pi / 5) * real_harmonics(2, axes, first=2), 0.0)


def form_errors(plain: Irradiance, made: Irradiance) -> dict[str, float]:
    """Return what a form costs beside what other numbers of coefficients cost.

    `plain` and `made` are those of all nine coefficients, and in the form; both without a window.

    Returns ``four``, ``nine`` and ``form``: relative RMS errors of the irradiance over all normals
    and channels, of the light's four and nine coefficients and of the form; and ``kept``, the part
    that the form keeps of what nine coefficients bring, as a share of the squared error.
    """
    missing = plain.info.predicted_error
    known = 1 - missing**2
    linear = replace(plain, coefficients=np.where(np.arange(9)[:, None] < 4, plain.coefficients, 0))
    # By Parseval, the series differ by as much as the irradiances.
    lost, change = (relative_difference(each.series, plain.series) for each in (linear, made))
    return {
        "four": float(np.sqrt(missing**2 + known * lost**2)),
        "nine": float(missing),
        "form": float(np.sqrt(missing**2 + known * change**2)),
        "kept": float(1 - (change / lost) ** 2) if lost > 0 else 1.0,
    }


def _direction(vector: Array, mean: float) -> Array:
    """Return the direction of a degree 1; 0 where it is next to nothing."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > _LEAST * abs(mean) else np.zeros(3)
