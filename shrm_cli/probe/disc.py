"""Circular lights, whose harmonic coefficients are known in closed form."""

from collections.abc import Iterator, Sequence

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.probe.make import latlong_solid_angles
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.grid.latlong import latlong_coordinates
from shrm_cli.sphere.harmonics import legendre_degrees
from shrm_cli.sphere.quadrature import spiral_directions

_VALUES_AT_ONCE = 2**17
_ROWS_AT_ONCE = 32
_LINES = 32
"""Lines of which a row of pixels is made. What they tell of a pixel at a disc's edge is off by less
than .004 of the pixel, and beside a pole, where rows are bent most, by less than .03."""
LEAST_RADIUS = 1e-6
"""The least radius of a disc in radians: smaller ones are points, which have no radiance."""
BRIGHTEST = float(np.finfo(np.float32).max)
"""The largest radiance of a disc, as of pixels, so that lamps of any probe can be discs."""


@record(eq=False)
class Disc:
    """A light of one radiance within an angle of its axis, such as the sun."""

    direction: Array
    """Unit axis, world axes, shape (3,)."""
    radius: float
    """Angle between the axis and the edge, radians, above 0 and up to pi."""
    radiance: Array
    """Shape (3,)."""

    @property
    def solid_angle(self) -> float:
        """The solid angle in sr: ``2 pi (1 - cos r)``."""
        return float(4 * np.pi * np.sin(self.radius / 2) ** 2)

    @property
    def irradiance(self) -> Array:
        """The irradiance of a surface that faces the light, shape (3,)."""
        return self.radiance * facing_factor(self.radius)

    @property
    def energy(self) -> Array:
        """The integral of the squared radiance, shape (3,)."""
        return self.radiance**2 * self.solid_angle


def radius_of(solid_angle: float) -> float:
    """Radius in radians of a disc of this solid angle, above 0 and up to 4 pi sr."""
    return float(2 * np.arcsin(np.sqrt(min(solid_angle / (4 * np.pi), 1.0))))


def facing_factor(radius: float) -> float:
    """Irradiance of a surface that faces a disc of radiance 1: ``pi sin(r)^2``.

    What lies below the surface's horizon does not count, so that no disc gives more than pi.
    """
    return float(np.pi * np.sin(min(radius, np.pi / 2)) ** 2)


def disc_directions(disc: Disc, count: int) -> Array:
    """Directions spread evenly over a disc, of equal solid angles, shape (count, 3)."""
    local = spiral_directions(count)
    # Cosines that are even over the sphere are brought to the range within the disc.
    cosine = 1 - (1 - local[:, 2]) / 2 * (1 - np.cos(disc.radius))
    scale = np.sqrt(np.maximum(1 - cosine**2, 0) / (1 - local[:, 2] ** 2))
    local = np.stack([local[:, 0] * scale, local[:, 1] * scale, cosine], axis=1)
    axis = disc.direction[None]
    return local @ surface_frames(axis, horizontal_tangents(axis))[0]


def disc_coefficients(discs: Sequence[Disc], order: int) -> Array:
    """Coefficients of the light of all discs, shape ((order+1)^2, 3), index l(l+1)+m, world axes.

    About its own axis a disc has the coefficients of `zonal_of_discs`. Zonal functions are turned
    to an axis a by ``L_lm = sqrt(4 pi / (2l+1)) L_l0 Y_lm(a)``.
    """
    result = np.zeros(((order + 1) ** 2, 3))
    for part in slices(len(discs), _VALUES_AT_ONCE // (order + 1)):
        some = discs[part]
        x, y, z = np.array([disc.direction for disc in some]).T
        # Discs of one height and radius, as the pixels of a row are, differ in the azimuth alone.
        keys = np.array([z, [disc.radius for disc in some], [disc.solid_angle for disc in some]])
        (height, radius, area), ring = np.unique(keys, axis=1, return_inverse=True)
        in_order = np.argsort(ring, kind="stable")
        starts = np.searchsorted(ring[in_order], np.arange(len(height)))
        sine = np.hypot(x, y)
        phase = np.where(sine > 0, (x + 1j * y) / np.where(sine > 0, sine, 1.0), 1.0)[in_order]
        radiance = np.array([disc.radiance for disc in some])[in_order]
        waves = np.full((order + 1, len(some)), np.sqrt(2), dtype=complex)
        waves[0] = 1
        waves[1:] *= np.cumprod(np.broadcast_to(phase, (order, len(some))), axis=0)
        lit = np.stack([waves.real, waves.imag], axis=-1)[..., None] * radiance[:, None]
        lit = lit.reshape(order + 1, len(some), 6)
        around = np.add.reduceat(lit, starts, axis=1)
        scale = np.sqrt(4 * np.pi / (2 * np.arange(order + 1) + 1))
        zonal = scale[:, None] * zonal_of_discs(order, radius, area)
        for degree, place in legendre_degrees(order, height, sine=sine[in_order][starts]):
            sums = ((zonal[degree] * place)[:, None] @ around[: degree + 1])[:, 0]
            middle = degree * (degree + 1)
            result[middle : middle + degree + 1] += sums[:, :3]
            result[middle - degree : middle] += sums[:0:-1, 3:]
    return result


def zonal_of_discs(order: int, radius: Array, area: Array) -> Array:
    """Return the coefficients l, 0 of discs of radiance 1 about their own axes, (order+1, discs).

    They are ``sqrt((2l+1) / 4 pi)`` times 2 pi times the integral of P_l from cos r to 1. This is
    ``(P_l-1 - P_l+1) / (2l+1)`` at cos r, which loses all digits for a small r; as
    ``sin(r)^2 P_l' / (l (l+1))`` it keeps them.

    `radius` and `area`, of shape (discs,), are in radians and sr.
    """
    sine, result = np.sin(radius), np.empty((order + 1, len(radius)))
    for degree, legendre in legendre_degrees(order, np.cos(radius), max_m=1, sine=sine):
        if degree == 0:
            result[0] = area / np.sqrt(4 * np.pi)
        else:
            result[degree] = 2 * np.pi * sine * legendre[1] / np.sqrt(degree * (degree + 1))
    return result


def disc_rows(disc: Disc, height: int) -> Iterator[tuple[int, Array]]:
    """Yield a disc on a lat-long sampled at pixel centers, in blocks of the rows that it is on.

    `height` is the number of rows of the lat-long.

    Yields `start`, the first row of the block; and `coverage` of shape (rows, 2 * height), the part
    of each pixel that the disc covers. The sum over all pixels of coverage times exact solid angle
    is the disc's solid angle.
    """
    areas = latlong_solid_angles(height)
    blocks = list(_covered(disc, height))
    found = sum(float(areas[at : at + len(each)] @ each.sum(axis=1)) for at, each in blocks)
    for start, coverage in blocks:
        yield start, coverage * (disc.solid_angle / found)


def _covered(disc: Disc, height: int) -> Iterator[tuple[int, Array]]:
    """Yield blocks as `disc_rows` does, with the rounding of sums over a few lines in each row.

    On a line of latitude a disc spans an interval of longitude, whose overlap with each pixel is
    known. The lines are those between the disc's highest and lowest point, so that none is missed.
    """
    across, down = latlong_coordinates(disc.direction)
    longitude, colatitude = float(across) * np.pi, (float(down) + 1) * (np.pi / 2)
    step, radius = np.pi / height, disc.radius
    low, high = max(colatitude - radius, 0.0), min(colatitude + radius, np.pi)
    first, last = min(int(low / step), height - 1), min(int(np.ceil(high / step)), height)
    fractions = (np.arange(_LINES) + 0.5) / _LINES
    edges = np.linspace(-np.pi, np.pi, 2 * height + 1) - longitude
    for start in range(first, max(last, first + 1), _ROWS_AT_ONCE):
        rows = np.arange(start, min(start + _ROWS_AT_ONCE, max(last, first + 1)))
        top, bottom = np.maximum(rows * step, low), np.minimum((rows + 1) * step, high)
        lines = top[:, None] + (bottom - top)[:, None] * fractions
        # The haversine formula keeps its digits for small discs.
        above = np.sin(radius / 2) ** 2 - np.sin((lines - colatitude) / 2) ** 2
        below = np.maximum(np.sin(lines) * np.sin(colatitude), np.finfo(float).tiny)
        half_width = 2 * np.arcsin(np.sqrt(np.clip(above / below, 0.0, 1.0)))
        # Integral of the disc along each line from its center to each pixel's edge.
        turns = np.round(edges / (2 * np.pi))
        within = edges - 2 * np.pi * turns
        covered = np.clip(within, -half_width[..., None], half_width[..., None])
        covered += 2 * half_width[..., None] * turns
        weights = np.sin(lines) * (bottom - top)[:, None] / _LINES
        weights /= (np.cos(rows * step) - np.cos((rows + 1) * step))[:, None]
        yield start, np.diff(np.einsum("rp,rpe->re", weights, covered), axis=1) * (height / np.pi)
