"""The outputs of commands: names, and the checks that neither inputs nor files of others are lost.

A file of a name which a command chooses itself is replaced if the same inputs and options made it,
or if the user says --force. What others made is kept, and the user is told before the work begins.
Names that the user gives by -o are written without asking, and so are pictures to look at.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.errors import MapError
from shrm_cli.files.whole import check_target, kept, note
from shrm_cli.naming import probe_stem

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.maps.request import Request
    from shrm_cli.probe.probe import Probe
    from shrm_cli.vocabulary import Precision

PAGES = (".html", ".htm")
"""The suffixes of pages."""

force_option = click.option(
    "--force", is_flag=True,
    help="Replace a file of the default name that other inputs or options made.",
)  # fmt: skip


def map_stem(path: str) -> str:
    """Return the name of a map's file without its folder and the suffix ``.exr``."""
    name = Path(path).name
    return name[:-4] if name.lower().endswith(".exr") else name


def source_stem(path: str, forms: Collection[str]) -> str:
    """Return what outputs are named after: a file's name without its suffix, and without a form."""
    stem = Path(path).stem
    base, dot, last = stem.rpartition(".")
    return probe_stem(f"{base if dot and last in forms else stem}.exr")


def check_outputs(
    targets: Iterable[str],
    *,
    files: Iterable[str] = (),
    specs: Iterable[str | None] = (),
    suffixes: Iterable[str] = (),
) -> None:
    """Check, before work begins, that outputs can be written and overwrite no input.

    Parameters
    ----------
    targets : iterable of str
        The outputs.
    files : iterable of str
        Paths of inputs that have not been opened yet; all others are known, see `files.whole`.
    specs : iterable of str or None
        Specifications of BRDFs, which may name files that have not been opened yet.
    suffixes : iterable of str
        The suffixes that the targets' names may have, in lower case; by default any.

    Raises
    ------
    OutputError
        If a target cannot be written, is one of the inputs, or has another suffix.
    """
    from shrm_cli.brdf.spec import named_files

    note(*files, *(path for spec in specs if spec is not None for path in named_files(spec)))
    for target in targets:
        check_target(target, tuple(suffixes))


def picture_attributes(
    recipe: dict[str, Any], primaries: Iterable[tuple[float, ...] | None]
) -> dict[str, Any]:
    """Return the attributes of an EXR picture.

    Parameters
    ----------
    recipe : dict
        How it was made. File names stand in it without their folders, because the bytes of the
        picture must not depend on them.
    primaries : iterable of tuple of 8 float or None
        The chromaticities of everything that the picture shows; they are passed on where all are
        the same.
    """
    attributes: dict[str, Any] = {"shrm:recipe": json.dumps(recipe)}
    known = set(primaries)
    if len(known) == 1 and None not in known:
        attributes["chromaticities"] = known.pop()
    return attributes


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
    from shrm_cli.files.whole import protecting
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
        What `picture_attributes` will store.

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
