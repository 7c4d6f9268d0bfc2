"""``shrm prefilter probe.exr --to ambient-cube``: six colors in place of the light.

McTaggart 2004, Half-Life 2 / Valve Source Shading, Game Developers Conference.
"""

from dataclasses import replace

import numpy as np

import shrm_cli as shrm
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.files.parts import Part
from shrm_cli.maps.kinds import FixedMap, ReflectionMap
from shrm_cli.maps.offers import FLOATS, LookUp, Setting
from shrm_cli.maps.request import Prefiltered
from shrm_cli.maps.shader.cost import Cost
from shrm_cli.maps.shader.source import Source
from shrm_cli.maps.stored import COLORS, common_header, map_info, read_attributes
from shrm_cli.messages import refuse_arguments
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.records import record
from shrm_cli.sphere.quadrature import spiral_directions

AXES = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
"""+x, -x, +y, -y, +z and -z."""


@record(eq=False)
class AmbientCube(FixedMap, ReflectionMap):
    """What a white diffuse surface reflects that faces along each of the axes, shape (6, 3)."""

    colors: np.ndarray
    info: shrm.MapInfo

    representation = "ambient-cube"
    center = "normal"
    sampling = "center"
    natural_precision = "float"
    size = 1
    is_white = True

    def radiance(self, normals, views):
        shape = np.broadcast_shapes(np.shape(normals), np.shape(views))
        return np.broadcast_to(weights(np.asarray(normals, float)) @ self.colors, shape)

    def summary(self):
        info = self.info
        errors = {"predicted_error": info.predicted_error, "added_error": info.added_error}
        return {**super().summary(), **errors, "colors": self.colors.tolist()}


def weights(normals):
    """The square of each coordinate, for the axis that the normal looks along, shape (..., 6)."""
    return np.maximum(normals @ AXES.T, 0) ** 2


def prefilter(probe, request):
    white = prefilter_with_facts(probe, "irradiance", {"order_f": 8}).map
    return Prefiltered(converted(white, request.to, **request.own))


def converted(source, to, fit=None, **options):
    """The cube of a map of white surfaces, such as irradiance: `shrm convert`."""
    refuse_arguments("an ambient cube", **options)
    if not source.is_white:
        raise shrm.MapError(f"{source.what} is not of white surfaces; convert irradiance")
    normals = spiral_directions(4096)
    light = source.radiance(normals, normals)
    colors = source.radiance(AXES, AXES)
    if fit == "least":
        colors = np.linalg.lstsq(weights(normals), light, rcond=None)[0]
    error = np.linalg.norm(weights(normals) @ colors - light) / np.linalg.norm(light)
    error = np.hypot(error, source.info.added_error)
    return AmbientCube(colors, replace(source.info, added_error=float(error)))


def report(result):
    """Lines for people, from what ``--json`` prints."""
    return ["an ambient cube of six colors", f"RMS error      {result['added_error']:.2%}"]


def encode(made):
    channels = dict(zip(COLORS, made.colors.T[:, None], strict=True))
    return [Part(channels, common_header(made, 0))]


def decode(file):
    part = file.first
    if (part.width, part.height) != (6, 1) or not part.holds(COLORS):
        raise shrm.MapError(f"{file.path}: an ambient cube has six pixels; make it again")
    return AmbientCube(part.read(COLORS)[0].astype(float), map_info(read_attributes(part), part))


def settings(brdf):
    """What `shrm choose` makes of it for a material."""
    is_diffuse = isinstance(brdf, Lambertian)
    return [Setting({"fit": fit}) for fit in ("axes", "least")] if is_diffuse else []


def look_up(made, brdf, taps):
    """What its code reads and computes: three squares, and three colors by one each."""
    return LookUp(f"six colors, {made.info.options['fit']}", 6 * FLOATS, Cost(0, 12))


def source(made, textures):
    return Source("An ambient cube.", lambda words: code(words.language, made.colors))


def code(language, colors):
    faces = [f"shrm_cube[{axis}]" for axis in ("x", "y", "z")]
    squares = ["(n.x * n.x)", "(n.y * n.y)", "(n.z * n.z)"]
    return [
        *language.colors("shrm_cube", colors),
        "vec3 shrm_radiance(vec3 n, vec3 v)",
        "{",
        "    int x = n.x > 0.0 ? 0 : 1, y = n.y > 0.0 ? 2 : 3, z = n.z > 0.0 ? 4 : 5;",
        f"    return {language.combined(squares, faces)};",
        "}",
    ]
