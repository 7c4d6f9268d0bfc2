"""Where a probe was captured, and the box that stands for the room around it.

A probe tells the light of one point. At another point of its room the same wall lies in another
direction, which is found where a ray from there meets the box: box-projected, or
parallax-corrected, cube maps.

References: Lagarde and Zanuttini 2012, Local Image-based Lighting With Parallax-corrected Cubemaps.
"""

import json
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.files.json_text import parse_json
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize
from shrm_cli.vocabulary import PROXY_ATTRIBUTE

PARALLEL = float(np.finfo(np.float32).eps)
"""The component below which a direction counts as parallel to a face: what rounding leaves of those
that shaders have."""

Place = tuple[float, float, float]


@record
class ProxyBox:
    """A box whose faces run along the world axes, around the place of a probe."""

    at: Place
    """Where the probe was captured, within the box."""
    low: Place
    high: Place
    """`low` and `high`: the least and the largest coordinates."""

    @classmethod
    def of(cls, low: ArrayLike, high: ArrayLike, at: ArrayLike | None = None) -> "ProxyBox":
        """Return a box by two corners; the probe was captured in its middle by default."""
        corners = np.array([low, high], dtype=float).reshape(2, 3)
        place = corners.mean(axis=0) if at is None else np.asarray(at, dtype=float).reshape(3)
        if not (np.isfinite(corners).all() and (corners[1] > corners[0]).all()):
            raise ProbeError("`box` is flat; give two corners x0,y0,z0,x1,y1,z1, the lesser first")
        # The place must be off the faces by more than rounding, or directions from it are none.
        edge = 1e-6 * (corners[1] - corners[0])
        if not ((place > corners[0] + edge) & (place < corners[1] - edge)).all():
            given = ",".join(f"{each:g}" for each in place)
            raise ProbeError(f"`at` {given} is not within the box; give a place inside it")
        return cls(*(tuple(map(float, each)) for each in (place, *corners)))  # type: ignore[arg-type]

    @classmethod
    def read(cls, found: Any) -> "ProxyBox | None":
        """Return the box of a record; None where a file holds anything else."""
        try:
            numbers = [np.array(found[key], dtype=float) for key in ("min", "max", "at")]
            return cls.of(*numbers)
        except (KeyError, IndexError, TypeError, ValueError, OverflowError, ProbeError):
            return None

    @classmethod
    def of_text(cls, text: str) -> "ProxyBox | None":
        """Return the box of an attribute; None where it is wrong."""
        try:
            return cls.read(parse_json(text))
        except ValueError:
            return None

    def record(self) -> dict[str, list[float]]:
        """Return what files hold of it."""
        return {"at": list(self.at), "min": list(self.low), "max": list(self.high)}

    def turned(self, matrix: ArrayLike) -> "ProxyBox | None":
        """Return the box turned about the origin; None where its faces leave the world axes.

        `matrix`, of shape (3, 3), is orthogonal; what was in a direction d is in ``matrix @ d``.
        """
        exact = np.round(np.asarray(matrix, dtype=float))
        if np.abs(exact - matrix).max() > 1e-6:
            return None
        corners = np.array([self.low, self.high]) @ exact.T
        return ProxyBox.of(corners.min(axis=0), corners.max(axis=0), exact @ self.at)

    def directions(self, points: ArrayLike, directions: ArrayLike) -> Array:
        """Return where the probe saw what rays meet of the box: unit, shape (..., 3).

        `points`, of shape (..., 3), are where the rays begin, in world axes. What lies outside the
        box is moved to it. `directions`, of shape (..., 3), broadcastable, are unit vectors.
        """
        rays = np.asarray(directions, dtype=float)
        start = np.clip(points, self.low, self.high)
        ahead = np.where(rays > 0, self.high, self.low) - start
        is_parallel = np.abs(rays) < PARALLEL
        ways = np.where(is_parallel, np.inf, ahead / np.where(is_parallel, 1, rays))
        met = start + ways.min(axis=-1)[..., None] * rays
        return normalize(met - self.at)


def box_attributes(proxy: ProxyBox | None) -> dict[str, str]:
    """Return the attributes of a probe's file that hold its box; none where there is no box."""
    return {} if proxy is None else {PROXY_ATTRIBUTE: json.dumps(proxy.record())}


def carried(vectors: ArrayLike, before: ArrayLike, after: ArrayLike) -> Array:
    """Turn vectors by the least rotation that takes one direction to another, shape (..., 3).

    Two half turns, about `before` and about what is between both, make twice the angle between
    their axes.

    `vectors`, `before` and `after` are each of shape (..., 3), broadcastable. The directions are
    unit, and not opposite.
    """
    middle = normalize(np.add(before, after))
    return _half_turned(_half_turned(np.asarray(vectors), np.asarray(before)), middle)


def _half_turned(vectors: Array, axis: Array) -> Array:
    return 2 * np.sum(axis * vectors, axis=-1, keepdims=True) * axis - vectors
