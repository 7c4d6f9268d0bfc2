"""What a BRDF reflects of discs of light: integrated over each, where a map is used."""

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.maps.lamps.lobe import TABLE_EXACT, LobeTable
from shrm_cli.maps.lamps.rule import EXACT, DiscRule, integrals
from shrm_cli.probe.disc import Disc
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents


@record(eq=False)
class LitDiscs:
    """Discs of light, and the BRDF that reflects them."""

    brdf: Brdf
    """It is not about the tangent."""
    discs: tuple[Disc, ...]
    """In world axes."""

    @cached_property
    def rule(self) -> DiscRule:
        """How all of them are integrated: as the largest one needs it."""
        radius = max(disc.radius for disc in self.discs)
        exact = TABLE_EXACT if isinstance(self.brdf, LobeTable) else EXACT
        make = partial(DiscRule.of, self.brdf, radius, exact)
        return remembered(self.brdf, ("disc rule", radius), make)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return what is reflected; parameters and result are those of `Map.radiance`."""
        tangents = horizontal_tangents(np.asarray(normals, dtype=float))
        return self.brushed_radiance(normals, tangents, views)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Return what a surface of some tangents reflects, as maps' `brushed_radiance` does."""
        normals, tangents, views = (
            np.asarray(each, dtype=float) for each in (normals, tangents, views)
        )
        result = np.zeros(np.broadcast_shapes(normals.shape, views.shape))
        for disc in self.discs:
            where = normals, views, disc.direction, disc.radius
            of = integrals(self.rule, self.brdf, *where, tangents)
            result += disc.radiance * of
        return result


def disc_records(discs: Sequence[Disc]) -> list[dict[str, object]]:
    """Return discs by the names that light files have, for files and for people."""
    return [
        {
            "direction": disc.direction.tolist(),
            "radius": float(np.degrees(disc.radius)),
            "radiance": disc.radiance.tolist(),
        }
        for disc in discs
    ]
