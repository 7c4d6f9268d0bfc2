"""What a material reflects to one distant viewer, as a plain lat-long over a direction.

Maps hold the light for every view. Compositing and other renderers know images only: with the view
held still, the reflected light is a function of one direction, and a lat-long holds it. That
direction is the normal N, which normal passes have, or the mirror direction R, which a perfect
mirror looks an environment up by; for a constant view the one tells the other.
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.progress import Progress
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector, normalize
from shrm_cli.sphere.grid.latlong import latlong_points
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import LOOKUPS, Lookup, Sampling

_PIXELS_AT_ONCE = 2**19
"""The most pixels that are looked up at a time."""

LEAST_COSINE = 1e-3
"""The least N.V that is looked up, a seventeenth of a degree inside the silhouette. BRDFs have no
value on the silhouette itself."""


def lookup_of(found: Map) -> Lookup:
    """Return the direction over which a map varies least with the view: that of its own look-up."""
    return "normal" if found.center == "normal" else "reflection"


def ignores_views(found: Map) -> bool:
    """Whether what a map reflects depends on the normal alone, as that of a diffuse surface."""
    return found.center == "normal" and found.info.order_p == 0


def one_view(
    reflecting: Reflecting,
    view: ArrayLike,
    height: int,
    by: Lookup,
    everywhere: bool = False,
    sampling: Sampling = "center",
    progress: Progress | None = None,
) -> Array:
    """Draw the light that a material reflects to a distant viewer, as a lat-long.

    `view`, of shape (3,), is the unit vector V to the viewer, world axes; the same for all pixels.
    `height` is the number of rows; there are twice as many columns. `by` is what the direction d of
    a pixel is. ``reflection``: the mirror direction, so that the normal is ``(d + V) / |d + V|``.
    ``normal``: the normal itself. Normals that face away from the viewer are not seen: they get the
    light of the nearest normal on the silhouette, so that filters find something sensible there.
    `everywhere` tells whether normals that face away are looked up as they are, as for
    `ignores_views`. `sampling` is where the pixels at the edge of the image lie.

    Returns an array of float32 of shape (height, 2 height, 3): radiance, linear, in the primaries
    of the map: +Z in the centre, +X in the left quarter, +Y in the top row. Small negative values
    of truncated expansions are kept. Raises ArgumentError if `by` is something else.
    """
    if by not in LOOKUPS:
        raise ArgumentError("by", f"{by!r} is none of {', '.join(LOOKUPS)}")
    toward = np.asarray(view, dtype=float)
    width = 2 * height
    across, down = nodes(width, sampling), nodes(height, sampling)
    picture = np.empty((height, width, 3), dtype=np.float32)
    rows = max(_PIXELS_AT_ONCE // width, 1)
    for start in range(0, height, rows):
        stop = min(start + rows, height)
        normals = latlong_points(across, down[start:stop, None])
        if by == "reflection":
            normals = bisector(normals, toward)
        if not (everywhere and by == "normal"):
            normals = _seen(normals, toward)
        picture[start:stop] = reflecting.radiance(normals, toward)
        if progress is not None:
            progress(stop, height)
    return picture


def _seen(normals: Array, view: Array) -> Array:
    """Move normals (..., 3) that do not face the viewer just inside the silhouette."""
    cosines = normals @ view
    hidden = cosines < LEAST_COSINE
    if not hidden.any():
        return normals
    across = normals[hidden] - cosines[hidden][:, None] * view
    # The normal that points away from the viewer is as far from all sides of the silhouette.
    some_side = np.cross(view, np.eye(3)[np.argmin(np.abs(view))])
    across[np.linalg.norm(across, axis=-1) < LEAST_COSINE] = some_side
    moved = normals.copy()
    moved[hidden] = np.sqrt(1 - LEAST_COSINE**2) * normalize(across) + LEAST_COSINE * view
    return moved
