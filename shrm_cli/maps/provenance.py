"""The probe and the BRDF that maps record, and whether those of several maps agree."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shrm_cli.brdf.base import Brdf, value_text
from shrm_cli.brdf.spec import parse_recorded
from shrm_cli.errors import BrdfError
from shrm_cli.files.json_text import parse_json
from shrm_cli.maps.info import MapInfo
from shrm_cli.orders import Orders
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import MAX_TERMS


def record_of(brdf: Brdf) -> dict[str, Any]:
    """Return a BRDF in the form in which maps record it; see `MapInfo`."""
    return {"name": brdf.name, "parameters": dict(brdf.values)}


def probe_name(probe: Probe) -> str:
    """Return the name of a probe's file as maps record it, without folders."""
    return probe.name.replace("\\", "/").rsplit("/", 1)[-1]


def provenance(probe: Probe, brdf: Brdf, orders: Orders) -> MapInfo:
    """Return the record of how a map is made, with a predicted error of 0 to be replaced."""
    return MapInfo(
        orders.order_f,
        orders.order_p,
        orders.eps,
        orders.captured,
        0.0,
        record_of(brdf),
        probe_name(probe),
        probe.digest(),
        probe.chromaticities,
    )


def spec_of(record: Mapping[str, Any]) -> str:
    """Return the specification of a BRDF that a map records, as `parse_recorded` reads it.

    Files can hold anything, so the result is ``unknown`` for a record without a name and
    parameters.
    """
    name, parameters = record.get("name"), record.get("parameters")
    if not isinstance(name, str) or not isinstance(parameters, dict):
        return "unknown"
    if name == "sum":
        return str(parameters.get("spec", "unknown"))
    inside = ",".join(f"{key}={value_text(value)}" for key, value in parameters.items())
    return f"{name}:{inside}" if inside else name


def same_brdf(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two records are of the same BRDF.

    The order of the parameters does not matter, nor whether a grey is one number or three.
    """
    return _canonical(one) == _canonical(other)


def common_brdf(infos: Mapping[str, MapInfo], advice: str = "give `brdf`") -> Brdf:
    """Return the BRDF that all maps were made for.

    Maps record a measured file by its name without the folder, and by the digest of its bytes. It
    is looked for in the folders of the maps, and nowhere else: what a map says leads to no other
    file, and runs no code.

    Parameters
    ----------
    infos : mapping of str to MapInfo
        The record of each map by the path of its file; at least one.
    advice : str
        What an error message tells the user to do.

    Raises
    ------
    BrdfError
        If the BRDFs of the maps differ or cannot be evaluated, or a measured file is not there.
    """
    (path, first), *others = infos.items()
    for other, info in others:
        if not same_brdf(info.brdf, first.brdf):
            raise BrdfError(
                f"{other}: its BRDF is {spec_of(info.brdf)}, but that of {path} is "
                f"{spec_of(first.brdf)}; {advice}"
            )
    measured = _measured_file(first.brdf.get("parameters"))
    if measured is not None:
        return _found_again(path, measured, list(infos), advice)
    files = _files_of_terms(first.brdf)

    def opened(term: str) -> Brdf | None:
        return _found_again(path, files[term], list(infos), advice) if term in files else None

    try:
        return parse_recorded(spec_of(first.brdf), opened, first.chromaticities)
    except _Missing:
        raise
    except BrdfError as error:
        raise BrdfError(
            f"{path}: its BRDF, {spec_of(first.brdf)}, cannot be evaluated; {advice}"
        ) from error


class _Missing(BrdfError):
    """A measured file is not where it is looked for."""


def _files_of_terms(record: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Return the names and the digests of the measured files of a recorded sum, by their names."""
    found: dict[str, dict[str, str]] = {}
    waiting: list[Any] = [record.get("parameters")] if record.get("name") == "sum" else []
    for values in waiting:  # which grows: a term with a factor before it has a record of its own
        text = values.get("terms") if isinstance(values, dict) else None
        terms = _parsed(text) if isinstance(text, str) else None
        if isinstance(terms, list) and len(waiting) + len(terms) <= MAX_TERMS**2:
            waiting += terms
        measured = _measured_file(values)
        if measured is not None:
            found[measured["file"]] = measured
    return found


def _parsed(text: str) -> Any:
    try:
        return parse_json(text)
    except ValueError:
        return None


def _measured_file(values: object) -> dict[str, str] | None:
    """Return the name and the digest of the measured file that parameters name, if they do."""
    if not isinstance(values, dict) or set(values) != {"file", "sha256"}:
        return None
    name = values["file"]
    # The name comes from a file, which must not lead into other folders.
    is_bare = isinstance(name, str) and name not in ("", "..") and Path(name).name == name
    return values if is_bare and "\0" not in name else None


def _found_again(
    path: str, measured: Mapping[str, str], beside: Sequence[str], advice: str
) -> Brdf:
    """Open a map's measured file, which lies in the folder of one of some files."""
    from shrm_cli.brdf.measured import open_measured  # it is slow to load
    from shrm_cli.brdf.measured.reading.file import file_values

    name = measured["file"]
    places = dict.fromkeys(Path(other).parent / name for other in beside)
    there = [place for place in places if place.is_file()]
    for place in there:
        if file_values(place) == measured:
            return open_measured(place)
    why = (
        f"{there[0]} is another measurement than its BRDF's"
        if there
        else f"its BRDF was measured, and {name} does not lie beside it"
    )
    raise _Missing(f"{path}: {why}; put the file there, or {advice}")


def differing_origins(
    infos: Mapping[str, MapInfo], probe: str, probe_sha256: str, brdf: Mapping[str, Any]
) -> list[str]:
    """Return a line for each map that was made from another probe, or for another BRDF.

    A map that does not record its probe or its BRDF is not said to differ in it.

    Parameters
    ----------
    infos : mapping of str to MapInfo
        The record of each map by the path of its file.
    probe : str
        What the lines call the expected probe.
    probe_sha256 : str
        The digest of the expected probe's bytes; nothing is compared where it is empty.
    brdf : mapping
        The expected BRDF, as maps record it; nothing is compared where it is empty.
    """
    lines = []
    for path, info in infos.items():
        if probe_sha256 and info.probe_sha256 not in ("", probe_sha256):
            lines.append(f"{path}: its probe is not {probe}")
        if brdf and info.brdf and not same_brdf(info.brdf, brdf):
            lines.append(f"{path}: its BRDF is {spec_of(info.brdf)}, not {spec_of(brdf)}")
    return lines


def _canonical(record: Mapping[str, Any]) -> tuple[str, dict[str, str]]:
    """Return the name and the parameters, as text, of a recorded BRDF, for comparisons."""
    parameters = record.get("parameters")
    values = parameters.items() if isinstance(parameters, dict) else ()
    return str(record.get("name")), {key: value_text(value) for key, value in values}
