"""Representations of prefiltered light compared for one probe: storage, time and errors."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.analysis.memory import Memory, within_limit
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import ShrmError
from shrm_cli.files.image import Picture
from shrm_cli.files.whole import scratch_folder
from shrm_cli.maps import registry
from shrm_cli.maps.file import open_map
from shrm_cli.maps.options import Representation
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import Difference, measure
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import render_sphere
from shrm_cli.vocabulary import COMPARED, DEFAULT_MAX_SIZE


@record
class Plan:
    """What a comparison will make."""

    probe: Probe
    surfaces: tuple[Ggx, ...]
    """Surfaces of one f0, in order of their roughness."""
    eps: float
    """The fraction of a BRDF's energy that orders may miss, for representations made for a BRDF."""
    viewers: tuple[Viewer, ...]
    size: int
    source_height: int | None
    """Rows that the probe is averaged down to for the truth; by default it is not averaged."""
    memory: Memory
    """The memory that it takes, and the most bytes of a map."""
    exact: bool = False
    """Whether the truth is the full sum over the pixels of the probe."""

    @property
    def truths(self) -> int:
        """The number of pictures by brute force; each representation has as many."""
        return len(self.surfaces) * len(self.viewers)

    @property
    def maps(self) -> int:
        return sum(len(groups(name, self.surfaces)) for name in COMPARED)


@record
class RepresentationResult:
    """The costs and the errors of a representation."""

    representation: Representation
    files: int
    stored: int
    """`files` and `stored`: how many files were written, and their bytes in all."""
    seconds: float
    """Wall-clock time of making the maps, which includes reading the probe for each."""
    differences: tuple[Difference | None, ...]
    """The pictures of each surface compared with the truth; None where no map was made."""
    difference: Difference | None
    """All pictures of all surfaces compared with the truth; None if any map was not made."""
    failures: tuple[str, ...]
    """The reasons why maps were not made."""
    pictures: tuple[Picture | None, ...]
    """Pictures of each surface; None where no map was made, of shape (V, S, S, 3) each."""

    @property
    def errors(self) -> tuple[float | None, ...]:
        """Relative RMS error of the pictures of each surface; None where no map was made."""
        return tuple(None if each is None else each.relative_rmse for each in self.differences)

    @property
    def error(self) -> float | None:
        """Relative RMS error of all pictures of all surfaces; None if any map was not made."""
        return None if self.difference is None else self.difference.relative_rmse


@record
class RepresentationTable:
    """The results of all representations, and the truth."""

    surfaces: tuple[Ggx, ...]
    """Surfaces of one f0, in order of their roughness."""
    truth: Picture
    """Pictures by angular integration, float32 of shape (surfaces, V, S, S, 3)."""
    truth_errors: tuple[float | None, ...]
    """What they may be wrong by, see `Reference.error`."""
    results: tuple[RepresentationResult, ...]

    def sheet(self, exposure: float = 0.0) -> Picture:
        """Draw a labelled sheet of the first view.

        It has a row for each roughness, which begins with the truth. The exposure is in stops.
        """
        size = self.truth.shape[-2]
        tiles, labels = [], []
        for index, surface in enumerate(self.surfaces):
            tiles.append(expose(self.truth[index, 0], exposure))
            labels.append(f"truth {surface.number('roughness'):.3g}")
            for result in self.results:
                pictures, error = result.pictures[index], result.errors[index]
                made = np.zeros_like(tiles[0]) if pictures is None else pictures[0]
                tiles.append(expose(made, exposure))
                share = "not made" if error is None else f"{error:.1%}"
                labels.append(f"{result.representation.name} {share}")
        return draw_sheet(table_layout(len(self.surfaces), size), tiles, labels)


def table_layout(surfaces: int, size: int) -> SheetLayout:
    """Lay out a sheet for a number of surfaces, with tiles of a size in pixels."""
    columns = 1 + len(COMPARED)
    return arrange(columns * surfaces, size, columns)


def groups(name: str, surfaces: Sequence[Ggx]) -> list[Sequence[Ggx]]:
    """Return the surfaces that share a map of a representation: each its own, or one for all."""
    return [[each] for each in surfaces] if registry.description(name).needs_brdf else [surfaces]


def plan_comparison(
    probe: Probe,
    surfaces: Sequence[Ggx],
    eps: float,
    viewers: Sequence[Viewer],
    size: int,
    height: int | None = None,
    max_memory: int | None = None,
    exact: bool = False,
) -> Plan:
    """Choose what to make, and estimate the memory that it takes.

    `height` is the number of rows that the probe is averaged down to for the truth; by default it
    is not averaged. `max_memory` is the most bytes of memory that may be taken; by default half of
    the machine's memory. Where they are too few, maps of fewer bytes than the default are made.
    """
    heights = [height] * len(surfaces)
    memory = within_limit(probe, heights, len(viewers), size, len(COMPARED), max_memory)
    return Plan(probe, tuple(surfaces), eps, tuple(viewers), size, height, memory, exact)


def compare_representations(plan: Plan, progress: Progress | None = None) -> RepresentationTable:
    """Prefilter a probe to every representation, and compare their pictures with the truth.

    The pictures are drawn from maps that were written and read again, so that they include the
    rounding of the files. One map is in memory at a time.

    If a map cannot be made, its result says so instead.
    """
    stages = Stages(progress, plan.truths + plan.maps)
    stages.done(0, 0)
    truth, errors = _draw_truth(plan, stages)
    done, results = plan.truths, []
    for name in COMPARED:
        results.append(_judge(registry.description(name), plan, truth, stages, done))
        done += len(groups(name, plan.surfaces))
    return RepresentationTable(plan.surfaces, truth, tuple(errors), tuple(results))


def _draw_truth(plan: Plan, stages: Stages) -> tuple[Picture, list[float | None]]:
    """Draw the truth of the surfaces, shape (surfaces, V, S, S, 3), and tell its errors."""
    count, size = len(plan.viewers), plan.size
    pictures = np.empty((len(plan.surfaces), count, size, size, 3), dtype=np.float32)
    errors = []
    for index, surface in enumerate(plan.surfaces):
        truth = Reference(
            plan.probe, surface, plan.source_height, progress=stages.within, exact=plan.exact
        )
        for view, viewer in enumerate(plan.viewers):
            pictures[index, view] = render_sphere(truth, viewer, size)
            stages.done(index * count + view + 1, plan.truths)
        errors.append(truth.error)
    return pictures, errors


def _judge(
    representation: Representation, plan: Plan, truth: Picture, stages: Stages, done: int
) -> RepresentationResult:
    """Make, write, read and draw the maps of a representation, and compare with the truth."""
    pictures: list[Picture | None] = []
    failures, files, stored, seconds = [], 0, 0, 0.0
    with scratch_folder() as folder:
        path = folder / "map.exr"
        for count, group in enumerate(groups(representation.name, plan.surfaces), start=1):
            try:
                seconds += _make(representation, plan, group, path, stages.within)
                pictures += _drawn(path, plan, group)
                files, stored = files + 1, stored + path.stat().st_size
            except ShrmError as reason:
                roughness = f"roughness {group[0].number('roughness'):.3g}: "
                where = roughness if representation.needs_brdf else ""
                failures.append(where + str(reason).removeprefix(f"{path}: "))
                pictures += [None] * len(group)
            stages.done(done + count, 0)
    differences = tuple(
        None if found is None else measure(found, expected)
        for found, expected in zip(pictures, truth, strict=True)
    )
    whole = [found for found in pictures if found is not None]
    difference = measure(np.stack(whole), truth) if len(whole) == len(truth) else None
    return RepresentationResult(
        representation, files, stored, seconds, differences, difference, tuple(failures),
        tuple(pictures),
    )  # fmt: skip


def _make(
    representation: Representation,
    plan: Plan,
    surfaces: Sequence[Ggx],
    path: Path,
    progress: Progress,
) -> float:
    """Write the map that `shrm prefilter` would make; return its seconds, without writing."""
    given: dict[str, Any] = {}
    if representation.needs_brdf:
        given = {"brdf": surfaces[0], "eps": plan.eps}
        if plan.memory.max_size < DEFAULT_MAX_SIZE:
            given["max_size"] = plan.memory.max_size
    elif "roughness" in representation.arguments:
        given = {"roughness": (surfaces[0].number("roughness"), surfaces[-1].number("roughness"))}
    start = time.perf_counter()
    made = prefilter_with_facts(plan.probe, representation.name, given, progress).map
    seconds = time.perf_counter() - start
    made.save(path)
    return seconds


def _drawn(path: Path, plan: Plan, surfaces: Sequence[Ggx]) -> list[Picture]:
    """Read a map, and draw it as each surface; a list of arrays of shape (V, S, S, 3)."""
    found = open_map(path)
    shown = [found.shaded(each.number("roughness"), each.color("f0")) for each in surfaces]
    return [np.stack([render_sphere(one, v, plan.size) for v in plan.viewers]) for one in shown]
