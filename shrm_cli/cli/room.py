"""The options of commands that light rooms, and how these are read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from shrm_cli.cli.options import several
from shrm_cli.cli.types import NAMED_COLOR

if TYPE_CHECKING:
    from shrm_cli.probe.probe import Probe
    from shrm_cli.rooms.room import Color, Room

_ALBEDO = 0.5
"""What triangles reflect that have no material."""

NamedColors = tuple[tuple[str, "Color"], ...]

room_options = several(
    click.option(
        "--probe", type=click.Path(),
        help="Light that is seen past the room, such as through windows.",
    ),
    click.option(
        "--albedo", type=NAMED_COLOR, multiple=True,
        help="What a material reflects, in place of its base colour. May be repeated.",
    ),
    click.option(
        "--emit", type=NAMED_COLOR, multiple=True,
        help="Radiance that a material sends. May be repeated.",
    ),
)  # fmt: skip


@dataclass(frozen=True)
class OpenRoom:
    """A room, all of the light past it, and what a user should know."""

    room: Room
    surroundings: Probe | None
    warnings: list[str]


def open_room(source: str, probe: str | None, albedo: NamedColors, emit: NamedColors) -> OpenRoom:
    """Read a room.

    Raises
    ------
    MeshError, ProbeError
        If a file cannot be read, or nothing sends light.
    """
    from shrm_cli.geometry.load import load_mesh
    from shrm_cli.lights.split import split_lamps
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.rooms.room import Room

    mesh = load_mesh(source)
    light = None if probe is None else open_probe(probe)
    split = None if light is None else split_lamps(light)
    changes = {"albedo": dict(albedo), "emission": dict(emit)}
    outside = (None, ()) if split is None else (split.residual_probe, split.discs)
    room = Room.of(mesh, (_ALBEDO,) * 3, changes, *outside)
    textured = [
        repr(each.name)
        for each in mesh.materials
        if (each.color_map and each.name not in changes["albedo"])
        or (each.emission_map and each.name not in changes["emission"])
    ]
    left_out = (
        f"{source}: textures are left out; the numbers alone count of {', '.join(textured)}; "
        "`albedo` NAME=R,G,B and `emit` NAME=R,G,B name their means"
    )
    return OpenRoom(room, light, [left_out] if textured else [])
