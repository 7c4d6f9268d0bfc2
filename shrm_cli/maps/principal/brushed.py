"""Lobes of anisotropic BRDFs: their functions depend on the azimuth of the view from the tangent.

The cubes are those of `principal.Lobe`. About the central direction all harmonics of a bundle count
now, of both signs of q, because the lobes of brushed surfaces are not their own mirror images in
the plane of the view. The bundle's harmonics at ``2p + 1`` fixed directions on a cone about C tell
them apart, and each sign is multiplied with a function of its own: the real and the imaginary part.
"""

from dataclasses import field

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.brushed_transfer import Waves, wave_values
from shrm_cli.maps.principal.about_center import orders_about
from shrm_cli.maps.principal.principal import Lobe, LookUp
from shrm_cli.records import record
from shrm_cli.sphere.directions import bisector

_ALONG = 1e-12
"""The sine of the angle of a view from the normal, below which it has no azimuth."""


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
        real, imaginary = self.parts(theta, psi)
        result = np.zeros(centers.shape)
        for place, by_order in self._by_order(look_up, orders_about, centers, across):
            shape = *by_order.shape[:2], by_order.shape[2] // 2 + 1, 3
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
