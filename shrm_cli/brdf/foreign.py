"""Checks of BRDFs whose code is not of `shrm`: of packages, of files of the user, and of scripts.

Each mistake is one clear line before any work begins. Statements of a class that are wrong would
otherwise give maps that are, without a word.
"""

import warnings
from collections.abc import Mapping
from functools import cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Value, check_finite
from shrm_cli.errors import BrdfError, ShrmWarning
from shrm_cli.messages import explained
from shrm_cli.sphere.directions import from_angles, reflect, tilted_frame, turned

# They lie along the normal, slanting, grazing, opposite each other, and below the surface.
_DIRECTIONS = np.array(
    [[0, 0, 1], [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.96, 0.28], [1, 0, 0], [0.6, 0, -0.8]]
)
_TURNS = 0.9, 2.3, 4.1
"""Angles that pairs are turned by, radians: no symmetry of a brush or of a weave maps them."""
_APART = 1e-3
"""How far values may differ that are to be the same, as a part of the largest of all."""
_SLIGHT = 1e-6
"""A turn, radians, which shows how much rounding changes: in single precision sharp lobes differ by
more than that. It may be in single precision within a class, whatever it returns."""
_ROUNDING = 8
"""How often what a slight turn changes may be in what another does."""
_NEGATIVE = 1e-6
"""The part of the largest value that rounding may make negative."""
_COUNT = 64
"""How many pairs of light and view are independent; as many others are near the mirror."""
_LOWEST = 0.1
"""The least cosine of the angle of a pair's light, and of its view."""
_STEPS = np.concatenate([np.geomspace(0.003, 1.5, 12), [1.7, 2.6]])
"""Angles from the center at which a zonal BRDF is compared with itself; radians."""


def make_checked(model: type[Brdf], values: Mapping[str, Value], where: str) -> Brdf:
    """Make an instance of a foreign model, and check it."""
    try:
        brdf = model(**values)
    except BrdfError:
        raise
    except (Exception, SystemExit) as error:
        raise BrdfError(f"{where} cannot be made: {explained(error)}") from error
    check_instance(brdf, where)
    return brdf


def check_instance(brdf: Brdf, where: str) -> None:
    """Evaluate a BRDF at some directions, and compare it with what its class states; once.

    `where` is what messages call it: ``mine.py: Mine``. It warns of values that are negative.
    """
    if vars(brdf).get("_is_checked"):
        return
    if not isinstance(getattr(brdf, "values", None), dict):
        raise BrdfError(f"{where} has an __init__ that lacks super().__init__(**values)")
    for directions in (_DIRECTIONS, _DIRECTIONS.astype(np.float32)):
        _evaluated(brdf, directions[:, None], directions, where)
        _evaluated(brdf, directions, directions[1], where)
    light, view = _pairs(brdf.center == "tangent")
    values = _evaluated(brdf, light, view, where)
    _check_range(values, where)
    if brdf.isotropic:
        _check_isotropic(brdf, light, view, values, where)
    if brdf.zonal:
        _check_zonal(brdf, where)
    vars(brdf)["_is_checked"] = True


def _evaluated(brdf: Brdf, light: Array, view: Array, where: str) -> Array:
    """Evaluate a BRDF, and check the kind and the shape of what it returns."""
    try:
        with np.errstate(all="ignore"):  # what is not finite is found where it matters
            # Copies, since it may write into what it gets.
            value: object = brdf.evaluate(light.copy(), view.copy())
    except Exception as error:
        cause = error.__cause__ if isinstance(error.__cause__, SystemExit) else error
        raise BrdfError(f"{where} cannot be evaluated: {explained(cause)}") from error
    expected = np.broadcast_shapes(light.shape, view.shape)
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f":
        kind = f"{value.dtype} numbers" if isinstance(value, np.ndarray) else f"{value!r:.40}"
        raise BrdfError(f"{where}: evaluate() returns {kind}, not an array of floats")
    if value.shape != expected:
        raise BrdfError(
            f"{where}: evaluate() returns the shape {value.shape} for light {light.shape} and "
            f"view {view.shape}; it must be {expected}"
        )
    return value


@cache
def _pairs(is_fibre: bool) -> tuple[Array, Array]:
    """Light and view, shape (n, 3): above a surface, or anywhere around a fibre.

    Half of them lie near the mirror direction at distances of all sizes, where sharp lobes do.
    """
    rng = np.random.default_rng(7)
    lowest = -1.0 if is_fibre else _LOWEST
    cosines, azimuths = rng.uniform(lowest, 1, (2, _COUNT)), rng.uniform(0, 2 * np.pi, (2, _COUNT))
    light, view = from_angles(np.arccos(cosines), azimuths)
    tilts = np.geomspace(1e-3, 0.6, _COUNT)
    half = from_angles(tilts, rng.uniform(0, 2 * np.pi, _COUNT))
    light, view = np.concatenate([light, reflect(view, half)]), np.concatenate([view, view])
    kept = light[:, 2] >= lowest
    return light[kept], view[kept]


def _check_range(values: Array, where: str) -> None:
    """Refuse values that are not finite or wholly negative; warn of those that partly are."""
    check_finite(values, where)
    least, most = values.min(axis=0), float(values.max())
    if most <= 0 and least.min() < 0:
        raise BrdfError(f"{where}: its value is negative; a BRDF is 0 at least")
    if least.min() < -_NEGATIVE * most:
        channel = int(least.argmin())
        of = "" if (least == least[0]).all() else f" in {('red', 'green', 'blue')[channel]}"
        warnings.warn(
            f"{where}: its value is negative in places, {least[channel]:.3g}{of}; no surface "
            "reflects less than nothing",
            ShrmWarning,
            stacklevel=2,
        )


def _check_isotropic(brdf: Brdf, light: Array, view: Array, values: Array, where: str) -> None:
    """Compare pairs with the same pairs turned together about the normal."""
    slight, *others = (
        _evaluated(brdf, turned(light, turn), turned(view, turn), where)
        for turn in (_SLIGHT, *_TURNS)
    )
    if any(_differ(values, each, values - slight) for each in others):
        about = "tangent" if brdf.center == "tangent" else "normal"
        raise BrdfError(
            f"{where}: it changes where light and view are turned together about the {about}, "
            "so that it is anisotropic; write `isotropic = False` into the class"
        )


def _check_zonal(brdf: Brdf, where: str) -> None:
    """Compare what is reflected at equal angles to the center, for other views and azimuths."""
    rows: list[Array] = []
    slight: list[Array] = []
    for theta, turn in ((0.1, 0.5), (0.6, 2.0), (1.4, 4.4)):
        tilt = np.asarray(theta if brdf.center == "reflection" else 0.0)
        for azimuth in (0.3, 2.2, 3.0):
            # The normal leans from the mirror direction towards the view.
            light = tilted_frame(from_angles(_STEPS, azimuth), tilt)
            view = from_angles(theta, 0.0)
            for found, angle in ((rows, turn), (slight, turn + _SLIGHT)):
                with np.errstate(all="ignore"):
                    found.append(brdf.transfer(turned(light, angle), turned(view, angle)))
    values = np.array(rows)
    alike = np.where((_STEPS[:, None] < np.pi / 2), values[0], 0)
    if _differ(values, np.broadcast_to(alike, values.shape), values - np.array(slight)):
        raise BrdfError(
            f"{where}: it depends on more than the angle between center and light, or goes on "
            "beyond 90 degrees; leave `zonal = True` out of the class"
        )


def _differ(values: Array, others: Array, rounding: Array) -> bool:
    """Whether values differ that are to be the same, by more than rounding does."""
    allowed = _APART * np.abs([values, others]).max() + _ROUNDING * np.abs(rounding).max()
    return bool(np.abs(values - others).max() > allowed)
