"""Directions, angles and frames. World axes: right-handed, +Y up; SH polar axis +Z."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.vocabulary import Center

_GRAZING = 1e-6
"""Length of R + V below which both are taken to be opposite."""

_ROUNDING = 1e-14
"""How far the squared length of a unit vector may be from 1."""


def as_vectors(**given: ArrayLike) -> list[Array]:
    """Return vectors as floats of shape (..., 3), each in its precision, if it has one.

    Raises an `ArgumentError`, which names the argument, for anything else, and for vectors that
    cannot be broadcast to one shape.
    """
    found: list[Array] = []
    for argument, vectors in given.items():
        try:
            array = np.asarray(vectors)
            found.append(array if array.dtype.kind == "f" else array.astype(float))
        except (TypeError, ValueError):
            raise ArgumentError(argument, "are no numbers; give vectors, shape (..., 3)") from None
        shape = found[-1].shape
        if shape[-1:] != (3,):
            raise ArgumentError(argument, f"of shape {shape} are no vectors; give (..., 3)")
        try:
            np.broadcast_shapes(found[0].shape, shape)
        except ValueError:
            others = f"{next(iter(given))} of shape {found[0].shape}"
            raise ArgumentError(argument, f"of shape {shape} do not go with {others}") from None
    return found


def as_directions(**given: ArrayLike) -> list[Array]:
    """Return unit vectors along those given, in double precision; see `as_vectors`.

    Those that are unit vectors but for rounding stay as they are.

    Raises an `ArgumentError` for those that point nowhere, too: of length 0, NaN or infinite.
    """
    found = [vectors.astype(float, copy=False) for vectors in as_vectors(**given)]
    for argument, vectors in zip(given, found, strict=True):
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            squares = np.einsum("...i,...i->...", vectors, vectors)
        pointing = (squares > 0) & (squares < np.inf)
        if not pointing.all():
            first = vectors[~pointing][0].tolist()
            raise ArgumentError(argument, f"hold {first}, whose length is 0 or not finite")
    return [_of_length_1(vectors) for vectors in found]


def _of_length_1(vectors: Array) -> Array:
    squares = np.einsum("...i,...i->...", vectors, vectors)
    if (np.abs(squares - 1) <= _ROUNDING).all():
        return vectors
    # The squares of short vectors may be too small to be told apart.
    scaled = vectors / np.abs(vectors).max(axis=-1, keepdims=True)
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))


def from_angles(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Unit vectors ``(sin t cos p, sin t sin p, cos t)``, shape (..., 3).

    `theta` and `phi`, broadcastable, are polar angle from +Z and azimuth from +X towards +Y,
    radians.
    """
    # Angles of a grid are few before they are broadcast, and their functions take the time.
    sine = np.sin(theta)
    parts = sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def to_angles(directions: ArrayLike) -> tuple[Array, Array]:
    """Polar angle and azimuth (radians) of directions, shape (..., 3), of any length."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    # atan2 keeps full precision near the poles, where acos loses half the digits.
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def from_azimuth_elevation(azimuth: float, elevation: float) -> Array:
    """Unit vector of a viewing direction given in degrees, as users give it.

    Azimuth 0 is +Z and turns about the up axis +Y towards +X; elevation is the height above
    the horizontal plane.
    """
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


def to_azimuth_elevation(direction: ArrayLike) -> tuple[float, float]:
    """Azimuth in -180 .. 180 and elevation of a direction, shape (3,), of any length; degrees."""
    x, y, z = (float(part) for part in np.asarray(direction))
    return float(np.degrees(np.arctan2(x, z))), float(np.degrees(np.arctan2(y, np.hypot(x, z))))


def turn_matrix(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """Matrix of a rotation given in degrees, as users give it, shape (3, 3).

    Roll comes first, about +Z from +X towards +Y; then pitch, about +X from +Y towards +Z; last
    yaw, about the up axis +Y from +Z towards +X, as azimuths turn. All axes are those of the world.
    """
    (sy, sp, sr), (cy, cp, cr) = (f(np.radians([yaw, pitch, roll])) for f in (np.sin, np.cos))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return about_y @ about_x @ about_z


def turn_about(axis: ArrayLike, degrees: float) -> Array:
    """Matrix of a rotation about any axis, counterclockwise as seen from its end, shape (3, 3).

    About +Y, +X and +Z it turns as the yaw, the pitch and the roll of `turn_matrix`.

    `axis`, of shape (3,), is of any length but 0.
    """
    x, y, z = normalize(np.asarray(axis, dtype=float))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    return np.eye(3) + sine * cross + (1 - cosine) * cross @ cross


def normalize(vectors: ArrayLike) -> Array:
    """Vectors, shape (..., 3), divided by their lengths."""
    vectors = np.asarray(vectors)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def reflect(views: ArrayLike, normals: ArrayLike) -> Array:
    """Mirror direction ``R = 2 (N.V) N - V``; all unit, pointing away from the surface."""
    views, normals = np.asarray(views), np.asarray(normals)
    return 2 * np.sum(normals * views, axis=-1, keepdims=True) * normals - views


def bisector(reflections: ArrayLike, views: ArrayLike) -> Array:
    """Normal ``N = (R + V) / |R + V|`` that mirrors each view into each reflection."""
    reflections, views = np.broadcast_arrays(reflections, views)
    total = reflections + views
    # Where R = -V every direction at a right angle is a normal: take one.
    grazing = np.linalg.norm(total, axis=-1) < _GRAZING
    axes = np.eye(3)[np.argmin(np.abs(views[grazing]), axis=-1)]
    total[grazing] = np.cross(views[grazing], axes)
    return normalize(total)


def horizontal_tangents(normals: ArrayLike) -> Array:
    """Unit tangents around +Y, as brushing on a lathe or parallels of a globe, shape (..., 3).

    The tangent of N = +Z is +X. So is that of N = +-Y, where all tangents are horizontal.

    `normals`, of shape (..., 3), are unit, world axes.
    """
    normals = np.asarray(normals)
    x, z = normals[..., 0], normals[..., 2]
    length = np.hypot(x, z)
    pole = length < np.finfo(normals.dtype).tiny if normals.dtype.kind == "f" else length == 0
    scale = np.where(pole, 1, length)
    return np.stack([np.where(pole, 1, z / scale), np.zeros_like(z), -x / scale], axis=-1)


def surface_frames(normals: Array, tangents: Array) -> Array:
    """The rows T, N x T and N of surfaces: ``frame @ world = local``, shape (n, 3, 3).

    `normals` and `tangents`, each of shape (n, 3), are unit vectors, world axes, at right angles to
    each other.
    """
    return np.stack([tangents, np.cross(normals, tangents), normals], axis=-2)


def tilted_frame(directions: Array, tilt: Array) -> Array:
    """Directions (..., 3) in a frame whose z axis is tilted by angles (...) from +Z towards +X.

    A normal is tilted by half the angle of the view about C, so this brings directions into its
    frame.
    """
    cosine, sine = np.cos(tilt), np.sin(tilt)
    x, y, z = np.moveaxis(directions, -1, 0)
    parts = cosine * x - sine * z, y, sine * x + cosine * z
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def turned(vectors: Array, angle: float) -> Array:
    """Vectors (..., 3) turned about the z axis, radians, in their own precision."""
    if not angle:
        return vectors
    cosine, sine = float(np.cos(angle)), float(np.sin(angle))
    result = np.empty_like(vectors)
    x, y, result[..., 2] = np.moveaxis(vectors, -1, 0)
    result[..., 0], result[..., 1] = cosine * x - sine * y, sine * x + cosine * y
    return result


def views_around(centers: ArrayLike, theta: float, count: int) -> Iterator[Array]:
    """Yield directions at an angle from each center, at evenly spaced azimuths of its local frame.

    `centers`, of shape (..., 3), are unit vectors. `theta` is the angle, radians.

    Yields an array of shape (..., 3).
    """
    frames = local_frame(*to_angles(centers))
    for phi in 2 * np.pi * np.arange(count) / count:
        yield frames @ from_angles(theta, phi)


def local_frame(theta: ArrayLike, phi: ArrayLike) -> Array:
    """Columns ``x' = dC/dtheta``, ``y' = dC/dphi / sin(theta)``, ``z' = C``, shape (..., 3, 3).

    These are the columns of ``Rz(phi) Ry(theta)``: ``frame @ local = world``.
    """
    theta, phi = np.broadcast_arrays(theta, phi)
    ct, st, cp, sp = np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    zero = np.zeros_like(ct)
    rows = [[ct * cp, -sp, st * cp], [ct * sp, cp, st * sp], [-st, zero, ct]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def central_directions(
    center: Center, normals: Array, views: Array, tangents: Array | None = None
) -> Array:
    """Compute the central directions C of points of a surface.

    `center` is the mirror direction of the view, the normal, or the tangent. `normals` and `views`,
    each of shape (..., 3), broadcastable, are unit vectors in world axes. `tangents`, of shape
    (..., 3), are unit vectors in world axes; horizontal by default.

    Returns an array of shape (..., 3): unit vectors in world axes.
    """
    if center == "reflection":
        return reflect(views, normals)
    if center == "normal":
        return normals
    return horizontal_tangents(normals) if tangents is None else tangents
