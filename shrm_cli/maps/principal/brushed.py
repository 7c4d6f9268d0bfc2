"""Lobes of anisotropic BRDFs and their functions of the view, which depend on its azimuth.

The cubes are those of `principal.Lobe`. About the central direction all harmonics of a bundle count
now, of both signs of q, because the lobes of brushed surfaces are not their own mirror images in
the plane of the view. The bundle's harmonics at ``2p + 1`` fixed directions on a cone about C tell
them apart, and each sign is multiplied with a function of its own: the real and the imaginary part.

A brushed surface tells where its tangent is by one angle more, the azimuth psi of the view from it.
About C, with the azimuth counted from the plane of the view, the reflected light is still

    B_q(R, theta_o, psi) = sum over l, m of L_lm rho_hat_lq(theta_o, psi) D^l_mq(R).

The left singular vectors of ``rho_hat_lq(theta_o, psi)``, rows of l, are what the light of each
degree is multiplied with; they make cubes as those of isotropic BRDFs do. The right ones are
functions of both angles. They are complex for q > 0, because lobes are not their own mirror images.
The real parts ``cos(q phi)`` and ``sin(q phi)`` of a lobe come with the same numbers over l: with
mirror images of tangents they are the best ones, as products of mirrored views are real.

Functions are tabulated over theta_o, for each of some waves over psi: see `Azimuths.waves`.
"""

from dataclasses import field
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.brushed_transfer import Azimuths, Waves, azimuths_of, wave_energies, wave_values
from shrm_cli.maps.principal.about_center import orders_about
from shrm_cli.maps.principal.functions import TABLES, Spectrum
from shrm_cli.maps.principal.principal import Lobe, LookUp
from shrm_cli.records import record
from shrm_cli.sphere.directions import bisector
from shrm_cli.sphere.quadrature import interpolation_matrix, linear_matrix

_ALONG = 1e-12
"""The sine of the angle of a view from the normal, below which it has no azimuth."""


@record(eq=False)
class BrushedLobe(Lobe):
    """The light that an anisotropic term of a BRDF reflects.

    `functions`, of shape (n, waves, entries, 3), are the amplitudes of each function's waves at
    even angles of the view. `waves`, of shape (waves, 2), is the frequency f of each wave and its
    power k, of ``i^k exp(i f psi)``.
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

        `theta` and `psi`, each of shape (points,), are the angle of the view from the central
        direction and its azimuth, radians.
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


_LEFT_OUT = 1e-6
"""The part of the energy of the reflected light, and of a function, in waves that are left out."""


class BrushedSpectrum(Spectrum):
    """The singular vectors of an anisotropic BRDF.

    Its tables have ``waves x entries`` entries.
    """

    @property
    def entries(self) -> int:
        """Those of whole degrees: tables of all waves are large, and metals are smooth enough."""
        return TABLES[0]

    @cached_property
    def _azimuths(self) -> Azimuths:
        return azimuths_of(self.transfer)

    @cached_property
    def waves(self) -> Waves:
        """The waves of the tables: the fewest that hold nearly all of the reflected light."""
        energy = np.einsum("lw,lc->w", wave_energies(self.transfer), self.light)
        weakest = np.argsort(energy, kind="stable")[:-1]  # black light has none, and takes one
        left_out = weakest[np.cumsum(energy[weakest]) <= _LEFT_OUT * energy.sum()]
        return np.delete(self._azimuths.waves, left_out, axis=0)

    def table(self, q: int, first: int, last: int) -> Array:
        """Return functions of an order q, shape (last - first, waves entries, 3).

        Waves that a function has next to nothing of are exactly 0, which files pack well.
        """
        made = super().table(q, first, last)
        by_wave = made.reshape(len(made), len(self.waves), -1)
        squares = np.sum(by_wave**2, axis=-1)
        by_wave[squares <= _LEFT_OUT * squares.sum(axis=1, keepdims=True) / len(self.waves)] = 0.0
        return made

    def _tabulated(self, q: int, functions: Array) -> Array:
        theta_o = np.unique(self.transfer.theta_o[self.weights > 0])
        by_wave = self._azimuths.analysis(self.waves)
        at_nodes = functions.reshape(len(functions), by_wave.shape[1], -1)
        amplitudes = (by_wave @ at_nodes).reshape(len(functions), len(by_wave), -1, 3)
        # Over the pole a view of the azimuth psi becomes one of psi + pi.
        even, odd = (interpolation_matrix(theta_o, self.angles(), odd=odd) for odd in (False, True))
        is_odd = (q + self.waves[:, 0]) % 2 == 1
        tables = np.empty((*amplitudes.shape[:2], self.entries, 3))
        tables[:, is_odd] = odd @ amplitudes[:, is_odd]
        tables[:, ~is_odd] = even @ amplitudes[:, ~is_odd]
        return tables.reshape(len(functions), -1, 3)

    def _looked_up(self, tables: Array) -> Array:
        transfer = self.transfer
        values, count = wave_values(self.waves, transfer.azimuths), len(transfer.theta_o)
        parts = np.where(np.arange(count) < count // 2, values.real, values.imag)
        theta_o, place = np.unique(transfer.theta_o, return_inverse=True)
        by_wave = tables.reshape(len(tables), len(self.waves), self.entries, 3)
        amplitudes = linear_matrix(self.angles(), theta_o) @ by_wave
        found = np.zeros((len(tables), count, 3))
        for part, amplitude in zip(parts, amplitudes.swapaxes(0, 1), strict=True):
            found += part[:, None] * amplitude[:, place]
        return found
