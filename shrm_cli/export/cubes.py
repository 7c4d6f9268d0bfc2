"""Cubes in KTX 2 files, as several engines read them."""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Package
from shrm_cli.export.ktx import can_compress, ktx2_cube
from shrm_cli.export.pixels import TexelFormat, encoded
from shrm_cli.export.turning import to_lookup
from shrm_cli.extras import install
from shrm_cli.maps.irradiance.irradiance import Irradiance

DIFFUSE_SIZE = 64
"""Texels along an edge of a cube of E / pi, which is smooth."""
_LARGE = f"not compressed, for want of the package zstandard: {install('export')}"


def diffuse_cube(irradiance: Irradiance, size: int = DIFFUSE_SIZE) -> Array:
    """Return E / pi, the light that a white diffuse surface reflects, as an OpenEXR cube.

    Shape (6 size, size, 3). Where the coefficients ring below 0 it is 0, as light cannot be less.
    """
    return np.maximum(irradiance.resampled(size, "center").cube(), 0) / np.pi


def ktx2_file(
    made: Package, name: str, levels: Sequence[Array], texels: TexelFormat, lookup: Array
) -> None:
    """Add a KTX 2 cube to a package, and tell what was clipped or could not be compressed.

    Parameters
    ----------
    made : Package
    name : str
    levels : sequence of ndarray, shape (6 N_k, N_k, 3)
        OpenEXR cubes in world axes.
    texels : TexelFormat
    lookup : ndarray, shape (3, 3)
        How the engine looks its cubes up; see `shrm_cli.export.turning`.
    """
    packed = [
        encoded(to_lookup(cube, lookup), texels, f"level {k}") for k, cube in enumerate(levels)
    ]
    made.tell_clipped(name, texels, [found for _, found in packed])
    compress = can_compress()
    if not compress and _LARGE not in made.told:
        made.told.append(_LARGE)
    data = ktx2_cube([data for data, _ in packed], levels[0].shape[1], texels, compress)
    made.add_bytes(name, data)
