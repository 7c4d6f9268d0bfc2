"""`shrm contact` puts many maps onto one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import PATH, option
from shrm_cli.maps.options import counted
from shrm_cli.messages import without_name

if TYPE_CHECKING:
    from shrm_cli.report.contact import Contacts


@click.command()
@click.argument("maps", metavar="MAP|FOLDER...", nargs=-1, required=True, type=PATH)
@option("-o --output", PATH, "HTML to write, one file.", required=True)
@option("--title", str, "Title of the page.", default="Maps")
@options.report_options
def contact(maps: tuple[str, ...], output: str, title: str) -> None:
    """Put each MAP onto one page: a row for each probe, a column for each BRDF and form.

    Each map is drawn as a small sphere, with its bytes, orders and predicted error, and links to
    its file. Of a FOLDER all maps are shown, with those of the folders below it. Split sums and SH
    exponentials are shown as GGX of roughness 0.5.

    \b
      shrm contact build -o build/index.html
    """
    from shrm_cli.report.contact import found_maps

    files = found_maps(maps)
    usage.check_outputs([output], files=files, suffixes=usage.PAGES)
    with progress_bar("drawing") as progress:
        found = shrm.draw_contacts(files, progress)
    if not found.maps:
        raise click.ClickException(_reason(*found.failures[0]))
    size = write_contacts(found, output, title)
    seconds = sum(each.seconds for each in found.maps)
    failures = [{"file": name, "error": usage.flags(why)} for name, why in found.failures]
    result = {
        "file": output,
        "bytes": size,
        "maps": [each.file for each in found.maps],
        "seconds": seconds,
        "failures": failures,
    }
    count = len(found.maps)
    lines = [
        f"{output}: {counted(count, 'map')}, {size:,} bytes, {seconds / max(count, 1):.2g} s each"
    ]
    conclude(result, lines, failures=[_reason(*each) for each in found.failures])


def _reason(name: str, why: str) -> str:
    """Why a map is not shown, with the name of its file before it once."""
    return f"{name}: {usage.flags(without_name(why, name))}"


def write_contacts(found: Contacts, output: str, title: str) -> int:
    """Write the page, whole or not at all, and return its bytes."""
    from shrm_cli.files.whole import write_bytes

    text = shrm.contact_page(found, output, title, usage.flags).encode("utf-8", "replace")
    write_bytes(output, text)
    return len(text)
