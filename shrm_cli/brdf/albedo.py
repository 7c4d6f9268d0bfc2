"""The directional albedo of a BRDF, by quadrature about the mirror direction."""

from collections.abc import Callable, Sequence

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.sums import weighted_terms
from shrm_cli.sphere.directions import from_angles, tilted_frame
from shrm_cli.sphere.quadrature import gauss_legendre

ACCURACY = 1e-3
"""The relative change of an albedo that counts as settled."""

_COUNTS = (48, 96, 192, 384)  # nodes of each angle, tried until the albedo settles
_SAMPLES_AT_ONCE = 2**17
_HORIZON = 3.0
"""The width of the step in what the hemisphere's border is, as the mirror direction grazes, in
tangents of its height: azimuths are dense there."""

_Rule = Callable[[float, int, slice], tuple[Array, Array]]


def directional_albedo(brdf: Brdf, theta: float) -> Array:
    """Integrate rho_hat over all directions of the light, for a view at an angle.

    The samples lie on polar coordinates about the mirror direction, are dense near it, and end at
    the horizon of a BRDF that has one. Their number is doubled in both coordinates until the result
    changes by `ACCURACY` at most, or there are 384 x 384.

    `theta` is the angle of the view from the z axis, radians. Returns an array of shape (3,):
    linear RGB.
    """
    ends = all(cuts_horizon(term) for _, term in weighted_terms(brdf))
    rule = hemisphere_rule if ends else _sphere_rule
    return settled(lambda count: sampled_albedo(brdf, theta, rule, count))


def settled(
    sample: Callable[[int], Array], accuracy: float = ACCURACY, counts: Sequence[int] = _COUNTS
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
