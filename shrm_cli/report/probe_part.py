"""What a report says about the probe: pictures, numbers, lamps, irradiance and harmonics."""

from collections.abc import Sequence

import numpy as np

from shrm_cli.analysis.probe_statistics import ProbeStatistics
from shrm_cli.arrays import Array
from shrm_cli.color import xyz_matrix
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.records import record
from shrm_cli.render.image import suitable_exposure
from shrm_cli.report import pictures, words
from shrm_cli.report.markup import Html, Part, details, facts, figure, joined, table, tag
from shrm_cli.report.words import base_name
from shrm_cli.sphere.directions import to_azimuth_elevation
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import degrees, real_harmonics

_ROWS, _SMOOTH_ROWS = 288, 96
"""Rows of the pictures of the probe, and of those of smooth light."""
_IRRADIANCE_ORDER = 16
"""Degrees of the irradiance: those above add less than 1e-4."""
_SHARES = (0.01, 0.998)
"""Shares of the pixels between whose luminances false colours lie; a sun is beyond them."""
_LEAST_STOPS = 4.0
"""The fewest stops that false colours span."""


@record(eq=False)
class Preview:
    """A probe as a small lat-long."""

    image: Array
    """Linear radiance, shape (H, 2 H, 3)."""
    luminance: Array
    """Luminance by the weights of the probe's primaries, shape (H, 2 H)."""
    exposure: float
    """The stops that suit it."""


def preview(probe: Probe) -> Preview:
    """Average a probe down to what a page shows of it, and choose its exposure."""
    grid = LatLong(_ROWS)
    image = to_grid(probe, grid)
    luminance = image @ xyz_matrix(probe.chromaticities)[1]
    return Preview(image, luminance, suitable_exposure(luminance, grid.weights()))


def probe_part(probe: Probe, found: ProbeStatistics, seen: Preview) -> Html:
    """Return the part of a page about a probe."""
    return tag(
        "section",
        tag("h2", "The light", id="light"),
        tag("p.warning", tag("b", "Clipped? "), found.clipped) if found.clipped else "",
        tag("div.pair", _plain(probe, found, seen), _false_colors(found, seen)),
        facts(_numbers(probe, found)),
        _lamps(found),
        _smooth(probe),
    )


def _plain(probe: Probe, found: ProbeStatistics, seen: Preview) -> Html:
    shown = pictures.tone_mapped(seen.image, seen.exposure, probe.chromaticities)
    picture = pictures.image(shown, f"{base_name(probe.name)} as a lat-long", "wide")
    return figure(
        tag("div.marked", picture, _marks(found)),
        f"Lat-long at {words.stops(seen.exposure)}, chosen by its upper quartile. Highlights are "
        "rolled off. The centre looks along +Z, the left quarter along +X.",
    )


def _marks(found: ProbeStatistics) -> Html | str:
    """Return rings around the lamps with their numbers, over a lat-long."""
    marks: list[Html] = []
    for count, lamp in enumerate(found.lamps, start=1):
        azimuth, elevation = to_azimuth_elevation(lamp.direction)
        x, y = 360 * (0.5 - azimuth / 360) % 360, 90 - elevation
        radius = max(np.degrees(lamp.radius) * 1.5, 5.0)
        beside = x + radius + 3 if x < 320 else x - radius - 9
        ring = {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": f"{radius:.1f}"}
        marks += [tag("circle.under", **ring), tag("circle.over", **ring)]
        marks.append(tag("text", str(count), x=f"{beside:.1f}", y=f"{y + 4:.1f}"))
    if not marks:
        return ""
    return tag("svg", marks, viewBox="0 0 360 180", aria_hidden="true")


def _false_colors(found: ProbeStatistics, seen: Preview) -> Html:
    """Show stops from the mean in false colours, over the stops that there are."""
    mean = max(found.mean_luminance, np.finfo(float).tiny)
    with np.errstate(divide="ignore"):
        stops = np.log2(np.maximum(seen.luminance, 0) / mean)
    lit = stops[np.isfinite(stops)]
    low, high = (0.0, 1.0) if not lit.size else np.quantile(lit, _SHARES)
    low, high = float(np.floor(low)), float(np.ceil(high))
    high = max(high, low + _LEAST_STOPS)
    picture = pictures.image(
        pictures.turbo((stops - low) / (high - low)), "Stops from the mean luminance", "wide"
    )
    ticks = [words.signed(value) for value in np.linspace(low, high, 5)]
    ticks[0], ticks[-1] = f"\u2264 {ticks[0]}", f"\u2265 {ticks[-1]}"
    bar = pictures.scale(pictures.turbo(np.linspace(0, 1, 256)), ticks, "Scale of the stops")
    return figure(
        picture, bar, "Luminance in stops from its mean, ", words.number(found.mean_luminance), "."
    )


def _numbers(probe: Probe, found: ProbeStatistics) -> Sequence[tuple[Part, Part]]:
    balance = found.white_balance
    white = "none, there is no green" if balance is None else words.color(balance)
    if found.temperature is not None:
        white = f"{found.temperature:,.0f} K, {white} over green"
    azimuth, elevation = to_azimuth_elevation(found.direction)
    directed = f"{words.angles(azimuth, elevation, 0)} ({found.directionality:.0%} directed)"
    ground = found.irradiance[2]
    return [
        ("File", base_name(probe.name)),
        ("Pixels", f"{probe.width} \u00d7 {probe.height}, {probe.grid.name}"),
        ("Range", f"{found.stops:.1f} EV between 1 % and 99.9 % of the sphere"),
        ("Whole range", f"{found.stops_whole:.1f} EV, largest {words.color(found.maximum)}"),
        ("Mean luminance", words.number(found.mean_luminance)),
        ("Mean radiance", words.color(found.mean)),
        ("Irradiance of the ground", words.color(ground)),
        ("White balance", white),
        ("Light comes from", directed if found.directionality else "everywhere alike"),
        ("Clipping", found.clipped or "none suspected"),
        ("Primaries", found.primaries),
    ]


def _lamps(found: ProbeStatistics) -> Html | str:
    if not found.lamps:
        return tag("p.quiet", "No lamp of a radius below 8\u00b0 stands out.")
    rows: list[list[Part]] = []
    for count, lamp in enumerate(found.lamps, start=1):
        azimuth, elevation = to_azimuth_elevation(lamp.direction)
        radius = f"{np.degrees(lamp.radius):.3g}\u00b0"
        rows.append([
            str(count), words.angles(azimuth, elevation, 1),
            radius if lamp.is_resolved else f"{radius} (a pixel)", words.color(lamp.irradiance),
            words.color(lamp.peak), lamp.clipped or "\u2013",
        ])  # fmt: skip
    titles = ["Lamp", "Azimuth, elevation", "Radius", "Irradiance", "Peak radiance", "Clipped"]
    return joined(tag("h3", "Brightest lamps"), table(titles, rows, texts=2))


def _smooth(probe: Probe) -> Html:
    """Show the irradiance, and the light of nine coefficients, with their numbers."""
    order = min(_IRRADIANCE_ORDER, probe.grid.resolved_order)
    light = project(probe, order).coefficients
    directions = LatLong(_SMOOTH_ROWS).directions()
    basis = real_harmonics(order, directions)
    factors = lambert_factors(order)[degrees(order), None]
    white = basis @ (factors * light) / np.pi
    luminance = white @ xyz_matrix(probe.chromaticities)[1]
    exposure = suitable_exposure(luminance, _areas(len(white)))
    low = min(2, order)
    nine = basis[..., : (low + 1) ** 2] @ light[: (low + 1) ** 2]

    def shown(values: Array, text: str, *caption: Part) -> Html:
        colors = pictures.shown(values, exposure, probe.chromaticities)
        return figure(pictures.image(colors, text, "wide"), *caption)

    negative = float(np.average((nine < 0).any(axis=-1), weights=_areas(nine.shape[0])))
    rows = [
        [
            f"L{degree},{index}",
            *(words.number(value) for value in light[degree**2 + degree + index]),
        ]
        for degree in range(low + 1)
        for index in range(-degree, degree + 1)
    ]
    of_nine = f"The light of {len(rows)} coefficients (order {low})"
    if negative >= 5e-4:
        of_nine += f": black where it is negative, {words.percent(negative)} of the sphere"
    return joined(
        tag("h3", "Smooth light"),
        tag(
            "div.pair",
            shown(
                white,
                "Irradiance over pi",
                f"A white surface at {words.stops(exposure)}: E / \u03c0.",
            ),
            shown(nine, "Light of order 2", of_nine, "."),
        ),
        details(
            "Spherical harmonic coefficients",
            table(["L", "R", "G", "B"], rows),
            tag(
                "p.quiet",
                "Orthonormal real harmonics of world axes, +Y up, polar axis +Z, no "
                "Condon\u2013Shortley phase.",
            ),
        ),
    )


def _areas(rows: int) -> Array:
    return np.broadcast_to(LatLong(rows).weights(), (rows, 2 * rows))
