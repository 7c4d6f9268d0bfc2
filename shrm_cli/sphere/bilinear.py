"""What bilinear filtering of a cube's texels does to functions.

A GPU looks a cube map up by weighting the four texels around a direction. Between the texels the
result is too smooth, and the finer the detail the more of it is lost. A function of degree l is
locally a plane wave of ``l + 1/2`` radians per radian. A wave that advances by ``a`` radians from
one sample to the next is, interpolated linearly, correlated with itself by ``sinc(a/2)^2`` and has
the mean square ``(2 + cos a) / 3``; both are means over the positions between the samples. Along
two axes both factors multiply. What is left is a mean over the face, where texels differ in size,
and over the directions of the wave.

Across an edge of a center-sampled cube the texels of the other face do not lie where the own grid
would go on: at the position s along the edge they are nearly s / 2 texels off, so that the wave
comes with a wrong phase.

So the error is predicted from the energy of each degree, as if waves met the texels in every phase
and direction. Under a bare sun the few texels of a small cube show one lobe, at one place among
them, and the prediction is up to a fifth off. A small cube is soon looked through, and what it
misses of given functions is found between its texels.
"""

import numpy as np

from shrm_cli.arrays import Array, Memo
from shrm_cli.sphere.cube import cube_solid_angles, face_axes, nearest_texels
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.quadrature import linear_matrix, nodes
from shrm_cli.sphere.synthesis import CubeSeries, synthesize_cube
from shrm_cli.vocabulary import Sampling

_POSITIONS = 8
"""Places over half a face along each of its axes."""
_DIRECTIONS = 8
"""Directions of waves, over half a turn."""
_STEP = 64
"""Errors are found to orders that are multiples of this. A search of maps asks for many orders."""
_known_errors = Memo(2**22)
"""The errors at each place, of some orders and sizes; those of order 128 take 66 kB."""
_PLACES_SIZE = 16
"""Texels of the cube that tells where on the faces details lie."""
_BEYOND = 1 / 12
"""The mean square of the weight of texels beyond an edge, within half a texel of it."""


def bilinear_errors(
    order: int, size: int, sampling: Sampling = "center", places: Array | None = None
) -> Array:
    """Return the mean squared error of bilinear filtering, relative to the energy of each degree.

    `places`, of shape (n, n), are what `energy_places` returns for the function that is filtered.
    By default its energy is the same everywhere.

    Returns an array of shape (order+1,): degree 0 is filtered without error. Where a degree is far
    beyond what the texels resolve, its error approaches 13/9: the wave is lost, and the values of
    single texels are left.
    """
    if places is None:
        places = energy_places(np.ones((1, 12 * _POSITIONS, 2 * _POSITIONS)))
    key = -(-order // _STEP) * _STEP, size, sampling, len(places)
    errors = _known_errors.get(key, lambda: _errors_at(*key))
    return np.asarray(places.reshape(-1) @ errors[:, : order + 1])


def _errors_at(order: int, size: int, sampling: Sampling, count: int) -> Array:
    """Return the errors of `bilinear_errors` at each place, shape (count^2, order+1)."""
    step = 2 / size if sampling == "center" or size == 1 else 2 / (size - 1)
    middles = (np.arange(count) + 0.5) / count
    t, s = np.meshgrid(middles, middles, indexing="ij")
    along_s, along_t = _advances(s, t)
    # Shape (positions, directions, degrees).
    degree = np.arange(order + 1)
    wave = np.where(degree > 0, degree + 0.5, 0.0) * step
    a, b = along_s.reshape(-1, _DIRECTIONS, 1) * wave, along_t.reshape(-1, _DIRECTIONS, 1) * wave
    # With s = sin(a/2), sinc(a/2) is 2s/a, and cos a is 1 - 2s^2.
    squares = [np.sin(each / 2) ** 2 for each in (a, b)]
    correlation = np.divide(
        16 * squares[0] * squares[1], (a * b) ** 2, out=np.ones_like(a), where=wave > 0
    )
    square = (3 - 2 * squares[0]) * (3 - 2 * squares[1]) / 9
    errors = np.mean(1 - 2 * correlation + square, axis=1)
    if sampling == "center":
        # Within half a texel of the edge at t = 1, and of the one at s = 1, which has as much.
        last = np.arange(len(errors)) >= len(errors) - count
        strip = min(count * step / 2, 1.0)
        shift = s.reshape(-1, 1, 1)[last] / (2 + step)
        errors[last] += 2 * strip * np.mean(_BEYOND * 2 * (1 - np.cos(shift * a[last])), axis=1)
    return np.asarray(errors)


def energy_places(cubes: Array) -> Array:
    """Return how the energy of functions is shared among the places of a face that differ in size.

    Texels are larger in the middle of a face than at its corners, so that a lamp in the middle of a
    face is filtered with several times the error of one at a corner. By symmetry a quarter of a
    face tells all.

    `cubes`, of shape (n, 6 N, N), are values of the functions at texels of center-sampled cubes, of
    an even number N.

    Returns an array of shape (N/2, N/2): the shares of the energy in the texels of a quarter of a
    face, from its middle outwards.
    """
    size = cubes.shape[-1]
    half = size // 2
    s = (np.arange(size) + 0.5) * 2 / size - 1
    energy = np.sum(cubes.astype(float) ** 2, axis=0).reshape(6, size, size).sum(axis=0)
    energy *= (1 + s[:, None] ** 2 + s**2) ** -1.5
    energy = energy[half:] + energy[:half][::-1]
    energy = energy[:, half:] + energy[:, :half][:, ::-1]
    # The face's two axes can be exchanged, too.
    energy = energy + energy.T
    return np.asarray(energy / max(energy.sum(), 1e-300))


def detail_places(series: Array) -> Array | None:
    """Return where on the faces of a cube the finest details of functions are.

    Bilinear filtering loses what second derivatives tell, which a small cube shows well enough.

    `series`, of shape ((order+1)^2, n), are the functions' coefficients over real harmonics, to an
    order that a small cube shows.

    Returns the argument of `bilinear_errors`; None where there is no detail.
    """
    degree = degrees(order_of(len(series)))
    details = series * (degree * (degree + 1))[:, None]
    if not details.any():
        return None
    return energy_places(synthesize_cube(details, _PLACES_SIZE, dtype=np.float32))


def _advances(s: Array, t: Array) -> tuple[Array, Array]:
    """Return how many radians waves of 1 radian per radian advance for each unit of s and t.

    `s` and `t`, each of shape (n, n), are positions on the face ``(1, s, t)``.

    Returns `along_s` and `along_t`, each of shape (n, n, directions).
    """
    # The direction is d = (1, s, t) / r, and its derivatives are tangents of the sphere.
    r = np.sqrt(1 + s**2 + t**2)
    d = np.stack([np.ones_like(s), s, t], axis=-1) / r[..., None]
    by_s = (np.array([0.0, 1.0, 0.0]) - d * d[..., 1:2]) / r[..., None]
    by_t = (np.array([0.0, 0.0, 1.0]) - d * d[..., 2:3]) / r[..., None]
    first = normalize(by_s)
    second = np.cross(d, first)
    angle = np.pi * (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    wave = (
        np.cos(angle)[:, None] * first[..., None, :] + np.sin(angle)[:, None] * second[..., None, :]
    )
    return np.einsum("ijnk,ijk->ijn", wave, by_s), np.einsum("ijnk,ijk->ijn", wave, by_t)


_FINER = 4, 2
"""The places that are looked at for each texel along an edge."""
_MANY = 2**19
"""The values above which the fewer places are looked at, unless the cube is small."""
_SMALL = 16
"""The texels along an edge of a small cube."""


def lost_between_texels(series: Array, size: int, sampling: Sampling = "center") -> Array:
    """Return what bilinear look-ups in a cube miss of functions.

    `series`, of shape ((order+1)^2, maps), are the functions' coefficients over real harmonics.

    Returns an array of shape (maps,): the integrals of the squared error over the sphere, against
    those of the squared functions, which are the sums of the squared coefficients. They are sums
    over a finer cube, whose root is off by up to two hundredths, and six where few places are
    looked at.
    """
    sampling = sampling if size > 1 else "center"
    many, few = _FINER
    finer = many if size <= _SMALL or 6 * (many * size) ** 2 * series.shape[1] <= _MANY else few
    places = finer * size
    cubes = CubeSeries(series)
    exact = cubes.planes(places, dtype=np.float32)
    texels = cubes.planes(size, sampling, np.float32)
    missed = exact.reshape(-1, 6, places, places) - _between(texels, places, sampling)
    squares = np.einsum("kfts,kfts,ts->k", missed, missed, cube_solid_angles(places))
    return np.asarray(squares / (_exaggeration(finer) if sampling == "center" else 1.0))


def _between(texels: Array, places: int, sampling: Sampling) -> Array:
    """Look cubes of shape (maps, 6N, N) up at the texels of finer ones, (maps, 6, M, M)."""
    maps, _, size = texels.shape
    at, fine = nodes(size, sampling), nodes(places, "center")
    faces = texels.reshape(maps, 6, size, size)
    if sampling == "center":
        # A look-up beside an edge takes the texels of the next face that are nearest to where the
        # own grid would go on.
        at = np.concatenate([[-1 - 1 / size], at, [1 + 1 / size]])
        right, down, forward = np.moveaxis(face_axes(), 1, 0)[:, :, None, None]
        rows, columns = nearest_texels(forward + at[:, None] * right + at[:, None, None] * down,
                                       size, sampling)  # fmt: skip
        faces = texels[:, rows, columns]
    across = linear_matrix(at, fine).astype(np.float32)
    return np.asarray(across @ faces @ across.T)


def _exaggeration(finer: int) -> float:
    """Return how much larger the mean squared error is at even places than between all texels.

    Along each axis the error of a smooth function is ``t (1 - t)`` times its second derivative, at
    the position t between two texels. In the mean over all directions of its waves, the product of
    both derivatives is a third of the square of either.
    """
    t = ((np.arange(finer) + 0.5) / finer + 0.5) % 1
    along = t * (1 - t)
    found = 2 * np.mean(along**2) + 2 / 3 * np.mean(along) ** 2
    return float(found / (2 / 30 + 2 / 3 / 36))
