"""What commands do about files that exist under the names which they choose themselves.

Such a file is replaced if the same inputs and options made it, or if the user says --force. What
others made is kept, and the user is told before the work begins. Names that the user gives by -o
are written without asking, and so are pictures to look at.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.errors import MapError
from shrm_cli.files.whole import kept

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.maps.request import Request
    from shrm_cli.probe.probe import Probe
    from shrm_cli.vocabulary import Precision

force_option = click.option(
    "--force", is_flag=True,
    help="Replace a file of the default name that other inputs or options made.",
)  # fmt: skip


def keep_other_map(target: str, probe: Probe, request: Request, precision: Precision) -> None:
    """Refuse to replace a map that was not made like the one that is asked for.

    Parameters
    ----------
    target : str
        The name of the file, which need not exist.
    probe : Probe
    request : Request
    precision : {"auto", "half", "float"}

    Raises
    ------
    OutputError
        If the file exists, and other inputs or options made it.
    """
    from shrm_cli.batch.made import difference

    if os.path.lexists(target):
        found = difference(target, probe, request, precision)
        if found is not None and not found.is_damage:
            raise kept(target, found.why)


def keep_edited(target: str) -> None:
    """Refuse to replace what `shrm` wrote and somebody has edited since.

    Raises
    ------
    OutputError
        If the file exists and its digest tells so.
    """
    from shrm_cli.batch.made import change_of

    found = change_of(target) if os.path.isfile(target) else None
    if found is not None and not found.is_damage:
        raise kept(target, found.why)


def readable_map(path: str) -> Map | None:
    """Return the map in a file that is only looked at, and is no input; None if it is no map."""
    from shrm_cli.files.inputs import protecting
    from shrm_cli.maps.file import open_map

    with suppress(MapError), protecting():
        return open_map(path)
    return None


def keep_other_picture(target: str, recipe: Mapping[str, Any]) -> None:
    """Refuse to replace an EXR picture that was not made by the same recipe.

    Parameters
    ----------
    target : str
        The name of the file, which need not exist.
    recipe : mapping of str to value
        What `outputs.picture_attributes` will store.

    Raises
    ------
    OutputError
        If the file exists, and another recipe, or none, made it.
    """
    from shrm_cli.files.parts import peek

    if not os.path.lexists(target):
        return
    keep_edited(target)
    stored = peek(target)
    text = "" if stored is None else stored.first.text("shrm:recipe")
    if text != json.dumps(recipe):
        raise kept(target, "other inputs or options made it")
