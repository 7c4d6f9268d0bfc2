"""What a lamp is: the light that was taken out of some pixels, and the discs that give it back."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.lights.search import brightness_of, typical_brightness
from shrm_cli.probe.disc import Disc, radius_of
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize, to_azimuth_elevation

_SHAPE = 0.25
"""Pixels brighter than this part of the typical brightness tell a lamp's shape."""
_LONG, _PIXELS_LONGER = 1.5, 2.0
"""A lamp is called elongated if its length is its width times this, and as many pixels more."""


@record(eq=False)
class Light:
    """Light at points of the sphere."""

    directions: Array
    """Unit, world axes, shape (n, 3)."""
    radiance: Array
    """Single values may be below 0, shape (n, 3)."""
    areas: Array
    """Solid angles, sr, shape (n,)."""

    def where(self, chosen: NDArray[np.bool_]) -> "Light":
        """Return a part of it."""
        return Light(self.directions[chosen], self.radiance[chosen], self.areas[chosen])

    @property
    def flux(self) -> Array:
        """The integral of the radiance over the sphere, shape (3,)."""
        return np.asarray(self.areas @ self.radiance)

    @property
    def axis(self) -> Array:
        """The unit direction that its light comes from on average, shape (3,)."""
        return normalize((brightness_of(self.radiance) * self.areas) @ self.directions)

    def shape(self) -> tuple[Array, Array, Array]:
        """The middle of its bright part, the directions of its length and width, and their halves.

        Returns `middle` of shape (3,); `axes` of shape (2, 3), at right angles to each other and to
        the middle; the length comes first; and `spans` of shape (2,), length and width in radians,
        of the rectangle with the same second moments.
        """
        bright = brightness_of(self.radiance)
        typical = typical_brightness(np.maximum(bright, 0), self.areas)
        core = bright >= _SHAPE * typical
        points, weights = self.directions[core], self.areas[core] / self.areas[core].sum()
        middle = normalize(weights @ points)
        first = normalize(np.cross(middle, np.eye(3)[np.argmin(np.abs(middle))]))
        frame = np.stack([first, np.cross(middle, first)])
        flat = points @ frame.T
        # A pixel is no point: it adds what its area has.
        moments = (flat * weights[:, None]).T @ flat + np.eye(2) * (weights @ self.areas[core]) / 12
        values, vectors = np.linalg.eigh(moments)
        return middle, vectors.T[::-1] @ frame, np.sqrt(12 * values[::-1])


def disc_of(light: Light, radius: float | None = None) -> Disc:
    """The disc that gives the same flux from the same direction.

    `radius` is in radians. By default the disc is as large as the light would be if all of it had
    its typical brightness: what a filter has spread around a lamp hardly counts.
    """
    bright = brightness_of(light.radiance)
    if radius is None:
        typical = typical_brightness(np.maximum(bright, 0), light.areas)
        radius = radius_of(float(bright @ light.areas) / typical)
    disc = Disc(light.axis, radius, np.ones(3))
    return replace(disc, radiance=np.maximum(light.flux, 0) / disc.solid_angle)


@record(eq=False)
class Lamp:
    """A lamp of a probe."""

    discs: tuple[Disc, ...]
    """One, or several for an elongated lamp; world axes. Their flux is what was taken out."""
    light: Light
    """What was taken out."""
    level: float
    """The brightness, mean of the channels, above which it was found."""
    peak: Array
    """The largest radiance of each channel in the probe, shape (3,)."""
    clipped: str
    """Why its maximum is suspected to be clipped; empty if it is not."""
    error: float
    """The RMS over normals of the difference that the discs make to the irradiance, over the RMS of
    the probe's irradiance."""
    pitch: float
    """The distance of the pixels in radians. Lamps that are smaller look as large as pixels."""

    @property
    def direction(self) -> Array:
        """The unit direction that its light comes from, world axes, shape (3,)."""
        return self.light.axis

    @property
    def solid_angle(self) -> float:
        """The solid angle of all its discs, sr."""
        return float(sum(disc.solid_angle for disc in self.discs))

    @property
    def radius(self) -> float:
        """The angle in radians from centre to edge, of the disc with the area of all its discs."""
        return radius_of(self.solid_angle)

    @property
    def radiance(self) -> Array:
        """The mean radiance of its discs, shape (3,)."""
        return self.light.flux / self.solid_angle

    @property
    def irradiance(self) -> Array:
        """What its discs give to a surface that faces its direction, shape (3,)."""
        cosines = np.array([disc.direction @ self.direction for disc in self.discs])
        return np.asarray(cosines @ np.array([disc.irradiance for disc in self.discs]))

    @property
    def spans(self) -> tuple[float, float]:
        """Length and width in radians, of the rectangle with the same second moments."""
        long, short = self.light.shape()[2]
        return float(long), float(short)

    @property
    def is_elongated(self) -> bool:
        """Whether it is a tube or a window rather than a disc."""
        long, short = self.spans
        return long > _LONG * short and long - short > _PIXELS_LONGER * self.pitch

    @property
    def is_resolved(self) -> bool:
        """Whether its radius is its own, and not that of the pixels which show it."""
        return self.radius > self.pitch

    def summary(self) -> dict[str, Any]:
        """The numbers by name, for JSON: angles in degrees, solid angles in sr."""
        azimuth, elevation = to_azimuth_elevation(self.direction)
        long, short = self.spans
        return {
            "direction": self.direction.tolist(),
            "azimuth": azimuth,
            "elevation": elevation,
            "radius": float(np.degrees(self.radius)),
            "pixel": float(np.degrees(self.pitch)),
            "solid_angle": self.solid_angle,
            "irradiance": self.irradiance.tolist(),
            "radiance": self.radiance.tolist(),
            "peak": self.peak.tolist(),
            "length": float(np.degrees(long)),
            "width": float(np.degrees(short)),
            "elongation": long / short,
            "is_elongated": self.is_elongated,
            "clipped": self.clipped,
            "level": self.level,
            "error": self.error,
            "discs": [disc_facts(disc) for disc in self.discs],
        }


def disc_facts(disc: Disc) -> dict[str, Any]:
    """The numbers of a disc by name, as `Lamp.summary` has them."""
    azimuth, elevation = to_azimuth_elevation(disc.direction)
    return {
        "direction": disc.direction.tolist(),
        "azimuth": azimuth,
        "elevation": elevation,
        "radius": float(np.degrees(disc.radius)),
        "irradiance": disc.irradiance.tolist(),
        "radiance": disc.radiance.tolist(),
    }
