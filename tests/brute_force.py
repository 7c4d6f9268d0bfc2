"""Brute-force angular integration with BRDFs that are written out again.

Nothing here shares code with shrm. Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

import numpy as np
from scipy.special import sph_harm_y


def unit(rng, count):
    """Return uniformly distributed directions, shape (count, 3)."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def pixels_of_spheres(rng, count):
    """Normals and views as pixels of spheres have them: all mirror directions are as frequent."""
    mirrored, views = unit(rng, count), unit(rng, count)
    normals = mirrored + views
    return normals / np.linalg.norm(normals, axis=1)[:, None], views


def on_sphere(square):
    """Return directions that are as even on the sphere as points are on a square, (n, 2)."""
    z, azimuth = 2 * square[:, 0] - 1, 2 * np.pi * square[:, 1]
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), z], axis=1)


def microfacet(sigma):
    """Return rho_hat of eq. 5.34 as a function of world vectors R (3,), V (3,) and L (n, 3)."""

    def rho_hat(reflection, view, light):
        normal = reflection + view
        normal = normal / np.sqrt(normal @ normal)
        cosine_i = light @ normal
        lit = np.flatnonzero(cosine_i > 0)
        # The half vector is (L + V) / |L + V|, and |L + V|^2 = 2 + 2 L.V for unit vectors.
        cosine = (cosine_i[lit] + view @ normal) / np.sqrt(2 + 2 * (light @ view)[lit])
        theta_h = np.arccos(np.clip(cosine, -1, 1))
        values = np.zeros(len(light))
        values[lit] = np.exp(-(theta_h**2) / sigma**2) / (4 * np.pi * sigma**2)
        return values

    return rho_hat


def phong(exponent):
    """Return rho_hat of eq. 5.26 as a function of world vectors R (3,), V (3,) and L (n, 3)."""

    def rho_hat(reflection, view, light):
        cosine = np.maximum(light @ reflection, 0)
        return (exponent + 1) / (2 * np.pi) * cosine**exponent * (cosine > 0)

    return rho_hat


def reflected(rho_hat, reflection, view, light, weights, radiance):
    """Return the reflected radiance, shape (channels,), as a sum over samples of the sphere."""
    return (weights * rho_hat(reflection, view, light)) @ radiance


def latlong_samples(height):
    """Return the directions of a lat-long's pixel centres, and the solid angles of its pixels.

    They follow the words of docs/conventions.md: the top row is up (+Y), the centre column is
    along +Z, and the left quarter is along +X.
    """
    polar = np.pi * (np.arange(height)[:, None] + 0.5) / height
    turn = 2 * np.pi * (0.5 - (np.arange(2 * height) + 0.5) / (2 * height))
    directions = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)
        ),
        axis=-1,
    )
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    weights = np.repeat((edges[:-1] - edges[1:]) * np.pi / height, 2 * height)
    return directions.reshape(-1, 3), weights


def sphere_rule(order):
    """Return directions and weights that integrate harmonics up to `order` exactly."""
    z, weights = np.polynomial.legendre.leggauss(order // 2 + 1)
    phi = 2 * np.pi * np.arange(order + 1) / (order + 1)
    sine = np.sqrt(1 - z**2)[:, None]
    directions = np.stack(
        [sine * np.cos(phi), sine * np.sin(phi), np.broadcast_to(z[:, None], (len(z), len(phi)))],
        axis=-1,
    )
    full = np.broadcast_to(weights[:, None] * 2 * np.pi / len(phi), (len(z), len(phi)))
    return directions.reshape(-1, 3), full.reshape(-1)


def band_limited(coefficients):
    """Return rho_hat for given rho_hat_lpq, (F+1, P+1, P+1), by scipy's complex harmonics."""
    order_f, order_p = coefficients.shape[0] - 1, coefficients.shape[1] - 1

    def rho_hat(reflection, view, light):
        theta = np.arccos(reflection[2])
        phi = np.arctan2(reflection[1], reflection[0])
        c, s = np.cos(theta), np.sin(theta)
        frame = np.array(
            [
                [c * np.cos(phi), -np.sin(phi), s * np.cos(phi)],
                [c * np.sin(phi), np.cos(phi), s * np.sin(phi)],
                [-s, 0, c],
            ]
        )
        local, v = light @ frame, view @ frame
        theta_i, phi_i = (
            np.arccos(np.clip(local[:, 2], -1, 1)),
            np.arctan2(local[:, 1], local[:, 0]),
        )
        theta_o, phi_o = np.arccos(np.clip(v[2], -1, 1)), np.arctan2(v[1], v[0])
        total = np.zeros(len(light), dtype=complex)
        for l in range(order_f + 1):  # noqa: E741
            for q in range(-min(l, order_p), min(l, order_p) + 1):
                left = np.conj(sph_harm_y(l, q, theta_i, phi_i))
                for p in range(abs(q), order_p + 1):
                    right = sph_harm_y(p, q, theta_o, phi_o)
                    total += coefficients[l, p, abs(q)] * left * right
        assert np.abs(total.imag).max() < 1e-9 * max(np.abs(total.real).max(), 1)
        return total.real

    return rho_hat


def grazing(even):
    """Return N.V of views, more of them grazing than there are, and their density to even views.

    Half of them are spread as evenly as all views of a mirror direction are, whose squares of N.V
    are even. Of the other half the logarithms are even, from .02 on.
    """
    cosines = np.linspace(0, 1, 100_001)[1:]
    span = -np.log(0.02)
    below = cosines**2 / 2 + np.maximum(1 + np.log(cosines) / span, 0) / 2
    found = np.interp(even, below, cosines)
    return found, 0.5 + np.where(found > 0.02, 1 / (4 * found**2 * span), 0)


def bright_pairs(rng, reflection_map, count, finer=None, candidates=15):
    """Mirror directions and views where a map is bright, and the weights of integrals over all.

    A lamp's few directions hold most of the energy and of the error of reflected light, so that
    pairs drawn evenly tell little. A quarter of these is drawn in proportion to the map's own
    squared light, the others everywhere, since errors may be where the map is dark; half of all are
    drawn where a finer map differs, if there is one. Their weights undo that. They are drawn from
    many candidates for each, which are spread more evenly than at random, and of which many graze,
    so that sums vary less. Sharp lobes under small lamps take more candidates.

    Returns
    -------
    reflections, views : ndarray, shape (count, 3)
    weights : ndarray, shape (count, 1)
    """
    from scipy.stats import qmc  # which takes a second to load

    drawn = qmc.Sobol(4, rng=rng).random_base2(int(np.ceil(np.log2(candidates * count))))
    reflections = on_sphere(drawn[:, :2])
    cosines, density = grazing(drawn[:, 2])
    # The view is twice as far from the mirror direction as from the normal.
    from_reflection = 2 * np.arccos(cosines)
    tangents = np.cross(reflections, [0.36, 0.48, 0.8])
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    azimuth = 2 * np.pi * drawn[:, 3, None]
    across = np.cos(azimuth) * tangents + np.sin(azimuth) * np.cross(reflections, tangents)
    views = (
        np.cos(from_reflection)[:, None] * reflections + np.sin(from_reflection)[:, None] * across
    )
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = reflection_map.radiance(normals, views)
    energy = np.sum(found**2, axis=1)
    wanted = 3 + energy / np.average(energy, weights=1 / density)
    if finer is not None:
        missed = np.sum((found - finer.radiance(normals, views)) ** 2, axis=1)
        wanted = wanted + 4 * missed / np.average(missed, weights=1 / density)
    share = wanted / density
    order = np.argsort(share)
    summed = np.cumsum(share[order])
    chosen = order[np.searchsorted(summed, summed[-1] * (np.arange(count) + 0.5) / count)]
    return reflections[chosen], views[chosen], 1 / wanted[chosen, None]
