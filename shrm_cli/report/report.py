"""`report`: a page about a probe and its maps, for somebody who has neither."""

import platform
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from importlib.metadata import version
from typing import Any

from shrm_cli import __version__
from shrm_cli.analysis.probe_statistics import ProbeStatistics, probe_statistics
from shrm_cli.brdf.base import value_text
from shrm_cli.errors import ArgumentError, MapError, OutputError, ShrmError
from shrm_cli.maps.base import Map
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.options import bytes_text
from shrm_cli.messages import check_fields, several, whole_number
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.report import words
from shrm_cli.report.markup import Html, details, facts, joined, spec, table, tag, whole_page
from shrm_cli.report.material_part import exposure_of, material_part, number_cells, row_titles
from shrm_cli.report.measure import Made, Material, Measured, Plan, measure_maps, names_of
from shrm_cli.report.probe_part import preview, probe_part
from shrm_cli.view.page import page as view_page
from shrm_cli.view.page import sources
from shrm_cli.view.scene import Start, Truth, make_scene
from shrm_cli.vocabulary import AUTO, MAX_PICTURE_SIZE, MAX_SOURCE_HEIGHT

_LEAST_VIEW = 10**6
"""The fewest bytes that are left for a view; the page has none where there is less room."""
_MARKUP = 1.15
"""How much larger a framed view is than its data, with a script and style of 80 kB."""
_OWN = 100_000
_SKY = 500_000
"""What is left for the probe and the truth in a view."""
_HALVED = (1, 2, 4, 8)
"""What the edges of maps are divided by, one after the other, until a view has room for them."""
_LEAST_EDGE = 16
"""Maps with fewer texels along an edge are not made smaller for a view."""
_TRUTH_SIZE = 192
"""The most points along the edge of the truth in a view, which takes as long as a picture."""


@record
class Look:
    """What a page shows, and how large it may be.

    Attributes
    ----------
    exposure : float, optional
        Stops of the spheres; what suits the truth of each material by default.
    views : bool
        Whether the interactive views are in it.
    max_bytes : int
        The most bytes of the page.
    command : str
        The command line that made it, for readers.
    options : mapping of str to value
        All options, for readers.
    worded : callable
        How messages of the library, which name its arguments in backticks, are shown.
    reading : str
        The options that say how the probe is read, for other commands.

    Examples
    --------
    >>> look = shrm.Look(exposure=1, views=False)
    >>> made = shrm.report("probes/studio.exr", ["lambertian"], picture_size=32, look=look)
    >>> made.warnings
    []
    """

    exposure: float | None = None
    views: bool = True
    max_bytes: int = 32 * 10**6
    command: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    worded: Callable[[str], str] = str
    reading: str = ""

    def __post_init__(self) -> None:
        check_fields(self)


def report_page(
    measured: Measured,
    statistics: ProbeStatistics,
    look: Look | None = None,
    progress: Progress | None = None,
) -> tuple[str, list[str]]:
    """Return the page of a probe and its maps, HTML for UTF-8, and what was left out of it.

    `statistics` are those of the same probe.
    """
    look = look or Look()
    seen = preview(measured.probe)
    first = probe_part(measured.probe, statistics, seen)
    parts = [
        material_part(each, count, look.exposure, _Place(count), look.worded)
        for count, each in enumerate(measured.materials, start=1)
    ]
    remarks: list[str] = []
    if len(first) + sum(map(len, parts)) > look.max_bytes:
        raise OutputError(
            f"the page would take {bytes_text(len(first) + sum(map(len, parts)))}, more than "
            f"{bytes_text(look.max_bytes)}; raise `max_page`, or give fewer `brdf` or a smaller "
            "`picture_size`"
        )
    room = look.max_bytes - len(first) - sum(map(len, parts)) - _OWN
    whole, stages = [], Stages(progress, len(parts))
    for count, (material, part) in enumerate(zip(measured.materials, parts, strict=True), start=1):
        own = room // (len(parts) - count + 1)
        view = _view(measured, material, look, own, remarks, stages.within)
        room -= len(view)
        whole.append(Html(part.replace(_Place(count), view)))
        stages.done(count, len(parts))
    name = words.base_name(measured.probe.name)
    text = whole_page(
        f"{name} \u2013 shrm report",
        _head(measured, name),
        _overview(measured, look),
        first,
        whole,
        _making(measured, look),
        framed=sources() if look.views else ("", ""),
    )
    return text, remarks


class _Place(Html):
    """Where the view of a material will stand, whose size depends on that of the rest."""

    def __new__(cls, count: int) -> "_Place":
        return super().__new__(cls, f"<!--view {count}-->")


def _head(measured: Measured, name: str) -> Html:
    links = [tag("a", "The light", href="#light")]
    links += [
        tag("a", tag("code", each.name), href=f"#material-{count}")
        for count, each in enumerate(measured.materials, start=1)
    ]
    links.append(tag("a", "How it was made", href="#made"))
    return tag("header", tag("p.kind", "Light probe report"), tag("h1", name), tag("nav", links))


def _overview(measured: Measured, look: Look) -> Html:
    """Return one row for each map, and what failed."""
    failed = [
        tag("p.failure", tag("b", tag("code", name), " failed: "), look.worded(why))
        for name, why in measured.failures
    ]
    warned = [tag("p.warning", look.worded(line)) for line in measured.warnings]
    if not measured.materials:
        return joined(*failed, *warned)
    rows = [
        [spec(material.name), made.form, *number_cells(material, index)]
        for material, index, made in names_of(measured.materials)
    ]
    return joined(
        *failed,
        *warned,
        table(["Material", "Map", *row_titles()], rows, texts=2),
        tag(
            "p.quiet",
            "Errors beside an integral over the probe. ",
            tag("a", "What they mean", href="#meanings"),
        ),
    )


def _view(
    measured: Measured,
    material: Material,
    look: Look,
    room: int,
    remarks: list[str],
    progress: Progress,
) -> Html:
    """Return the interactive view of a material, as a page within the page."""
    if not look.views:
        return Html("")
    if room < _LEAST_VIEW:
        return _left_out(material, "the page would be too large", remarks)
    surface = material.surface
    exposure = exposure_of(material) if look.exposure is None else look.exposure
    given: dict[str, Any] = {"views": measured.plan.views[:1], "exposure": exposure}
    if surface is not None:
        given |= {"roughness": surface[0], "f0": surface[1]}
    plan = measured.plan
    truth = Truth(material.brdf, min(plan.size, _TRUTH_SIZE), plan.rows, plan.exact)
    limit = int((room - _OWN) / _MARKUP)
    try:
        maps, files, change = _fitting(material, limit - _SKY)
        scene = make_scene(
            maps, files, measured.probe, start=Start(**given), truth=truth, max_size=limit,
            progress=progress,
        )  # fmt: skip
        text = view_page(scene)
    except ShrmError as error:
        return _left_out(material, str(error).partition(";")[0], remarks)
    frame = tag(
        "iframe", srcdoc=text, sandbox="allow-scripts allow-downloads", loading="lazy",
        title=f"Interactive view of {material.name}",
    )  # fmt: skip
    note: Html | str = ""
    if change:
        remarks.append(f"the view of {material.name} {change}; raise `max_page` to have all")
        note = tag("p.quiet", f"So that the page stays small, this view {change}.")
    return joined(tag("h3.view-heading", "To turn and compare"), tag("div.view", frame), note)


def _fitting(material: Material, limit: int) -> tuple[list[Map], list[str], str]:
    """Return the maps that a view has room for, their files, and what was done to them.

    Maps get half as many texels along an edge, again and again; where that is not enough, those
    whose sizes are fixed are left out, as split sums are.
    """
    able = [each for each in material.maps if _halved(each.map) is not each.map]
    groups = [material.maps, able] if 0 < len(able) < len(material.maps) else [material.maps]
    for group in groups:
        maps, files = [each.map for each in group], [each.file for each in group]
        for halved in _HALVED:
            try:
                make_scene(maps, files, max_size=limit)
                return maps, files, _what_is_smaller(halved, material.maps, group)
            except MapError:
                if group is groups[-1] and halved == _HALVED[-1]:
                    raise
            maps = [_halved(each) for each in maps]
    raise AssertionError("the loop returns or raises")


def _what_is_smaller(halved: int, all_maps: Sequence[Made], kept: Sequence[Made]) -> str:
    """Return what a view lacks of the maps that were measured, as a part of a sentence."""
    words_of_it = []
    left_out = [each.form for each in all_maps if each not in kept]
    if left_out:
        words_of_it.append(f"is without {' and '.join(left_out)}")
    if halved > 1:
        words_of_it.append(f"has maps with 1/{halved} of their texels along an edge")
    return ", and ".join(words_of_it)


def _halved(reflection_map: Map) -> Map:
    """Return a map with half as many texels along an edge; itself where it is small, or fixed."""
    if reflection_map.size < _LEAST_EDGE:
        return reflection_map
    try:
        return reflection_map.resampled(reflection_map.size // 2)
    except ArgumentError:  # as of split sums, whose levels have sizes of their own
        return reflection_map


def _left_out(material: Material, why: str, remarks: list[str]) -> Html:
    remarks.append(f"no view of {material.name}: {why}; `max_page` and `max_size` say how large")
    files = " ".join(each.file for each in material.maps)
    return tag(
        "p.quiet", f"No interactive view: {why}. ", tag("code", f"shrm view {files}"), " shows it."
    )


def _making(measured: Measured, look: Look) -> Html:
    """Return how the page was made, and what its numbers mean."""
    probe = measured.probe
    options = _comparing(measured.plan, look)
    versions = [
        ("shrm", __version__),
        ("Python", platform.python_version()),
        *((name, version(name)) for name in ("numpy", "OpenEXR", "OpenImageIO")),
        ("Machine", f"{platform.system()} {platform.machine()}"),
    ]
    said = [(name, _text(value)) for name, value in look.options.items()]
    return tag(
        "section",
        tag("h2", "How it was made", id="made"),
        tag("pre", look.command) if look.command else "",
        facts([*versions, ("Probe", tag("code", f"sha256 {probe.digest()}"))]),
        details("All options", table(["Option", "Value"], said, texts=2)) if said else "",
        details("Each map", *[_recipe(*each, options) for each in names_of(measured.materials)]),
        _meanings(),
    )


def _comparing(plan: Plan, look: Look) -> str:
    """Return the options of `shrm compare` that all maps have in common."""
    words = [look.reading] if look.reading else []
    words += [f"--view {azimuth:g},{elevation:g}" for azimuth, elevation in plan.views]
    words += [] if plan.rows is None else [f"--source-height {plan.rows}"]
    words += ["--exact"] if plan.exact else []
    return " ".join([*words, f"--size {plan.size}"])


def _recipe(material: Material, index: int, made: Made, options: str) -> Html:
    said = {
        key: value for key, value in made.summary.items() if key not in ("brdf", "probe_sha256")
    }
    rows = [(key, _text(value)) for key, value in said.items()]
    compared = f"shrm compare {shlex.quote(made.file)} --probe PROBE {options}"
    if isinstance(made.map, LightMap) and material.surface is not None:
        roughness, f0 = material.surface
        compared += f" --roughness {value_text(roughness)} --f0 {value_text(list(f0))}"
    return joined(
        tag("h3", tag("code", made.file)),
        tag("pre", compared),
        table(["Fact", "Value"], rows, texts=2),
    )


def _meanings() -> Html:
    rows = [
        ("Predicted", "Relative RMS error of the reflected light over all orientations and views, "
                      "by Parseval's theorem, before anything is rendered, with what the form of "
                      "the map and discs in the place of lamps add. Of split sums and SH "
                      "exponentials it leaves out the model itself."),
        ("Filtering", "What bilinear look-ups on a GPU add to it, predicted."),
        ("RMS", "Of the difference to the truth over the spheres shown, relative to the truth's. "
                "A few bright pixels decide it."),
        ("Median, 95\u00a0%", "Of the relative error of the luminance over the pixels."),
        ("> 5 %", "The share of pixels whose luminance is wrong by more than that."),
        ("Negative", "The share of pixels with less than no light."),
        ("FLIP", "Mean HDR-FLIP, 0 to 1: what an observer sees when flipping between the two."),
        ("File", "As written, in half precision unless said otherwise."),
        ("Time", "Of making the map, on the machine that wrote this page."),
    ]  # fmt: skip
    return joined(
        tag("h3", "What the numbers mean", id="meanings"),
        table(["Number", "Meaning"], rows, texts=2),
    )


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(map(_text, value)) or "none"
    return str(value)


@record(eq=False)
class ProbeReport:
    """A page, and what it tells."""

    html: str
    """The page, to be written as UTF-8."""
    measured: Measured
    """The maps and how far they are from the truth."""
    statistics: ProbeStatistics
    warnings: list[str]


def report(
    probe: AnyProbe,
    brdfs: Sequence[str] | str,
    to: Sequence[str] | str = (AUTO,),
    *,
    angles: Sequence[tuple[float, float]] = Plan.views,
    picture_size: int = 256,
    truth_height: int | None = None,
    exact: bool = False,
    flips: bool = True,
    look: Look | None = None,
    progress: Progress | None = None,
    **arguments: Any,
) -> ProbeReport:
    """Make the page of a probe and its maps, which needs no network.

    Parameters
    ----------
    probe : Probe, path-like or array
    brdfs, to : sequence of str, or one
        Specifications and representations, or ``auto``; each pair that there is makes a map.
    angles : sequence of 2 float
        Azimuth and elevation of the viewers, degrees.
    picture_size : int
        Width and height of the spheres' pictures, pixels.
    truth_height : int, optional
        Rows that the probe is averaged down to for the truth.
    exact : bool
        Whether the truth sums all pixels.
    flips : bool
        Whether HDR-FLIP is measured, where it is installed.
    look : Look, optional
        What the page shows, and how large it may be.
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **arguments
        Other arguments of `prefilter`.

    Returns
    -------
    ProbeReport

    Raises
    ------
    ArgumentError, ProbeError, BrdfError, OutputError

    Examples
    --------
    >>> made = shrm.report("probes/studio.exr", ["lambertian"], picture_size=32)
    >>> len(made.measured.summary())
    1
    """
    light = as_probe(probe)
    brdfs, to = tuple(several(brdfs)), tuple(several(to, "to"))
    picture_size = whole_number("picture_size", picture_size, 1, MAX_PICTURE_SIZE)
    if truth_height is not None:
        truth_height = whole_number("truth_height", truth_height, 2, MAX_SOURCE_HEIGHT)
    angles = several(angles, "angles")
    plan = Plan(brdfs, to, arguments, tuple(angles), picture_size, truth_height, exact, flips)
    plan.recipes()  # refuses what no probe could make, before long work
    stages = Stages(progress, 2)
    statistics = probe_statistics(light)
    measured = measure_maps(light, plan, stages.within)
    stages.done(1, 2)
    text, remarks = report_page(measured, statistics, look, stages.within)
    return ProbeReport(text, measured, statistics, [*measured.warnings, *remarks])
