"""`shrm report` tells of a probe and its maps on one page."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.prefilter import MAKING_HEADINGS
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import BYTES, PATH, Named, flag, option, whole
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.registry import installed_names
from shrm_cli.vocabulary import AUTO, MAX_SOURCE_HEIGHT, REPRESENTATIONS

if TYPE_CHECKING:
    from shrm_cli.report.measure import Measured

_MAX_PAGE = 32 * 10**6
_OF_PAGE = (
    "angles", "picture_size", "truth_height", "exact", "exposure", "no_flip", "no_view",
    "max_page",
)  # fmt: skip
_HEADINGS = {
    **MAKING_HEADINGS,
    "What to make": ["brdfs", "to"],
    "What the page shows": [*_OF_PAGE],
    "How the probe is read": [*options.READING_NAMES],
    "Output": ["output", "as_json", "quiet"],
}
_UNSAID = ("probe", "output")
"""Options that the page does not list; the command line has all that were given."""


@click.command(cls=options.command_with_headings(_HEADINGS))
@click.argument("probe", metavar="PROBE", type=PATH)
@options.brdfs_option
@option(
    "--to", Named([AUTO, *REPRESENTATIONS], installed_names), multiple=True, default=[AUTO],
    help="A representation to make, or auto, as shrm prefilter has it. May be repeated.",
)  # fmt: skip
@options.shared_options("eps", "error", "seen", "order_f", "order_p", "center")
@options.representation_options(lambda option: not option.prints)
@options.shared_options("domain", "source_height", "frame", "size", "max_size", "sun")
@option("-o --output", PATH, "HTML to write, one file.", required=True)
@options.views_option("angles")
@option(
    "--picture-size N", whole(16, 1024), default=256,
    help="Width and height of the spheres' pictures, pixels.",
)  # fmt: skip
@option(
    "--truth-height ROWS", whole(2, MAX_SOURCE_HEIGHT),
    help="Rows that the probe is averaged down to for the truth.  [default: all]",
)  # fmt: skip
@options.exact_option
@options.stops("Stops of the spheres.  [default: what suits the truth of each BRDF]")
@flag("--no-flip", "Leave out HDR-FLIP.")
@flag("--no-view", "Leave out the interactive views: a small page.")
@option(
    "--max-page BYTES", BYTES, default=str(_MAX_PAGE), show_default=False,
    help="The most that the page may take, such as 8MB; views that do not fit are left out.  "
    "[default: 32MB]",
)  # fmt: skip
@options.probe_options
@options.report_options
def report(
    probe: str,
    brdfs: tuple[str, ...],
    to: tuple[str, ...],
    output: str,
    exposure: float | None,
    no_flip: bool,
    no_view: bool,
    max_page: int,
    **values: Any,
) -> None:
    """Report on the light probe PROBE and its maps: a page to send, which needs no network.

    The page shows the probe with its range, white balance and lamps; each map in numbers, and in
    pictures beside the truth, with differences and HDR-FLIP; and each BRDF in a view to orbit. Of
    what engines use, split sums and SH exponentials are shown as each GGX of --brdf.

    \b
      shrm report probe.exr --brdf ggx:roughness=0.3 --brdf paint.bsdf -o report.html
      shrm report probe.exr --brdf ggx:roughness=0.5 --to principal --to splitsum -o report.html
    """
    from shrm_cli.files.whole import write_bytes

    light = shrm.open_probe(probe, options.make_read_options(values))
    usage.check_outputs([output], specs=brdfs, suffixes=usage.PAGES)
    arguments = {name: value for name, value in values.items() if value is not None}
    command = shlex.join(["shrm", "report", *options.words_of_call()])
    with progress_bar("measuring") as progress:
        made = shrm.report(
            light, brdfs, to, flips=not no_flip, progress=progress, **arguments,
            look=shrm.Look(
                exposure, not no_view, max_page, command, _options(), usage.flags,
                shlex.join(options.words_of_reading()),
            ),
        )  # fmt: skip
    text, measured = made.html.encode("utf-8", "replace"), made.measured
    write_bytes(output, text)
    failures = [{"what": name, "error": usage.flags(why)} for name, why in measured.failures]
    result = {
        "file": output,
        "bytes": len(text),
        "probe": made.statistics.summary(),
        "maps": measured.summary(),
        "failures": failures,
    }
    warnings = light.warnings()
    warnings += made.warnings
    failed = [f"{each['what']}: {each['error']}" for each in failures]
    conclude(result, _lines(output, len(text), measured), warnings, failed)


def _options() -> dict[str, Any]:
    """Return all options with a value by their flags; defaults are options, too."""
    context = click.get_current_context()
    return {
        each.opts[0]: context.params[each.name]
        for each in context.command.get_params(context)
        if isinstance(each, click.Option)
        and each.name in context.params
        and each.name not in _UNSAID
        and context.params[each.name] not in (None, False, ())
    }


def _lines(output: str, size: int, measured: Measured) -> list[str]:
    """Return the page's size, and a line for each map."""
    from shrm_cli.report import words
    from shrm_cli.report.measure import names_of

    lines = [f"{output}: {bytes_text(size)}, opens in a browser without a network"]
    for material, index, made in names_of(measured.materials):
        found = material.numbers(index)
        lines.append(
            f"  {material.spec}, {made.form}: RMS {words.percent(found['relative_rmse'])}, median "
            f"{words.percent(found['median_relative_error'])}, 95 % within "
            f"{words.percent(found['p95_relative_error'])}, "
            f"{bytes_text(made.summary['bytes'])}, {words.duration(made.seconds)}"
        )
    return lines
