"""A random walk between a coat and its base: the truth for `coated`, with no formula of its own.

It is the position-free Monte Carlo method of Guo, Hasan and Zhao 2018: light is refracted by a
facet of the coat's border, reflected by the base, and there and back again; at each visit to the
base the path from the viewer is joined to one from the light. Facets are those of Walter et al.
2007, chosen among the visible ones as in Heitz 2018. The base is any BRDF, called as it is.
"""

import numpy as np

BOUNCES = 100
"""Paths end earlier by chance, except for light that is caught over a base without loss."""


def fresnel(cosine, ratio):
    """Return the reflectance of a facet, and the refracted cosine; `ratio` is n_here / n_there."""
    square = 1 - ratio**2 * (1 - cosine**2)
    there = np.sqrt(np.maximum(square, 0))
    s = (ratio * cosine - there) / (ratio * cosine + there)
    p = (cosine - ratio * there) / (cosine + ratio * there)
    return np.where(square > 0, (s**2 + p**2) / 2, 1.0), there


def smith(z, alpha):
    """Return Smith's Lambda of the cosine to the normal."""
    z = np.clip(np.abs(z), 1e-6, 1)
    return (np.sqrt(1 + alpha**2 * (1 - z**2) / z**2) - 1) / 2


def facets(directions, alpha, rng):
    """Choose a visible facet for each direction above the surface."""
    x, y, z = directions.T
    stretched = np.stack([alpha * x, alpha * y, z], axis=1)
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    across = np.hypot(stretched[:, 0], stretched[:, 1])
    safe = np.maximum(across, 1e-12)
    first = np.stack([-stretched[:, 1] / safe, stretched[:, 0] / safe, np.zeros(len(x))], axis=1)
    first[across < 1e-9] = (1, 0, 0)
    second = np.cross(stretched, first)
    radius, turn = np.sqrt(rng.random(len(x))), 2 * np.pi * rng.random(len(x))
    one, other = radius * np.cos(turn), radius * np.sin(turn)
    share = (1 + stretched[:, 2]) / 2
    other = (1 - share) * np.sqrt(1 - one**2) + share * other
    rest = np.sqrt(np.maximum(0, 1 - one**2 - other**2))
    found = one[:, None] * first + other[:, None] * second + rest[:, None] * stretched
    found *= (alpha, alpha, 1)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def enter(outside, alpha, ior, rng):
    """Refract directions in air into the coat: directions that point up from the base, weights."""
    facet = facets(outside, alpha, rng)
    cosine = np.sum(outside * facet, axis=1)
    reflected, there = fresnel(cosine, 1 / ior)
    down = -outside / ior + (cosine / ior - there)[:, None] * facet
    inside = -down
    weight = (1 - reflected) / (1 + smith(inside[:, 2], alpha))
    return inside, np.where(inside[:, 2] > 0, weight, 0)


def turn_back(inside, alpha, ior, rng):
    """Reflect directions up from the base at the border: whence they come back, and weights."""
    facet = facets(inside, alpha, rng)
    cosine = np.sum(inside * facet, axis=1)
    reflected, _ = fresnel(cosine, ior)
    back = 2 * cosine[:, None] * facet - inside
    ours, theirs = smith(inside[:, 2], alpha), smith(back[:, 2], alpha)
    weight = reflected * (1 + ours) / (1 + ours + theirs)
    return back, np.where(back[:, 2] > 0, weight, 0)


def from_base(directions, alpha, rng):
    """Choose where the base reflects to: half of all by the cosine, half by a lobe of GGX."""
    count = len(directions)
    radius, turn = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    z = np.sqrt(1 - radius**2)
    cosine_wise = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    facet = facets(directions, alpha, rng)
    lobe = 2 * np.sum(directions * facet, axis=1, keepdims=True) * facet - directions
    chosen = np.where(rng.random((count, 1)) < 0.5, cosine_wise, lobe)
    half = chosen + directions
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-12)
    stretched = (half[:, 0] ** 2 + half[:, 1] ** 2) / alpha**2 + half[:, 2] ** 2
    density = 1 / (np.pi * alpha**2 * stretched**2)
    density /= 4 * directions[:, 2] * (1 + smith(directions[:, 2], alpha))
    above = chosen[:, 2] > 0
    return chosen, np.where(above, (density + np.maximum(chosen[:, 2], 0) / np.pi) / 2, np.inf)


def coated(base, light, view, alpha, ior, color=1.0, samples=64, base_alpha=0.3, seed=1):
    """Return a coated base's BRDF without what the coat reflects itself, and its standard error.

    Parameters
    ----------
    base : Brdf
    light, view : ndarray, shape (n, 3)
        Above the surface.
    alpha, ior : float
        Of the coat's border.
    color : float or sequence of 3 floats
        What passes the coat along its normal, there and back.
    samples : int
        Paths for each pair.
    base_alpha : float
        The width of the lobe that the base's reflections are chosen by.
    """
    rng, count = np.random.default_rng(seed), len(light)
    light, view = np.repeat(light, samples, axis=0), np.repeat(view, samples, axis=0)
    color = np.broadcast_to(np.asarray(color, dtype=float), 3)

    def passed(directions):
        return color ** (0.5 / np.maximum(directions[:, 2:], 1e-6))

    inner_light, weight = enter(light, alpha, ior, rng)
    arriving = weight[:, None] * passed(inner_light)
    at, weight = enter(view, alpha, ior, rng)
    carried = weight[:, None] * passed(at) / ior**2
    total, alive = np.zeros((len(light), 3)), np.arange(len(light))
    for _ in range(BOUNCES):
        stays = np.minimum(carried[alive].max(axis=1) * ior**2, 1) * (arriving[alive, 0] > 0)
        luck = rng.random(len(alive)) < stays
        carried[alive] /= np.maximum(stays, 1e-300)[:, None]
        alive = alive[luck]
        if not len(alive):
            break
        here = at[alive]
        value = base.transfer(inner_light[alive], here) / inner_light[alive, 2:]
        total[alive] += carried[alive] * value * arriving[alive]
        going, density = from_base(here, base_alpha, rng)
        carried[alive] *= base.transfer(going, here) / density[:, None]
        back, weight = turn_back(going, alpha, ior, rng)
        carried[alive] *= weight[:, None] * passed(going) * passed(back)
        at[alive] = back
    each = total.reshape(count, samples, 3)
    return each.mean(axis=1), each.std(axis=1) / np.sqrt(samples)
