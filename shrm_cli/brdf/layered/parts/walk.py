"""A random walk between a coat and its base: the truth for `coated`, with no formula of its own.

It is the position-free Monte Carlo method of Guo, Hasan and Zhao 2018: light passes the border of
the coat, is reflected by the base, and there and back again; at each visit to the base the path
from the viewer is joined to one from the light. At the border light walks among facets of GGX
until it leaves them on one side or the other, as in Heitz et al. 2016, so that nothing is lost
there. Facets are chosen among the visible ones as in Heitz 2018. The base is any BRDF, called as it
is.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, added
from shrm_cli.brdf.layered.coated import Coated
from shrm_cli.brdf.layered.parts.dielectric import CoatLobe
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.sums import flat_terms
from shrm_cli.errors import BrdfError
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, normalize

BOUNCES = 100
"""Paths end earlier by chance, except for light that is caught over a base without loss."""
VIEWS = 0, 15, 30, 45, 60, 75
"""Degrees from the normal."""
_LIGHTS = 512
_BASE_ALPHA = 0.3
"""The width of the lobe that light at a base is sent by, where the base has no GGX."""


@record(eq=False)
class Walk:
    """What the base of a coated BRDF adds, in light from everywhere, seen at `VIEWS`."""

    albedo: Array
    walked: Array
    """`albedo` and `walked`: the part of the light, as the BRDF has it and as the walk finds it,
    shape (6, 3)."""
    noise: Array
    """The standard error of `walked`, beside that of the lights, which both share, shape (6, 3)."""
    difference: Array
    difference_noise: Array
    """`difference` and `difference_noise`: RMS over the lights of what they differ by, and the part
    of it that is the walk's noise, relative to the RMS of what the walk finds, shape (6,)."""


def compared(brdf: Brdf, paths: int) -> Walk:
    """Compare a coated BRDF with the walk.

    `paths` is their number for each of 512 lights, which are spread by the cosine, at each of
    `VIEWS`.
    """
    if not isinstance(brdf, Coated) or brdf.number("weight") != 1 or "film" in brdf.values:
        raise BrdfError(f"{brdf!r}: the walk is for coated:base=(...) without weight and film")
    light = _spread(np.random.default_rng(1), _LIGHTS)
    lit = light[:, 2:]
    widths = [max(each.alphas) for _, each in flat_terms([(1, brdf.base)]) if isinstance(each, Ggx)]
    below = [(share, each) for share, each in brdf.terms if not isinstance(each, CoatLobe)]
    rows = []
    for degrees in VIEWS:
        view = np.broadcast_to(from_angles(np.radians(degrees), 0.0), light.shape)
        found = added([share * each.evaluate(light, view) for share, each in below])
        true, error = coated(
            brdf.base, light, view, brdf.number("roughness") ** 2, brdf.number("ior"),
            brdf.color("color"), paths, min(widths, default=_BASE_ALPHA), 1 + degrees,
        )  # fmt: skip
        # Lights by the cosine have the weight pi / (cosine n) each, times the cosine.
        means = [np.pi * each.mean(axis=0) for each in (found, true)]
        noise = np.pi * np.sqrt(np.sum(error**2, axis=0)) / len(light)
        squares = [np.sum((each * lit) ** 2) for each in (true, found - true, error)]
        own = max(squares[0] - squares[2], 1e-300)
        rows.append((*means, noise, *(np.sqrt(each / own) for each in squares[1:])))
    return Walk(*(np.array(each) for each in zip(*rows, strict=True)))


def coated(
    base: Brdf,
    light: Array,
    view: Array,
    alpha: float,
    ior: float,
    color: ArrayLike = 1.0,
    samples: int = 64,
    base_alpha: float = _BASE_ALPHA,
    seed: int = 1,
) -> tuple[Array, Array]:
    """Walk between a coat and a base.

    `light` and `view`, each of shape (n, 3), are above the surface. `alpha` and `ior` are those of
    the coat's border. `color` is what passes the coat along its normal, there and back. `samples`
    is the number of paths for each pair. `base_alpha` is the width of the lobe that the base's
    reflections are chosen by.

    Returns `value` and `error`, each of shape (n, 3), the BRDF without what the coat reflects
    itself, and its standard error.
    """
    rng, count = np.random.default_rng(seed), len(light)
    light, view = np.repeat(light, samples, axis=0), np.repeat(view, samples, axis=0)
    color = np.broadcast_to(np.asarray(color, dtype=float), 3)

    def passed(directions: Array) -> Array:
        return np.asarray(color ** (0.5 / np.maximum(directions[:, 2:], 1e-6)))

    inner_light, enters = border(light, alpha, 1 / ior, rng)
    arriving = enters[:, None] * passed(inner_light)
    at, enters = border(view, alpha, 1 / ior, rng)
    carried = enters[:, None] * passed(at) / ior**2
    total, alive = np.zeros((len(light), 3)), np.flatnonzero(enters & (arriving[:, 0] > 0))
    for _ in range(BOUNCES):
        stays = np.minimum(carried[alive].max(axis=1) * ior**2, 1)
        luck = rng.random(len(alive)) < stays
        carried[alive] /= np.maximum(stays, 1e-300)[:, None]
        alive = alive[luck]
        if not len(alive):
            break
        here = at[alive]
        value = base.transfer(inner_light[alive], here) / inner_light[alive, 2:]
        total[alive] += carried[alive] * value * arriving[alive]
        going, density = _from_base(here, base_alpha, rng)
        carried[alive] *= base.transfer(going, here) / density[:, None]
        sent = going[:, 2] > 0
        alive, going = alive[sent], going[sent]
        at[alive], leaves = border(going, alpha, ior, rng)
        carried[alive] *= passed(going) * passed(at[alive]) * ~leaves[:, None]
    each = total.reshape(count, samples, 3)
    return each.mean(axis=1), each.std(axis=1) / np.sqrt(samples)


def border(
    directions: Array, alpha: float, ratio: float, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Send light against a rough border, and let it walk among its facets until it leaves.

    `directions`, of shape (n, 3), are whence light comes, away from the border: z is above 0.
    `ratio` is the index of refraction on the light's side of the border as a part of that beyond.

    Returns `found` of shape (n, 3), whither light that comes back goes, and the opposite of where
    light that passes goes; z is above 0; and `passes` of shape (n,).
    """
    # Each side has a frame in which its own medium is above: that beyond is the other, inverted.
    # Heights are even in 0 .. 1; light that rises from one goes on to a higher one, or away.
    found, passes = -directions, np.zeros(len(directions), bool)
    height, walking = np.ones(len(directions)), np.arange(len(directions))
    while len(walking):
        way, far = found[walking], passes[walking]
        lift = np.clip(way[:, 2], -1 + 1e-9, 1 - 1e-9)
        lift = np.where(abs(lift) < 1e-6, 1e-6, lift)
        slope = np.sqrt(1 + alpha**2 * (1 - lift**2) / lift**2)
        lambdas = np.where(lift > 0, np.maximum(slope - 1, 1e-12), -1 - slope) / 2
        rise = -np.log1p(-rng.random(len(walking))) / lambdas
        met = height[walking] * np.exp(np.minimum(rise, 50))
        stays = met < 1
        walking, way, far, met = walking[stays], way[stays], far[stays], met[stays]
        facet = _facets(-way, alpha, rng)
        cosine = np.clip(np.sum(-way * facet, axis=1), 0, 1)
        relative = np.where(far, 1 / ratio, ratio)
        reflected, there = _fresnel(cosine, relative)
        crosses = rng.random(len(walking)) >= reflected
        mirrored = way + 2 * cosine[:, None] * facet
        beyond = relative[:, None] * way + (relative * cosine - there)[:, None] * facet
        found[walking] = np.where(crosses[:, None], -beyond, mirrored)
        passes[walking] = far ^ crosses
        height[walking] = np.where(crosses, 1 - met, met)
    return found, passes


def _fresnel(cosine: Array, ratio: Array) -> tuple[Array, Array]:
    """The reflectance of a facet, and the refracted cosine; `ratio` is n_here / n_there."""
    square = 1 - ratio**2 * (1 - cosine**2)
    there = np.sqrt(np.maximum(square, 0))
    s = (ratio * cosine - there) / np.maximum(ratio * cosine + there, 1e-300)
    p = (cosine - ratio * there) / np.maximum(cosine + ratio * there, 1e-300)
    return np.where(square > 0, (s**2 + p**2) / 2, 1.0), there


def _facets(directions: Array, alpha: float, rng: np.random.Generator) -> Array:
    """Choose a visible facet for each direction, which may be below the surface."""
    x, y, z = directions.T
    stretched = normalize(np.stack([alpha * x, alpha * y, z], axis=1))
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
    return normalize(found)


def _spread(rng: np.random.Generator, count: int) -> Array:
    """Choose directions by the cosine."""
    radius, turn = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    z = np.sqrt(1 - radius**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)


def _from_base(directions: Array, alpha: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Choose where the base reflects to: half of all by the cosine, half by a lobe of GGX."""
    facet = _facets(directions, alpha, rng)
    lobe = 2 * np.sum(directions * facet, axis=1, keepdims=True) * facet - directions
    is_even = rng.random((len(directions), 1)) < 0.5
    chosen = np.where(is_even, _spread(rng, len(directions)), lobe)
    half = chosen + directions
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-12)
    stretched = (half[:, 0] ** 2 + half[:, 1] ** 2) / alpha**2 + half[:, 2] ** 2
    z = np.maximum(directions[:, 2], 1e-6)
    # 4 z (1 + Lambda)
    projected = 2 * (z + np.sqrt(alpha**2 * (1 - z**2) + z**2))
    density = 1 / (np.pi * alpha**2 * stretched**2 * projected)
    above = chosen[:, 2] > 0
    return chosen, np.where(above, (density + np.maximum(chosen[:, 2], 0) / np.pi) / 2, np.inf)
