"""What is made for programs that read plain images: a material seen from one side as a lat-long,
and the levels of a split sum as one mip-mapped file.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.convert.made import Converted, Written, kept_precision
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.files.exr import write_mipmap
from shrm_cli.files.image import without_negative, write_image
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.maps.base import Map
from shrm_cli.maps.kinds import MaterialMap
from shrm_cli.maps.splitsum.mips import cube_mips, latlong_mips, mip_chain
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import shaded_maps
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector, normalize
from shrm_cli.sphere.grid.latlong import latlong_points
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import LOOKUPS, Layout, Lookup, Precision, Sampling

_LEAST_ROWS = 256
"""The least height of a lat-long of a material, where none is given. Seen over the normal, or under
a dim map of few texels, a material has finer detail than its map."""


@record(eq=False)
class Seen(Converted):
    """The light that a map reflects to a distant viewer, as a lat-long."""

    map: Map
    name: str
    """The file of the map."""
    picture: Array
    """Float32 of shape (rows, 2 rows, 3)."""
    said: dict[str, Any]
    """The view, what a pixel's direction is, and the surface."""
    sampling: Sampling
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        path, rows = os.fspath(path), len(self.picture)
        (picture,), told = without_negative(path, [self.picture], self.map.against_negatives)
        recipe = {"convert": Path(self.name).name, "to": "latlong", **self.said}
        pixels = write_image(path, picture, precision, _attributes(self.map, recipe, self.sampling))
        result = {
            "file": path, "kind": "view", "representation": self.map.representation, **self.said,
            "width": 2 * rows, "height": rows, "sampling": self.sampling, "precision": pixels,
        }  # fmt: skip
        azimuth, elevation = self.said["view"]
        what = {"reflection": "mirror direction", "normal": "normal"}[self.said["by"]]
        report = (
            f"{path}: lat-long over the {what}, seen from {azimuth:g},{elevation:g}, "
            f"{2 * rows} x {rows}, {pixels}"
        )
        return Written(result, [report], [*self.warnings, *told, *self.notes])


def seen_from(
    found: Map,
    name: str,
    view: tuple[float, float],
    by: Lookup | None,
    size: int | None,
    sampling: Sampling | None,
    surface: tuple[float | None, str | None],
    progress: Progress | None,
) -> Seen:
    """Draw what a map reflects to a viewer at an azimuth and an elevation, degrees.

    `surface` has the roughness and reflectance of maps of light alone.
    """
    if isinstance(found, MaterialMap):
        raise MapError(
            f"{name}: a product texture that holds no light; make one with light by shrm "
            "prefilter PROBE --brdf SPEC --to product"
        )
    roughness, f0 = surface
    lights = "maps of GGX" if found.surface_arguments else "split sums and SH exponentials"
    for argument, value in (("roughness", roughness), ("f0", f0)):
        if value is not None and argument not in found.surface_arguments:
            words = f"applies to {lights}, and no MAP is one; leave it out"
            raise ArgumentError(argument, words)
    shown, said, warnings = shaded_maps([found], [name], roughness, f0)
    chosen, sampled = by or lookup_of(found), sampling or "center"
    rows = size or max(2 * found.size, _LEAST_ROWS)
    direction, everywhere = Viewer(*view).direction, ignores_views(found)
    picture = one_view(shown[0], direction, rows, chosen, everywhere, sampled, progress)
    said = {"view": list(view), "by": chosen, **said}
    return Seen(found, name, picture, said, sampled, tuple(warnings))


@record(eq=False)
class Mips(Converted):
    """The levels of a split sum as one mip-mapped file."""

    map: Map
    name: str
    """The file of the map."""
    levels: Sequence[Array]
    """All mip levels, down to one pixel."""
    roughness: list[float]
    """Perceptual, of each."""
    layout: Layout
    sampling: Sampling
    notes: tuple[str, ...] = ()

    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        path = os.fspath(path)
        levels, told = without_negative(path, self.levels, self.map.against_negatives)
        recipe = {"convert": Path(self.name).name, "to": self.layout, "roughness": self.roughness}
        attributes = _attributes(self.map, recipe, self.sampling)
        pixels = write_mipmap(path, levels, kept_precision(self.map, precision), attributes)
        height, width, _ = levels[0].shape
        result = {
            "file": path, "kind": "mips", "layout": self.layout, "sampling": self.sampling,
            "width": width, "height": height, "levels": len(levels), "roughness": self.roughness,
            "precision": pixels,
        }  # fmt: skip
        listed = ", ".join(f"{value:.3g}" for value in self.roughness)
        lines = [
            f"{path}: {self.layout} in {len(levels)} mip levels from {width} x {height}, {pixels}",
            f"  roughness      {listed}",
        ]
        return Written(result, lines, [*told, *self.notes])


def mips_of(
    made: Map, name: str, layout: Layout, size: int | None, sampling: Sampling | None
) -> Mips:
    """Return the mip levels of a split sum."""
    found, sampled = mip_chain(made, name), sampling or "center"
    if layout == "openexr":
        levels = cube_mips(found)
    else:
        levels = latlong_mips(found, size or 2 * found.size, sampled)
    # Levels beyond a split sum's own have the roughness of its last.
    known = (*found.roughness, *[found.roughness[-1]] * (len(levels) - len(found.roughness)))
    return Mips(found, name, levels, [round(each, 6) for each in known], layout, sampled)


def _attributes(made: Map, recipe: dict[str, Any], sampling: Sampling) -> dict[str, Any]:
    attributes = picture_attributes(recipe, [made.info.chromaticities])
    return {**attributes, "envmap": "latlong"} if sampling == "border" else attributes


# ---- one view ------------------------------------------------------------------------------------
# Maps hold the light for every view. Compositing and other renderers know images only: with the
# view held still, the reflected light is a function of one direction, and a lat-long holds it. That
# direction is the normal N, which normal passes have, or the mirror direction R, which a perfect
# mirror looks an environment up by; for a constant view the one tells the other.

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
    `ignores_views`.

    Returns an array of float32 of shape (height, 2 height, 3): radiance, linear, in the primaries
    of the map: +Z in the centre, +X in the left quarter, +Y in the top row. Small negative values
    of truncated expansions are kept.
    """
    if by not in LOOKUPS:
        raise ArgumentError("by", f"{by!r} is none of {', '.join(LOOKUPS)}")
    toward = np.asarray(view, dtype=float)
    width = 2 * height
    across, down = nodes(width, sampling), nodes(height, sampling)
    picture = np.empty((height, width, 3), dtype=np.float32)
    for rows in slices(height, _PIXELS_AT_ONCE // width):
        normals = latlong_points(across, down[rows, None])
        if by == "reflection":
            normals = bisector(normals, toward)
        if not (everywhere and by == "normal"):
            normals = _turned_to_viewer(normals, toward)
        picture[rows] = reflecting.radiance(normals, toward)
        tell(progress, rows.stop, height)
    return picture


def _turned_to_viewer(normals: Array, view: Array) -> Array:
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
