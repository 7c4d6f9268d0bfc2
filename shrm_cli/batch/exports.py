"""Folders of files that engines load, as outputs of a batch.

Beside the files of an export lies ``NAME_export.json``: what was asked for, the digests of the
probe, the program and the files. By it a later run knows what is there already and whole.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from shrm_cli.batch.job import Job
from shrm_cli.batch.made import DAMAGED, MISSING, RECORD, Difference, differing
from shrm_cli.errors import ArgumentError, OutputError
from shrm_cli.export.cubes import LARGE
from shrm_cli.export.engine import engine as engine_of
from shrm_cli.export.ktx import can_compress
from shrm_cli.export.make import Asked, Source, check, made_folder, packaged, write
from shrm_cli.files.exr_header import holds_nothing
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.whole import check_target, exists_error, write_bytes
from shrm_cli.maps.info import probe_name
from shrm_cli.maps.options import Option, Representation
from shrm_cli.naming import probe_stem
from shrm_cli.probe.probe import Probe
from shrm_cli.sources import EXPORTS, fingerprint, fingerprint_with
from shrm_cli.vocabulary import ENGINES, EXPORT, TEXEL_FORMATS

OPTIONS = (
    Option("engine", "who loads it", "text"),
    Option("size", "texels along an edge", "integer", limits=(1, 4096)),
    Option("format", "texels of cubes", "choice", choices=TEXEL_FORMATS),
    Option("max_error", "what texels may change", "fraction"),
    Option("skybox", "texels of the sharp cube", "integer", limits=(0, 4096)),
    Option("window", "of the nine coefficients", "text"),
    Option("dfg", "the environment-BRDF table", "switch"),
    Option("firefly_safe", "lamps that the engine's filter resolves", "switch"),
    Option("sun", "lamps that become lights of the engine", "choice", choices=("split",)),
)
DESCRIPTION = Representation(
    EXPORT, "files of engines", frozenset(), OPTIONS, why_no_brdf="exports are of GGX"
)
"""What a batch needs to know of exports, as of a representation."""
_ATTRIBUTES = {"format": "texels", "dfg": "table", "firefly_safe": "safe"}
"""Options that `Asked` has other names for."""

_MOST_RECORD = 2**20
_NO_END = 64
"""So many zeros at its end, which others stood for, show that a file was not written whole."""
_HEAD = 256
"""The bytes by which a file that was cut is told from one that was made smaller."""
_LACKED = "zstandard"
"""The package without which files are larger than they could be."""


def checked(given: Mapping[str, Any], engines: Iterable[str]) -> list[dict[str, Any]]:
    """Return the arguments of the exports for some engines: of each those that it has.

    Raises ArgumentError for what none of them has, or what is out of range for one.
    """
    known = {option.name: option for option in OPTIONS}
    for name in given:
        if name not in known:
            raise ArgumentError(name, f"does not apply to {EXPORT}")
    found = {name: known[name].checked(value) for name, value in given.items()}
    chosen = [engine_of(known["engine"].checked(each)) for each in engines]
    asked = _asked(found)
    try:
        own = asked.of_several(chosen)
        for engine, its in zip(chosen, own, strict=True):
            check(engine, its)
    except ArgumentError as error:
        names = {attribute: name for name, attribute in _ATTRIBUTES.items()}
        raise ArgumentError(names.get(error.argument, error.argument), error.message) from None

    def has(its: Asked, name: str) -> bool:
        attribute = _ATTRIBUTES.get(name, name)
        return bool(getattr(its, attribute) == getattr(asked, attribute))

    return [
        {**{name: value for name, value in found.items() if has(its, name)}, "engine": engine.name}
        for engine, its in zip(chosen, own, strict=True)
    ]


def difference(job: Job, probe: Probe) -> Difference | None:
    """Say in what a job's folder differs from what this program would write, or return None."""
    folder = Path(job.output)
    if not os.path.lexists(folder):
        return MISSING
    if not folder.is_dir():
        return Difference("it is no folder", is_ours=False)
    path = folder / _record_name(job)
    if not path.is_file():
        is_empty = not any(folder.iterdir())
        return MISSING if is_empty else Difference("no batch made what it holds", is_ours=False)
    held = _read(path)
    if held is None:
        return Difference(DAMAGED)
    if held.get("probe_sha256") != probe.digest():
        is_ours = held.get("probe") == probe_name(probe)
        return Difference("another probe made it, or another version of this one", is_ours=is_ours)
    if held.get("files") is None:
        return Difference("it is unfinished")
    changed = _changed(folder, held["files"])
    if changed is not None and not changed.is_ours:
        return changed
    options = held.get("options")
    words = differing(options if isinstance(options, dict) else {}, _options(job, probe))
    if words:
        return Difference(f"it was made with other options ({words})")
    if held.get("sources") != _sources(job):
        return Difference("another version or state of shrm made it")
    if held.get("lacks") == _LACKED and can_compress():
        return Difference(f"it was made without the package {_LACKED}")
    return changed


def _sources(job: Job) -> str:
    """Return the fingerprint of the code that makes an export, of an installed package, too."""
    name = job.recipe.arguments["engine"]
    if name in ENGINES:
        return fingerprint(EXPORTS)
    return fingerprint_with(type(engine_of(name)).__module__)


def make_folder(job: Job, probe: Probe, force: bool = False) -> dict[str, Any]:
    """Make the folder of a job, and return what its record tells of it.

    `force` tells whether files that no batch made are replaced, too.
    """
    folder, arguments = Path(job.output), job.recipe.arguments
    source = Source(probe_stem(job.probe), probe_name(probe), probe)
    asked = _asked(arguments, keeps_primaries=job.reading.get("working") is not None)
    path = folder / _record_name(job)
    check_target(path if folder.is_dir() else folder, makes_folder=True)  # before the work
    package = packaged(source, engine_of(arguments["engine"]), asked)
    folder.parent.mkdir(parents=True, exist_ok=True)
    held = _read(path) or {}
    before = held.get("files")
    names = [each.name for each in package.files]
    ours = _named(before) | _named(held.get("begun"))
    for name in sorted({*names} - ours) if ours and not force else ():
        if os.path.lexists(folder / name):
            raise exists_error(folder / name, "no batch made it")
    facts = {
        "probe": probe_name(probe),
        "probe_sha256": probe.digest(),
        "options": _options(job, probe),
        "sources": _sources(job),
        **({"lacks": _LACKED} if LARGE in package.told else {}),
    }
    with made_folder(folder):
        # A run that ends between the files leaves a folder that the next one may finish.
        _write(path, {**facts, "begun": names})
        try:
            paths = write(package, folder, kept=False)
        except OutputError:
            path.unlink(missing_ok=True)
            raise
        files = {each.name: _facts(each) for each in paths}
        _remove_stale(folder, before, files)
        _write(path, {**facts, "files": files})
    return {"bytes": sum(size for size, *_ in files.values()), "warnings": package.warnings}


def _asked(arguments: Mapping[str, Any], keeps_primaries: bool = False) -> Asked:
    given = {_ATTRIBUTES.get(name, name): value for name, value in arguments.items()}
    given.pop("engine", None)
    return Asked(**given, keeps_primaries=keeps_primaries)


def _options(job: Job, probe: Probe) -> dict[str, Any]:
    """Return what is recorded of what was asked for, as JSON has it."""
    return {**job.recipe.arguments, "reading": probe.reading()}


def _record_name(job: Job) -> str:
    return probe_stem(job.probe) + RECORD


def _read(path: Path) -> dict[str, Any] | None:
    """Return a record, or None of what is none."""
    try:
        if path.stat().st_size > _MOST_RECORD:
            return None
        held = parse_json(path.read_text(encoding="utf-8"))
    except (ValueError, OSError):
        return None
    return held if isinstance(held, dict) else None


def _write(path: Path, held: Mapping[str, Any]) -> None:
    write_bytes(path, (json.dumps({"shrm": EXPORT, **held}, indent=1) + "\n").encode())


def _named(files: object) -> set[str]:
    """The names in a record; none where it is damaged."""
    if isinstance(files, dict):
        return set(files) if all(_is_sound(name, facts) for name, facts in files.items()) else set()
    names = set(map(str, files)) if isinstance(files, list) else set()
    return names if all(Path(name).name == name for name in names) else set()


def _is_sound(name: str, facts: object) -> bool:
    """Whether a record may say so of a file."""
    is_known = isinstance(facts, list) and len(facts) == 3 and type(facts[0]) is int
    return is_known and Path(name).name == name


def _remove_stale(folder: Path, before: object, files: Mapping[str, Any]) -> None:
    """Remove what an earlier run made, and this one did not, unless somebody changed it."""
    for name, facts in (before if isinstance(before, dict) else {}).items():
        if name not in files and _changed(folder, {name: facts}) is None:
            (folder / name).unlink()


def _changed(folder: Path, files: object) -> Difference | None:
    """Say how the files of a folder were changed since they were written; None if not.

    What somebody edited counts before what is damaged, which a run replaces.
    """
    if not isinstance(files, dict):
        return Difference(DAMAGED)
    found = None
    for name, facts in files.items():
        path = folder / name
        if not _is_sound(name, facts):
            return Difference(DAMAGED)
        there = _facts(path) if path.is_file() else None
        if there is None or (there[:2] != facts[:2] and _is_damage(path, there, facts)):
            found = Difference(DAMAGED)
        elif there[:2] != facts[:2]:
            return Difference(f"{name} was changed since shrm made it", is_ours=False)
    return found


def _is_damage(path: Path, there: Sequence[Any], made: Sequence[Any]) -> bool:
    """Whether a file that has changed was cut, or ends in zeros as after a power cut.

    `there` and `made` are its `_facts`. One that begins with something else was made anew by
    somebody, such as one that was compressed.
    """
    if holds_nothing(path):
        return True
    if there[0] > made[0] or there[2] != made[2]:
        return False
    with open(path, "rb") as stream:
        stream.seek(-min(_NO_END, there[0]), os.SEEK_END)
        return there[0] < made[0] or not stream.read().strip(b"\0")


def _facts(path: Path) -> list[Any]:
    """What is recorded of a file: its bytes, their digest, and that of the first of them."""
    return [path.stat().st_size, _digest(path), _digest(path, _HEAD)]


def _digest(path: Path, count: int = -1) -> str:
    """SHA-256 of the first bytes of a file, or of all of them, in hexadecimal digits."""
    with open(path, "rb") as stream:
        if count < 0:
            return hashlib.file_digest(stream, "sha256").hexdigest()
        return hashlib.sha256(stream.read(count)).hexdigest()
