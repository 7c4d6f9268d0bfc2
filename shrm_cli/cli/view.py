"""`shrm view` shows maps in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.shading import brush_option, brushed_options, surface_options, surface_rules
from shrm_cli.cli.terminal import conclude, echo, echo_lines, progress_bar, warn
from shrm_cli.cli.types import BYTES, DIRECTION, FILE, PATH, flag, option, whole
from shrm_cli.maps.options import bytes_text

if TYPE_CHECKING:
    from shrm_cli.view.scene import Scene

_MAX_SIZE = 64 * 10**6
"""The most bytes of a page that is written, where no other number is given."""
_TRUTH_SIZE = 192
_OF_TRUTH = ("brdf", "truth_size", "source_height", "exact")


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, required=True, type=FILE)
@option(
    "-o --output", PATH,
    help="HTML to write: one file that needs no network.  [default: serve the page on this "
    "machine and open a browser]",
)  # fmt: skip
@options.lit_by("Light probe to show behind the shape, and to compute the truth of.")
@option(
    "--mesh FILE", PATH,
    help="OBJ, PLY, STL, glTF or GLB to show the maps on, besides a sphere and a figure.",
)  # fmt: skip
@option(
    "--view views", DIRECTION, multiple=True, default=["0,0"], show_default=False,
    help="First direction to the viewer, degrees: azimuth from +Z towards +X, elevation. Given "
    "several times, the truth is known of all of them.  [default: 0,0]",
)  # fmt: skip
@surface_options
@brushed_options
@brush_option
@options.stops("Stops at the beginning.  [default: what suits the first MAP]")
@options.optional_brdf_option
@option(
    "--truth-size N", whole(16, 1024), default=_TRUTH_SIZE,
    help="Points of the truth along the edge of its picture.",
)  # fmt: skip
@options.truth_options
@flag("--no-truth", "Compute no truth; the probe is shown all the same.")
@option(
    "--max-size BYTES", BYTES, default=str(_MAX_SIZE), show_default=False,
    help="The most that a page with -o may take, such as 20MB. The probe behind the shape is made "
    "smaller to keep it; maps are not.  [default: 64MB]",
)  # fmt: skip
@flag(
    "--lossless",
    help="Keep textures in half precision in the file of -o, instead of rounding them by a percent "
    "or so, which makes it ten times as small.",
)  # fmt: skip
@flag("--no-open", "Print the page's address, but open no browser.")
@options.probe_options
@options.report_options
def view(
    maps: tuple[str, ...],
    output: str | None,
    probe: str | None,
    mesh: str | None,
    brdf: str | None,
    truth_size: int,
    no_truth: bool,
    max_size: int,
    lossless: bool,
    no_open: bool,
    **values: Any,
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
    from shrm_cli.files.whole import write_bytes

    has_truth = _check_usage(probe is not None, output is not None, no_truth)
    reading = options.make_read_options(values)
    light = None if probe is None else shrm.open_probe(probe, reading)
    if output is not None:
        files = [*maps, *([mesh] if mesh else [])]
        usage.check_outputs([output], files=files, specs=[brdf], suffixes=usage.PAGES)
    opened = [shrm.open_map(path) for path in maps]
    usage.refuse_inapplicable(surface_rules(opened))
    with progress_bar("integrating") as progress:
        shown = shrm.view(
            opened, light, brdf, names=maps, mesh=mesh, **values,
            truth_size=truth_size if has_truth else 0, max_size=max_size if output else None,
            rounded=output is not None and not lossless, progress=progress,
        )  # fmt: skip
    warnings = [] if light is None else light.warnings()
    warnings += shown.warnings
    if output is None:
        warn(warnings)
        for line in shown.told:
            echo_lines([line], err=True)
        _serve(shown.scene, no_open)
        return
    text = shown.html().encode("utf-8")
    write_bytes(output, text)
    result = {
        "file": output,
        "bytes": len(text),
        "maps": list(maps),
        "views": [list(each) for each in values["views"]],
        "rounding_error": shown.scene.blocks.rounding_error,
        "truths": len(shown.scene.description["truths"]),
    }
    lines = [
        f"{output}: {bytes_text(len(text))}, opens in a browser without a network",
        *shown.told,
    ]
    error = shown.scene.blocks.rounding_error
    if error:
        lines.append(
            f"textures rounded by up to {error:.2%} (RMS); --lossless keeps half precision"
        )
    conclude(result, lines, warnings)


def _check_usage(has_probe: bool, has_output: bool, no_truth: bool) -> bool:
    """Refuse options that would have no effect, and return whether the truth is wanted."""
    has_truth = has_probe and not no_truth
    usage.refuse_inapplicable({
        **options.reading_rules(has_probe, "with --probe"),
        "no_truth": (has_probe, "with --probe"),
        **dict.fromkeys(_OF_TRUTH, (has_truth, "to the truth, with --probe")),
        "max_size": (has_output, "with -o"),
        "lossless": (has_output, "with -o"),
        "no_open": (not has_output, "without -o"),
        "as_json": (has_output, "with -o"),
    })  # fmt: skip
    usage.exclude("no_truth", "brdf")
    return has_truth


def _serve(scene: Scene, no_open: bool) -> None:
    """Serve a page until the user interrupts."""
    import webbrowser

    from shrm_cli.view.serve import PageServer

    with PageServer(scene) as server:
        echo(server.url)
        if not usage.is_quiet():
            echo("Ctrl-C ends it.", err=True)
        if not no_open:
            webbrowser.open(server.url)
        server.serve_forever()
