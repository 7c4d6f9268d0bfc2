"""What the vertices of a mesh send to others: the light that they reflect.

A diffuse vertex sends the same radiance everywhere: ``albedo / pi`` times its irradiance. A glossy
one sends towards the unit vector v

    sum_i c_i(F v) sum_j M_ij L_j,

where M is its transfer matrix and F takes directions into its frame (see `transfer.gather`), L_j
are the coefficients of the light, and c_i those of the BRDF's product function (see
`maps.product.product`). Both are linear in the light, so that what is sent is a coefficient for
each j.

References
----------
Kautz, Sloan and Snyder 2002, Fast, Arbitrary BRDF Shading for Low-Frequency Lighting Using
Spherical Harmonics, section 5: the BRDF must be fixed for interreflection.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.records import record
from shrm_cli.transfer.shading import Product

_VERTICES_AT_ONCE = 2**12
"""Vertices whose matrices are gathered at a time: 10 MB of them at order 4."""


class Sent(Protocol):
    """Coefficients of the radiance that the vertices of a mesh send."""

    @property
    def shape(self) -> tuple[int, int]:
        """Coefficients, and colour channels."""

    def towards(self, vertices: NDArray[np.integer], directions: Array) -> Array:
        """What some vertices, shape (k,), send in world directions, shape (k, 3).

        Returns an array of float32 of shape (k, coefficients * channels).
        """


@record(eq=False)
class DiffuseLight:
    """What diffuse vertices send."""

    radiance: Array
    """``albedo / pi`` times the transfer vectors of all vertices, float32 of shape (v, n,
    channels)."""

    @property
    def shape(self) -> tuple[int, int]:
        """Coefficients, and colour channels."""
        return self.radiance.shape[1:]

    def towards(self, vertices: NDArray[np.integer], directions: Array) -> Array:
        """See `Sent.towards`; the direction does not matter."""
        return self.radiance.reshape(len(self.radiance), -1)[vertices]


@record(eq=False)
class GlossyLight:
    """What glossy vertices send."""

    matrices: Array
    """The transfer matrices of all vertices, float32 of shape (v, n, n, 1 or channels)."""
    frames: Array
    """Their frames, with axes as rows, shape (v, 3, 3)."""
    product: Product
    """The product function of the BRDF."""
    channels: int
    """Colour channels of what is sent."""

    @property
    def shape(self) -> tuple[int, int]:
        """Coefficients, and colour channels."""
        return self.matrices.shape[2], self.channels

    def towards(self, vertices: NDArray[np.integer], directions: Array) -> Array:
        """See `Sent.towards`; vertices that face away send nothing."""
        size = self.matrices.shape[1]
        result = np.zeros((len(vertices), *self.shape), np.float32)
        for start in range(0, len(vertices), _VERTICES_AT_ONCE):
            part = slice(start, start + _VERTICES_AT_ONCE)
            some = vertices[part]
            local = np.einsum("kij,kj->ki", self.frames[some], directions[part])
            facing = np.flatnonzero(local[:, 2] > 0)
            values = self.product.values(local[facing])[:, :size].astype(np.float32)
            matrices = self.matrices[some[facing]]
            # Matrices of one channel serve all colours of the BRDF, and the other way round.
            shape = len(facing), size, self.channels
            result[start + facing] = np.einsum(
                "kic,kijc->kjc",
                np.broadcast_to(values, shape),
                np.broadcast_to(matrices, (*shape[:2], size, self.channels)),
                optimize=True,
            )
        return result.reshape(len(vertices), -1)
