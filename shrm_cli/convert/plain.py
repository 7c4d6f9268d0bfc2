"""What is made for programs that read plain images: a material seen from one side as a lat-long,
and the levels of a split sum as one mip-mapped file.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from shrm_cli.arrays import Array
from shrm_cli.convert.made import Converted, Written, kept_precision
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.files.image import without_negative, write_image
from shrm_cli.files.mipmap import write_mipmap
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.maps.base import Map
from shrm_cli.maps.kinds import MaterialMap
from shrm_cli.maps.splitsum.mips import cube_mips, latlong_mips, mip_chain
from shrm_cli.progress import Progress
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import shaded_maps
from shrm_cli.render.oneview import ignores_views, lookup_of, one_view
from shrm_cli.vocabulary import Layout, Lookup, Precision, Sampling

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
        (picture,), told = without_negative(path, [self.picture])
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
        return Written(result, report, [*self.warnings, *told, *self.notes])


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

    Raises ArgumentError if the map is none of those. Raises MapError if it holds no light.
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
        levels, told = without_negative(path, list(self.levels))
        recipe = {
            "convert": Path(self.name).name, "to": self.layout, "roughness": self.roughness
        }  # fmt: skip
        attributes = _attributes(self.map, recipe, self.sampling)
        pixels = write_mipmap(path, levels, kept_precision(self.map, precision), attributes)
        height, width, _ = levels[0].shape
        result = {
            "file": path, "kind": "mips", "layout": self.layout, "sampling": self.sampling,
            "width": width, "height": height, "levels": len(levels), "roughness": self.roughness,
            "precision": pixels,
        }  # fmt: skip
        listed = ", ".join(f"{value:.3g}" for value in self.roughness)
        report = (
            f"{path}: {self.layout} in {len(levels)} mip levels from {width} x {height}, {pixels}\n"
            f"  roughness      {listed}"
        )
        return Written(result, report, [*told, *self.notes])


def mips_of(
    made: Map, name: str, layout: Layout, size: int | None, sampling: Sampling | None
) -> Mips:
    """Return the mip levels of a split sum.

    Raises MapError if the map is no split sum whose levels halve.
    """
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
