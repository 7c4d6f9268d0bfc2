"""Lobes of anisotropic BRDFs: their functions depend on the azimuth of the view from the tangent.

The cubes are those of `principal.Lobe`. About the central direction all harmonics of a bundle count
now, of both signs of q, because the lobes of brushed surfaces are not their own mirror images in
the plane of the view. The bundle's harmonics at ``2p + 1`` fixed directions on a cone about C tell
them apart, and each sign is multiplied with a function of its own: the real and the imaginary part.
"""

from dataclasses import field
from functools import lru_cache
from itertools import groupby

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.brushed_transfer import Waves, wave_values
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.maps.principal.principal import Lobe, LookUp
from shrm_cli.records import record
from shrm_cli.sphere.directions import bisector
from shrm_cli.sphere.harmonics import legendre_table, real_harmonics

_ALONG = 1e-12
"""The sine of the angle of a view from the normal, below which it has no azimuth."""
_CONES = 400
"""The cones of which the best one is taken."""


@record(eq=False)
class BrushedLobe(Lobe):
    """The light that an anisotropic term of a BRDF reflects.

    Attributes
    ----------
    functions : ndarray, shape (n, waves, entries, 3)
        The amplitudes of each function's waves at even angles of the view.
    waves : ndarray of int, shape (waves, 2)
        The frequency f of each wave and its power k, of ``i^k exp(i f psi)``.
    """

    waves: Waves = field(default_factory=lambda: np.zeros((0, 2), dtype=np.intp))

    is_brushed = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.functions.shape[1] != len(self.waves):
            raise ValueError(f"functions of shape {self.functions.shape}")

    @property
    def _values_a_point(self) -> int:
        return 6 * int(np.prod(self.functions.shape[:2])) + 3 * self.cubes.shape[2]

    def parts(self, theta: Array, psi: Array) -> Array:
        """Return the real and imaginary parts of functions, shape (2, points, n, 3).

        Parameters
        ----------
        theta, psi : ndarray, shape (points,)
            The angle of the view from the central direction and its azimuth, radians.
        """
        values = wave_values(self.waves, psi)
        rows = self.at(theta)
        return np.stack(
            [np.einsum("pnwc,wp->pnc", rows, each) for each in (values.real, values.imag)]
        )

    def _radiance(self, look_up: LookUp, centers: Array, views: Array, tangents: Array) -> Array:
        theta, across, psi = self._frame(centers, views, tangents)
        values = look_up(centers).reshape(len(centers), -1, 3)
        real, imaginary = self.parts(theta, psi)
        result = np.zeros(centers.shape)
        cube = first = 0
        for p, same in groupby(self.degrees):
            count = len(list(same))
            bundles = values[:, cube : cube + count * (2 * p + 1)]
            cube += bundles.shape[1]
            by_bundle = bundles.reshape(len(centers), count, 2 * p + 1, 3)
            by_order = orders_about(p, centers, across)[:, None] @ by_bundle
            place, shape = slice(first, first + count * (p + 1)), (len(centers), count, p + 1, 3)
            first = place.stop
            used = [each[:, place].reshape(shape) for each in (real, imaginary)]
            both = np.concatenate([used[0], used[1][:, :, 1:]], axis=2)
            result += np.einsum("nbqc,nbqc->nc", by_order, both)
        return result

    def _frame(self, centers: Array, views: Array, tangents: Array) -> tuple[Array, Array, Array]:
        """Return angles of views, the axes towards them, and their azimuths from the tangents."""
        theta, _ = self._plane(centers, views)
        is_mirror = self.center == "reflection"
        normals = bisector(centers, views) if is_mirror else centers
        beside = np.cross(normals, tangents)
        x, y = (np.sum(views * each, axis=-1, keepdims=True) for each in (tangents, beside))
        far = np.hypot(x, y)
        # A view along the normal has the azimuth 0, and then the tangent is the axis.
        x, y = np.where(far > _ALONG, (x, y), ([[1.0]], [[0.0]]))
        across = (x * tangents + y * beside) / np.hypot(x, y)
        if is_mirror:
            across = np.sum(views * normals, axis=-1, keepdims=True) * across + far * normals
        return theta, across, np.arctan2(y, x)[:, 0]


def orders_about(degree: int, centers: Array, across: Array) -> Array:
    """Return what leads from harmonics in world axes to the parts of each q about C.

    Parameters
    ----------
    degree : int
    centers, across : ndarray, shape (n, 3)
        Orthonormal vectors; azimuths are counted from the second about the first.

    Returns
    -------
    ndarray, shape (n, 2 degree + 1, 2 degree + 1)
        The rows are ``cos(q phi)`` for q = 0 .. p, and ``sin(q phi)`` for q = 1 .. p.
    """
    angle, azimuths, inverse = cone_rule(degree)
    beside = np.cross(centers, across)
    rows = [
        real_harmonics(
            degree,
            np.cos(angle) * centers
            + np.sin(angle) * (np.cos(azimuth) * across + np.sin(azimuth) * beside),
        )[..., degree**2 :]
        for azimuth in azimuths
    ]
    return np.einsum("qj,...jk->...qk", inverse, np.stack(rows, axis=-2))


@lru_cache(MAX_Q + 1)
def cone_rule(degree: int) -> tuple[float, Array, Array]:
    """Return directions on a cone about C, and how values there are taken apart by q.

    A function of one degree has the values ``sum_q f_q(angle) (b_q cos(q phi) + b_-q sin(q phi))``,
    with the normalized Legendre functions of that degree.

    Returns
    -------
    angle : float
        That of the cone, radians. No function of the degree is small there.
    azimuths : ndarray, shape (2 degree + 1,)
        Even azimuths on it.
    inverse : ndarray, shape (2 degree + 1, 2 degree + 1)
        From values at the directions to ``b_0 .. b_p, b_-1 .. b_-p``.
    """
    # Shaders are given its tangent of half the angle, as `plane_rule` has it.
    angles = np.linspace(0, np.pi / 2, _CONES + 1)[1:]
    angles = 2 * np.arctan(np.tan(angles / 2).astype(np.float32).astype(float))
    table = legendre_table(degree, np.cos(angles))
    functions = np.stack([table[q, degree - q] for q in range(degree + 1)])
    weighted = np.abs(functions) * np.where(np.arange(degree + 1) == 0, 1, np.sqrt(0.5))[:, None]
    best = int(np.argmax(weighted.min(axis=0)))
    azimuths = 2 * np.pi * np.arange(2 * degree + 1) / (2 * degree + 1)
    q = np.arange(degree + 1)[:, None]
    waves = np.concatenate([np.cos(q * azimuths), np.sin(q * azimuths)[1:]])
    scale = np.concatenate([functions[:, best], functions[1:, best]])
    norm = np.where(np.arange(2 * degree + 1) == 0, 1.0, 2.0) / (2 * degree + 1)
    return float(angles[best]), azimuths, waves * (norm / scale)[:, None]
