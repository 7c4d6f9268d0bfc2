"""Whether a file is what a run would make, and whether a run may replace it if it is not.

This is the one place that decides it. What other inputs, other options or another state of the
program made is made anew by batches, and so is what is damaged. What `shrm` did not make of this
probe, or somebody has edited since, is nobody's to replace without being told so: `force` does it.
"""

import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import MapError
from shrm_cli.export.quoting import code_span, spans
from shrm_cli.files.exr_header import condition, holds_nothing, is_output, says_map
from shrm_cli.files.parts import peek
from shrm_cli.maps import registry
from shrm_cli.maps.file import Recorded, check_amount, recorded
from shrm_cli.maps.info import probe_name, record_of, same_brdf
from shrm_cli.maps.request import Request, recorded_defaults
from shrm_cli.messages import is_remote
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.vocabulary import AUTO, AUTO_FORMS, REPRESENTATIONS, Precision

DAMAGED = "it is damaged"
NOT_THERE = "not there"
"""Why most outputs are made."""


@record
class Difference:
    """In what a file differs from the map that a run would write."""

    why: str
    """A part of a sentence such as ``it is for another BRDF``."""
    is_ours: bool = True
    """Whether it is an earlier state of the same output, which a batch makes anew."""

    @property
    def is_damage(self) -> bool:
        """Whether nothing of it is worth keeping."""
        return self.why == DAMAGED


MISSING = Difference(NOT_THERE)


def difference(
    path: str | os.PathLike[str],
    probe: Probe,
    request: Request,
    precision: Precision,
    sources: str = "",
) -> Difference | None:
    """Say in what a file differs from the map that a run would write, or return None.

    `sources` is the fingerprint of the program that must have written the file; any, where it is
    empty.
    """
    to, brdf = request.to, request.brdf
    found = recorded(path)
    if found is None:
        return _unreadable(path)
    if found.representation not in ({to} if to != AUTO else AUTO_FORMS):
        return Difference(f"it is a map of representation {found.representation}", is_ours=False)
    changed = change_of(path)
    if changed is not None:
        return changed
    if found.info.probe_sha256 != probe.digest():
        return Difference(
            "another probe made it, or another version of this one",
            is_ours=found.info.probe == probe_name(probe),
        )
    if not _is_of(brdf, found):
        return Difference("it is for another BRDF")
    wanted = request.record(probe) | ({} if precision == "auto" else {"precision": precision})
    others = differing(_options(found), wanted)
    if others:
        return Difference(f"it was made with other options ({others})")
    if sources and not found.sources:
        return Difference("an earlier version of shrm made it, which recorded no digest")
    if sources and found.sources != sources:
        is_ours = found.representation in REPRESENTATIONS
        of = "shrm" if is_ours else "shrm, or of the package with the form,"
        return Difference(f"another version or state of {of} made it")
    return None


def _is_of(brdf: Brdf | None, found: Recorded) -> bool:
    """Whether a file was made for a BRDF, or for none where that is None.

    What needs none may be made for one, and records it among its options.
    """
    needs_one = registry.description(found.representation).needs_brdf
    there = found.info.brdf if needs_one else found.info.options.get("brdf")
    if brdf is None or there is None:
        return brdf is None and (needs_one or there is None)
    return same_brdf(there, record_of(brdf))


def _unreadable(path: str | os.PathLike[str]) -> Difference:
    """Say what a file is that cannot be read as a map: damaged, or something else."""
    is_file = os.path.isfile(path)  # opening a pipe would wait for its writer
    if is_file and (holds_nothing(path) or (says_map(path) and condition(path) != "intact")):
        return Difference(DAMAGED)
    return Difference("it is no map that can be read", is_ours=False)


def change_of(path: str | os.PathLike[str]) -> Difference | None:
    """Say how a map's file was changed since it was written; None if it was not."""
    found = condition(path)
    if found in ("intact", "unknown"):
        return None
    # What an editor has written can be read; of what is damaged within, some chunk cannot.
    if found == "other" and _can_be_read(path):
        return Difference("it was changed since shrm made it", is_ours=False)
    return Difference(DAMAGED)


def _can_be_read(path: str | os.PathLike[str]) -> bool:
    """Whether all pixels of a file can be decoded, be they those of a map or not."""
    with suppress(MapError):
        file = peek(path)
        if file is None:
            return False
        check_amount(file)
        for part in file.parts:
            part.read(part.channel_names)
        return True
    return False


def _options(found: Recorded) -> Mapping[str, Any]:
    """Return the options of a file, with the defaults that earlier versions left out."""
    options = found.info.options
    if found.sources:
        return options
    return {**recorded_defaults(found.representation, options), **options}


def differing(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return in words how recorded options differ from those of this run."""
    here = json.loads(json.dumps(here))
    if there.get("reading") != here["reading"]:
        return "how the probe is read"
    if there.get("code") != here.get("code"):
        return "another state of the BRDF's code"
    names = sorted({*there, *here} - {"reading", "brdf", "code"})
    texts = [
        f"`{name}` {_text(there.get(name))} there, {_text(here.get(name))} here"
        for name in names
        if there.get(name) != here.get(name)
    ]
    return ", ".join(texts)


def _text(value: Any) -> str:
    return "by default" if value is None else json.dumps(value)


# ---- which files that a pattern matches are no probes, because commands of `shrm` wrote them -----

_NO_PROBES = (
    ".json", ".jsonl", ".npz", ".parquet", ".html", ".htm", ".ktx", ".ktx2", ".env", ".usda", ".md",
    ".yaml", ".yml",
    ".bsdf", ".binary", ".gif", ".apng", ".mp4", ".obj", ".ply", ".stl", ".glb", ".gltf", ".part",
)  # fmt: skip
"""Suffixes of other files that commands write or read, and that few probes have."""
_MAY_BE_PROBES = (".json", ".usda")
"""Suffixes that some probes have: coefficients, as of a LightProbe of three.js, and stages."""
RECORD = "_export.json"
"""What the names of a batch's records of exports end in."""
_OF_FARMS = ("", ".txt", ".sh")
"""Suffixes that lists of commands for farms mostly have."""
_README = "_README.md"
_MOST_README = 2**16


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
                lower.endswith((*others, RECORD))
                or code_span(last) in exported[folder]
                or _is_made(name)
            )
        (outputs if is_made else probes).append(name)
    return probes, outputs


def _is_made(name: str) -> bool:
    """Whether a file says that it is a map, a table, a picture or a list that `shrm` made."""
    if os.path.splitext(name)[1].lower() in _OF_FARMS:
        from shrm_cli.batch.farm import is_list

        return is_list(name)
    if name.lower().endswith(".png"):
        from shrm_cli.files.png import is_ours

        return is_ours(name)
    return is_output(name)


def _exported(folder: str) -> frozenset[str]:
    """Return the `code_span`s of the files that exports have written into a folder."""
    found: set[str] = set()
    with suppress(OSError, ValueError):
        for name in os.listdir(folder or "."):
            if not name.endswith(_README):
                continue
            with open(os.path.join(folder, name), encoding="utf-8", errors="replace") as stream:
                text = stream.read(_MOST_README)
            title, _, files = text.partition("\nFiles: ")
            if ", by shrm " in title:
                found |= {code_span(name), *spans(files.partition("\n")[0])}
    return frozenset(found)
