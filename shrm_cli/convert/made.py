"""What conversions make, and how each of it is written and told of."""

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.files.image import without_negative, write_image
from shrm_cli.files.mipmap import write_mipmap
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.maps.base import Map
from shrm_cli.maps.kinds import MaterialMap
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import description
from shrm_cli.maps.splitsum.mips import cube_mips, latlong_mips, mip_chain
from shrm_cli.maps.stored import store
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import shaded_maps
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector, normalize
from shrm_cli.sphere.grid.latlong import latlong_points
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import (
    CUBES,
    LOOKUPS,
    Layout,
    Lookup,
    Orientation,
    PixelType,
    Precision,
    Sampling,
    default_orientation,
)

_ERRORS = {
    "added_error": "added by its form",
    "fit_residual": "left by the fit",
    "storage_error": "from half precision",
}


@record
class Written:
    """What is told of a conversion that was written."""

    result: dict[str, Any]
    """As JSON has it."""
    report: str
    """As text."""
    warnings: list[str]


class Converted(ABC):
    """What a map or a probe was converted to."""

    @abstractmethod
    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        """Write it, whole or not at all, and return what is to be told of it."""


def kept_precision(made: Map, precision: Precision) -> Precision:
    """Return the pixel type for what is made of a map: a conversion must not lose precision."""
    return "float" if precision == "auto" and not made.is_exact_in_half else precision


@record(eq=False)
class ConvertedMap(Converted):
    """A map of another representation, or the same one in another layout, or turned."""

    map: Map
    layout: Layout
    orientation: Orientation
    notes: tuple[str, ...] = ()
    """What is to be said of its colors."""

    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        made, info = self.map, self.map.info
        pixels = kept_precision(made, precision)
        stored = store(path, made, pixels, self.layout, self.orientation)
        result = {
            "file": os.fspath(path),
            "kind": "map",
            "representation": made.representation,
            "frame": made.frame,
            "size": made.size,
            "sampling": made.sampling,
            "maps": made.cube_count,
            "order_p": info.order_p,
            "layout": self.layout,
            "orientation": self.orientation,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "fit_residual": info.fit_residual,
            "storage_error": math.hypot(stored.error, info.storage_error),
            "precision": stored.pixel_type,
        }
        return Written(result, _map_report(result), list(self.notes))


def _map_report(result: dict[str, Any]) -> str:
    """Return lines about a map: what it is, and the errors that can be seen in it."""
    size, kind = result["size"], result["representation"]
    if not description(kind).needs_brdf:
        return f"{result['file']}: {kind}, {result['precision']}"
    lines = [
        f"{result['file']}: {result['frame']} {kind} map, {result['maps']} cubes of 6 x {size} x "
        f"{size} texels as {result['layout']}, {result['precision']}"
    ]
    for key, text in _ERRORS.items():
        if result[key] >= (5e-4 if key == "storage_error" else 5e-6):
            lines.append(f"  RMS error      {result[key]:.3%} {text}")
    return "\n".join(lines)


@record(eq=False)
class Layers(Converted):
    """The textures that the code of a map reads."""

    map: Map
    name: str
    """What messages call the map."""
    code: str | None
    """The code that reads them."""
    notes: tuple[str, ...] = ()

    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        from shrm_cli.maps.shader.file import write_layers

        made, notes = self.map, list(self.notes)
        if made.stored is not made and self.code is None:
            notes.append(
                f"{path}: textures hold no lamps; the code of `shader` has those of the map"
            )
        try:
            pixels, shapes = write_layers(path, made, precision)
        except MapError as error:
            raise MapError(f"{self.name}: {error}") from error
        result = {
            "file": os.fspath(path),
            "kind": "layers",
            "representation": made.representation,
            "textures": {name: list(shape) for name, shape in shapes.items()},
            "precision": pixels,
            **({} if self.code is None else {"shader": self.code}),
        }
        texts = [
            f"{name} of {counted(layers, 'layer')} of {width} x {height} texels"
            for name, (layers, height, width) in shapes.items()
        ]
        report = f"{path}: textures of {made.representation}, {' and '.join(texts)}, {pixels}"
        return Written(result, report, notes)


@record(eq=False)
class ConvertedProbe(Converted):
    """A probe in another layout."""

    probe: Probe
    """The one that it was made of."""
    image: Array
    """As `to_layout` returns it, float32 of shape (rows, columns, 3)."""
    layout: Layout
    orientation: Orientation
    sampling: Sampling

    def save(self, path: str | os.PathLike[str], precision: Precision = "auto") -> Written:
        """Write the image, or six of them, whose names have the faces in place of ``%``."""
        from shrm_cli.files.image import probe_attributes, write_images
        from shrm_cli.probe.open import face_paths
        from shrm_cli.probe.proxy import box_attributes

        path = os.fspath(path)
        files, pictures = [path], [self.image]
        if self.layout == "faces":
            files, pictures = face_paths(path), np.split(self.image, 6)
            if "%" not in os.path.basename(path):
                words = f"{path} has no % in place of +X, -X and so on, which six files need"
                raise ArgumentError("path", words)
        is_marked = (self.layout, self.orientation) in (("openexr",) * 2, ("latlong", "openexr"))
        envmap = self.layout if self.sampling == "border" and is_marked else None
        attributes = probe_attributes(self.probe.chromaticities, envmap)
        attributes |= box_attributes(self.probe.proxy)
        pixels = write_images(files, pictures, precision, attributes)
        return self._written(path, files, is_marked, pixels)

    def _written(self, path: str, files: list[str], is_marked: bool, pixels: PixelType) -> Written:
        rows, width, _ = self.image.shape
        height = rows // len(files)
        result = {
            "kind": "probe",
            "files": files,
            "layout": self.layout,
            "orientation": self.orientation,
            "sampling": self.sampling,
            "width": width,
            "height": height,
            "precision": pixels,
        }
        report = f"{', '.join(files)}: {self.layout} probe, {width} x {height}, {pixels}"
        warnings = [f"{self.probe.name}: {line}" for line in self.probe.report.warnings()]
        if self.sampling == "border" and not is_marked:
            warnings.append(f"{path}: no attribute tells of this; read it with `sampling` border")
        if self.layout in CUBES and self.orientation != default_orientation(self.layout):
            warnings.append(
                f"{path}: no attribute tells of this; read it with `orientation` {self.orientation}"
            )
        return Written(result, report, warnings)


# ---- for programs that read plain images ---------------------------------------------------------


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
            normals = _seen(normals, toward)
        picture[rows] = reflecting.radiance(normals, toward)
        tell(progress, rows.stop, height)
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
