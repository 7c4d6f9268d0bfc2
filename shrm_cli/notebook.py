"""What notebooks show of probes, light and maps: a picture, and the numbers of `shrm info`."""

from collections.abc import Callable
from typing import Any

import numpy as np

from shrm_cli.analysis.facts import fact_text, in_words, map_facts, probe_facts
from shrm_cli.arrays import Array
from shrm_cli.color import xyz_matrix
from shrm_cli.errors import ShrmError
from shrm_cli.lights.split import LampSplit
from shrm_cli.maps.base import Map
from shrm_cli.maps.lamps.rule import disc_records
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe
from shrm_cli.render.camera import Viewer, whole_coverage
from shrm_cli.render.image import suitable_exposure
from shrm_cli.render.sphere import render_sphere
from shrm_cli.report import pictures
from shrm_cli.report.markup import Html, Part, joined, tag
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import real_harmonics

_BALL, _ROWS = 64, 80
"""Pixels of a map's ball from side to side, and rows of a probe's lat-long."""
_MOST_PIXELS = 2**20
"""The most pixels of a probe of which statistics are made while somebody waits for a cell."""
_UNSHOWN = "see --json"
"""What `fact_text` says of tables that are too long to be shown."""


def html(shown: Map | Probe | Lighting | LampSplit) -> Html:
    """Return a picture of a probe, light or a map, and a table of its numbers.

    What cannot be drawn or read says why in the place of its picture.
    """
    title, draw, facts = _parts(shown)
    try:
        picture: Part = draw()
    except (ShrmError, OSError) as reason:
        picture = tag("p", f"No picture: {reason}")
    try:
        found = facts()
    except (ShrmError, OSError) as reason:
        return joined(tag("p", str(reason)))
    texts = {
        key.replace("_", " "): fact_text(value)
        for key, value in found.items()
        if value not in (None, "", [], {})
    }
    # Notebooks align cells to the right, and lines of a text would run into each other.
    rows = [
        tag("tr", tag("th", key), tag("td", text, style="text-align: left; white-space: pre-line"))
        for key, text in texts.items()
        if text != _UNSHOWN
    ]
    return tag("div", tag("p", title), picture, tag("table", rows))


def _parts(
    shown: Map | Probe | Lighting | LampSplit,
) -> tuple[str, Callable[[], Html], Callable[[], dict[str, Any]]]:
    """Return the title of something, what draws it, and what tells its numbers."""
    if isinstance(shown, Map):
        return shown.info.probe, lambda: _ball(shown), lambda: map_facts(shown)
    if isinstance(shown, Lighting):
        return f"light to order {shown.order}", lambda: _series(shown), lambda: _of_light(shown)
    if isinstance(shown, LampSplit):
        title = f"{shown.probe.name} without its lamps"
        return title, lambda: _latlong(shown.residual_probe), lambda: _of_lamps(shown)
    return shown.name, lambda: _latlong(shown), lambda: _of_probe(shown)


def _of_probe(shown: Probe) -> dict[str, Any]:
    stats = shown.width * shown.height <= _MOST_PIXELS
    values = probe_facts(shown, stats)
    return values | (in_words(values) if stats else {})


def _of_light(shown: Lighting) -> dict[str, Any]:
    whole = shown.energy.sum()
    return {
        "coefficients": len(shown.coefficients),
        "mean": (shown.coefficients[0] / np.sqrt(4 * np.pi)).tolist(),
        "energy captured": f"{shown.power().sum() / whole:.2%}" if whole else None,
    }


def _of_lamps(shown: LampSplit) -> dict[str, Any]:
    return {
        "lamps": disc_records(shown.discs),
        "lamps that stay": shown.left,
        "irradiance changed by": f"{shown.proof.rms:.3%} (RMS)",
    }


def _ball(shown: Map) -> Html:
    """Return a sphere of the map's material, or of its light, as `shrm render` draws it."""
    ball = render_sphere(shown, Viewer(0.0, 0.0), _BALL)
    drawn, primaries = pictures.unmultiplied(ball), shown.info.chromaticities
    luminance = (drawn @ xyz_matrix(primaries)[1])[whole_coverage(_BALL) > 0]
    colors = pictures.tone_mapped(drawn, suitable_exposure(luminance), primaries)
    return pictures.image(pictures.on_sphere(colors), f"a sphere of {shown.representation}")


def _latlong(shown: Probe) -> Html:
    """Return a probe as a small lat-long, as bright as suits it."""
    pixels = coarse_probe(shown, 2 * _ROWS).radiance(LatLong(_ROWS).directions())
    return _panorama(pixels, shown.chromaticities)


def _series(shown: Lighting) -> Html:
    """Return the radiance that the coefficients have, as a small lat-long."""
    directions = LatLong(_ROWS).directions()
    return _panorama(real_harmonics(shown.order, directions) @ shown.coefficients, None)


def _panorama(pixels: Array, primaries: tuple[float, ...] | None) -> Html:
    exposure = suitable_exposure(pixels @ xyz_matrix(primaries)[1], LatLong(_ROWS).weights())
    return pictures.image(pictures.tone_mapped(pixels, exposure, primaries), "lat-long")
