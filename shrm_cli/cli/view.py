"""`shrm view` shows maps in a browser."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.options import (
    conclude,
    make_read_options,
    optional_brdf_option,
    probe_options,
    reading_rules,
    report_options,
    truth_options,
    warn,
)
from shrm_cli.cli.outputs import PAGES, check_outputs
from shrm_cli.cli.shading import (
    brushed_options,
    brushed_rules,
    lit_maps,
    needs_surface,
    surface_of,
    surface_options,
)
from shrm_cli.cli.terminal import echo
from shrm_cli.cli.types import BYTES, DIRECTION, STOPS
from shrm_cli.cli.usage import Applies, exclude, is_quiet, refuse_inapplicable
from shrm_cli.maps.options import bytes_text
from shrm_cli.vocabulary import DEFAULT_TAPS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shrm_cli.maps.base import Map
    from shrm_cli.view.scene import Scene, Start

_MAX_SIZE = 64 * 10**6
"""The most bytes of a page that is written, where no other number is given."""
_TRUTH_SIZE = 192
_OF_TRUTH = ("brdf", "truth_size", "source_height", "exact")


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, required=True, type=click.Path(dir_okay=False))
@click.option(
    "-o", "--output", type=click.Path(),
    help="HTML to write: one file that needs no network.  [default: serve the page on this "
    "machine and open a browser]",
)  # fmt: skip
@click.option(
    "--probe", type=click.Path(), metavar="PROBE",
    help="Light probe to show behind the shape, and to compute the truth of.",
)  # fmt: skip
@click.option(
    "--mesh", type=click.Path(), metavar="FILE",
    help="OBJ, PLY, STL, glTF or GLB to show the maps on, besides a sphere and a figure.",
)  # fmt: skip
@click.option(
    "--view", "views", type=DIRECTION, multiple=True, default=["0,0"],
    help="First direction to the viewer, degrees: azimuth from +Z towards +X, elevation. Given "
    "several times, the truth is known of all of them.  [default: 0,0]",
)  # fmt: skip
@surface_options
@brushed_options
@click.option(
    "--exposure", type=STOPS, metavar="EV",
    help="Stops at the beginning.  [default: what suits the first MAP]",
)  # fmt: skip
@optional_brdf_option
@click.option(
    "--truth-size", type=click.IntRange(16, 1024), metavar="N", default=_TRUTH_SIZE,
    show_default=True, help="Points of the truth along the edge of its picture.",
)  # fmt: skip
@truth_options
@click.option("--no-truth", is_flag=True, help="Compute no truth; the probe is shown all the same.")
@click.option(
    "--max-size", type=BYTES, metavar="BYTES", default=str(_MAX_SIZE),
    help="The most that a page with -o may take, such as 20MB. The probe behind the shape is made "
    "smaller to keep it; maps are not.  [default: 64MB]",
)  # fmt: skip
@click.option(
    "--lossless", is_flag=True,
    help="Keep textures in half precision in the file of -o, instead of rounding them by a percent "
    "or so, which makes it ten times as small.",
)  # fmt: skip
@click.option("--no-open", is_flag=True, help="Print the page's address, but open no browser.")
@probe_options
@report_options
def view(
    maps: tuple[str, ...],
    output: str | None,
    probe: str | None,
    mesh: str | None,
    views: tuple[tuple[float, float], ...],
    roughness: float | None,
    f0: str | None,
    anisotropy: float | None,
    taps: int | None,
    exposure: float | None,
    brdf: str | None,
    truth_size: int,
    source_height: int | None,
    exact: bool,
    no_truth: bool,
    max_size: int,
    lossless: bool,
    no_open: bool,
    **reading: Any,
) -> None:
    """Show each MAP in a browser: orbit, zoom, compare, read radiance under the mouse.

    The page shows two maps beside each other or their difference. With --probe there is the truth
    besides, integrated for the views of --view. Split sums and SH exponentials are
    shown as GGX of any roughness and f0. The shader is the one that --shader prints. The options
    from --sampling to --clamp are about the file of --probe.

    \b
      shrm view probe.microfacet.shrm.exr --probe probe.exr
      shrm view a.shrm.exr a.splitsum.exr --mesh bunny.obj -o page.html
    """
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.files.whole import write_bytes
    from shrm_cli.geometry.load import load_mesh
    from shrm_cli.maps.file import open_map
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.view.page import page
    from shrm_cli.view.scene import Start, Truth, make_scene

    has_truth = probe is not None and not no_truth
    refuse_inapplicable({
        **reading_rules(probe is not None, "with --probe"),
        "no_truth": Applies(probe is not None, "with --probe"),
        **dict.fromkeys(_OF_TRUTH, Applies(has_truth, "to the truth, with --probe")),
        "max_size": Applies(output is not None, "with -o"),
        "lossless": Applies(output is not None, "with -o"),
        "no_open": Applies(output is None, "without -o"),
        "as_json": Applies(output is not None, "with -o"),
    })  # fmt: skip
    exclude("no_truth", "brdf")
    options = make_read_options(reading)
    light = None if probe is None else open_probe(probe, options)
    if output is not None:
        files = [*maps, *([mesh] if mesh else [])]
        check_outputs([output], files=files, specs=[brdf], suffixes=PAGES)
    opened, notes = lit_maps([open_map(path) for path in maps], maps, light, None)
    refuse_inapplicable(needs_surface(opened))
    refuse_inapplicable(brushed_rules(opened))
    surface = surface_of(roughness, f0, opened[0].info.chromaticities)
    shown = surface.number("roughness"), surface.color("f0"), anisotropy or 0.0
    start = Start(views, exposure, *shown, taps or DEFAULT_TAPS)
    told: list[str] = []
    if roughness is None and f0 is None and anisotropy is None:
        start, told = _as_beside(start, opened, maps)
    with progress_bar("integrating") as progress:
        own = None
        if brdf is not None and light is not None:
            own = parse_spec(brdf, primaries=light.chromaticities)
        truth = Truth(own, truth_size if has_truth else 0, source_height, exact)
        shape = None if mesh is None else load_mesh(mesh)
        scene = make_scene(
            opened, maps, light, shape, start, truth, max_size if output else None, progress,
            is_rounded=output is not None and not lossless,
        )  # fmt: skip
    warnings = [] if light is None else [f"{probe}: {line}" for line in light.report.warnings()]
    warnings += notes + scene.remarks
    scene.remarks.extend(told)
    if output is None:
        warn(warnings)
        for line in told:
            echo(line, err=True)
        _serve(scene, no_open)
        return
    text = page(scene).encode("utf-8")
    write_bytes(output, text)
    result = {
        "file": output,
        "bytes": len(text),
        "maps": list(maps),
        "views": [list(each) for each in views],
        "rounding_error": scene.blocks.rounding_error,
        "truths": len(scene.description["truths"]),
    }
    lines = [f"{output}: {bytes_text(len(text))}, opens in a browser without a network", *told]
    if scene.blocks.rounding_error:
        error = scene.blocks.rounding_error
        lines.append(
            f"textures rounded by up to {error:.2%} (RMS); --lossless keeps half precision"
        )
    conclude(result, lines, warnings)


def _as_beside(
    start: Start, opened: Sequence[Map], names: Sequence[str]
) -> tuple[Start, list[str]]:
    """Show maps of light alone with the surface that a map beside them was made for.

    The anisotropy is that of the surface, too, where all of them can be shown with one.

    Returns
    -------
    start : Start
        With the roughness, f0 and anisotropy of the first map of plain GGX, where a map beside it
        needs them.
    told : list of str
        A line that says so.
    """
    from shrm_cli.brdf.models.ggx import Ggx
    from shrm_cli.errors import BrdfError
    from shrm_cli.maps.provenance import common_brdf, spec_of
    from shrm_cli.render.shading import can_be_brushed

    if not any(each.needs_surface for each in opened):
        return start, []
    lit = [each for each in opened if each.needs_surface]
    is_brushable = all(map(can_be_brushed, lit))
    for made, name in zip(opened, names, strict=True):
        same = made.info.chromaticities == opened[0].info.chromaticities
        if made.needs_surface or made.info.brdf.get("name") != "ggx" or not same:
            continue
        try:
            brdf = common_brdf({name: made.info})
        except BrdfError:
            continue
        surface = brdf.brushed_surface if isinstance(brdf, Ggx) else None
        if surface is not None and (is_brushable or not surface[1]):
            shown = replace(start, roughness=surface[0], anisotropy=surface[1], f0=surface[2])
            line = f"maps of light alone have the surface of {name}, {spec_of(made.info.brdf)}"
            return shown, [line]
    return start, []


def _serve(scene: Scene, no_open: bool) -> None:
    """Serve a page until the user interrupts."""
    import webbrowser

    from shrm_cli.view.serve import PageServer

    with PageServer(scene) as server:
        echo(server.url)
        if not is_quiet():
            echo("Ctrl-C ends it.", err=True)
        if not no_open:
            webbrowser.open(server.url)
        server.serve_forever()
