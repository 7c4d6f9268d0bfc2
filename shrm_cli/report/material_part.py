"""What a report says about a material: its maps beside the truth, in pictures and numbers."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.maps.options import bytes_text
from shrm_cli.messages import predicted_error
from shrm_cli.render.camera import whole_coverage
from shrm_cli.render.image import suitable_exposure
from shrm_cli.render.seen import FlipError
from shrm_cli.report import pictures, words
from shrm_cli.report.markup import Html, Part, facts, figure, joined, spec, table, tag
from shrm_cli.report.measure import Made, Material
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR

_SCALES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Ends of the scale of differences; the least is taken that 95 % of the pixels are within."""
_DARKER = 4.0
"""Stops by which the second exposure is darker, where there is something to see."""


def exposure_of(material: Material) -> float:
    """Return the exposure that suits the truth of a material in all views."""
    assert material.comparison is not None
    truth = material.comparison.baseline
    inside = whole_coverage(truth.shape[-2]) == 1
    return suitable_exposure(truth[:, inside] @ LUMINANCE)


def material_part(
    material: Material,
    count: int,
    exposure: float | None,
    view: Part,
    worded: Callable[[str], str] = str,
) -> Html:
    """Return the part of a page about a material.

    `exposure` is that of its pictures, stops; what suits the truth by default. `view` is the
    interactive view. `worded` is how messages of the library, which name its arguments in
    backticks, are shown.
    """
    stops = exposure_of(material) if exposure is None else exposure
    assert material.comparison is not None
    made = material.maps
    return tag(
        "section",
        tag("h2", spec(material.name), id=f"material-{count}"),
        table(
            ["Map", "Orders", "Texels", "Predicted", "Filtering", *row_titles()],
            [_row(material, index, each) for index, each in enumerate(made)],
        ),
        [_remarks(each, worded) for each in made],
        tag("h3", f"Beside the truth, at {words.stops(stops)}"),
        [_pictures(material, index, stops) for index in range(len(made))],
        tag(
            "p.quiet",
            f"The truth is an integral over the probe, {material.truth}; it took "
            f"{words.duration(material.seconds)}. Differences are those of the luminance, relative "
            f"to the truth, which counts as {SEEN_FLOOR:.0%} of its mean at least.",
        ),
        view,
    )


def row_titles() -> list[str]:
    """Return the titles of the columns of `number_cells`."""
    return ["RMS", "Median", "95 %", "> 5 %", "Negative", "FLIP", "File", "Time"]


def number_cells(material: Material, index: int) -> list[Part]:
    """Return the measured errors, storage and time of a map."""
    made, found = material.maps[index], material.numbers(index)
    flip = found["hdr_flip"]
    return [
        words.percent(found["relative_rmse"]),
        words.percent(found["median_relative_error"]),
        words.percent(found["p95_relative_error"]),
        words.percent(found["wrong_share"]),
        words.percent(found["negative_share"]),
        "\u2013" if flip is None else f"{flip:.3f}",
        bytes_text(made.summary["bytes"]),
        words.duration(made.seconds),
    ]


def _row(material: Material, index: int, made: Made) -> list[Part]:
    said = made.summary
    order_f = said.get("order_f", made.map.info.order_f)
    orders = f"F {order_f}"
    if said.get("order_p"):
        orders += f", P {said['order_p']}"
    if said.get("order_carried", order_f) > order_f:
        orders += f" ({said['order_carried']})"
    return [
        made.form,
        orders,
        _texels(said),
        words.known_percent(predicted_error(said)),
        words.known_percent(said.get("filter_error")),
        *number_cells(material, index),
    ]


def _texels(said: Mapping[str, Any]) -> str:
    """Return the edge of a map's cubes and, where there are several, their number."""
    if not said.get("size"):
        return "\u2013"
    return " \u00d7 ".join(str(said[key]) for key in ("size", "maps") if key in said)


def _remarks(made: Made, worded: Callable[[str], str]) -> Html:
    lines: list[tuple[Part, Part]] = [
        (heading[:1].upper() + heading[1:], worded(text)) for heading, text in made.notes
    ]
    warnings = [
        tag("p.warning", tag("b", f"{made.form}: "), worded(line)) for line in made.warnings
    ]
    return joined(*warnings, facts(lines) if lines else "")


def _pictures(material: Material, index: int, stops: float) -> Html:
    """Show the truth, the map, the difference and FLIP in all views."""
    assert material.comparison is not None
    comparison, name = material.comparison, material.maps[index].form
    found, truths = comparison.others[index], comparison.baseline
    primaries = material.maps[index].map.info.chromaticities
    differences = [_relative(*pair) for pair in zip(found, truths, strict=True)]
    end = _end(differences)
    flips: Sequence[FlipError | None] = material.flips[index] if material.flips else []
    darker = stops - _DARKER
    has_lights = _has_lights(truths, stops)

    def spheres(images: Array, at: float, what: str) -> list[Html]:
        return [
            pictures.image(
                pictures.on_sphere(pictures.shown(pictures.unmultiplied(each), at, primaries)),
                f"{what} seen from {viewer.azimuth:g}, {viewer.elevation:g}",
            )
            for each, viewer in zip(images, comparison.viewers, strict=True)
        ]

    columns: list[tuple[Part, list[Html]]] = [
        ("Truth", spheres(truths, stops, "The truth")),
        (name, spheres(found, stops, name)),
        (
            joined("Difference", _bar(end)),
            [_sphere(pictures.signed(each / end), f"Difference of {name}") for each in differences],
        ),
    ]
    if any(each is not None for each in flips):
        bar = pictures.magma(np.linspace(0, 1, 128))
        scale = pictures.scale(bar, ["0", "0.5", "1"], "Scale of HDR-FLIP")
        heading = joined("HDR-FLIP", scale)
        columns.append((heading, [
            _sphere(pictures.magma(each.errors), f"HDR-FLIP of {name}")
            if each is not None else tag("span.none", "not defined") for each in flips
        ]))  # fmt: skip
    if has_lights:
        columns += [
            (f"Truth at {words.stops(darker)}", spheres(truths, darker, "The truth, darker")),
            (f"{name} at {words.stops(darker)}", spheres(found, darker, f"{name}, darker")),
        ]
    shown = [
        tag("div.column", tag("div.heading", heading), tag("div.stack", images))
        for heading, images in columns
    ]
    views = "; ".join(words.angles(each.azimuth, each.elevation, 0) for each in comparison.viewers)
    known = next((each for each in flips if each is not None), None)
    words_of_flip = ""
    if known is not None:
        at = known.exposures
        words_of_flip = (
            f" HDR-FLIP is the largest over {at.number} exposures, "
            f"{words.stops(at.start)} to {words.stops(at.stop)} in the first view."
        )
    elif not flips:
        words_of_flip = (
            " HDR-FLIP was not measured: flip-evaluator is not installed, or it was left out."
        )
    caption = f"{name}, seen from azimuth and elevation {views}.{words_of_flip}"
    return figure(tag("div.columns", shown), caption)


def _sphere(colors: NDArray[np.uint8], text: str) -> Html:
    return pictures.image(pictures.on_sphere(colors), text)


def _relative(found: Array, truth: Array) -> Array:
    """Return the signed relative difference of the luminance, as `seen_errors` measures it."""
    weights = whole_coverage(len(truth))
    shown, true = (pictures.unmultiplied(each) @ LUMINANCE for each in (found, truth))
    floor = SEEN_FLOOR * max(float(np.average(true, weights=weights)), 0.0)
    scale = np.maximum(true, floor)
    return np.divide(shown - true, scale, out=np.zeros_like(true), where=scale > 0)


def _end(differences: Sequence[Array]) -> float:
    """Return the end of a scale that 95 % of the pixels of spheres are within."""
    inside = whole_coverage(len(differences[0])) > 0
    values = np.abs([each[inside] for each in differences])
    most = float(np.quantile(np.nan_to_num(values, nan=np.inf), 0.95))
    return next((each for each in _SCALES if most <= each), _SCALES[-1])


def _has_lights(truths: Array, stops: float) -> bool:
    """Whether a hundredth of the spheres is white at an exposure."""
    inside = whole_coverage(truths.shape[-2]) == 1
    return bool(np.mean(truths[:, inside].max(axis=-1) * 2.0**stops > 1) > 0.01)


def _bar(end: float) -> Html:
    bar = pictures.signed(np.linspace(-1, 1, 128))
    share = f"{100 * end:g} %"
    return pictures.scale(bar, [f"\u2212{share}", "0", f"+{share}"], "Scale of the differences")
