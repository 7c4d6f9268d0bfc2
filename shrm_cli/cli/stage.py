"""The options of `shrm render` about meshes, and the stage that they set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.shading import brush_option, brushed_rules, refuse_window
from shrm_cli.cli.types import PATH, VECTOR, flag, option, within
from shrm_cli.vocabulary import LARGEST_COORDINATE

if TYPE_CHECKING:
    from shrm_cli.probe.disc import Disc
    from shrm_cli.render.mesh import MeshSubject
    from shrm_cli.render.stage import Stage
    from shrm_cli.rooms.grid import ProbeGrid
    from shrm_cli.transfer.transfer import Transfer

_OPTIONS = (
    "fov", "distance", "target", "brush", "vary", "irradiance", "plain", "transfer", "no_box",
)  # fmt: skip
OF_SURFACES = ("roughness", "f0", "anisotropy", "taps", "brush", "vary", "plain", "irradiance")
"""The names of options that say what a mesh is like; scenes say all but the last of each object."""
_NAMED = 3
"""How many materials a warning names."""


mesh_options = options.several(
    option(
        "--mesh FILE", PATH,
        help="OBJ, PLY, STL, glTF or GLB to draw in place of the sphere, or a TOML scene.",
    ),
    option(
        "--fov DEGREES", within(0.01, 170),
        help="Angle of view of the camera before a mesh, across the shorter edge.  "
        "[default: 35]",
    ),
    option(
        "--distance D", within(0, LARGEST_COORDINATE),
        help="From the camera to its target, in the mesh's unit.  [default: all is seen]",
    ),
    option("--target", VECTOR, "What the camera looks at.  [default: the middle of the mesh]"),
    brush_option,
    option(
        "--vary vertex|IMAGE|NAME=X", str, multiple=True,
        help="What the parameter of a product texture follows that varies: the brightness of "
        "the mesh's vertex colours, or of an image over its texture coordinates. Of two "
        "parameters the first follows their red, the second their green. Or its value, "
        "NAME=LOW..HIGH over --frames.",
    ),
    option(
        "--irradiance MAP", PATH,
        help="Irradiance map, or grid of probes: light of the diffuse part of the mesh's "
        "materials.",
    ),
    flag(
        "--plain", "Leave out the materials, textures and vertex colours of the mesh.", default=None
    ),
    flag(
        "--no-box", default=None,
        help="Look light up as if all of it were far away, whatever box the map knows of.",
    ),
    option(
        "--transfer FILE", PATH,
        help="What shrm transfer baked of the mesh: its own shadows, for irradiance maps, product "
        "textures, and with --probe in place of a MAP.",
    ),
)  # fmt: skip
"""--mesh and the options that apply with it."""


def open_stage(
    mesh: str, maps: Sequence[shrm.Map], names: Sequence[str], values: Mapping[str, Any]
) -> tuple[Stage, list[str]]:
    """Read a mesh or a scene, and check that there is a map for all of it.

    `maps` and `names` are the maps that pictures are drawn of, and their files' names; objects of a
    scene may name their own. `values` are those of the options `OF_SURFACES`, for a mesh.

    Returns the stage, and warnings.
    """
    from shrm_cli.geometry.load import load_mesh
    from shrm_cli.render.scene_file import Shown, as_irradiance, is_scene_name, read_scene
    from shrm_cli.render.stage import Stage

    path = values["irradiance"]
    light = None if path is None else as_irradiance(path)
    of_light = "to maps of light alone, such as split sums"
    if is_scene_name(mesh):
        in_scene = (False, "to a single mesh; a scene says it of each object")
        usage.refuse_inapplicable(
            {k: in_scene for k in OF_SURFACES[:-1] if k != "vary" or values[k]}
        )
        stage = Stage.of(read_scene(mesh, list(maps), light))
        lit = any(each.surface_arguments for each in (*maps, *stage.maps()))
        usage.refuse_inapplicable({"irradiance": (lit, of_light)})
    else:
        alone = (any(each.surface_arguments for each in maps), of_light)
        usage.refuse_inapplicable({"roughness": alone, "f0": alone, "irradiance": alone})
        usage.refuse_inapplicable(brushed_rules(maps))
        varies = (any(each.varies for each in maps), "to maps of shrm product --vary")
        usage.refuse_inapplicable({"vary": varies})
        found = load_mesh(mesh)
        given = {name: values[name] for name in OF_SURFACES}
        shown = Shown(None, **{**given, "irradiance": light, "plain": bool(values["plain"])})
        primaries = maps[0].info.chromaticities if maps else None
        stage = Stage.of([shown.actor(found, primaries)])
    if light is not None and not any(each is light for each in stage.irradiances()):
        raise shrm.ArgumentError("irradiance", f"does not apply: no materials are drawn of {mesh}")
    if stage.needs_map and not maps:
        raise click.UsageError("Missing argument 'MAP...': objects without a map are drawn by it")
    if maps and not stage.needs_map:
        raise click.UsageError("all objects of the scene have maps; leave MAP out")
    warnings = []
    for each, name in zip(maps, names, strict=True):
        warnings += stage.warnings(name, each)
    if not maps:
        warnings += stage.warnings(mesh, None)
    if stage.lacks_diffuse(maps):
        warnings.append(
            f"{mesh}: only the specular part of its materials is drawn; `irradiance` adds the rest"
        )
    unread = stage.unread(maps)
    if unread:
        more = f" and of {len(unread) - _NAMED} more" if len(unread) > _NAMED else ""
        warnings.append(f"{mesh}: not drawn of the material {'; '.join(unread[:_NAMED])}{more}")
    return stage, warnings


def refuse_mesh_options(mesh: str | None, transfer: str | None, follows: str | None) -> None:
    """Refuse options that say nothing to what is drawn.

    `follows` is what --vary lets parameters follow, if anything.
    """
    with_mesh = (mesh is not None, "with --mesh")
    usage.refuse_inapplicable({k: with_mesh for k in _OPTIONS if k != "vary"})
    spread = (mesh is not None, "with --mesh, or as NAME=X")
    usage.refuse_inapplicable({"vary": spread} if follows else {})
    if transfer is not None and mesh is not None:
        from shrm_cli.render.scene_file import is_scene_name

        if is_scene_name(mesh):
            raise click.UsageError(
                "--transfer applies to a single mesh, not to a scene; name the mesh that was baked"
            )
    baked = (transfer is None, "without --transfer, which was baked with what it needs")
    usage.refuse_inapplicable({name: baked for name in OF_SURFACES if name != "vary"})


@dataclass(frozen=True)
class Baked:
    """A transfer, and the light that it is drawn under."""

    transfer: Transfer
    maps: list[shrm.Map]
    names: list[str]
    """`maps` and `names`: the maps that pictures are drawn of, lit, and their files' names."""
    discs: tuple[Disc, ...]
    """Lamps that the maps' light lacks."""
    warnings: list[str]

    def drawn(self, stage: Stage) -> list[list[Any]]:
        """Return the surfaces of a mesh with its own shadows, under each of the maps."""
        from shrm_cli.render.vertex_colors import vertex_colors

        follows = stage.looks[0].variation
        each = [
            vertex_colors(stage.mesh, self.transfer, made, self.discs, name, follows)
            for made, name in zip(self.maps, self.names, strict=True)
        ]
        return [[one] * len(stage.looks) for one in each]

    def with_maps(self, maps: Sequence[shrm.Map]) -> Baked:
        """Return the same transfer under other maps, which hold all of their light."""
        return replace(self, maps=list(maps), names=[""] * len(maps), discs=())


def open_baked(
    transfer: str,
    maps: Sequence[shrm.Map],
    names: Sequence[str],
    light: shrm.Probe | ProbeGrid | None,
    window: str | None,
    ways: dict[str, tuple[float, float]] | None,
) -> Baked:
    """Read a transfer, and light the maps that it shades.

    The lamps of a probe are taken out of its light, and cast shadows of their own. Without a map
    the surface is diffuse, and its light is the probe's.

    `light` is that of maps that hold none. `ways` are those of `lit_maps`.
    """
    from shrm_cli.maps.info import probe_name
    from shrm_cli.prefilter import prefilter_with_facts
    from shrm_cli.render.lit import lit_maps
    from shrm_cli.rooms.lit import InGrid
    from shrm_cli.transfer.file import read_transfer

    if not maps and light is None:
        raise click.UsageError("Missing argument 'MAP...', or --probe for a diffuse surface")
    baked = read_transfer(transfer)
    warnings = _of_another_brdf(transfer, baked.facts.brdf, maps, names)
    if light is not None and not isinstance(light, shrm.Probe):  # of a grid, whose lamps are in it
        lit, told = lit_maps(maps, names, light, window)
        told = warnings + told
        return Baked(baked, lit or [InGrid(light, "")], list(names) or ["grid"], (), told)
    probe = light
    discs: tuple[Disc, ...] = ()
    named = "" if probe is None else probe_name(probe)
    if probe is not None:
        split = shrm.split_lamps(probe)
        if not baked.shades_lamps(glossy=bool(maps)):
            warnings.append(
                f"{transfer}: lamps are as blurred as other light; bake it with 0 bounces"
            )
        elif split.discs:
            discs, probe = split.discs, split.residual_probe
    if not maps and probe is not None:
        # What is to be said of the probe's pixels the command says: without lamps it may be black.
        made = prefilter_with_facts(probe, "irradiance", {"order_f": baked.order})
        return Baked(baked, [made.map], [named], discs, [*warnings, *made.warnings])
    refuse_window(maps)
    lit, negative = lit_maps(maps, names, probe, window, ways)
    for each, name in zip(lit, names, strict=True):
        if each.harmonic_light and each.is_white and each.info.order_f < baked.order:
            warnings.append(
                f"{name}: has light of order {each.info.order_f} for a transfer of order "
                f"{baked.order}, and lamps without sharp shadows; give `probe` in place of the map"
            )
    return Baked(baked, lit, list(names), discs, warnings + negative)


def _of_another_brdf(
    transfer: str, baked: str, maps: Sequence[shrm.Map], names: Sequence[str]
) -> list[str]:
    """Return a line for each map that is not of the BRDF which bounces were `baked` for, if any."""
    from shrm_cli.maps.info import spec_of

    def parts(spec: str) -> list[str]:  # files sort parameters
        return sorted(spec.replace(":", ",").split(","))

    given = [(name, spec_of(each.info.brdf)) for name, each in zip(names, maps, strict=True)]
    return [
        f"{transfer}: what the mesh reflects onto itself is of {baked:.80}, which is not the BRDF "
        f"of {name}; bake it with that one's"
        for name, spec in given or [("a diffuse surface", "")]
        if baked and parts(baked) != parts(spec)
    ]


def mesh_values(subject: MeshSubject, mesh: str) -> dict[str, Any]:
    """Return what the results and the attributes of pictures say about a mesh and its camera."""
    materials = sum(look.paint is not None for look in subject.stage.looks)
    return {
        "mesh": mesh,
        "triangles": len(subject.stage.mesh.faces),
        **({"materials": materials} if materials else {}),
        "fov": subject.lens.fov,
        "target": [float(each) for each in subject.aim.target],
        "distance": subject.aim.distance,
    }
