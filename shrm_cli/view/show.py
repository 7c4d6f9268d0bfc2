"""`view`: what a page shows of some maps, to be written or served."""

import os
from collections.abc import Sequence
from dataclasses import replace

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.color import same_primaries
from shrm_cli.errors import ArgumentError, BrdfError
from shrm_cli.geometry.load import load_mesh
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import common_brdf, differing_origins, spec_of
from shrm_cli.maps.kinds import LightMap, check_tap_count
from shrm_cli.messages import check_names, several, whole_number
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress
from shrm_cli.records import record
from shrm_cli.render.boxed import outside
from shrm_cli.render.lit import lit_maps, surface_of, with_classes
from shrm_cli.view.page import page
from shrm_cli.view.scene import TRUTH_SIZE, Scene, Start, Truth, make_scene
from shrm_cli.vocabulary import MAX_PICTURE_SIZE, MAX_SOURCE_HEIGHT


@record(eq=False)
class Shown:
    """What a page shows."""

    scene: Scene
    warnings: list[str]
    """What was changed or left out."""
    told: list[str]
    """What was chosen for the user."""

    def html(self) -> str:
        """Return the page, to be written as UTF-8."""
        return page(self.scene)


def view(
    maps: Sequence[Map | str | os.PathLike[str]] | Map | str | os.PathLike[str],
    probe: AnyProbe | None = None,
    brdf: AnyBrdf | None = None,
    *,
    names: Sequence[str] | None = None,
    mesh: str | os.PathLike[str] | None = None,
    views: Sequence[tuple[float, float]] = ((0.0, 0.0),),
    roughness: float | None = None,
    f0: str | float | Sequence[float] | None = None,
    anisotropy: float | None = None,
    taps: int | None = None,
    brush: str | tuple[float, float, float] | None = None,
    exposure: float | None = None,
    truth_size: int = TRUTH_SIZE,
    source_height: int | None = None,
    exact: bool = False,
    max_size: int | None = None,
    rounded: bool = False,
    progress: Progress | None = None,
) -> Shown:
    """Put together a page to look around in: maps on a sphere or a mesh, and the truth.

    Parameters
    ----------
    maps : sequence of Map or path-like, or one of them
    probe : Probe, path-like or array, optional
        It is shown behind the shape, and is the light of the truth.
    brdf : Brdf, str or path-like, optional
        That of the truth; by default the one that all maps were made for. Split sums of a class of
        yours are shown by it, with the values that they record.
    names : sequence of str, optional
        What the page calls the maps; by default their files, or their representations.
    mesh : path-like, optional
    views : sequence of 2 float
        Azimuth and elevation of the first view, and of others that have a truth, degrees.
    roughness, f0, anisotropy, taps
        The surface that maps of light alone are shown as first; by default that of a map of GGX
        beside them. Split sums of GGX alone are shown brushed.
    brush : {"uv"} or tuple of 3 float, optional
        What the tangents of brushed surfaces follow first: texture coordinates of the mesh, or a
        direction. By default they run around +Y.
    exposure : float, optional
        Stops; by default the page finds them.
    truth_size : int
        Width and height of a picture of the truth, pixels; 0 for no truth.
    source_height, exact
        Of the truth, as `reference` takes them.
    max_size : int, optional
        The most bytes of the page.
    rounded : bool
        Whether textures are rounded, by a percent or so, to make the page small.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Shown

    Raises
    ------
    MapError, ProbeError, BrdfError, MeshError

    Examples
    --------
    >>> white = shrm.prefilter("probes/studio.exr", to="irradiance")
    >>> shrm.view([white]).html()[:15]
    '<!DOCTYPE html>'
    """
    maps, truth_size = (
        several(maps, "maps"),
        whole_number("truth_size", truth_size, 0, MAX_PICTURE_SIZE),
    )
    if source_height is not None:
        whole_number("source_height", source_height, 2, MAX_SOURCE_HEIGHT)
    if anisotropy is not None and not 0 <= anisotropy <= 1:
        raise ArgumentError("anisotropy", f"is {anisotropy:g}; give 0 to 1")
    if names is None:
        names = [each.representation if isinstance(each, Map) else os.fspath(each) for each in maps]
    check_names(names, maps)
    light = None if probe is None else as_probe(probe)
    opened = [each if isinstance(each, Map) else open_map(each) for each in maps]
    if brdf is not None:
        brdf = as_brdf(brdf, None if light is None else light.chromaticities)
    opened = with_classes(opened, brdf)
    opened, notes = lit_maps(opened, names, light, None)
    if light is not None:
        infos = {name: each.info for name, each in zip(names, opened, strict=True)}
        notes = [*notes, *differing_origins(infos, light.name, light.digest(), {}, light.reading())]
    if taps is not None:
        check_tap_count(taps, bool(anisotropy))
    surface = surface_of(roughness, f0, opened[0].info.chromaticities if opened else None)
    first = surface.number("roughness"), surface.color("f0"), anisotropy or 0.0
    start = Start(views, exposure, *first, taps, brush)
    told: list[str] = []
    if roughness is None and f0 is None and anisotropy is None:
        start, told = _as_beside(start, opened, names)
    truth = Truth(brdf, truth_size, source_height, exact)
    shape = None if mesh is None else load_mesh(mesh)
    scene = make_scene(
        opened, names, light, shape, start, truth, max_size, progress, is_rounded=rounded
    )
    if shape is not None:
        notes = [*notes, *outside(opened, names, shape.vertices)]
    warnings = [*notes, *scene.remarks]
    scene.remarks.extend(told)
    return Shown(scene, warnings, told)


def _as_beside(
    start: Start, opened: Sequence[Map], names: Sequence[str]
) -> tuple[Start, list[str]]:
    """Show maps of light alone with the surface that a map beside them was made for.

    The anisotropy is that of the surface, too, where all of them can be shown with one.

    Returns `start`, with the roughness, f0 and anisotropy of the first map of plain GGX, where a
    map beside it needs them; and `told`, a line that says so.
    """
    lights = [each for each in opened if isinstance(each, LightMap)]
    if not lights:
        return start, []
    is_brushable = all("anisotropy" in each.surface_arguments for each in lights)
    for made, name in zip(opened, names, strict=True):
        same = same_primaries(made.info.chromaticities, opened[0].info.chromaticities)
        if isinstance(made, LightMap) or made.info.brdf.get("name") != "ggx" or not same:
            continue
        try:
            brdf = common_brdf({name: made.info})
        except BrdfError:
            continue
        surface = brdf.brushed_surface if isinstance(brdf, Ggx) else None
        if surface is not None and (is_brushable or not surface[1]):
            shown = replace(start, roughness=surface[0], anisotropy=surface[1], f0=surface[2])
            line = f"maps of light alone have the surface of {name}, {spec_of(made.info.brdf)}"
            return shown, [line]
    return start, []
