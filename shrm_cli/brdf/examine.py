"""Properties of a BRDF: its values, its albedo, and whether a real surface could have it."""

from collections.abc import Callable, Sequence

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.sums import weighted_terms
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, normalize, reflect, tilted_frame
from shrm_cli.sphere.quadrature import gauss_legendre

ANGLES = (0, 15, 30, 45, 60, 75)
"""The angles of the view, in degrees, at which albedos are reported."""

_GRAZING = (80, 85, 88)  # more angles of the view, at which a gain of energy is looked for
_STEEPEST = np.radians(80)  # the largest angle from the normal of the random pairs
_PAIRS = 2**15
_NARROWEST = 1e-3  # radians from the half vector to the normal, least of the pairs near the mirror
_COUNTS = (48, 96, 192, 384)  # nodes of each angle, tried until the albedo settles
_ACCURACY = 1e-3  # the relative change of an albedo that counts as settled
_SAMPLES_AT_ONCE = 2**17
_HORIZON = 3.0
"""The width of the step in what the hemisphere's border is, as the mirror direction grazes, in
tangents of its height: azimuths are dense there."""

_Rule = Callable[[float, int, slice], tuple[Array, Array]]


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
        return self.furnace_albedo > 1 + 2 * _ACCURACY


def examine(brdf: Brdf, seed: int = 0) -> Examination:
    """Sample a BRDF, and summarize what it does.

    Parameters
    ----------
    brdf : Brdf
        Albedos of an anisotropic one are those of views in the plane of x and z.
    seed : int
        Of the random pairs of directions; the same seed gives the same result.

    Examples
    --------
    >>> shrm.examine(shrm.parse_spec("lambertian")).gains_energy
    False
    """
    light, view = _random_pairs(brdf, np.random.default_rng(seed))
    there, back = _values(brdf, light, view), _values(brdf, view, light)
    mirrored = _values(brdf, reflect(view, np.array([0.0, 0.0, 1.0])), view)
    everything = np.concatenate([there, back, mirrored])
    size = np.mean(there**2 + back**2) / 2
    error = np.sqrt(np.mean((there - back) ** 2) / size) if size > 0 else 0.0
    angles = ANGLES + _GRAZING
    albedos = np.stack([directional_albedo(brdf, np.radians(angle)) for angle in angles])
    most = int(np.argmax(albedos.max(axis=1)))
    return Examination(
        everything.min(axis=0), everything.max(axis=0), albedos[: len(ANGLES)],
        float(albedos[most].max()), float(angles[most]), float(error),
    )  # fmt: skip


def difference(one: Brdf, other: Brdf, seed: int = 0) -> float:
    """Relative RMS difference of the transfer functions of two BRDFs over random directions.

    Light and view are up to 80 degrees from the normal, and half of the pairs lie near the mirror
    direction. The difference is relative to the root mean square of the first BRDF.
    """
    light, view = _random_pairs(one, np.random.default_rng(seed))
    first, second = (np.asarray(brdf.transfer(light, view), dtype=float) for brdf in (one, other))
    size = np.mean(first**2)
    return float(np.sqrt(np.mean((first - second) ** 2) / size)) if size > 0 else 0.0


def directional_albedo(brdf: Brdf, theta: float) -> Array:
    """Integrate rho_hat over all directions of the light, for a view at an angle.

    The samples lie on polar coordinates about the mirror direction, are dense near it, and end at
    the horizon of a BRDF that has one. Their number is doubled in both coordinates until the result
    changes by `_ACCURACY` at most, or there are 384 x 384.

    `theta` is the angle of the view from the z axis, radians. Returns an array of shape (3,):
    linear RGB.
    """
    ends = all(cuts_horizon(term) for _, term in weighted_terms(brdf))
    rule = hemisphere_rule if ends else _sphere_rule
    return settled(lambda count: sampled_albedo(brdf, theta, rule, count))


def settled(
    sample: Callable[[int], Array], accuracy: float = _ACCURACY, counts: Sequence[int] = _COUNTS
) -> Array:
    """Sample something with more and more nodes, until its sum changes by an accuracy at most.

    `sample` takes a number of nodes of each angle, and returns what is found, shape (..., 3).
    `accuracy` is relative. `counts` are the numbers of nodes that are tried.
    """
    previous = np.full(3, np.inf)
    for count in counts:
        found = sample(count)
        current = found.reshape(-1, 3).sum(axis=0)
        if np.abs(current - previous).max() <= accuracy * current.max():
            break
        previous = current
    return found


def sampled_albedo(brdf: Brdf, theta: float, rule: _Rule, count: int) -> Array:
    """`directional_albedo` by a rule with `count` nodes of each angle."""
    view = from_angles(theta, 0.0)
    total = np.zeros(3)
    is_whole = rule is _sphere_rule or brdf.isotropic
    for rows in slices(count, _SAMPLES_AT_ONCE // count):
        light, weights = rule(theta, count, rows)
        if is_whole:
            total += np.einsum("tp,tpc->c", weights, brdf.transfer(light, view))
            continue
        for side in (1, -1):
            values = brdf.transfer(light * np.array([1, side, 1]), view)
            total += np.einsum("tp,tpc->c", weights / 2, values)
    return total


def hemisphere_rule(theta: float, count: int, block: slice = slice(None)) -> tuple[Array, Array]:
    """Directions over the horizon and weights, about the mirror direction of a view at an angle.

    They lie on one side of the plane of the view, and count for both sides: a lobe is its own
    mirror image. Angles from the mirror direction are squares of Gauss's nodes, and end at the
    horizon, so that all that is integrated is smooth.

    `theta` is the angle of the view from the z axis, radians; its azimuth is 0. `count` is that of
    the angles from the mirror direction, and of the azimuths about it. `block` holds the angles
    from the mirror direction to take.

    Returns `light` of shape (n, count, 3) and `weights` of shape (n, count).
    """
    nodes, weights = gauss_legendre(count)
    cosine, sine = np.cos(theta), np.sin(theta)
    width = min(_HORIZON * cosine / max(sine, 1e-9), 2 * np.pi)
    end = np.arcsinh(np.pi / 2 / width)
    azimuths = np.pi / 2 + width * np.sinh(end * nodes)
    around = 2 * weights * end * width * np.cosh(end * nodes)
    horizon = np.arctan2(cosine, -sine * np.cos(azimuths))
    part = (nodes[block, None] + 1) / 2
    angles = horizon * part**2
    light = tilted_frame(from_angles(angles, azimuths), np.asarray(theta))
    return light, around * weights[block, None] * part * horizon * np.sin(angles)


def _sphere_rule(theta: float, count: int, block: slice) -> tuple[Array, Array]:
    """Directions and weights as of `hemisphere_rule`, over the whole sphere."""
    nodes, weights = gauss_legendre(count)
    # The angles from the mirror direction are squares of equal steps, so dense near it that a lobe
    # a third of a degree wide has nodes enough.
    u = (nodes[block, None] + 1) / 2
    from_mirror = np.pi * u**2
    step = 2 * np.pi / count
    weights = weights[block, None] * np.pi * u * np.sin(from_mirror) * step
    around_mirror = from_angles(from_mirror, (np.arange(count) + 0.5) * step)
    light = tilted_frame(around_mirror, np.asarray(theta))
    return light, np.broadcast_to(weights, light.shape[:-1])


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
