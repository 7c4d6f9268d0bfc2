"""Lamps that light a mesh beside its other light, with the shadows that the mesh casts on itself.

Few coefficients hold no shadow of a lamp: to order 4 a dragon under a studio's lamps is 15 % off,
and 1.5 % where they are taken out of the light and each point of the surface looks for them.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.geometry.mesh import Mesh, smooth_points
from shrm_cli.geometry.rays import Rays
from shrm_cli.maps.lamps.rule import DiscRule, LitDiscs, integrals
from shrm_cli.probe.disc import Disc, disc_directions
from shrm_cli.render.variation import between_steps
from shrm_cli.sphere.directions import horizontal_tangents

Points = tuple[NDArray[np.int64], Array]
"""Triangles of points, shape (n,), and their places within these, barycentric (n, 3)."""
BrdfAt = Callable[[tuple[float, ...]], Brdf]
"""From where parameters are on their ways to the BRDF; of nothing where none varies."""

_DIRECTIONS = 64
"""Directions within a lamp along which a point in its penumbra looks for it."""
_FIRST = 4
"""Every so many of them tell whether the point is in the penumbra."""
_OF_SAMPLE = 16
"""Every so many of them are all that one of the samples of a pixel looks along."""
_LIFT = 1e-5
"""How far above the surface rays begin, as a part of the diagonal of the mesh's box."""


class LampsOnMesh:
    """What a mesh reflects of lamps that it partly hides from itself.

    `rays` meet the same mesh. `discs` are the lamps, world axes. `brdf` takes where parameters are
    on their ways, a tuple of float, and returns the BRDF. White and diffuse by default.
    """

    def __init__(
        self, mesh: Mesh, rays: Rays, discs: Sequence[Disc], brdf: BrdfAt | None = None
    ) -> None:
        self._mesh, self._rays = mesh, rays
        self.discs = tuple(discs)
        self._brdf = brdf
        self._directions = tuple(disc_directions(disc, _DIRECTIONS) for disc in discs)
        self._lift = _LIFT * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))

    def with_discs(self, discs: Sequence[Disc]) -> "LampsOnMesh":
        """Return the same mesh under other lamps."""
        return LampsOnMesh(self._mesh, self._rays, discs, self._brdf)

    def turned(self, rotation: Array) -> "LampsOnMesh":
        """Return the same mesh under lamps that a matrix (3, 3) has turned."""
        return self.with_discs(
            [replace(disc, direction=rotation @ disc.direction) for disc in self.discs]
        )

    def radiance(
        self,
        points: Points,
        normals: Array,
        views: Array,
        tangents: Array | None = None,
        samples: NDArray[np.int64] | None = None,
        shares: Array | Sequence[float] = (),
    ) -> Array:
        """Return what points of the surface reflect, shape (n, 3).

        `normals`, `views`, of shape (n, 3), are unit vectors in world axes; normals face the
        viewer. `tangents`, of shape (n, 3), are unit vectors at right angles to the normals; around
        +Y by default. `samples`, of shape (n,), is the number of each point among the samples of
        its pixel, which share the work. `shares`, of shape (n, parameters) or (parameters,), is
        where parameters of the BRDF are on their ways, for each point or for all of them.
        """
        tangents = horizontal_tangents(normals) if tangents is None else tangents
        origins = smooth_points(self._mesh, *points, normals) + self._lift * normals
        result = np.zeros((len(origins), 3))
        for disc, directions in zip(self.discs, self._directions, strict=True):
            if self._brdf is None:
                cosines = np.maximum(normals @ directions.T, 0).mean(axis=1)
                free = cosines[:, None] * (disc.solid_angle / np.pi * disc.radiance)
            else:
                free = self._reflected(disc, (normals, views, tangents), np.asarray(shares))
            lit = np.flatnonzero(free.any(axis=1))
            if samples is None:
                share = self._seen(origins[lit], normals[lit], directions)
            else:
                share = self._seen_by_samples(origins[lit], normals[lit], directions, samples[lit])
            result[lit] += share[:, None] * free[lit]
        return result

    def _reflected(self, disc: Disc, vectors: tuple[Array, Array, Array], shares: Array) -> Array:
        """Return what points reflect of a lamp that nothing hides, shape (n, 3)."""
        brdf_at = self._brdf
        assert brdf_at is not None
        normals, views, tangents = vectors
        if shares.ndim == 1:
            lit = LitDiscs(brdf_at(tuple(shares.tolist())), (disc,))
            return lit.brushed_radiance(normals, tangents, views)
        # One rule for all, as it takes longer to find than pictures: the finest at the ends.
        ends = product((0.0, 1.0), repeat=shares.shape[1])
        rules = [LitDiscs(brdf_at(end), (disc,)).rule for end in ends]
        rule = DiscRule(min(each.width for each in rules), max(each.steps for each in rules))

        def of_node(node: tuple[float, ...], own: NDArray[np.int64]) -> Array:
            where = normals[own], views[own], disc.direction, disc.radius
            return disc.radiance * integrals(rule, brdf_at(node), *where, tangents[own])

        return between_steps(shares, of_node)

    def _seen(self, origins: Array, normals: Array, directions: Array) -> Array:
        """Return the part of a lamp's irradiance that points get, shape (n,)."""
        share = self._share(origins, normals, directions[::_FIRST])
        partly = np.flatnonzero((share > 0) & (share < 1))
        share[partly] = self._share(origins[partly], normals[partly], directions)
        return share

    def _seen_by_samples(
        self, origins: Array, normals: Array, directions: Array, samples: NDArray[np.int64]
    ) -> Array:
        """Return the same for samples of pixels, each of which looks along other directions."""
        share = np.empty(len(origins))
        for each in range(_OF_SAMPLE):
            own = np.flatnonzero(samples % _OF_SAMPLE == each)
            share[own] = self._share(origins[own], normals[own], directions[each::_OF_SAMPLE])
        return share

    def _share(self, origins: Array, normals: Array, directions: Array) -> Array:
        cosines = np.maximum(normals @ directions.T, 0)
        points, along = np.nonzero(cosines)
        free = ~self._rays.occluded(origins[points], directions[along])
        seen = np.bincount(points, free * cosines[points, along], len(origins))
        return seen / np.maximum(cosines.sum(axis=1), np.finfo(float).tiny)


def blended(
    first: LampsOnMesh | None, second: LampsOnMesh | None, share: float
) -> LampsOnMesh | None:
    """Return the lamps of one light, dimmed, beside a share of those of another one."""
    known = first or second
    if known is None:
        return None
    discs = [
        replace(disc, radiance=part * disc.radiance)
        for lamps, part in ((first, 1 - share), (second, share))
        for disc in (() if lamps is None else lamps.discs)
    ]
    return known.with_discs(discs)
