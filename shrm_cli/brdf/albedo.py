"""The directional albedo of a BRDF, by quadrature about the mirror direction."""

from collections.abc import Callable, Sequence
from functools import partial

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
_VIEWS_AT_ONCE = 2**15
"""The samples up to which several views are evaluated together, so that they stay in the
processor's cache: one by one, most of the time would go into calls for a thousand samples."""
_HORIZON = 3.0
"""The width of the step in what the hemisphere's border is, as the mirror direction grazes, in
tangents of its height: azimuths are dense there."""

_Rule = Callable[[Array, int, slice], tuple[Array, Array]]


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
    return settled(partial(sampled_albedos, brdf, rule), np.array([theta]))[0]


def settled(
    sample: Callable[[Array, int], Array],
    angles: Array,
    accuracy: float = ACCURACY,
    counts: Sequence[int] = _COUNTS,
) -> Array:
    """Sample something for views with more and more nodes, until its sum changes by an accuracy.

    `sample` takes angles of views from the z axis, (k,), and a number of nodes of each angle, and
    returns what is found, shape (k, ..., 3). `angles`, of shape (n,), are those of all views, each
    of which settles for itself. `accuracy` is relative. `counts` are the numbers of nodes that are
    tried.

    Returns an array of shape (n, ..., 3).
    """
    found, rows, previous = None, np.arange(len(angles)), np.full((len(angles), 3), np.inf)
    for count in counts:
        parts = slices(len(rows), _VIEWS_AT_ONCE // count**2)
        made = np.concatenate([sample(angles[rows[part]], count) for part in parts])
        found = made if found is None else found
        found[rows] = made
        current = made.reshape(len(made), -1, 3).sum(axis=1)
        is_left = np.abs(current - previous).max(axis=1) > accuracy * current.max(axis=1)
        rows, previous = rows[is_left], current[is_left]
        if not rows.size:
            break
    assert found is not None
    return found


def sampled_albedos(brdf: Brdf, rule: _Rule, angles: Array, count: int) -> Array:
    """`directional_albedo` of views at angles (k,), by a rule with `count` nodes, shape (k, 3)."""
    views = from_angles(angles, 0.0)[:, None, None]
    total = np.zeros((len(angles), 3))
    is_whole = rule is _sphere_rule or brdf.isotropic
    sides = [(1, 1, 1)] if is_whole else [(1, 1, 1), (1, -1, 1)]
    for nodes in slices(count, _SAMPLES_AT_ONCE // count):
        light, weights = rule(angles, count, nodes)
        for side in sides:
            values = brdf.transfer(light * np.array(side), views)
            for row, each in enumerate(values):
                total[row] += np.einsum("tp,tpc->c", weights[row] / len(sides), each)
    return total


def hemisphere_rule(angles: Array, count: int, block: slice = slice(None)) -> tuple[Array, Array]:
    """Directions over the horizon and weights, about the mirror directions of views at angles.

    They lie on one side of the plane of the view, and count for both sides: a lobe is its own
    mirror image. Angles from the mirror direction are squares of Gauss's nodes, and end at the
    horizon, so that all that is integrated is smooth.

    `angles`, of shape (k,), are those of the views from the z axis, radians; their azimuth is 0.
    `count` is that of the angles from the mirror direction, and of the azimuths about it. `block`
    holds the angles from the mirror direction to take.

    Returns `light` of shape (k, n, count, 3) and `weights` of shape (k, n, count).
    """
    nodes, weights = gauss_legendre(count)
    theta = angles[:, None, None]
    cosine, sine = np.cos(theta), np.sin(theta)
    width = np.minimum(_HORIZON * cosine / np.maximum(sine, 1e-9), 2 * np.pi)
    end = np.arcsinh(np.pi / 2 / width)
    azimuths = np.pi / 2 + width * np.sinh(end * nodes)
    around = 2 * weights * end * width * np.cosh(end * nodes)
    horizon = np.arctan2(cosine, -sine * np.cos(azimuths))
    part = (nodes[block, None] + 1) / 2
    from_mirror = horizon * part**2
    light = tilted_frame(from_angles(from_mirror, azimuths), theta)
    return light, around * weights[block, None] * part * horizon * np.sin(from_mirror)


def _sphere_rule(angles: Array, count: int, block: slice) -> tuple[Array, Array]:
    """Directions and weights as of `hemisphere_rule`, over the whole sphere."""
    nodes, weights = gauss_legendre(count)
    # The angles from the mirror direction are squares of equal steps, so dense near it that a lobe
    # a third of a degree wide has nodes enough.
    u = (nodes[block, None] + 1) / 2
    from_mirror = np.pi * u**2
    step = 2 * np.pi / count
    weights = weights[block, None] * np.pi * u * np.sin(from_mirror) * step
    around_mirror = from_angles(from_mirror, (np.arange(count) + 0.5) * step)
    light = tilted_frame(around_mirror, angles[:, None, None])
    return light, np.broadcast_to(weights, light.shape[:-1])
