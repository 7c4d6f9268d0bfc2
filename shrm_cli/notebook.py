"""What notebooks show of a probe or a map: a picture, and the numbers that `shrm info` tells."""

import numpy as np

from shrm_cli.analysis.facts import fact_text, in_words, map_facts, probe_facts
from shrm_cli.color import xyz_matrix
from shrm_cli.errors import ShrmError
from shrm_cli.maps.base import Map
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe
from shrm_cli.render.camera import Viewer, whole_coverage
from shrm_cli.render.image import suitable_exposure
from shrm_cli.render.sphere import render_sphere
from shrm_cli.report import pictures
from shrm_cli.report.markup import Html, Part, joined, tag
from shrm_cli.sphere.grid.latlong import LatLong

_BALL, _ROWS = 64, 80
"""Pixels of a map's ball from side to side, and rows of a probe's lat-long."""
_MOST_PIXELS = 2**20
"""The most pixels of a probe of which statistics are made while somebody waits for a cell."""


def html(shown: Map | Probe) -> Html:
    """Return a picture of a map or a probe, and a table of its numbers.

    What cannot be drawn or read says why in the place of its picture.
    """
    try:
        picture: Part = _ball(shown) if isinstance(shown, Map) else _latlong(shown)
    except (ShrmError, OSError) as reason:
        picture = tag("p", f"No picture: {reason}")
    try:
        facts = _facts(shown)
    except (ShrmError, OSError) as reason:
        return joined(tag("p", str(reason)))
    rows = [tag("tr", tag("th", key), tag("td", text)) for key, text in facts.items()]
    title = shown.info.probe if isinstance(shown, Map) else shown.name
    return tag("div", tag("p", title), picture, tag("table", rows))


def _facts(shown: Map | Probe) -> dict[str, str]:
    """Return the numbers as text; those that nobody knows are left out."""
    if isinstance(shown, Map):
        values = map_facts(shown)
    else:
        stats = shown.width * shown.height <= _MOST_PIXELS
        values = probe_facts(shown, stats)
        values |= in_words(values) if stats else {}
    known = {key: value for key, value in values.items() if value not in (None, "", [], {})}
    return {key.replace("_", " "): fact_text(value) for key, value in known.items()}


def _ball(shown: Map) -> Html:
    """Return a sphere of the map's material, or of its light, as `shrm render` draws it."""
    ball = render_sphere(shown, Viewer(0.0, 0.0), _BALL)
    drawn, primaries = pictures.unmultiplied(ball), shown.info.chromaticities
    luminance = (drawn @ xyz_matrix(primaries)[1])[whole_coverage(_BALL) > 0]
    colors = pictures.tone_mapped(drawn, suitable_exposure(luminance), primaries)
    return pictures.image(pictures.on_sphere(colors), f"a sphere of {shown.representation}")


def _latlong(shown: Probe) -> Html:
    """Return a probe as a small lat-long, as bright as suits it."""
    grid = LatLong(_ROWS)
    pixels = coarse_probe(shown, 2 * _ROWS).radiance(grid.directions())
    luminance = np.asarray(pixels @ xyz_matrix(shown.chromaticities)[1])
    exposure = suitable_exposure(luminance, grid.weights())
    return pictures.image(pictures.tone_mapped(pixels, exposure, shown.chromaticities), "lat-long")
