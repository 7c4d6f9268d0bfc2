"""Which files that a pattern matches are no probes, because commands of `shrm` wrote them."""

import os
import re
from collections.abc import Iterable
from contextlib import suppress

from shrm_cli.files.exr_header import is_output
from shrm_cli.maps import registry
from shrm_cli.messages import is_remote

_NO_PROBES = (
    ".json", ".jsonl", ".npz", ".parquet", ".html", ".htm", ".ktx", ".ktx2", ".env", ".usda", ".md",
    ".bsdf", ".binary", ".gif", ".apng", ".mp4", ".obj", ".ply", ".stl", ".glb", ".gltf", ".part",
)  # fmt: skip
"""Suffixes of other files that commands write or read, and that few probes have."""
_MAY_BE_PROBES = (".json", ".usda")
"""Those that some probes have: coefficients, as of a LightProbe of three.js, and stages."""
RECORD = "_export.json"
"""What the names of a batch's records of exports end in."""
_README = "_README.md"
_MOST_README = 2**16
_NAMED = re.compile(r"`([^`\n]+)`")


def without_outputs(names: Iterable[str], pattern: str = "") -> tuple[list[str], list[str]]:
    """Divide files into those that may be probes, and those that `shrm` wrote.

    On disk a map, a table or a picture says what it is at its beginning, and of what an engine's
    export wrote, the README beside it names the files. Of a listing from elsewhere nothing is known
    but names. Stages and coefficients, of whose suffixes others are as well, are probes where
    `pattern`, which the names match, ends in the suffix.

    Returns the probes, and the outputs, in the order of the names.
    """
    exported: dict[str, frozenset[str]] = {}
    named = [each for each in _MAY_BE_PROBES if pattern.lower().endswith(each)]
    others = tuple(each for each in _NO_PROBES if each not in named)
    maps: tuple[str, ...] = ()  # what their default names end in
    probes: list[str] = []
    outputs: list[str] = []
    for name in names:
        lower = name.lower()
        if is_remote(name):
            maps = maps or tuple(f".{to}.exr" for to in registry.names())
            is_made = lower.endswith((*others, *maps))
        else:
            folder, last = os.path.split(name)
            if folder not in exported:
                exported[folder] = _exported(folder)
            is_made = (
                lower.endswith((*others, RECORD)) or last in exported[folder] or _is_made(name)
            )
        (outputs if is_made else probes).append(name)
    return probes, outputs


def _is_made(name: str) -> bool:
    """Whether a file says that it is a map, a table or a picture that `shrm` made."""
    if name.lower().endswith(".png"):
        from shrm_cli.files.png import is_ours

        return is_ours(name)
    return is_output(name)


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
