"""Scene files: several meshes of several materials in one picture, as a small TOML file.

An example, with everything that an object may have:

    [[objects]]
    mesh = "bunny.obj"              # in the scene's folder or below, as all that it names
    map = "city.splitsum.exr"       # by default the MAP of the command line
    roughness = 0.3                 # these five for maps of light alone
    f0 = "gold"                     # or a number, or [R, G, B]
    anisotropy = 0.6                # these two for split sums of GGX
    taps = 8                        # 3, 5 or 8; without anisotropy 0, 1, 2 or 3
    irradiance = "city.irradiance.exr"  # by default --irradiance
    brush = [1, 0, 0]               # or "uv": what the tangents follow
    vary = "wear.png"               # or "vertex": what a parameter that varies follows
    plain = true                    # without the materials and vertex colours of the mesh
    scale = 2                       # or [x, y, z]
    rotate = [0, 90, 0]             # degrees about x, y and z in turn, after the scale
    translate = [0, 1, 0]           # last

Tables [[key]] say what moves over the frames: see `shrm_cli.render.moving`.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from shrm_cli.color import from_rec709
from shrm_cli.errors import BrdfError, MeshError
from shrm_cli.files.json_text import read_toml
from shrm_cli.files.whole import check_regular, note
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import Mesh, SurfaceMaterial
from shrm_cli.geometry.paint import Paint
from shrm_cli.geometry.textures import Shelf
from shrm_cli.maps.base import Map
from shrm_cli.maps.kinds import MaterialMap
from shrm_cli.probe.light_file import stays_below
from shrm_cli.records import record
from shrm_cli.render.lit import reflectance
from shrm_cli.render.stage import Actor, Look, transformation
from shrm_cli.render.variation import open_variation
from shrm_cli.rooms.lit import open_lit
from shrm_cli.vocabulary import EVEN_LOOK_UPS, LARGEST_COORDINATE, MIN_ROUGHNESS, TAP_COUNTS

MOST_OBJECTS = 256
_MOST_BYTES = 2**20
_KEYS = (
    "mesh", "map", "roughness", "f0", "anisotropy", "taps", "irradiance", "brush", "vary", "plain",
    "translate", "rotate", "scale",
)  # fmt: skip


@record
class Shown:
    """What is said about a mesh besides its file, on the command line or in a scene file."""

    map: Map | None = None
    """The map that it shows; by default the one that the picture is of."""
    roughness: float | None = None
    """It replaces that of the mesh's materials."""
    f0: str | float | Sequence[float] | None = None
    """What a BRDF's specification has: ``0.04``, ``1/0.78/0.34`` or ``gold``."""
    irradiance: Map | None = None
    """The light of the diffuse part of the mesh's materials."""
    brush: "str | tuple[float, float, float] | None" = None
    """What `Actor` has: "uv" or a direction."""
    vary: str | None = None
    """What a parameter that varies follows, as `open_variation` takes it."""
    plain: bool = False
    """Whether the mesh's materials and vertex colours are left out."""
    anisotropy: float | None = None
    taps: int | None = None
    """`anisotropy` and `taps`: as `Look` has them."""

    def actor(
        self, mesh: Mesh, primaries: tuple[float, ...] | None, shelf: Shelf | None = None
    ) -> Actor:
        """Return the mesh as it is shown.

        `primaries` are the chromaticities of the light, which colours are converted to. `shelf`
        holds the textures of the picture; by default those of this mesh alone.
        """
        given: dict[str, Any] = {
            "map": self.map, "anisotropy": self.anisotropy, "taps": self.taps
        }  # fmt: skip
        if self.vary is not None:
            given["variation"] = open_variation(self.vary, mesh)
        if self.roughness is not None:
            given["roughness"] = self.roughness
        if self.f0 is not None:
            given["f0"] = reflectance(self.f0, primaries)
        looks = [Look(**given)]
        shelf = shelf or Shelf()
        for material in mesh.materials:
            paint = None
            if not self.plain:
                paint = Paint(mesh, self._shown(material), shelf, from_rec709(primaries))
            looks.append(Look(**given, irradiance=self.irradiance, paint=paint))
        return Actor(mesh, looks, self.brush)

    def _shown(self, material: SurfaceMaterial) -> SurfaceMaterial:
        if self.roughness is not None:
            material = replace(material, roughness=self.roughness, roughness_map=None)
        if self.vary == "vertex":
            material = replace(material, colored="")
        return material


def is_scene_name(path: str | os.PathLike[str]) -> bool:
    """Whether a file's suffix is that of a scene."""
    return Path(path).suffix.lower() == ".toml"


def read_scene(
    path: str | os.PathLike[str],
    maps: "tuple[Map, ...] | list[Map]",
    irradiance: Map | None = None,
) -> list[Actor]:
    """Read a scene file, and the meshes and maps that it names.

    `path` is a TOML file; see the top of this module. `maps` are the maps that the pictures are of,
    which objects without a map are drawn by. The first one tells the primaries of the light.
    `irradiance` is that of objects which name none.
    """
    name = os.fspath(path)
    note(path)
    objects, _ = read_tables(name)
    opened: Callable[[str], Map] = cache(open_lit)
    loaded: Callable[[str], Mesh] = cache(load_mesh)
    shelf, actors = Shelf(), []
    for index, each in enumerate(objects, 1):
        try:
            actors.append(_actor(name, each, opened, loaded, maps, irradiance, shelf))
        except (ValueError, TypeError) as error:
            raise MeshError(f"{name}: object {index}: {error}") from None
        except BrdfError as error:
            raise MeshError(f"{name}: object {index}: {str(error).removeprefix('ggx: ')}") from None
    return actors


def read_tables(name: str) -> tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]:
    """Return the tables of a scene file: its objects and its keyframes."""
    check_regular(name, MeshError, "a mesh, or a scene in TOML")
    too_large = f"more than {_MOST_BYTES:,} bytes, so it is no scene; name one"
    tree, _ = read_toml(name, "a scene", _MOST_BYTES, too_large, MeshError)
    objects, keys = tree.get("objects"), tree.get("key", [])
    sound = all(isinstance(each, list) for each in (objects, keys))
    if not set(tree) <= {"objects", "key"} or not sound or not objects:
        raise MeshError(f"{name}: a scene has tables [[objects]] and [[key]] alone; correct it")
    if not all(isinstance(each, dict) for each in keys):
        raise MeshError(f"{name}: keyframes are tables; write [[key]]")
    if len(objects) > MOST_OBJECTS:
        raise MeshError(f"{name}: more than {MOST_OBJECTS} objects; join some meshes")
    return objects, keys


def _actor(
    name: str,
    given: Any,
    opened: Callable[[str], Map],
    loaded: Callable[[str], Mesh],
    maps: "tuple[Map, ...] | list[Map]",
    irradiance: Map | None,
    shelf: Shelf,
) -> Actor:
    if not isinstance(given, dict) or not set(given) <= set(_KEYS):
        wrong = sorted(set(given) - set(_KEYS)) if isinstance(given, dict) else [given]
        raise ValueError(f"{str(wrong[0])[:40]!r} is none of {', '.join(_KEYS)}; correct it")
    folder = Path(name).parent
    mesh = loaded(str(folder / _text(given, folder, "mesh", True)))
    own, diffuse = _text(given, folder, "map"), _text(given, folder, "irradiance")
    shown = Shown(
        None if not own else opened(str(folder / own)), _number(given, "roughness", MIN_ROUGHNESS),
        _f0(given.get("f0")),
        as_irradiance(str(folder / diffuse), opened) if diffuse else irradiance,
        _brush(given.get("brush")), _vary(folder, _text(given, folder, "vary")),
        _plain(given.get("plain", False)), _number(given, "anisotropy", 0), _taps(given),
    )  # fmt: skip
    if isinstance(shown.map, MaterialMap):
        raise ValueError(
            f"{own} holds no light, and `probe` lights no maps of objects; leave the map out, and "
            "name it before the scene, or make one with light by shrm prefilter PROBE --to product"
        )
    if shown.brush == "uv" and mesh.uvs is None:
        raise ValueError(f"brush cannot be uv: {mesh.name} has no texture coordinates; name others")
    light = shown.map or (maps[0] if maps else None)
    if shown.anisotropy is not None and light and "anisotropy" not in light.surface_arguments:
        raise ValueError(
            "anisotropy is of split sums of GGX; other maps have a BRDF, ggx:anisotropy="
        )
    moved = mesh.transformed(
        transformation(
            _numbers(given, "translate", 0.0),
            _numbers(given, "rotate", 0.0),
            _numbers(given, "scale", 1.0),
        )
    )
    return shown.actor(moved, None if light is None else light.info.chromaticities, shelf)


def as_irradiance(path: str, opened: Callable[[str], Map] = open_lit) -> Map:
    """Return the map of a file, which is of a white diffuse surface."""
    found = opened(path)
    if not found.is_white:
        raise MeshError(
            f"{path}: {found.what}, not irradiance; shrm prefilter PROBE --to irradiance makes one"
        )
    return found


def _text(given: Mapping[str, Any], folder: Path, key: str, required: bool = False) -> str:
    value = given.get(key, "")
    if not isinstance(value, str) or (required and not value) or "\0" in value:
        raise ValueError(f"{key} must be the name of a file; correct it")
    if not stays_below(value, folder):
        raise ValueError(f"{key}: {value!r:.100} leaves the scene's folder; put the file into it")
    return value


def _vary(folder: Path, text: str) -> str | None:
    """Return what a parameter follows: ``vertex``, or the path of an image."""
    return str(folder / text) if text not in ("", "vertex") else text or None


def _plain(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("plain must be true or false; correct it")
    return value


def _number(given: Mapping[str, Any], key: str, least: float) -> float | None:
    """Return a number up to 1, if it is given."""
    value = given.get(key)
    if value is not None and not (is_number(value) and least <= value <= 1):
        raise ValueError(f"{key} must be a number within {least:g} .. 1; correct it")
    return value


def _taps(given: Mapping[str, Any]) -> int | None:
    value = given.get("taps")
    known = TAP_COUNTS if given.get("anisotropy") else EVEN_LOOK_UPS
    if value is None or (isinstance(value, int) and value in known):
        return value
    raise ValueError("taps are 0, 1, 2 or 3, or 3, 5 or 8 with anisotropy; correct them")


def _f0(value: Any) -> str | None:
    if isinstance(value, list) and len(value) == 3 and all(is_number(each) for each in value):
        return "/".join(f"{each:g}" for each in value)
    if is_number(value):
        return f"{value:g}"
    if value is None or (isinstance(value, str) and not set(value) & set(",:+*=")):
        return value
    raise ValueError("f0 must be a number, [R, G, B] or a metal's name; correct it")


def _brush(value: Any) -> "str | tuple[float, float, float] | None":
    if value is None or value == "uv":
        return value
    if isinstance(value, list) and len(value) == 3 and all(is_number(each) for each in value):
        x, y, z = (float(each) for each in value)
        if (x, y, z) != (0, 0, 0):
            return x, y, z
    raise ValueError('brush must be "uv" or a direction [X, Y, Z]; correct it')


def _numbers(given: Mapping[str, Any], key: str, default: float) -> list[float]:
    value = given.get(key, default)
    numbers = value if isinstance(value, list) else [value] * 3
    is_one = key == "scale" or key not in given or isinstance(value, list)
    if len(numbers) != 3 or not is_one or not all(is_number(each) for each in numbers):
        raise ValueError(f"{key} must be three finite numbers; correct it")
    if key == "scale" and not all(numbers):
        raise ValueError("scale must not be 0; correct it")
    return [float(each) for each in numbers]


def is_number(value: Any, largest: float = LARGEST_COORDINATE) -> bool:
    """Whether it is a number of moderate size; TOML has NaN, infinity and endless integers."""
    known = isinstance(value, int | float) and not isinstance(value, bool)
    return known and -largest <= value <= largest
