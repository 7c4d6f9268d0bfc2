"""Manifests: TOML files that say what a batch makes.

A small one; `docs/batch.md` has every key::

    probes = ["probes/**/*.exr"]
    brdfs = ["microfacet:sigma=0.2", "paint.bsdf"]
    to = ["shrm", "irradiance"]
    output = "bake/{folder}/{probe}.{brdf}.{to}.exr"
    eps = 0.02

    [irradiance]
    form = "zh3"

    [[entry]]
    probes = ["night/*.exr"]
    error = 0.05

    [[entry]]
    for = ["three", "bevy"]
    to = "export"
    output = "engines/{engine}/{probe}"

Every ``[[entry]]`` begins with what stands before the first one, as far as it applies to its forms
and to what it says itself: an error takes the place of ``eps`` and of orders, and the reverse.
Without any, that is the one entry. Names are relative to the current folder, as those of the
command line are.
"""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from shrm_cli.batch.entry import DEFAULT_OUTPUT, Entry, every_engine
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.files.json_text import read_toml
from shrm_cli.files.whole import note
from shrm_cli.maps.options import listing
from shrm_cli.maps.registry import DESCRIPTIONS
from shrm_cli.maps.request import over
from shrm_cli.messages import as_keys
from shrm_cli.probe.options import ReadOptions, with_keywords
from shrm_cli.probe.pixels import PixelPolicy
from shrm_cli.vocabulary import AUTO, EXPORT, PRECISIONS, REPRESENTATIONS

_MOST_BYTES = 2**22
_MOST_ENTRIES = 10_000
_LISTS = ("probes", "brdfs", "to", "for")
_TEXTS = ("output", "precision")
_READING = {each.name for each in (*fields(ReadOptions), *fields(PixelPolicy))} - {"pixels"}


def is_manifest(name: str) -> bool:
    """Whether a file is a manifest, rather than a light file, which is TOML too.

    A manifest has ``probes`` or ``entry``, and a light file ``probe`` or ``disc``.
    """
    if not name.lower().endswith(".toml") or not Path(name).is_file():
        return False
    try:
        found = _read(name)
    except ProbeError:
        return True  # which tells what is wrong when it is read
    return not {"probe", "disc"} & found.keys()


def read_manifest(name: str) -> list[Entry]:
    """Read the entries of a manifest.

    Raises ProbeError if there is no such file, it is no TOML, a key or a value is unknown, or one
    applies to nothing.
    """
    found = _read(name)
    note(name)
    shared = {key: value for key, value in found.items() if key != "entry"}
    tables = found.get("entry", [{}])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        raise ProbeError(f"{name}: 'entry' is no list of tables; write [[entry]]")
    if len(tables) > _MOST_ENTRIES:
        raise ProbeError(f"{name}: {len(tables):,} entries are more than {_MOST_ENTRIES:,}")
    written = [_entry(name, _merged(shared, table)) for table in tables]
    try:
        idle = [entry.idle() for entry in written]
        # What stands before all entries is there for those that it applies to, if there are any.
        spare = {key for key in shared if any(key not in each for each in idle)}
        entries = [
            entry.without_idle(spare - table.keys())
            for entry, table in zip(written, tables, strict=True)
        ]
        for entry in entries:
            entry.recipes()
    except ArgumentError as error:
        # A manifest has no flags, and the error is none of usage.
        raise ProbeError(f"{name}: {as_keys(error)}") from None
    return entries


def _read(name: str) -> dict[str, Any]:
    too_large = f"more than {_MOST_BYTES:,} bytes are no manifest; split it"
    found, _ = read_toml(name, "a manifest", _MOST_BYTES, too_large, ProbeError)
    return found


def _merged(shared: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of an entry over the shared ones; tables are merged key by key.

    An entry that says an error of its own does not take over what an error chooses, as `eps`.
    """
    chosen = frozenset[str]().union(*(each.chosen for each in DESCRIPTIONS.values()))
    own = dict(table)
    for key, value in table.items():
        before = shared.get(key)
        if isinstance(value, dict) and isinstance(before, dict):
            own[key] = over(before, value, chosen)
    return over(shared, own, chosen)


def _entry(name: str, found: Mapping[str, Any]) -> Entry:
    texts = {key: _text_list(name, key, found[key]) for key in _LISTS if key in found}
    for key in _TEXTS:
        if key in found and not isinstance(found[key], str):
            raise ProbeError(f"{name}: '{key}' is no text; put it in quotes")
    precision = found.get("precision", "auto")
    if precision not in PRECISIONS:
        raise ProbeError(f"{name}: 'precision' is none of {listing(PRECISIONS, 'and')}")
    others = {
        key: value for key, value in found.items() if key not in (*_LISTS, *_TEXTS, "reading")
    }
    forms = AUTO, EXPORT, *REPRESENTATIONS  # others are known when it is seen what is made
    own = {key: value for key, value in others.items() if key in forms or isinstance(value, dict)}
    for key, value in own.items():
        if not isinstance(value, dict):
            raise ProbeError(f"{name}: '{key}' is no table; write [{key}]")
    arguments = {key: value for key, value in others.items() if key not in own}
    if "brdf" in arguments:
        raise ProbeError(f"{name}: 'brdf' is no key; write brdfs = [...]")
    if "probes" not in texts:
        raise ProbeError(f"{name}: an entry names no probes; write probes = [...]")
    return Entry(
        texts["probes"], texts.get("brdfs", ()),
        texts.get("to", (EXPORT,) if "for" in texts else (AUTO,)),
        found.get("output", DEFAULT_OUTPUT), arguments, own,
        _reading(name, found.get("reading", {})), precision,
        engines=every_engine(texts.get("for", ())),
    )  # fmt: skip


def _text_list(name: str, key: str, value: Any) -> tuple[str, ...]:
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not all(isinstance(each, str) and each for each in texts):
        example = f'{key} = ["...", "..."]'
        raise ProbeError(f"{name}: '{key}' is no list of texts; write {example}")
    return tuple(texts)


def _reading(name: str, found: Any) -> dict[str, Any]:
    """Return the keywords of `open_probe` that a manifest holds, checked."""
    if not isinstance(found, dict):
        raise ProbeError(f"{name}: 'reading' is no table; write [reading]")
    unknown = sorted(found.keys() - _READING)
    if unknown:
        known = ", ".join(sorted(_READING))
        raise ProbeError(f"{name}: {unknown[0]!r:.60} says nothing of reading; known are {known}")
    try:
        with_keywords(ReadOptions(), found)  # type: ignore[arg-type]
    except ProbeError as error:
        raise ProbeError(f"{name}: {as_keys(error)}") from None
    return dict(found)
