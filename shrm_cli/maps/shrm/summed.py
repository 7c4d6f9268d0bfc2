"""Maps of BRDFs that are sums: each term about its own central direction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.compressed import CompressedShrm
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.sphere.directions import bisector, from_angles, local_frame, to_angles
from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]

_AZIMUTHS = 32


@dataclass(frozen=True)
class SummedShrm:
    """SHRMs whose radiances add up.

    A diffuse term needs few coefficients about the normal, and many about the mirror direction.

    Attributes
    ----------
    terms : tuple of Shrm or CompressedShrm
        Each of its own centre, size and orders.
    info : MapInfo
        Of the sum: the largest orders, the error of all terms together.
    """

    terms: tuple[Shrm | CompressedShrm, ...]
    info: MapInfo

    representation = "shrm"

    def __post_init__(self) -> None:
        if len(self.terms) < 2:
            raise ValueError(f"{len(self.terms)} terms make no sum")

    @property
    def size(self) -> int:
        """Of the largest term."""
        return max(term.size for term in self.terms)

    @property
    def frame(self) -> str:
        return self.terms[0].frame

    @property
    def center(self) -> str:
        """Of each term, with plus signs between."""
        return "+".join(term.center for term in self.terms)

    @property
    def sampling(self) -> Sampling:
        return self.terms[0].sampling

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, shape (..., 3), as `Shrm.radiance` gives it."""
        first, *others = (term.radiance(normals, views) for term in self.terms)
        return np.asarray(sum(others, start=first))

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Radiance by mirror directions, shape (..., 3), instead of normals."""
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        return self.radiance(bisector(centers, views), views)

    def zonal_radiance(self, centers: ArrayLike, view_theta: float) -> Array:
        """Its mean over the views at an angle (radians) from mirror directions (..., 3)."""
        frames = local_frame(*to_angles(centers))
        phi = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
        parts = [
            self.central_radiance(centers, frames @ from_angles(view_theta, each)) for each in phi
        ]
        return np.mean(parts, axis=0)
