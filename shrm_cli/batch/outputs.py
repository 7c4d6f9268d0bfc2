"""Files that `shrm` wrote itself, which patterns never mean when they name probes.

Outputs often lie beside their probes, so that a pattern such as ``*.exr`` matches both from the
second run on. On disk a map, a table or a picture says what it is at its beginning, and of what an
engine's export wrote, the README beside it names the files. Of a listing from elsewhere nothing is
known but names.
"""

import os
import re
from collections.abc import Iterable
from contextlib import suppress

from shrm_cli.addresses import is_remote
from shrm_cli.files.exr_header import is_output
from shrm_cli.vocabulary import REPRESENTATIONS

_NO_PROBES = (
    ".json", ".jsonl", ".npz", ".parquet", ".html", ".htm", ".ktx", ".ktx2", ".env", ".usda", ".md",
    ".bsdf", ".binary",
)  # fmt: skip
"""Suffixes of other files that commands write or read, and that no probe has."""
_MAPS = tuple(f".{to}.exr" for to in REPRESENTATIONS)
"""What the default names of maps end in."""
_README = "_README.md"
_MOST_README = 2**16
_NAMED = re.compile(r"`([^`\n]+)`")


def without_outputs(names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Divide files into those that may be probes, and those that `shrm` wrote.

    Pixels are not read; it takes some 40 microseconds a file.

    Parameters
    ----------
    names : iterable of str
        Paths or URLs.

    Returns
    -------
    probes, outputs : list of str
        In the order of the names.
    """
    exported: dict[str, frozenset[str]] = {}
    probes: list[str] = []
    outputs: list[str] = []
    for name in names:
        lower = name.lower()
        if is_remote(name):
            is_made = lower.endswith((*_NO_PROBES, *_MAPS))
        else:
            folder, last = os.path.split(name)
            if folder not in exported:
                exported[folder] = _exported(folder)
            is_made = lower.endswith(_NO_PROBES) or last in exported[folder] or is_output(name)
        (outputs if is_made else probes).append(name)
    return probes, outputs


def _exported(folder: str) -> frozenset[str]:
    """Return the names of the files that exports have written into a folder."""
    found: set[str] = set()
    with suppress(OSError, ValueError):
        for name in os.listdir(folder or "."):
            if not name.endswith(_README):
                continue
            with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as stream:
                text = stream.read(_MOST_README)
            title, _, files = text.partition("\nFiles: ")
            if ", by shrm " in title:
                found |= {name, *_NAMED.findall(files.partition("\n")[0])}
    return frozenset(found)
