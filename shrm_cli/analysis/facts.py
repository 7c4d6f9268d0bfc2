"""What is told of probes and maps, by the names of JSON, and in words."""

from collections.abc import Iterable
from typing import Any

from shrm_cli.maps.base import Map
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.proxy import ProxyBox

_MOST_ROWS, _MOST_NUMBERS = 9, 16
"""The most rows of a table and numbers of a list that are printed as text; JSON has them all."""

_RADIANCES = "minimum", "maximum", "mean", "mean_luminance"
_KINDS = {
    "light file": "light file",
    "USD stage": "stage of USD",
    "coefficients": "coefficients of light",
}
"""What probes that are no images are called."""


def map_facts(found: Map) -> dict[str, Any]:
    """Return what `shrm info` tells of a map."""
    return {
        "kind": "map",
        **found.summary(),
        **found.details(),
        **found.info.origin(),
        "chromaticities": found.info.chromaticities,
        **_of_box(found.info.proxy),
    }


def probe_facts(probe: Probe, stats: bool) -> dict[str, Any]:
    """Return what `shrm info` tells of a probe, with statistics of its pixels or without."""
    first = probe.images[0]
    values = {
        "kind": _KINDS.get(first.file_format, "probe"),
        "layout": probe.layout,
        "width": first.width,
        "height": first.height,
        "sampling": probe.sampling,
        "orientation": probe.orientation,
        "format": first.file_format,
        **first.facts(),
    }
    if stats:
        from shrm_cli.analysis.probe_statistics import probe_statistics  # maps do not need it

        values |= probe_statistics(probe).summary()
    values |= {"chromaticities": probe.chromaticities, "sha256": probe.digest()}
    values |= _of_box(probe.proxy)
    return {key: value for key, value in values.items() if value is not None}


def _of_box(proxy: ProxyBox | None) -> dict[str, Any]:
    return {} if proxy is None else {"proxy": proxy.record()}


def in_percent(values: dict[str, Any]) -> dict[str, str]:
    """Return what the errors of a map say to people."""
    return {
        key: f"{value:.2%}{'' if key.endswith('captured') else ' (RMS)'}"
        for key, value in values.items()
        if isinstance(value, float) and key.endswith(("_error", "_residual", "_captured"))
    }


def in_words(values: dict[str, Any]) -> dict[str, str]:
    """Return what the statistics of a probe say to people, with units."""
    stops, white = values["stops"], values["white_balance"]
    azimuth, elevation = values["light_from"]["azimuth_elevation"]
    names = {"over_green": "R, G, B over green", "xy": "xy", "kelvin": "kelvin", "duv": "duv"}
    balance = [f"{before} {fact_text(white[name])}" for name, before in names.items()]
    return {
        **{key: f"{fact_text(values[key])} of radiance" for key in _RADIANCES},
        "stops": f"{stops['1%_to_99.9%']:.3g} between what 1 % and 99.9 % of the sphere are below, "
        f"{stops['least_to_most']:.3g} in all",
        "irradiance": fact_text(values["irradiance"])
        + "\nradiance x sr, by the axis of the normal",
        "white_balance": "; ".join(balance),
        "light_from": f"azimuth {azimuth:z.1f}, elevation {elevation:z.1f} degrees, directionality "
        f"{values['light_from']['directionality']:.2f} (0 from everywhere, 1 from one point)",
        "lamps": "\n".join(map(_lamp_line, values["lamps"])) or "none",
        "advice": values["advice"] or "none",
    }


def seen_channels(values: Iterable[float]) -> list[float]:
    """Return a colour whose channels are 0 where they are nothing beside the largest one."""
    found = [float(value) for value in values]
    least = 1e-6 * max(map(abs, found), default=0.0)
    return [0.0 if abs(value) < least else value for value in found]


def _lamp_line(lamp: dict[str, Any]) -> str:
    irradiance = fact_text(seen_channels(lamp["irradiance"]))
    size = f"radius {lamp['radius']:.3g}"
    if lamp["is_elongated"]:
        size = f"{lamp['length']:.3g} x {lamp['width']:.3g}"
    return (
        f"azimuth {lamp['azimuth']:z.1f}, elevation {lamp['elevation']:z.1f}, {size} degrees, "
        f"{lamp['share']:.1%} of the light, irradiance {irradiance}"
    )


def fact_text(value: Any) -> str:
    """Return a value in words; of long tables and lists, where they are."""
    if value in (None, "", {}, [], ()):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | dict):
        if isinstance(value[0], list) and (len(value) > _MOST_ROWS or len(value[0]) > 3):
            return "see --json"
        return "\n".join(fact_text(item) for item in value)
    if isinstance(value, list | tuple) and len(value) > _MOST_NUMBERS:
        return "see --json"
    if isinstance(value, list | tuple):
        return ", ".join(fact_text(item) for item in value)
    if isinstance(value, dict) and all(isinstance(item, list) for item in value.values()):
        return "\n".join(f"{key}  {fact_text(item)}" for key, item in value.items())
    if isinstance(value, dict):
        pairs = ((key.replace("_", " "), fact_text(item)) for key, item in value.items())
        return ", ".join(" ".join(pair) for pair in pairs)
    return str(value)
