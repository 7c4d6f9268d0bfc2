"""The outputs of commands: default names, and the check that no input is overwritten."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from shrm_cli.files.inputs import note
from shrm_cli.files.whole import check_target

_LONGEST_STEM, _LONGEST_LABEL = 100, 80
"""The most bytes of a probe's and of a BRDF's part of a default name.

File systems take names of 255 bytes, and names of pictures and conversions are longer ones yet.
"""


def probe_stem(probe: str) -> str:
    """Return what the names of a probe's outputs begin with, without the ``%`` of six files."""
    stem = Path(probe).stem.replace("%", "").rstrip("_-.") or "probe"
    return shortened(stem, _LONGEST_STEM)


def brdf_label(spec: str) -> str:
    """Return a BRDF's specification as a part of a file's name; sums may be long, and are cut."""
    from shrm_cli.brdf.spec import file_label

    return shortened(file_label(spec), _LONGEST_LABEL)


def shortened(text: str, most: int) -> str:
    """Return a text of at most so many bytes: a longer one ends in eight digits of its SHA-256.

    So texts that begin alike are told apart.
    """
    from hashlib import sha256

    data = os.fsencode(text)
    if len(data) <= most:
        return text
    digits = sha256(data).hexdigest()[:8]
    return f"{data[: most - 9].decode(errors='ignore')}-{digits}"


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
