"""The light and the material that maps remember, and whether they may be compared."""

from collections.abc import Mapping
from typing import Any

from shrm_cli.brdf.base import Brdf, value_text
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.maps.info import MapInfo


def record_of(brdf: Brdf) -> dict[str, Any]:
    """A BRDF as maps remember it, see `MapInfo`."""
    return {"name": brdf.name, "parameters": dict(brdf.values)}


def spec_of(record: Mapping[str, Any]) -> str:
    """The specification, as `parse_spec` reads it, of a BRDF that a map remembers.

    Files can hold anything: without a name and parameters it is ``unknown``.
    """
    name, parameters = record.get("name"), record.get("parameters")
    if not isinstance(name, str) or not isinstance(parameters, dict):
        return "unknown"
    if name == "sum":
        return str(parameters.get("spec", "unknown"))
    inside = ",".join(f"{key}={value_text(value)}" for key, value in parameters.items())
    return f"{name}:{inside}" if inside else name


def same_brdf(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two records are of the same BRDF, in whatever order, greys as one number or three."""
    return _canonical(one) == _canonical(other)


def common_brdf(infos: Mapping[str, MapInfo], advice: str = "give --brdf") -> Brdf:
    """The BRDF of all maps.

    Parameters
    ----------
    infos : mapping
        Of each file.
    advice : str
        What to do where there is none.

    Raises
    ------
    BrdfError
        If they differ, or remember none that can be evaluated.
    """
    (path, first), *others = infos.items()
    for other, info in others:
        if not same_brdf(info.brdf, first.brdf):
            raise BrdfError(
                f"{other}: its BRDF is {spec_of(info.brdf)}, but that of {path} is "
                f"{spec_of(first.brdf)}; {advice}"
            )
    try:
        # What a file says must not run code.
        return parse_spec(spec_of(first.brdf), run_code=False)
    except BrdfError as error:
        raise BrdfError(
            f"{path}: its BRDF, {spec_of(first.brdf)}, cannot be evaluated; {advice}"
        ) from error


def differing_origins(
    infos: Mapping[str, MapInfo], probe: str, probe_sha256: str, brdf: Mapping[str, Any]
) -> list[str]:
    """Lines about the maps that were made from another probe, or for another BRDF.

    What a map does not remember is not said to differ.

    Parameters
    ----------
    infos : mapping
        Of each file.
    probe : str
        What the lines call the expected probe.
    probe_sha256 : str
        The digest of its bytes.
    brdf : mapping
        The expected BRDF, as maps remember it.
    """
    lines = []
    for path, info in infos.items():
        if probe_sha256 and info.probe_sha256 not in ("", probe_sha256):
            lines.append(f"{path}: its probe is not {probe}")
        if brdf and info.brdf and not same_brdf(info.brdf, brdf):
            lines.append(f"{path}: its BRDF is {spec_of(info.brdf)}, not {spec_of(brdf)}")
    return lines


def _canonical(record: Mapping[str, Any]) -> tuple[str, dict[str, str]]:
    parameters = record.get("parameters")
    values = parameters.items() if isinstance(parameters, dict) else ()
    return str(record.get("name")), {key: value_text(value) for key, value in values}
