"""Whether a file is what a run would make: the same probe, BRDF and options made it."""

import json
import os
from collections.abc import Mapping
from typing import Any

from shrm_cli.files.seal import is_intact
from shrm_cli.maps.file import recorded
from shrm_cli.maps.provenance import record_of, same_brdf
from shrm_cli.prefilter import checked_arguments, options_of
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import Precision

NO_MAP = "it is no map that can be read"
"""What is said of a file that this program has not made, or that is damaged in its header."""


def difference(
    path: str | os.PathLike[str],
    to: str,
    probe: Probe,
    given: Mapping[str, Any],
    precision: Precision,
    sources: str = "",
) -> str | None:
    """Say in what a file differs from the map that a run would write.

    Parameters
    ----------
    path : path-like
        A file that exists.
    to : str
        The representation.
    probe : Probe
    given : mapping of str to value
        The arguments of `shrm_cli.prefilter.prefilter` by name.
    precision : {"auto", "half", "float"}
    sources : str
        The fingerprint of the program that must have written the file, which then must be as it
        was written, too; any program, and any pixels, where it is empty.

    Returns
    -------
    str or None
        A part of a sentence such as ``it is for another BRDF``, or None where nothing differs.

    Raises
    ------
    ArgumentError, BrdfError
        If an argument or the BRDF cannot be used.
    """
    given = checked_arguments(to, given, probe)
    found = recorded(path)
    if found is None:
        return NO_MAP
    if found.representation != to:
        return f"it is no map of representation {to}"
    if found.info.probe_sha256 != probe.digest():
        return "another probe made it, or another version of this one"
    if "brdf" in given and not same_brdf(found.info.brdf, record_of(given["brdf"])):
        return "it is for another BRDF"
    wanted = options_of(probe, to, given) | (
        {} if precision == "auto" else {"precision": precision}
    )
    differing = _differing(found.info.options, wanted)
    if differing:
        return f"it was made with other options ({differing})"
    if sources and found.sources != sources:
        return "another version or state of shrm made it"
    if sources and not is_intact(path):
        return "it is damaged or was changed since it was made"
    return None


def _differing(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """Return in words how the options of a file differ from those of this run."""
    here = json.loads(json.dumps(here))
    if there.get("reading") != here["reading"]:
        return "how the probe is read"
    names = sorted({*there, *here} - {"reading"})
    texts = [
        f"`{name}` {_text(there.get(name))} there, {_text(here.get(name))} here"
        for name in names
        if there.get(name) != here.get(name)
    ]
    return ", ".join(texts)


def _text(value: Any) -> str:
    return "by default" if value is None else json.dumps(value)
