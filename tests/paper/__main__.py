"""The program of `make tables`: it makes the papers' tables and figures anew."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shrm_cli import settings
from shrm_cli.cli.threads import limit_libraries

if TYPE_CHECKING:
    from shrm_cli.probe.probe import Probe

ROOT = Path(__file__).resolve().parents[2]
PROBES = (ROOT.parent / "shared" / "probes", ROOT / "probes" / "real", ROOT / "probes")
SOURCE_HEIGHT = 128
_SEEN = "seen.md"


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
    written = Page(folder / "index.md")
    written.add(page.introduction(platform.processor() or platform.machine(), np.__version__))
    with tempfile.TemporaryDirectory() as temporary:
        small = Path(temporary) / "small.exr"
        write_image(small, to_grid(interior, LatLong(SOURCE_HEIGHT)), "float")
        light = timings.in_memory(open_probe(small))
    for size in timings.SIZES:
        _say(f"table 5.4, faces of {size} x {size}")
        written.add(page.table_5_4(timings.table_5_4(light, size)))
    for size in timings.SIZES:
        _say(f"table 5.5, faces of {size} x {size}")
        rows = timings.table_5_5(light, size, np.random.default_rng(55))
        written.add(page.table_5_5(rows))
    with settings.using(threads=os.cpu_count()):  # pictures are not timed
        for part in _pictures(folder, interior, studio):
            written.add(part)
    write_seen(folder)
    _say(f"The pages are {written.path.resolve()} and {_SEEN}")


class Page:
    """A page that is on disk as far as it has come, so that a crash leaves what was done before.

    Parameters
    ----------
    path : Path
        The file, which is written anew.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.parts = path, []

    def add(self, part: str) -> None:
        """Add a part, and write the page."""
        self.parts.append(part)
        self.path.write_text("\n".join(self.parts))


def write_seen(folder: Path) -> None:
    """Write the page on what is seen of maps into a folder, one BRDF at a time."""
    from tests.paper import exponentials, page_seen, seen

    folder.mkdir(parents=True, exist_ok=True)
    probes = equal_probes(_real(exponentials.NAMES), seen.ROWS)
    names = [probe.name for probe in probes]
    rows: list[seen.Seen] = []
    head = page_seen.introduction(names, probes[0].height, seen.SIZE)
    with settings.using(threads=os.cpu_count(), cache=folder / "coefficients"):
        _say("Phong lobes beside cmft")
        chosen = probes[names.index("interior") if "interior" in names else 0]
        cubes = page_seen.beside_cmft(seen.phong_cubes(chosen), chosen.name)
        _say(f"what is seen of {seen.SPECS[0]}")
        for k, found in enumerate(seen.measure(probes), start=1):
            rows += found
            done = list(dict.fromkeys(row.spec for row in rows))
            sections = [page_seen.section([r for r in rows if r.spec == spec]) for spec in done]
            parts = [head, page_seen.verdict(rows), page_seen.summary(rows), cubes, *sections]
            (folder / _SEEN).write_text("".join(parts))
            if k < len(seen.SPECS):
                _say(f"what is seen of {seen.SPECS[k]}")


def _pictures(folder: Path, interior: Probe, studio: Probe) -> Iterator[str]:
    """Yield the parts of the page whose work is not timed."""
    from tests.paper import exponentials, figures, page, page_engines, spheres
    from tests.paper.irradiance import irradiance_rows

    _say("figure 5.5")
    yield page.figure_5_5(figures.figure_5_5(interior, folder), interior.name)
    _say("figure 5.6")
    yield page.figure_5_6(*figures.figure_5_6(studio, folder))
    _say("figure 5.8")
    yield page.figure_5_8(*figures.figure_5_8(studio, folder))
    _say("figure 5.9")
    for brdf, order_p, name in figures.LOBES_5_9:
        file, methods = figures.figure_5_9(interior, folder, brdf, order_p, name)
        yield page.figure_5_9(file, repr(brdf), methods)
    files = _real(exponentials.NAMES)
    _say("chapter 4's irradiance")
    yield page_engines.irradiance(irradiance_rows(files))
    _say("SH exponentials and split sums")
    results = exponentials.compare(equal_probes(files))
    picture = spheres.spheres((interior, studio), folder)
    pictured = [f"`{Path(probe.name).name}`" for probe in (interior, studio)]
    yield page_engines.exponentials(results, picture, pictured)


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


def equal_probes(files: Sequence[Path], most: int | None = None) -> list[Probe]:
    """Open lat-longs, averaged down to the rows of the smallest one, or to `most` if that is less.

    Those that have this height already stay as they are.
    """
    from shrm_cli.probe.probe import open_probe
    from tests.paper.seen import small_probes

    opened = [open_probe(file) for file in files]
    rows = min(each.height for each in opened)
    rows = rows if most is None else min(rows, most)
    return [
        each if each.height == rows else small
        for each, small in zip(opened, small_probes(opened, rows), strict=True)
    ]


def _say(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/paper"))
