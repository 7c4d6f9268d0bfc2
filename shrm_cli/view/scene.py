"""Everything that a page shows, as a description in JSON and blocks of bytes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli import vocabulary
from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.vectors import METALS
from shrm_cli.color import REC709, mix_channels, title_of, to_rec709
from shrm_cli.errors import ArgumentError, BrdfError, MapError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.tangents import projected_tangents
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import common_brdf, record_of, spec_of
from shrm_cli.maps.kinds import LightMap, MaterialMap
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.product.steps import rounded
from shrm_cli.maps.shader.code import Code, written_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.messages import first_of
from shrm_cli.naming import map_stem
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import default_size, to_grid
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer, sphere_normals
from shrm_cli.render.lit import reflectance
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.view.blocks import Blocks
from shrm_cli.view.shapes import described_shapes

SKY_ROWS = 512
"""The most rows of the probe behind the shape."""
_LEAST_SKY_ROWS = 64
"""The fewest rows that a probe is reduced to so that the page is small enough."""
MOST_VIEWS = 8
"""The most views that the truth is computed for."""
TRUTH_SIZE = 192
"""Pixels along the edge of a picture of the truth, where no other number is asked for."""


_INSIDE = 0.25
"""Points on the silhouette are moved inside by half this part of the distance between two of
them, because BRDFs have no value there."""


@record
class Start:
    """What the page shows first."""

    views: Sequence[tuple[float, float]] = ((0.0, 0.0),)
    """Azimuth and elevation of the first view, and of further ones that get a truth, degrees."""
    exposure: float | None = None
    """Stops; by default the page finds what suits the first map."""
    roughness: float = vocabulary.DEFAULT_ROUGHNESS
    """Perceptual roughness of the GGX surface that maps of light alone are shown as."""
    f0: Color = (1.0, 1.0, 1.0)
    """Its reflectance at normal incidence."""
    anisotropy: float = 0.0
    """As glTF has it; only split sums of GGX are shown with one."""
    taps: int | None = None
    """How many directions their light is looked up in, as `Map.shaded` takes it."""
    brush: str | tuple[float, float, float] | None = None
    """What the tangents of brushed surfaces follow: the texture coordinates of a mesh, or a
    direction of any length. By default they run around +Y. It is "uv" or a direction."""

    @property
    def tap_counts(self) -> tuple[int, int]:
        """The look-ups of even surfaces and of brushed ones, between which the page goes."""
        is_even = self.taps in vocabulary.EVEN_LOOK_UPS
        even = self.taps if self.taps is not None and is_even else vocabulary.DEFAULT_EVEN_TAPS
        return even, self.taps if self.taps in vocabulary.TAP_COUNTS else vocabulary.DEFAULT_TAPS


@record
class Truth:
    """How the truth is computed."""

    brdf: Brdf | None = None
    """The BRDF; by default the one of all maps."""
    size: int = TRUTH_SIZE
    """Pixels along the edge of its pictures; 0 for no truth."""
    rows: int | None = None
    """Rows of the lat-long that the probe is averaged down to; by default it is not averaged."""
    exact: bool = False
    """Whether it is the full sum over the pixels of the probe."""


@dataclass
class Scene:
    """What a page shows."""

    description: dict[str, Any]
    """What JSON can hold; `start.js` reads it."""
    blocks: Blocks
    """The bytes of textures and triangles."""
    remarks: list[str] = field(default_factory=list)
    """What was changed or left out, a line each."""


def make_scene(
    maps: Sequence[Map],
    files: Sequence[str],
    probe: Probe | None = None,
    mesh: Mesh | None = None,
    start: Start | None = None,
    truth: Truth | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
    is_rounded: bool = False,
) -> Scene:
    """Put together what a page shows.

    `probe` is shown behind the shape, and the truth is computed of it. `mesh` is a shape to show
    the maps on, in world axes. `max_size` is the most bytes of the blocks, in base64. The probe
    behind the shape gets fewer rows to keep it. By default there is no limit. `is_rounded` tells
    whether textures of light are rounded, by a percent or so, to make a page small.
    """
    start, truth = start or Start(), truth or Truth()
    if not maps:
        raise ArgumentError("maps", "are none; name one at least")
    if not 1 <= len(start.views) <= MOST_VIEWS:
        raise ArgumentError("view", f"is given {len(start.views)} times; give 1 to {MOST_VIEWS}")
    blocks, names = Blocks(is_rounded), _names(files)
    described = [
        described_map(each, name, Path(file).name, blocks, start.tap_counts)
        for each, name, file in zip(maps, names, files, strict=True)
    ]
    ways = _ways(described)
    is_brushed = any(each["tangents"] for each in described)
    shapes = described_shapes(mesh, blocks, is_brushed)
    # Whoever names a mesh wants to see it, unless there is a truth, which is of a sphere.
    shows_mesh = mesh is not None and (probe is None or not truth.size)
    description: dict[str, Any] = {
        "title": first_of(names, 2),
        "file": names[0],
        "maps": described,
        "shapes": shapes,
        "start": {
            "view": list(start.views[0]),
            "shape": len(shapes) - 1 if shows_mesh else 0,
            "exposure": start.exposure,
            "roughness": start.roughness,
            "f0": list(start.f0),
            "anisotropy": start.anisotropy,
            "brush": _checked_brush(start.brush, mesh, is_brushed),
            "values": [way.pop("start") for way in ways],
        },
        "ways": ways,
        "metals": _metals(maps[0].info.chromaticities),
        "sky": None,
        "truths": [],
        "truth_facts": [],
    }
    scene = Scene(description, blocks, blocks.remarks)
    others = [p for p in (each.info.chromaticities for each in maps) if to_rec709(p) is not None]
    if others:
        scene.remarks.append(
            "colours are shown and measured in linear Rec.709, converted from "
            f"{title_of(others[0])}"
        )
    _check_size(blocks, max_size)  # before the truth, which takes long
    if probe is not None:
        if truth.size:
            _add_truth(scene, maps, files, probe, start, truth, progress)
        _add_sky(scene, probe.in_primaries(REC709), max_size)
    _check_size(blocks, max_size)
    description["notes"] = scene.remarks
    return scene


def _add_truth(
    scene: Scene,
    maps: Sequence[Map],
    files: Sequence[str],
    probe: Probe,
    start: Start,
    truth: Truth,
    progress: Progress | None,
) -> None:
    """Add pictures of the truth, if the maps are of one BRDF."""
    shown = [each.shaded(start.roughness, start.f0, start.anisotropy) for each in maps]
    brdf = truth.brdf
    if brdf is None:
        infos = {file: each.info for file, each in zip(files, shown, strict=True)}
        try:
            brdf = common_brdf(infos)
        except BrdfError as error:
            scene.remarks.append(f"no truth: {error}")
            return
    source = Reference(probe, brdf, truth.rows, exact=truth.exact)
    brush = scene.description["start"]["brush"]
    pictures = _truth_pictures(source, start.views, truth.size, brush, progress)
    matrix = to_rec709(probe.chromaticities)
    for view, picture in zip(start.views, pictures, strict=True):
        if matrix is not None:
            picture = mix_channels(picture, matrix)
        scene.description["truths"].append(
            {
                "view": list(view),
                "roughness": start.roughness,
                "f0": list(start.f0),
                "anisotropy": start.anisotropy,
                "brush": None if brush == "uv" else brush,
                "values": scene.description["start"]["values"],
                "picture": scene.blocks.texture(picture, "the truth", is_half=False),
            }
        )
    scene.description["truth_facts"] = [
        ("what", f"integral over the probe, {source.statement}"),
        ("BRDF", spec_of(record_of(brdf))),
        ("probe", f"{Path(probe.name).name}, {source.pixels:,} pixels"),
        ("picture", f"{truth.size} \u00d7 {truth.size} points on the sphere"),
    ]


def _truth_pictures(
    source: Reference,
    views: Sequence[tuple[float, float]],
    size: int,
    brush: str | list[float] | None = None,
    progress: Progress | None = None,
) -> list[Array]:
    """Integrate what a distant viewer sees on a sphere.

    The points of a picture are at equal angles between the normal and the view: a point as far from
    the middle as a share s of half the picture's width is seen at ``sin(s pi / 2)`` radii from the
    centre of the sphere. They are close together at the silhouette, where reflections are, too.

    `views` are the azimuth and elevation of each viewer, degrees. `brush` is a direction that
    tangents follow. A sphere has no texture coordinates to follow.

    Returns arrays of float32 of shape (size, size, 3): linear radiance, rows from the highest.
    Pixels beside the silhouette hold what is on it, so that pictures can be interpolated; others
    off the sphere are 0.
    """
    across = (np.arange(size) + 0.5) * (2 / size) - 1
    x, y = np.meshgrid(across, -across)
    share = np.hypot(x, y)  # of a right angle between the normal and the view
    needed = share < 1 + 3 / size
    x, y, share = x[needed], y[needed], share[needed]
    radius = np.sin(np.minimum(share, 1 - _INSIDE / size) * np.pi / 2) / np.maximum(share, 1e-9)
    x, y = x * radius, y * radius
    pictures: list[Array] = []

    def counted(done: int, total: int) -> None:
        tell(progress, len(pictures) * total + done, len(views) * total)

    source.progress = counted
    for azimuth, elevation in views:
        viewer = Viewer(azimuth, elevation)
        picture = np.zeros((size, size, 3), dtype=np.float32)
        normals = sphere_normals(viewer, x, y)
        tangents = projected_tangents(normals, brush) if isinstance(brush, list) else None
        picture[needed] = (
            source.radiance(normals, viewer.direction)
            if tangents is None
            else source.brushed_radiance(normals, tangents, viewer.direction)
        )
        pictures.append(picture)
    return pictures


def _add_sky(scene: Scene, probe: Probe, max_size: int | None) -> None:
    """Add the probe as a lat-long of at most `SKY_ROWS` rows, fewer where the page is small."""
    rows = wanted = min(default_size(probe, LatLong), SKY_ROWS)
    if max_size is not None:
        left = max_size - scene.blocks.encoded_bytes
        while rows > _LEAST_SKY_ROWS and 16 * rows**2 > left:
            rows //= 2
    if rows < wanted:
        scene.remarks.append(f"the probe behind the shape has {rows} rows, not {wanted}")
    name = Path(probe.name).name
    image = to_grid(probe, LatLong(rows))
    scene.description["sky"] = {
        "name": name,
        "file": name,
        **scene.blocks.texture(image, f"{name} behind the shape"),
    }


def _checked_brush(
    brush: str | tuple[float, float, float] | None, mesh: Mesh | None, is_brushed: bool
) -> str | list[float] | None:
    """Return what tangents follow, a direction as a unit vector, or say why they cannot."""
    if brush is None:
        return None
    if not is_brushed:
        raise ArgumentError("brush", "applies to brushed surfaces, and no map is shown as one")
    if not isinstance(brush, str):
        if not any(brush):
            raise ArgumentError("brush", "0,0,0 is no direction")
        return [float(x) for x in np.array(brush) / np.linalg.norm(brush)]
    if mesh is None or mesh.uvs is None:
        name = "the sphere" if mesh is None else mesh.name
        raise ArgumentError("brush", f"cannot be uv: {name} has no texture coordinates")
    return brush


def _names(files: Sequence[str]) -> list[str]:
    """Return the files' names without folders and suffixes, numbered where two are the same."""
    names: list[str] = []
    for file in files:
        stem = map_stem(file)
        count, unique = 1, stem
        while unique in names:
            count += 1
            unique = f"{stem} ({count})"
        names.append(unique)
    return names


def _ways(described: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the parameters that vary in maps, which refer to them by number instead of by name.

    One of several maps goes over the ranges of all of them. It starts in the middle of the first.
    """
    ways: dict[str, dict[str, Any]] = {}
    for own in (way for each in described for way in each["ways"]):
        name, low, high = own.pop("name"), own["low"], own["high"]
        first = {"name": name, "low": low, "high": high, "start": rounded((low + high) / 2)}
        whole = ways.setdefault(name, first)
        whole |= {"low": min(whole["low"], low), "high": max(whole["high"], high)}
        own["number"] = list(ways).index(name)
    return list(ways.values())


def _metals(primaries: tuple[float, ...] | None) -> list[dict[str, Any]]:
    """Return colours to choose from for f0, in the primaries of the light."""
    known: list[tuple[str, Color]] = [("White, 1", (1.0,) * 3), ("Dielectric, 0.04", (0.04,) * 3)]
    known += [(name.capitalize(), reflectance(name, primaries)) for name in sorted(METALS)]
    return [{"name": name, "f0": [float(x) for x in np.clip(f0, 0, 1)]} for name, f0 in known]


def _check_size(blocks: Blocks, max_size: int | None) -> None:
    if max_size is not None and blocks.encoded_bytes > max_size:
        raise MapError(
            f"the page would hold {bytes_text(blocks.encoded_bytes)} of data, more than "
            f"{bytes_text(max_size)}; leave `output` out to serve it, raise `max_size`, or make "
            "smaller maps by `shrm convert`"
        )


# ---- maps as the page draws them -----------------------------------------------------------------

_LIGHT = ("shrm_layers", "shrm_product", "shrm_lobe")
"""The textures of light and of a BRDF, for which half precision will do; other tables stay 32
bits."""


def described_map(
    made: Map, name: str, file: str, blocks: Blocks, taps: tuple[int, int] = Start().tap_counts
) -> dict[str, Any]:
    """Describe a map for the page, as `viewer.js` knows it, and keep its textures.

    `file` is the name of its file, without a folder. Its textures are added to `blocks`. `taps` are
    the look-ups of a split sum for surfaces that are not brushed, and for those that are.
    """
    if isinstance(made, MaterialMap):
        raise MapError(f"{file}: a product texture that holds no light; give `probe`")
    even, brushed = taps if "anisotropy" in made.surface_arguments else (None, None)
    try:
        code = written_code(made, "glsl", "layers", brushed, even or None)
        textures = pack(made)
    except MapError as error:
        raise MapError(
            f"{file}: pages cannot show it ({error}); `shrm convert` makes another form of it"
        ) from error
    facts, light, ways = _facts(made), made.harmonic_light, made.ways.items()
    is_lit = light is None or light.product is None
    packed = []
    for each in textures:
        what, is_half = f"{file}: {each.name}", each.name in _LIGHT
        found = blocks.texture(each.values, what, is_half, made.texels_are_series, is_lit)
        packed.append({"name": each.name, **found})
    facts += [("rounded by", f"{each['error']:.2%}") for each in packed if "error" in each]
    return {
        "name": name,
        "file": file,
        "code": code.text,
        "call": _call(made, code, even),
        "boxed_call": _call(made, code, even, ", p") if code.is_boxed and not made.varies else None,
        "brushed_call": _in_rec709(made, _BRUSHED) if brushed else None,
        "surface": isinstance(made, LightMap),
        "even": even,
        "brushed": brushed,
        "tangents": code.takes_tangent or brushed is not None,
        "roughness": list(made.roughness_range),
        "textures": packed,
        "lighting": light.coefficients.ravel().tolist() if light and light.product else None,
        "probe": made.info.probe,
        "ways": [{"name": name, "low": low, "high": high} for name, (low, high) in ways],
        "facts": facts,
    }


def _call(made: Map, code: Code, taps: int | None, point: str = "") -> str:
    """Return the expression of the radiance at a normal n and a view v, in linear Rec.709.

    Of brushed maps the code takes the tangent besides. A split sum of GGX is looked up with `taps`,
    as a surface that is not brushed. With a point it is looked up in the box of the map's probe.
    """
    at = "_at" if point else ""
    own = [f", view_{name}" for name in ("roughness", "f0") if name in made.surface_arguments]
    call = f"shrm_{'even' if taps else 'radiance'}{at}(n, v{point}{''.join(own)})"
    if code.takes_tangent:
        call = f"shrm_brushed_radiance{at}(n, view_tangent(n), v{point})"
    if made.varies:
        shares = "".join(f", view_shares.{axis}" for axis, _ in zip("xy", made.ways, strict=False))
        call = f"shrm_varied_radiance(n, view_tangent(n), v{shares})"
    if code.is_irradiance:
        call = f"shrm_irradiance{at}(n{point}) * 0.3183098861837907"
    return _in_rec709(made, call)


_BRUSHED = "shrm_brushed(n, view_tangent(n), v, view_roughness, view_anisotropy, view_f0)"
"""The expression of a brushed surface of a split sum, which knows of no box."""


def _in_rec709(made: Map, call: str) -> str:
    """Return the expression of a colour in linear Rec.709."""
    matrix = to_rec709(made.info.chromaticities)
    if matrix is None:
        return call
    # GLSL takes matrices column by column.
    return f"mat3({', '.join(repr(float(x)) for x in matrix.T.ravel())}) * ({call})"


def _facts(made: Map) -> list[tuple[str, str]]:
    """Return what the page says of a map, as pairs of a word and a value."""
    info, summary = made.info, made.summary()
    facts = [("form", registry.description(made.representation).title)]
    if "f0" not in made.surface_arguments and not made.is_white:
        brdf = info.brdf
        if isinstance(own := brdf.get("parameters"), dict):
            same = {name: value for name, value in own.items() if name not in made.ways}
            brdf = {**brdf, "parameters": same}
        places_to_break = re.sub(r"([,+:])", "\\1\u200b", spec_of(brdf))
        facts.append(("BRDF", places_to_break))
    facts += [(name, f"{low:.3g} \u2026 {high:.3g}") for name, (low, high) in made.ways.items()]
    facts.append(("probe", info.probe or "unknown"))
    if made.cube_count:
        facts.append(("cubes", f"{made.cube_count} of 6 \u00d7 {made.size}\u00b2"))
    orders = f"F = {info.order_carried}"
    facts.append(("orders", orders if not info.order_p else f"{orders}, P = {info.order_p}"))
    if isinstance(made, LightMap):
        low, high = made.roughness_range
        facts.append(("roughness", f"{low:.3g} \u2026 {high:.3g}"))
    for word, key in (
        ("predicted error", "predicted_error"),
        ("added by form", "added_error"),
        ("by bilinear", "filter_error"),
        ("by lamps beside it", "lamp_error"),
    ):
        value = summary.get(key) or 0.0
        if value > 0:
            facts.append((word, f"{value:.2%}"))
    return facts
