"""The outputs of commands: names, and the check that no input is overwritten."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from shrm_cli.files.whole import check_target, note


def map_stem(path: str) -> str:
    """Return the name of a map's file without its folder and the suffix ``.exr``."""
    name = Path(path).name
    return name[:-4] if name.lower().endswith(".exr") else name


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
        Paths of inputs that have not been opened yet; all others are known, see `files.inputs`.
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
