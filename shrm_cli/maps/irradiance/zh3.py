"""Irradiance of five numbers a channel: linear harmonics and one zonal harmonic of degree 2.

Light that comes from one side mostly has a degree 2 that is nearly zonal about the direction of its
degree 1. ZH3 keeps of the five coefficients of degree 2 the one of that zonal harmonic::

    L(d) = L00 Y00 + L1 . d sqrt(3 / 4 pi) + z sqrt(5 / 16 pi) (3 (a . d)^2 - 1)

a is the axis, the direction of the degree 1 of the luminance, and z is a channel's zonal
coefficient, the projection of its degree 2. The forms are

``zh3``
    The axis is shared by the channels: it follows from the linear coefficients.
``zh3-channel``
    Each channel has the direction of its own degree 1 as axis.
``zh3-hallucinated``
    z is guessed from the linear coefficients, which then are all that a reader needs:
    ``z = L00 r (0.08 + 0.6 r)``, with r the part of the channel's degree 1 along the shared axis,
    divided by L00.

References: Roughton, Sloan, Silvennoinen, Iwanicki and Shirley 2024, ZH3: Quadratic Zonal
Harmonics.
"""

import math
from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import luminance_weights
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.irradiance.window import Window
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import real_harmonics

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
        return {**super().summary(), "form": self.form, "coefficients": self.numbers_each}

    @property
    def takes_windows(self) -> bool:
        """Whether degree 2 is a number of its own, which a window can damp, and no guess."""
        return self.form != "zh3-hallucinated"

    @property
    def numbers_each(self) -> int:
        """The numbers that a reader needs of each channel."""
        return 5 if self.takes_windows else 4

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
        zonal = _guess(coefficients[0], np.abs(np.sum(axes * vectors, axis=1)))
    else:
        zonal = np.einsum("cm,mc->c", zonal_harmonics(axes), coefficients[_QUADRATIC])
    made = np.concatenate([coefficients[:4], (zonal[:, None] * zonal_harmonics(axes)).T])
    change = _change(plain, replace(plain, coefficients=made))
    info = with_change(source.info, change)
    return Zh3(
        made, info, source.size, source.sampling, source.window, form, axes, zonal
    )  # fmt: skip


def with_change(info: MapInfo, change: float) -> MapInfo:
    """Return the record of irradiance that was changed by a part of the degrees that it has.

    Its errors are relative to the irradiance of all degrees.
    """
    kept = math.sqrt(max(1 - info.predicted_error**2, 0.0))
    return replace(info, added_error=math.hypot(info.added_error, kept * change))


def zonal_harmonics(axes: Array) -> Array:
    """Return the coefficients of unit zonal harmonics of degree 2 about axes, shape (n, 5).

    An axis that is 0 has none.
    """
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
    lost, change = (_change(plain, each) for each in (linear, made))
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


def _guess(mean: Array, along: Array) -> Array:
    """Return the zonal coefficients that linear ones suggest, shape (3,)."""
    ratio = np.divide(along, mean, out=np.zeros(3), where=mean > 0)
    return np.asarray(mean * ratio * (0.08 + 0.6 * ratio))


def _change(one: Irradiance, other: Irradiance) -> float:
    """Return the relative RMS difference of two irradiances, by Parseval."""
    whole = float(np.sum(one.series**2))
    difference = float(np.sum((other.series - one.series) ** 2))
    return float(np.sqrt(difference / whole)) if whole > 0 else 0.0
