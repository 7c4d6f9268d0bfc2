"""What `shrm render` draws: a sphere or a mesh, of each map, at each moment."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.moving import refuse_fixed_light
from shrm_cli.cli.shading import shaded_maps
from shrm_cli.cli.stage import OF_SURFACES, Baked, mesh_values, open_stage
from shrm_cli.records import record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shrm_cli.maps.base import Map
    from shrm_cli.maps.info import MapInfo
    from shrm_cli.render.moving import Moment


@record(eq=False)
class Lit:
    """Maps of the light at rest, and of the light that it becomes, with their files' names.

    Attributes
    ----------
    maps, others : sequence of Map
        There are no others where the light becomes no other.
    names, other_names : sequence of str
    """

    maps: Sequence[Map]
    names: Sequence[str]
    others: Sequence[Map]
    other_names: Sequence[str]


@record(eq=False)
class Drawing:
    """Something to draw, in several materials.

    Attributes
    ----------
    subject : Subject
    drawn : list
        Its materials under the light at rest.
    become : list, optional
        Its materials under the light that it becomes.
    seen : list of MapInfo
        How the maps were made, in the primaries of the picture.
    primaries : tuple of 8 float, optional
        Those of the picture.
    rows : int
        Of a lat-long that is fine enough to be its background.
    said : dict
        What results and recipes say of it.
    warnings : list of str
    recolored : bool
        Whether materials are maps, which may have other primaries.
    """

    subject: Any
    drawn: list[Any]
    become: list[Any] | None
    seen: list[MapInfo]
    primaries: tuple[float, ...] | None
    rows: int
    said: dict[str, Any]
    warnings: list[str]
    recolored: bool = False

    def at(self, moment: Moment) -> list[Any]:
        """Return the materials under the light of a moment."""
        from shrm_cli.render.primaries import in_same_primaries

        lit: list[Any] = moment.moved(self.drawn, self.become)
        return in_same_primaries(lit, self.primaries) if self.recolored else lit


def on_sphere(lit: Lit, size: tuple[int, int], values: dict[str, Any]) -> Drawing:
    """Return the sphere that is drawn.

    Raises
    ------
    click.UsageError
        If it has no square picture, or an option does not apply.
    """
    from shrm_cli.render.boxed import Placed
    from shrm_cli.render.camera import background_rows
    from shrm_cli.render.primaries import in_same_primaries
    from shrm_cli.render.scene import SphereSubject

    width, height = size
    if width != height:
        raise click.UsageError("--size of a sphere's picture is one number")
    asked = [values[name] for name in ("roughness", "f0", "anisotropy", "taps")]
    drawn, surface, warnings = shaded_maps(lit.maps, lit.names, *asked)
    place, radius = values["place"], values["radius"]
    if place is not None:
        pairs = zip(lit.maps, drawn, lit.names, strict=True)
        placed = [Placed.of(*each, place, radius) for each in pairs]
        surface |= {"place": list(place), "radius": placed[0].radius}
        drawn = [*placed]
    become: list[Any] | None = None
    if lit.others:
        become, _, more = shaded_maps(lit.others, lit.other_names, *asked)
        warnings = warnings + more
    primaries = lit.maps[0].info.chromaticities
    seen = [each.info for each in in_same_primaries(drawn, primaries)]
    return Drawing(
        SphereSubject(width), list(drawn), become, seen, primaries, background_rows(width),
        {"size": width, **surface}, warnings, True,
    )  # fmt: skip


def on_mesh(
    lit: Lit,
    mesh: str,
    baked: Baked | None,
    size: tuple[int, int],
    moments: Sequence[Moment],
    values: dict[str, Any],
) -> Drawing:
    """Return the mesh or the scene that is drawn, seen by the viewers of all moments.

    Raises
    ------
    click.UsageError
        If an option does not apply.
    """
    from shrm_cli.render.mesh import MeshSubject
    from shrm_cli.render.perspective import DEFAULT_FOV, Lens, aimed
    from shrm_cli.render.primaries import one_of

    plain = values["plain"] or baked is not None  # its albedo is baked
    stage, warnings = open_stage(mesh, lit.maps, lit.names, {**values, "plain": plain})
    refuse_fixed_light(stage, values)
    lens = Lens(*size, DEFAULT_FOV if values["fov"] is None else values["fov"])
    viewers = [each.viewer for each in moments]
    aim = aimed(stage.mesh.vertices, viewers, lens, values["target"], values["distance"])
    is_boxed = not values["no_box"]
    subject = MeshSubject(stage, lens, aim, is_boxed)
    seen = [each.info for each in (*lit.maps, *stage.maps())]
    given = {name: values[name] for name in (*OF_SURFACES, "transfer")}
    if baked is None:
        drawn = [stage.reflectors(each) for each in lit.maps] or [stage.reflectors(None)]
        become = [stage.reflectors(each) for each in lit.others]
    else:
        drawn, become = baked.drawn(stage), baked.with_maps(lit.others).drawn(stage)
    said = {
        "size": list(size),
        **mesh_values(subject, mesh),
        **{key: value for key, value in given.items() if value is not None},
    }
    return Drawing(
        subject,
        drawn,
        become or None,
        seen,
        one_of({each.chromaticities for each in seen}),
        subject.lens.background_rows(),
        said,
        warnings,
    )
