"""Maps for the tests, and slow formulas about them that share no code with shrm."""

import numpy as np

from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from tests import oracles
from tests.brute_force import unit

EXPLICIT = {"cabral": Cabral, "kautz-mccool": KautzMcCool, "lightfield": LightField}
"""The classes of explicit maps by the names of their representations."""


def random_coefficients(rng, order_f, order_p):
    """rho_hat_lpq of a band-limited BRDF that depends on everything."""
    values = rng.normal(size=(order_f + 1, order_p + 1, order_p + 1, 3))
    for degree in range(order_f + 1):
        for p in range(order_p + 1):
            values[degree, p, min(degree, p) + 1 :] = 0
    return values


def make_info(order_f, order_p):
    brdf = {"name": "phong", "parameters": {"exponent": 8.0}}
    return MapInfo(order_f, order_p, 0.03, 0.975, 0.125, brdf, "p.exr", "ab" * 32)


def make_shrm(order_f=4, order_p=2, size=8, center="reflection", seed=0, **options):
    """A random band-limited SHRM; `options` as `Shrm.from_coefficients` takes them."""
    rng = np.random.default_rng(seed)
    lighting = rng.normal(size=((order_f + 1) ** 2, 3))
    brdf = random_coefficients(rng, order_f, order_p)
    return Shrm.from_coefficients(
        lighting, brdf, center, make_info(order_f, order_p), size=size, **options
    )


def normals_of(centers, views, center="reflection"):
    """Normals whose central directions are given."""
    if center == "normal":
        return np.broadcast_to(centers, np.broadcast_shapes(centers.shape, views.shape))
    total = centers + views
    return total / np.linalg.norm(total, axis=-1, keepdims=True)


def uniform_points(count, center="reflection", seed=1):
    """Normals and views, uniform in the central direction and the view."""
    rng = np.random.default_rng(seed)
    centers, views = unit(rng, count), unit(rng, count)
    return normals_of(centers, views, center), views


def rms(values):
    return float(np.sqrt(np.mean(np.asarray(values, dtype=float) ** 2)))


def relative_rms(found, truth):
    return rms(np.asarray(found, dtype=float) - truth) / rms(truth)


def harmonics_image(shrm, view):
    """What every texel of a global SHRM reflects to a view, shape (6N, N, 3)."""
    assert shrm.frame == "global"
    return np.einsum("ijkc,k->ijc", shrm.coefficients, oracles.real_harmonics(shrm.order_p, view))


def around(centers, theta, count):
    """Views at an angle from each of (n, 3) central directions, shape (count, n, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(centers), axis=-1)]
    right = np.cross(centers, helper)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    up = np.cross(centers, right)
    turn = 2 * np.pi * (np.arange(count) / count)[:, None, None] + 0.1
    return np.cos(theta) * centers + np.sin(theta) * (np.cos(turn) * right + np.sin(turn) * up)


def azimuthal_mean_image(shrm, theta, count=24):
    """Mean over the views at an angle from each texel's direction, shape (6N, N, 3)."""
    assert shrm.frame == "global"
    texels = oracles.cube_texels(shrm.size, shrm.sampling).reshape(-1, 3)
    coefficients = shrm.coefficients.reshape(len(texels), -1, 3)
    harmonics = oracles.real_harmonics(shrm.order_p, around(texels, theta, count))
    mean = np.einsum("vnk,nkc->nc", harmonics, coefficients) / count
    return mean.reshape(6 * shrm.size, shrm.size, 3)


def triangle_angles(a, b, c):
    """Angles of the spherical triangles of unit vectors (..., 3), at their three corners."""

    def at(p, q, r):
        to_q, to_r = np.cross(p, q), np.cross(p, r)
        sine = np.linalg.norm(np.cross(to_q, to_r), axis=-1)
        return np.arctan2(sine, np.sum(to_q * to_r, axis=-1))

    return at(a, b, c), at(b, c, a), at(c, a, b)


def girard(a, b, c):
    """Area of spherical triangles by their excess of angles (Girard's theorem)."""
    return sum(triangle_angles(a, b, c)) - np.pi


def texel_solid_angles(size, sampling="center"):
    """Solid angle of each texel of one face, shape (size, size), of two triangles each."""
    at = np.array(oracles.positions(size, sampling))
    edges = np.concatenate([[-1.0], (at[1:] + at[:-1]) / 2, [1.0]])
    x, y = np.meshgrid(edges, edges)
    points = np.stack([x, y, np.ones_like(x)], axis=-1)
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return girard(a, b, c) + girard(a, c, d)


def cube_weights(size, sampling="center"):
    """Solid angle of every texel, shape (6 size, size)."""
    return np.tile(texel_solid_angles(size, sampling), (6, 1))
