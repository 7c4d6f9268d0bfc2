"""The options of commands that light rooms, and what these leave out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from shrm_cli.cli.options import several
from shrm_cli.cli.types import NAMED_COLOR

if TYPE_CHECKING:
    from shrm_cli.rooms.room import Color

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


def textures_left_out(source: str, textured: Sequence[str]) -> list[str]:
    """Return a warning about materials of which the numbers alone count, if there are any."""
    if not textured:
        return []
    return [
        f"{source}: textures are left out; the numbers alone count of {', '.join(textured)}; "
        "`albedo` NAME=R,G,B and `emit` NAME=R,G,B name their means"
    ]
