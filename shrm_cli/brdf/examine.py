"""Properties of a BRDF: its values, its albedo, and whether a real surface could have it."""

import numpy as np

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.brdf.albedo import ACCURACY, directional_albedo
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.messages import whole_number
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, normalize, reflect

ANGLES = (0, 15, 30, 45, 60, 75)
"""The angles of the view, in degrees, at which albedos are reported."""

_GRAZING = (80, 85, 88)  # more angles of the view, at which a gain of energy is looked for
_STEEPEST = np.radians(80)  # the largest angle from the normal of the random pairs
_PAIRS = 2**15
_NARROWEST = 1e-3  # radians from the half vector to the normal, least of the pairs near the mirror


@record(eq=False)
class Examination:
    """What `examine` finds; arrays of three are linear RGB."""

    smallest: Array
    largest: Array
    """`smallest` and `largest`: the range of f_r (1/sr) over light and view up to 80 degrees from
    the normal, shape (3,). For a BRDF about the tangent it is the range of rho_hat over all
    directions."""
    albedo: Array
    """The integral of rho_hat over the light, for views at `ANGLES` from the normal, or from the
    tangent, shape (6, 3). A reciprocal BRDF reflects that fraction of the light from there."""
    furnace_albedo: float
    furnace_angle: float
    """`furnace_albedo` and `furnace_angle`: the largest albedo of any channel at angles up to 88
    degrees, and that angle in degrees. If it is above 1, the surface glows in a white furnace."""
    reciprocity_error: float
    """The root mean square of f(L, V) - f(V, L) relative to that of f, over random pairs, half of
    which are near the mirror direction. It is 0 for real surfaces."""

    @property
    def gains_energy(self) -> bool:
        """Whether the BRDF reflects more light than arrives, by more than sampling could err."""
        return self.furnace_albedo > 1 + 2 * ACCURACY


def examine(brdf: AnyBrdf, seed: int = 0) -> Examination:
    """Sample a BRDF, and summarize what it does.

    Parameters
    ----------
    brdf : Brdf, str or path-like
        Albedos of an anisotropic one are those of views in the plane of x and z.
    seed : int
        Of the random pairs of directions; the same seed gives the same result.

    Raises
    ------
    BrdfError
        If the BRDF cannot be read, or its value is not finite everywhere.

    Examples
    --------
    >>> shrm.examine("lambertian").gains_energy
    False
    """
    brdf = as_brdf(brdf)
    light, view = _random_pairs(brdf, np.random.default_rng(whole_number("seed", seed, 0, 2**63)))
    there, back = _values(brdf, light, view), _values(brdf, view, light)
    mirrored = _values(brdf, reflect(view, np.array([0.0, 0.0, 1.0])), view)
    everything = np.concatenate([there, back, mirrored])
    check_finite(everything, brdf)
    size = np.mean(there**2 + back**2) / 2
    error = relative_rms(np.mean((there - back) ** 2), size)
    angles = ANGLES + _GRAZING
    albedos = np.stack([directional_albedo(brdf, np.radians(angle)) for angle in angles])
    check_finite(albedos, brdf)
    most = int(np.argmax(albedos.max(axis=1)))
    return Examination(
        everything.min(axis=0), everything.max(axis=0), albedos[: len(ANGLES)],
        float(albedos[most].max()), float(angles[most]), error,
    )  # fmt: skip


def difference(one: Brdf, other: Brdf, seed: int = 0) -> float:
    """Relative RMS difference of the transfer functions of two BRDFs over random directions.

    Light and view are up to 80 degrees from the normal, and half of the pairs lie near the mirror
    direction. The difference is relative to the root mean square of the first BRDF.
    """
    light, view = _random_pairs(one, np.random.default_rng(seed))
    first, second = (np.asarray(brdf.transfer(light, view), dtype=float) for brdf in (one, other))
    return relative_rms(np.mean((first - second) ** 2), np.mean(first**2))


def _random_pairs(brdf: Brdf, rng: "np.random.Generator") -> tuple[Array, Array]:
    """Light and view, shape (n, 3). Half of the pairs are independent, half near the mirror."""
    if brdf.center == "tangent":
        directions = normalize(rng.normal(size=(2, _PAIRS, 3)))
        return directions[0], directions[1]
    lowest = np.cos(_STEEPEST)
    turns = rng.uniform(0, 2 * np.pi, (2, _PAIRS))
    light, view = from_angles(np.arccos(rng.uniform(lowest, 1, (2, _PAIRS))), turns)
    tilt = np.exp(rng.uniform(np.log(_NARROWEST), np.log(np.pi / 2), _PAIRS))
    half = from_angles(tilt, rng.uniform(0, 2 * np.pi, _PAIRS))
    light = np.concatenate([light, reflect(view, half)])
    view = np.concatenate([view, view])
    above = light[:, 2] >= lowest
    return light[above], view[above]


def _values(brdf: Brdf, light: Array, view: Array) -> Array:
    """Values (n, 3) of f_r, also if the model includes the cosine; of rho_hat about a tangent."""
    value = np.asarray(brdf.evaluate(light, view), dtype=float)
    if brdf.includes_cosine and brdf.center != "tangent":
        return value / light[:, 2:]
    return value
