"""What bilinear look-ups in a cube miss of given functions, found by looking between its texels.

`shrm_cli.sphere.bilinear` predicts it from the energy of each degree, as if waves met the texels in
every phase and direction. Under a bare sun the few texels of a small cube show one lobe, at one
place among them, and the prediction is up to a fifth off. A small cube is soon looked through.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.sphere.cube import cube_solid_angles, face_axes, nearest_texels
from shrm_cli.sphere.interpolation import linear_matrix
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import Sampling

_FINER = 4, 2
"""For each texel along an edge, the places that are looked at."""
_MANY = 2**19
"""The values above which the fewer places are looked at, unless the cube is small."""
_SMALL = 16
"""The texels along an edge of a small cube."""


def lost_between_texels(series: Array, size: int, sampling: Sampling = "center") -> Array:
    """Return what bilinear look-ups in a cube miss of functions.

    Parameters
    ----------
    series : ndarray, shape ((order+1)^2, maps)
        The functions' coefficients over real harmonics.
    size : int
        Texels along a face's edge.
    sampling : {"center", "border"}
        Where the edge texels lie.

    Returns
    -------
    ndarray, shape (maps,)
        The integrals of the squared error over the sphere, against those of the squared functions,
        which are the sums of the squared coefficients. They are sums over a finer cube, whose root
        is off by up to two hundredths, and six where few places are looked at.
    """
    sampling = sampling if size > 1 else "center"
    many, few = _FINER
    finer = many if size <= _SMALL or 6 * (many * size) ** 2 * series.shape[1] <= _MANY else few
    places = finer * size
    exact = synthesize_cube(series, places, dtype=np.float32)
    texels = synthesize_cube(series, size, sampling, np.float32)
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
