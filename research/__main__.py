"""The program of `make tables`, `make survey` and `make scale`: the papers, and what maps cost."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shrm_cli import settings
from shrm_cli.settings import limit_libraries

if TYPE_CHECKING:
    from research.extent import Extent
    from shrm_cli.probe.probe import Probe

ROOT = Path(__file__).resolve().parents[1]
_SEEN, _PRODUCT, _SURVEY = "seen.md", "product.md", "brdfs.md"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the pages, Markdown files, and their pictures into a folder."""
    given = _parsed(arguments)
    limit_libraries(1)  # both sides of every comparison get one thread

    from research.extent import FULL, SHORT
    from research.inputs import probe_files, say

    extent = SHORT if given.short else FULL
    if given.scale:
        from research.scale.reach import FULL as WHOLE
        from research.scale.reach import SHORT as LITTLE
        from research.scale.write import write_scale

        write_scale(given.folder, given.probes, LITTLE if given.short else WHOLE)
        return
    if given.survey:
        write_survey(given.folder, given.probes, given.measured, extent)
        say(f"The page is {(given.folder / _SURVEY).resolve()}")
        return
    files = probe_files(given.probes)
    # The figures have a room with windows and one with lamps.
    pictured = probe_files(given.probes, ("interior", "studio"))
    with settings.using(threads=1, cache=False):  # the times include sampling the BRDF
        write_tables(given.folder, files, pictured, given.meshes, extent)
        write_product(given.folder, pictured, given.meshes, given.measured, extent)
        write_seen(given.folder, files, extent)
    say(f"The pages are {(given.folder / 'index.md').resolve()}, {_PRODUCT} and {_SEEN}")


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m research", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the pages go")
    parser.add_argument("--survey", action="store_true", help="survey all BRDFs instead")
    parser.add_argument("--scale", action="store_true", help="measure what batches take instead")
    parser.add_argument("--short", action="store_true", help="few cases and small pictures")
    parser.add_argument(
        "--probes", type=Path, default=ROOT / "probes" / "real", help="where the real probes are"
    )
    parser.add_argument(
        "--meshes", type=Path, default=ROOT.parent / "shared" / "meshes",
        help="where bunny.obj and dragon.ply are; a knot takes their place",
    )  # fmt: skip
    parser.add_argument(
        "measured", nargs="*", help="measured BRDFs, files of the survey and of product textures"
    )
    return parser.parse_intermixed_args(arguments)


def write_tables(
    folder: Path, files: Sequence[Path], pictured: Sequence[Path], meshes: Path, extent: Extent
) -> None:
    """Write the page with the papers' tables and figures.

    Parameters
    ----------
    folder : Path
        It is made where it is missing.
    files : sequence of Path
        The probes; those that differ in size are averaged down to the smallest.
    pictured : sequence of Path
        The probes of the figures, of which there may be one or two.
    meshes : Path
        The folder of the meshes, which need not exist.
    extent : Extent
    """
    import numpy as np

    from research import page, timings
    from research.basis import figure_4_3
    from research.diffuse import figure_4_1
    from research.inputs import Page, equal_probes, say, small_probes
    from research.product.scenes import meshes as meshes_of

    # Pictures of two probes are shown beside each other.
    first, last = (equal_probes(pictured)[k] for k in (0, -1))
    written = Page(folder / "index.md")
    processor = platform.processor() or platform.machine()
    written.add(page.introduction(processor, np.__version__, extent))
    (light,) = small_probes([first], extent.source_rows)
    for size in extent.face_sizes:
        say(f"table 5.4, faces of {size} x {size}")
        times = timings.table_5_4(light, size, extent.exponents, extent.repeats)
        written.add(page.table_5_4(times))
    for size in extent.face_sizes:
        say(f"table 5.5, faces of {size} x {size}")
        rng = np.random.default_rng(55)
        times = timings.table_5_5(light, size, rng, extent.sigmas, extent.repeats)
        written.add(page.table_5_5(times))
    with settings.using(threads=os.cpu_count()):  # pictures are not timed
        shape = meshes_of(meshes, extent.product_rows)[0]
        say("figure 4.1")
        found = figure_4_1(last, shape, folder, extent)
        written.add(page.figure_4_1(*found, (Path(last.name).stem, shape.name)))
        say("figure 4.3")
        written.add(figure_4_3(shape, folder))
        for part in _pictures(folder, files, first, last, extent):
            written.add(part)


def _pictures(
    folder: Path, files: Sequence[Path], first: Probe, last: Probe, extent: Extent
) -> Iterator[str]:
    """Yield the parts of the page whose work is not timed."""
    from research import exponentials, figures, page, page_engines, spheres
    from research.inputs import equal_probes, say
    from research.irradiance import irradiance_rows

    say("figure 5.4")
    yield page.figure_5_4(*figures.figure_5_4(last, folder, extent))
    say("figure 5.5")
    yield page.figure_5_5(figures.figure_5_5(first, folder), first.name)
    say("figure 5.6")
    yield page.figure_5_6(*figures.figure_5_6(last, folder, extent))
    say("figure 5.7")
    yield page.figure_5_7(figures.figure_5_7(extent.materials))
    say("figure 5.8")
    yield page.figure_5_8(*figures.figure_5_8(last, folder, extent))
    say("figure 5.9")
    for brdf, order_p, name in figures.LOBES_5_9:
        file, methods = figures.figure_5_9(first, folder, brdf, order_p, name, extent)
        yield page.figure_5_9(file, repr(brdf), methods)
    say("chapter 4's irradiance")
    yield page_engines.irradiance(irradiance_rows(files))
    say("SH exponentials and split sums")
    results = exponentials.compare(equal_probes(files)[: extent.glossy_probes], extent)
    picture = spheres.spheres((first, last), folder, extent.glossy_pictures[2])
    pictured = [f"`{Path(probe.name).name}`" for probe in (first, last)]
    yield page_engines.exponentials(results, picture, pictured)


def write_product(
    folder: Path,
    pictured: Sequence[Path],
    meshes: Path,
    measured: Sequence[str],
    extent: Extent,
) -> None:
    """Write the page on product textures into a folder, one figure at a time.

    Parameters
    ----------
    folder : Path
    pictured : sequence of Path
        The probes of the figures, of which there may be one or two.
    meshes : Path
        The folder of the meshes, which need not exist.
    measured : sequence of str
        The files of measured BRDFs, which may be none.
    extent : Extent
    """
    from research.inputs import Page, equal_probes, say, small_probes
    from research.product import (
        incident,
        materials,
        orders,
        page,
        scenes,
        shadows,
        textures,
        turned,
    )

    written = Page(folder / _PRODUCT)
    found = scenes.meshes(meshes, extent.product_rows)
    names = [f"{mesh.name} ({len(mesh.vertices)} vertices)" for mesh in found]
    probes = equal_probes(pictured)
    probe_names = [Path(probe.name).stem for probe in probes]
    written.add(page.introduction(names, extent))
    with settings.using(threads=os.cpu_count()):  # pictures are not timed
        say("figure 2 of product textures")
        written.add(page.figure_2(*textures.figure_2(folder, extent)))
        say("figure 3")
        written.add(page.figure_3(*turned.figure_3(pictured[-1], found[0], folder, extent)))
        say("figure 4")
        written.add(page.figure_4(*textures.figure_4(probes[-1], folder, extent), extent))
        say("figures 5 and 7")
        pair = shadows.figures_5_and_7(probes[-1], found[-1], folder, extent)
        written.add(page.figures_5_and_7(*pair))
        say("figure 6")
        (small,) = small_probes(probes[-1:], extent.product_source)
        written.add(page.figure_6(*orders.figure_6(small, folder, extent), probe_names[-1]))
        shapes = [*found, scenes.vase(extent.product_rows)]
        eight = materials.figure_8(probes, shapes, measured, folder, extent)
        written.add(page.figure_8(*eight, probe_names, bool(measured)))
        say("an incident light field")
        field = incident.incident_field(found[0], folder, extent)
        written.add(page.incident_field(*field, found[0].name, incident.SIZE))


def write_seen(folder: Path, files: Sequence[Path], extent: Extent) -> None:
    """Write the page on what is seen of maps into a folder, one BRDF at a time.

    Parameters
    ----------
    folder : Path
    files : sequence of Path
        The probes, which are averaged down to the same number of rows.
    extent : Extent
    """
    from research import page_seen, seen
    from research.inputs import Page, equal_probes, say, small_probes

    written = Page(folder / _SEEN)
    probes = equal_probes(files, 2 * extent.seen_rows)
    names = [probe.name for probe in probes]
    rows: list[seen.Seen] = []
    head = page_seen.introduction(names, min(probes[0].height, extent.seen_rows), extent)
    with settings.using(threads=os.cpu_count(), cache=folder / "coefficients"):
        say("Phong lobes beside cmft")
        chosen = probes[names.index("interior") if "interior" in names else 0]
        (small,) = small_probes([chosen], min(chosen.height, extent.seen_rows))
        found = seen.phong_cubes(small, extent.cube)
        cubes = page_seen.beside_cmft(found, chosen.name, extent.cube)
        sections = []
        for found_rows in seen.measure(probes, extent):
            rows += found_rows
            sections.append(page_seen.section(found_rows))
            summary = page_seen.summary(rows)
            written.write([head, page_seen.verdict(rows), summary, cubes, *sections])


def write_survey(folder: Path, probes: Path, measured: Sequence[str], extent: Extent) -> None:
    """Write the page of the survey into a folder, one BRDF at a time.

    Parameters
    ----------
    folder : Path
    probes : Path
        The folder of the real probes.
    measured : sequence of str
        The files of measured BRDFs.
    extent : Extent
    """
    from research import page_survey, survey
    from research.inputs import Page, equal_probes, probe_files, say

    lights = equal_probes(probe_files(probes, survey.PROBES), extent.survey_rows)
    specs = [*(extent.survey or survey.all_specs()), *measured]
    written = Page(folder / _SURVEY)
    rows: list[survey.Outcome] = []
    say(f"{len(specs)} BRDFs; {specs[0]}")
    for k, found in enumerate(survey.outcomes(lights, specs, extent.survey_picture), start=1):
        rows += found
        written.write(page_survey.survey(rows, lights[0].height))
        if k < len(specs):
            say(f"{k} done; {specs[k]}")


if __name__ == "__main__":
    main()
