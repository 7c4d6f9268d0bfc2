"""Discs in the place of a lamp that differ least from it in what a material reflects.

A bulb is a bright middle in a dim rim, and a tube is long: two or three discs that overlap show
either in glossy lobes, where many discs beside each other still show gaps. So all discs of a lamp
are moved, widened and lit together. Lobes blur light as a zonal filter does, which makes a disc a
profile over the angle from its middle, and a lamp a picture of a few hundred points. Given middles
and radii the radiances follow by linear least squares. Some may be negative, as of a ring, which is
a disc without its middle. Others would nearly cancel each other, because a blur hides that, and a
sharper lobe than the blur shows it: then none may be negative, which is as near with fewer discs.

References: Golub & Pereyra 1973, The differentiation of pseudo-inverses and nonlinear least squares
problems whose variables separate (variable projection); Kaufman 1975, for its Jacobian.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array, Indices, node_before
from shrm_cli.lights.lamp import Light, disc_of
from shrm_cli.probe.disc import Disc, disc_directions, radius_of, zonal_of_discs
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, horizontal_tangents, normalize, surface_frames
from shrm_cli.sphere.harmonics import legendre_degrees
from shrm_cli.vocabulary import LUMINANCE

_MARGIN = 0.1
"""Radians around a lamp that its blurred light is compared in."""
_LEAST_SAMPLES, _MOST_SAMPLES = 500, 2000
_MOST_CELLS = 2**14
"""The cells that hold the pixels of a lamp, of which it may have hundreds of thousands."""
_RADII, _ANGLES = 48, 2048
"""The radii and angles of the table of blurred discs, between which it is interpolated."""
_START_RADII = 7
"""The radii of discs that may be added."""
_FLUX = 3.0
"""How much more than all of the picture the flux of the lamp weighs, which has to stay."""
_STEPS, _DAMPINGS = 12, 5
"""The most steps with so many discs, and the most dampings that are tried for one."""
_GAIN = 1e-3
"""The part of the squared error that a step takes away at least, or it is the last one."""
_AROUND, _BESIDE = 64, 1e-3
"""The points around a circle where light is looked at, so many radii from it on either side."""
_DARK, _BRIGHT = -0.125, 3.0
"""How dark and how bright discs may be together, in units of a lamp's brightest pixel. Those of a
sun of seven pixels had up to thirty times its light, and as much less than none beside it, which
made black pixels in a coat, and those of a square soft box 44 times and -23 times."""
_RANK = 1e-6
"""What others hold of a disc but for this part of it, in their measure, is one of them."""


def fitted_discs(light: Light, amplitudes: Array, most: int) -> Iterator[tuple[Disc, ...]]:
    """Yield one disc for a lamp, then two, three and so on, as long as more discs may be nearer.

    Parameters
    ----------
    light : Light
    amplitudes : array of shape (order+1,)
        What the blur by a material multiplies each degree of light with, as far as its energy tells
        that.
    most : int
        The most discs.

    Yields
    ------
    tuple of Disc
        In world axes. Their flux is that of the light, to a thousandth or so. Radiances may be
        negative, as long as discs are like the lamp together; see `are_like`.
    """
    picture, only_bright = _Picture(light, amplitudes), False
    shape: Array | None = picture.first()
    for count in range(1, most + 1):
        if shape is None:
            return
        found = picture.refined(shape, only_bright)
        is_like = are_like(picture.discs(found), light)
        if not (is_like or only_bright):
            only_bright = True
            found = picture.refined(shape, only_bright)
            is_like = are_like(picture.discs(found), light)
        if is_like:
            yield picture.discs(found)
        shape = picture.with_one_more(found) if count < most else None


def are_like(discs: Sequence[Disc], light: Light) -> bool:
    """Tell whether discs are nowhere far darker than nothing, or brighter than their lamp.

    Their circles bound areas of even light, each of which is looked at beside its circles.
    """
    around = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    sides = (1 - _BESIDE, 1 + _BESIDE)
    axes = np.array([disc.direction for disc in discs])
    radii = np.array([disc.radius for disc in discs])
    circles = [[from_angles(side * radius, around) for side in sides] for radius in radii]
    frames = surface_frames(axes, horizontal_tangents(axes))
    places = (np.array(circles) @ frames[:, None]).reshape(-1, 3)
    inside = places @ axes.T >= np.cos(radii)
    found = inside @ np.array([disc.radiance @ LUMINANCE for disc in discs])
    peak = float((light.radiance @ LUMINANCE).max())
    return bool(found.min() >= _DARK * peak and found.max() <= _BRIGHT * peak)


@record(eq=False)
class _Lit:
    """Discs with the radiances that suit them best."""

    shape: Array
    """The middles and radii of the discs, as `_Picture` has them, shape (n, 3)."""
    columns: Array
    """What each looks like at radiance 1, shape (samples + 1, n)."""
    radiances: Array
    """Shape (n, 3)."""
    left: Array
    """What is left of the picture, shape (samples + 1, 3)."""
    only_bright: bool
    """Whether no radiance may be negative."""

    @property
    def error(self) -> float:
        return float(np.sum(self.left**2))

    @cached_property
    def held(self) -> Array:
        """An orthonormal basis of the columns, of their shape."""
        return np.asarray(np.linalg.qr(self.columns)[0])

    def beside(self, others: Array) -> Array:
        """Return what of other columns is not in the span of these."""
        return others - self.held @ (self.held.T @ others)


class _Picture:
    """A lamp as it looks blurred, at points around it, and discs beside it.

    Discs are rows x, y and log r: their middle ``(x, y, 1)`` in the frame of the lamp, which is not
    of unit length, and their radius in radians.
    """

    def __init__(self, light: Light, amplitudes: Array) -> None:
        self._light, self._amplitudes = light, amplitudes
        axis = light.axis[None]
        self._frame = surface_frames(axis, horizontal_tangents(axis))[0]
        angles = np.arccos(np.clip(light.directions @ axis[0], -1, 1))
        self._least = radius_of(float(light.areas.mean()))
        self._reach = max(float(angles.max()), self._least)
        around = Disc(axis[0], min(self._reach + _MARGIN, np.pi), np.ones(3))
        wanted = around.solid_angle * (len(amplitudes) / (1.2 * np.pi)) ** 2
        count = int(min(max(wanted, _LEAST_SAMPLES), _MOST_SAMPLES))
        self._log_radii = float(np.log(self._least)), float(np.log(1.2 * self._reach))
        self._samples = disc_directions(around, count)
        self._scale = np.sqrt(around.solid_angle / count)
        self._table = self._blurred_discs()
        seen = self._of_pixels()
        flux = max(float(np.linalg.norm(light.flux)), 1e-300)
        self._flux_weight = _FLUX * float(np.linalg.norm(seen)) / flux
        self._target = np.vstack([seen, light.flux * self._flux_weight])

    def first(self) -> Array:
        """Return the disc of the same flux, typical brightness and mean direction."""
        return np.array([[0.0, 0.0, np.log(max(disc_of(self._light).radius, self._least))]])

    def discs(self, lit: _Lit) -> tuple[Disc, ...]:
        """Return discs in world axes."""
        directions, radii = self._directions(lit.shape), np.exp(lit.shape[:, 2]).tolist()
        return tuple(Disc(*row) for row in zip(directions, radii, lit.radiances, strict=True))

    def refined(self, shape: Array, only_bright: bool = False) -> _Lit:
        """Move and widen discs until the squared error falls no more: Levenberg and Marquardt."""
        damping, found = 1e-2, self._lit(shape, only_bright)
        for _ in range(_STEPS):
            matrix, slope, scale = self._normal_equations(found)
            for _ in range(_DAMPINGS):
                damped = matrix + damping * np.diag(np.diag(matrix) + 1e-12 * np.trace(matrix))
                step = (np.linalg.solve(damped, slope) * scale).reshape(3, -1).T
                moved = self._lit(self._bounded(found.shape + step), only_bright)
                if moved.error < found.error:
                    break
                damping *= 6
            else:
                return found
            gain, found = 1 - moved.error / found.error, moved
            damping = max(damping / 5, 1e-6)
            if gain < _GAIN:
                return found
        return found

    def with_one_more(self, lit: _Lit) -> Array | None:
        """Add the disc that takes away most of what is left; None where all are there."""
        choices, own, squares = self._choices
        # One product of both reads all choices once. What is not in the span of the discs is never
        # made of all choices.
        both = np.hstack([lit.held, lit.beside(lit.left)]).T @ own
        held, left = np.split(both, [len(lit.shape)])
        new = squares - (held**2).sum(axis=0)
        gains = (left**2).sum(axis=0) / np.maximum(new, 1e-300)
        gains[new < _RANK**2 * squares] = 0
        if lit.only_bright:
            gains[LUMINANCE @ left < 0] = 0
        best = int(np.argmax(gains))
        return np.vstack([lit.shape, choices[best]]) if gains[best] > 0 else None

    @cached_property
    def _choices(self) -> tuple[Array, Array, Array]:
        """Discs of some radii all over the lamp, what they look like, and the squares of that."""
        found, whole = [], Disc(self._frame[2], min(self._reach, 1.2), np.ones(3))
        least = min(max(self._reach / 10, 1.5 * self._least), self._reach)
        for radius in np.geomspace(least, self._reach, _START_RADII):
            count = int((whole.radius / (0.6 * radius)) ** 2) + 1
            local = disc_directions(whole, count) @ self._frame.T
            middles = np.vstack([[0.0, 0.0], local[:, :2] / local[:, 2:]])
            found.append(np.column_stack([middles, np.full(len(middles), np.log(radius))]))
        choices = self._bounded(np.vstack(found))
        own = self._columns(choices)
        return choices, own, np.sum(own**2, axis=0)

    def _normal_equations(self, lit: _Lit) -> tuple[Array, Array, Array]:
        """Return Gauss and Newton's matrix and right side, and the units of their unknowns.

        The unknowns are all x, then all y, then all log r. As radiances follow, only what changes
        beside the span of the columns counts.
        """
        scale = np.repeat([self._reach, self._reach, 1.0], len(lit.shape))
        change = lit.beside(self._slopes(lit.shape)) * scale
        radiances = np.tile(lit.radiances, (3, 1))
        matrix = (change.T @ change) * (radiances @ radiances.T)
        return matrix, np.sum((change.T @ lit.left) * radiances, axis=1), scale

    def _lit(self, shape: Array, only_bright: bool) -> _Lit:
        """Return discs with their best radiances, without those that would have negative ones."""
        columns = self._columns(shape)
        radiances = np.linalg.lstsq(columns, self._target, rcond=_RANK)[0]
        shown = radiances @ LUMINANCE
        if only_bright and len(shape) > 1 and (shown < 0).any():
            return self._lit(np.delete(shape, shown.argmin(), axis=0), only_bright)
        left = self._target - columns @ radiances
        return _Lit(shape, columns, radiances, left, only_bright)

    def _columns(self, shape: Array) -> Array:
        """Return what discs of radiance 1 look like, and their weighted solid angles below."""
        angles = np.arccos(np.clip(self._samples @ self._directions(shape).T, -1, 1))
        blurred = self._looked_up(angles, shape[:, 2]) * self._scale
        return np.vstack([blurred, _solid_angles(shape[:, 2]) * self._flux_weight])

    def _slopes(self, shape: Array) -> Array:
        """Return the derivatives of `_columns` by all x, y and log r, (samples + 1, 3 n)."""
        directions, radii = self._directions(shape), np.exp(shape[:, 2])
        local = directions @ self._frame.T
        cosines = np.clip(self._samples @ directions.T, -1, 1)
        farther, wider = self._looked_up_slopes(np.arccos(cosines), shape[:, 2])
        # The cosine of the angle changes as the unit vector to the middle (x, y, 1) does.
        by_cosine = -farther / np.maximum(np.sqrt(1 - cosines**2), 1e-9) * local[:, 2]
        sides = (self._samples @ self._frame[:2].T).T[..., None]
        moved = [by_cosine * (sides[axis] - cosines * local[:, axis]) for axis in (0, 1)]
        of_flux = np.concatenate([0 * radii, 0 * radii, 2 * np.pi * radii * np.sin(radii)])
        seen = np.concatenate([*moved, wider], axis=1) * self._scale
        return np.vstack([seen, of_flux * self._flux_weight])

    def _directions(self, shape: Array) -> Array:
        middles = np.column_stack([shape[:, :2], np.ones(len(shape))])
        return normalize(middles) @ self._frame

    def _bounded(self, shape: Array) -> Array:
        """Return discs whose middles are on the lamp, and that are no larger than it."""
        size = np.hypot(shape[:, 0], shape[:, 1])[:, None]
        most = np.tan(min(self._reach, 1.4))
        inner = shape[:, :2] * np.minimum(1.0, most / np.maximum(size, 1e-300))
        radii = np.clip(shape[:, 2:], np.log(self._least), np.log(1.2 * self._reach))
        return np.hstack([inner, radii])

    @property
    def _farthest(self) -> float:
        """The largest angle of the table: between a sample and a disc on the other side."""
        return min(2 * self._reach + _MARGIN, np.pi)

    def _blurred_discs(self) -> Array:
        """Return profiles of blurred discs of radiance 1, shape (radii, angles)."""
        log_radii = np.linspace(*self._log_radii, _RADII)
        radii, areas = np.exp(log_radii), _solid_angles(log_radii)
        order = len(self._amplitudes) - 1
        at = np.cos(np.linspace(0, self._farthest, _ANGLES))
        zonal = zonal_of_discs(order, radii, areas) * self._amplitudes[:, None]
        result = np.zeros((_RADII, _ANGLES))
        for degree, here in legendre_degrees(order, at, max_m=0):
            result += zonal[degree][:, None] * here[0]
        return result

    def _looked_up(self, angles: Array, log_radii: Array) -> Array:
        """Return profiles at angles (n, discs), each of its own radius, interpolated."""
        own, _ = self._profiles(log_radii)
        at, across = self._places(angles, len(own))
        here = own.take(at)
        return np.asarray(here + across * (own.take(at + 1) - here))

    def _looked_up_slopes(self, angles: Array, log_radii: Array) -> tuple[Array, Array]:
        """Return the derivatives of what `_looked_up` does, by the angles and by log r."""
        own, wider = self._profiles(log_radii)
        at, across = self._places(angles, len(own))
        by_angle = (own.take(at + 1) - own.take(at)) * ((_ANGLES - 1) / self._farthest)
        here = wider.take(at)
        return by_angle, here + across * (wider.take(at + 1) - here)

    def _profiles(self, log_radii: Array) -> tuple[Array, Array]:
        """Return the profiles of discs, (discs, angles), and their derivatives by log r."""
        low, high = self._log_radii
        steps = (_RADII - 1) / (high - low)
        row, down = node_before((log_radii - low) * steps, _RADII)
        rise = self._table[row + 1] - self._table[row]
        return self._table[row] + down[:, None] * rise, rise * steps

    def _places(self, angles: Array, count: int) -> tuple[Indices, Array]:
        """Return where angles (n, discs) stand in `_profiles`, and how far behind that.

        `count` is that of the profiles: 1 where all discs are of one radius.
        """
        column, across = node_before(angles * ((_ANGLES - 1) / self._farthest), _ANGLES)
        return column + np.arange(count) * _ANGLES, across

    def _of_pixels(self) -> Array:
        """Return the blurred lamp at the samples, shape (samples, 3)."""
        directions, fluxes = self._cells()
        small = np.full(1, self._log_radii[0])
        scale = self._scale / _solid_angles(small)
        seen = np.zeros((len(self._samples), 3))
        step = max(2**16 // len(self._samples), 1)
        for start in range(0, len(directions), step):
            part = slice(start, start + step)
            angles = np.arccos(np.clip(self._samples @ directions[part].T, -1, 1))
            seen += self._looked_up(angles, small) @ fluxes[part]
        return seen * scale

    def _cells(self) -> tuple[Array, Array]:
        """Return directions and fluxes of the pixels, of many small ones together."""
        light = self._light
        fluxes = light.radiance * light.areas[:, None]
        if len(fluxes) <= _MOST_CELLS:
            return light.directions, fluxes
        local = light.directions @ self._frame.T
        places = local[:, :2] / np.maximum(local[:, 2:], 1e-3)
        edge = int(np.sqrt(_MOST_CELLS))
        low, size = places.min(axis=0), np.ptp(places, axis=0)
        across, down = np.minimum((places - low) / size * edge, edge - 1).astype(int).T
        _, cell = np.unique(across * edge + down, return_inverse=True)
        sums = np.zeros((cell.max() + 1, 6))
        np.add.at(sums, cell, np.hstack([fluxes, light.directions * light.areas[:, None]]))
        return normalize(sums[:, 3:]), sums[:, :3]


def _solid_angles(log_radii: Array) -> Array:
    return np.asarray(4 * np.pi * np.sin(np.exp(log_radii) / 2) ** 2)
