"""What conversions make, and how each of it is written and told of.

`shrm_cli.convert.plain` has those for programs that read plain images.
"""

import math
import os
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import description
from shrm_cli.maps.stored import store
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.vocabulary import (
    CUBES,
    Layout,
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
    """What is told of it in JSON."""
    lines: list[str]
    """What is told of it in words."""
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
    code: str | None = None
    """The code that looks it up."""

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
            **({} if self.code is None else {"shader": self.code}),
        }
        return Written(result, _map_report(result), list(self.notes))


def _map_report(result: dict[str, Any]) -> list[str]:
    """Return lines about a map: what it is, and the errors that can be seen in it."""
    size, kind = result["size"], result["representation"]
    lines = [f"{result['file']}: {kind}, {result['precision']}"]
    if description(kind).needs_brdf and result["maps"]:  # products have parabolic maps
        lines = [
            f"{result['file']}: {result['frame']} {kind} map, {counted(result['maps'], 'cube')} of "
            f"6 x {size} x {size} texels as {result['layout']}, {result['precision']}"
        ]
    for key, text in _ERRORS.items():
        if result[key] >= (5e-4 if key == "storage_error" else 5e-6):
            lines.append(f"  RMS error      {result[key]:.3%} {text}")
    return lines


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
        return Written(result, [report], notes)


@record(eq=False)
class ConvertedProbe(Converted):
    """A probe in another layout."""

    probe: Probe
    """The one that it was made of."""
    image: Array
    """What `to_layout` returns, float32 of shape (rows, columns, 3)."""
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
        if self.layout == "angular":  # square images may be many things
            attributes["shrm:layout"] = self.layout
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
        warnings = self.probe.warnings()
        if self.sampling == "border" and not is_marked:
            warnings.append(f"{path}: no attribute tells of this; read it with `sampling` border")
        if self.layout in CUBES and self.orientation != default_orientation(self.layout):
            warnings.append(
                f"{path}: no attribute tells of this; read it with `orientation` {self.orientation}"
            )
        return Written(result, [report], warnings)
