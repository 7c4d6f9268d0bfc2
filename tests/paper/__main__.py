"""The program of `make tables`: it makes the papers' tables and figures anew."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shrm_cli import settings
from shrm_cli.cli.threads import limit_libraries

if TYPE_CHECKING:
    from shrm_cli.probe.probe import Probe

ROOT = Path(__file__).resolve().parents[2]
PROBES = (ROOT.parent / "shared" / "probes", ROOT / "probes" / "real", ROOT / "probes")
SOURCE_HEIGHT = 128


def main(folder: Path) -> None:
    """Write the page, a Markdown file, and its pictures into a folder."""
    limit_libraries(1)  # both sides of every comparison get one thread
    with settings.using(threads=1, cache=False):  # the times include sampling the BRDF
        _write_page(folder)


def _write_page(folder: Path) -> None:
    import numpy as np

    from shrm_cli.files.image import write_image
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.probe.resample import to_grid
    from shrm_cli.sphere.grid.latlong import LatLong
    from tests.paper import page, timings

    folder.mkdir(parents=True, exist_ok=True)
    interior, studio = (open_probe(_find(name)) for name in ("interior", "studio"))
    parts = [page.introduction(platform.processor() or platform.machine(), np.__version__)]
    with tempfile.TemporaryDirectory() as temporary:
        small = Path(temporary) / "small.exr"
        write_image(small, to_grid(interior, LatLong(SOURCE_HEIGHT)), "float")
        light = timings.in_memory(open_probe(small))
    for size in timings.SIZES:
        _say(f"table 5.4, faces of {size} x {size}")
        parts.append(page.table_5_4(timings.table_5_4(light, size)))
    for size in timings.SIZES:
        _say(f"table 5.5, faces of {size} x {size}")
        rows = timings.table_5_5(light, size, np.random.default_rng(55))
        parts.append(page.table_5_5(rows))
    with settings.using(threads=os.cpu_count()):  # pictures are not timed
        parts += _pictures(folder, interior, studio)
    (folder / "index.md").write_text("\n".join(parts))
    _say(f"The page is {folder.resolve() / 'index.md'}")


def _pictures(folder: Path, interior: Probe, studio: Probe) -> list[str]:
    """Return the parts of the page whose work is not timed."""
    from shrm_cli.probe.probe import open_probe
    from tests.paper import exponentials, figures, page, page_engines, spheres
    from tests.paper.irradiance import irradiance_rows

    _say("figure 5.5")
    parts = [page.figure_5_5(figures.figure_5_5(interior, folder), interior.name)]
    _say("figure 5.6")
    parts.append(page.figure_5_6(*figures.figure_5_6(studio, folder)))
    _say("figure 5.8")
    parts.append(page.figure_5_8(*figures.figure_5_8(studio, folder)))
    _say("figure 5.9")
    for brdf, order_p, name in figures.LOBES_5_9:
        file, methods = figures.figure_5_9(interior, folder, brdf, order_p, name)
        parts.append(page.figure_5_9(file, repr(brdf), methods))
    files = _real(exponentials.NAMES)
    _say("chapter 4's irradiance")
    parts.append(page_engines.irradiance(irradiance_rows(files)))
    _say("SH exponentials and split sums")
    results = exponentials.compare([open_probe(file) for file in files])
    picture = spheres.spheres((interior, studio), folder)
    pictured = [f"`{Path(probe.name).name}`" for probe in (interior, studio)]
    parts.append(page_engines.exponentials(results, picture, pictured))
    return parts


def _find(name: str) -> Path:
    """Find a real probe, or take the shipped studio where there is none."""
    for folder in PROBES:
        if (folder / f"{name}.exr").exists():
            return folder / f"{name}.exr"
    return ROOT / "probes" / "studio.exr"


def _real(names: Sequence[str]) -> list[Path]:
    """Find those of some real probes that are there, or take two shipped ones."""
    for folder in PROBES[:-1]:
        found = [folder / f"{name}.exr" for name in names if (folder / f"{name}.exr").exists()]
        if found:
            return found
    return [ROOT / "probes" / "studio.exr", ROOT / "probes" / "sky.exr"]


def _say(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/paper"))
