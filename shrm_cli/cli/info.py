"""`shrm info` prints what a file is."""

from typing import Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import PATH, option
from shrm_cli.progress import Rising, using


@click.command()
@click.argument("file", type=PATH)
@option(
    "--stats/--no-stats", bool, default=True,
    help="Read the pixels of a probe: range, irradiance, white balance, lamps.",
)  # fmt: skip
@options.probe_options
@options.report_options
def info(file: str, stats: bool, **reading: Any) -> None:
    """Print what FILE is: a map, table or collection of shrm, light, a measured BRDF, or a mesh.

    Of a probe it reads the pixels. Stops lie between the luminances that 1 % and 99.9 % of the
    sphere are below; irradiance is that of normals along the axes, +Y that of the ground; the
    temperature is the correlated one of the mean light. Advice names small lamps that hold so much
    of the light that glossy surfaces show them wrong; `--sun split` keeps them beside maps.
    """
    from shrm_cli.analysis.facts import fact_text

    with progress_bar("reading") as progress, using(Rising(progress)):
        found = shrm.describe(file, options.make_read_options(reading), stats=stats)
    usage.refuse_inapplicable(
        options.reading_rules(found.is_probe, f"to probes; FILE {found.what}")
    )
    facts = found.facts if usage.wants_json() else found.facts | found.words
    width = max(len(key) for key in found.facts)
    lines = [file]
    for key, value in facts.items():
        first, *others = fact_text(value).split("\n")
        lines.append(f"  {key.replace('_', ' '):<{width}}  {first}")
        lines += [" " * (width + 4) + line for line in others]
    conclude({"file": file, **found.facts}, lines, found.warnings)
