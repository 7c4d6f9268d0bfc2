"""Representations of prefiltered light compared for one probe: storage, time and errors."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import ShrmError
from shrm_cli.files.picture import Picture
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import open_map
from shrm_cli.maps.options import Representation
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import Difference, measure
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import ReflectionMap, render_sphere

Array = NDArray[np.floating]

_ROWS_OF_LOBE = 24.0
"""Rows of the probe for the truth times the width of the lobe, which is about alpha radians."""

_ROWS = 64, 256
"""The fewest and the most rows that the truth takes by default."""


COMPARED = ("shrm", "splitsum", "she", "cabral")
"""Names of the representations that are compared."""


@dataclass(frozen=True)
class RepresentationResult:
    """The costs and the errors of a representation.

    Attributes
    ----------
    representation : Representation
    files, stored : int
        How many files were written, and their bytes in all.
    seconds : float
        Wall-clock time of making the maps, which includes reading the probe for each.
    differences : tuple of Difference or None
        The pictures of each surface compared with the truth; None where no map was made.
    difference : Difference or None
        All pictures of all surfaces compared with the truth; None if any map was not made.
    failures : tuple of str
        The reasons why maps were not made.
    pictures : tuple of ndarray of float32, shape (V, S, S, 3), or None
        Pictures of each surface; None where no map was made.
    """

    representation: Representation
    files: int
    stored: int
    seconds: float
    differences: tuple[Difference | None, ...]
    difference: Difference | None
    failures: tuple[str, ...]
    pictures: tuple[Picture | None, ...]

    @property
    def errors(self) -> tuple[float | None, ...]:
        """Relative RMS error of the pictures of each surface; None where no map was made."""
        return tuple(None if each is None else each.relative_rmse for each in self.differences)

    @property
    def error(self) -> float | None:
        """Relative RMS error of all pictures of all surfaces; None if any map was not made."""
        return None if self.difference is None else self.difference.relative_rmse


@dataclass(frozen=True)
class RepresentationTable:
    """The results of all representations, and the truth.

    Attributes
    ----------
    surfaces : tuple of Ggx
        Surfaces of one f0, in order of their roughness.
    truth : ndarray of float32, shape (surfaces, V, S, S, 3)
        Pictures by brute force.
    source_heights : tuple of int or None
        Rows that the probe was averaged down to for the truth of each surface; None where it was
        not averaged.
    results : tuple of RepresentationResult
    """

    surfaces: tuple[Ggx, ...]
    truth: Picture
    source_heights: tuple[int | None, ...]
    results: tuple[RepresentationResult, ...]

    def sheet(self, exposure: float = 0.0) -> Picture:
        """Draw a labelled sheet of the first view.

        It has a row for each roughness, which begins with the truth. The exposure is in stops.

        Raises
        ------
        OutputError
            If the sheet would be too large, or its labels cannot be drawn.
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
    """Lay out a sheet for a number of surfaces, with tiles of a size in pixels.

    Raises
    ------
    OutputError
        If the sheet would be too large.
    """
    columns = 1 + len(COMPARED)
    return arrange(columns * surfaces, size, columns)


def source_height(probe: Probe, roughness: float) -> int | None:
    """Return the rows that suffice for the truth of a roughness; None if the probe has no more.

    The lobe of GGX is about alpha = roughness^2 radians wide. On real probes the pictures differ
    from those of 256 rows by 0.6 % at most, for roughnesses of 0.5 and more.
    """
    enough = int(np.clip(np.ceil(_ROWS_OF_LOBE / roughness**2), *_ROWS))
    return enough if probe.grid.latlong_rows > enough else None


def compare_representations(
    probe: Probe,
    surfaces: Sequence[Ggx],
    tolerance: float,
    viewers: Sequence[Viewer],
    size: int,
    height: int | None = None,
    progress: Progress | None = None,
) -> RepresentationTable:
    """Prefilter a probe to every representation, and compare their pictures with brute force.

    The pictures are drawn from maps that were written and read again, so that they include the
    rounding of the files.

    Parameters
    ----------
    probe : Probe
    surfaces : sequence of Ggx
        Surfaces of one f0, in order of their roughness.
    tolerance : float
        The fraction of a BRDF's energy that orders may miss, for representations made for a BRDF.
    viewers : sequence of V Viewer
    size : int
        Width and height of each picture, pixels.
    height : int, optional
        Rows that the probe is averaged down to for the truth; `source_height` by default.
    progress : callable, optional
        Called with the amount done and the amount in all.

    Raises
    ------
    ProbeError
        If the probe cannot be read. If a map cannot be made, its result says so instead.
    """
    heights = [height or source_height(probe, each.number("roughness")) for each in surfaces]
    pictures = len(surfaces) * len(viewers)
    total = pictures + len(COMPARED)
    stages = Stages(progress, total)
    truth = _draw_truth(probe, surfaces, heights, viewers, size, stages, total)
    results = []
    for name in COMPARED:
        results.append(
            _judge(registry.description(name), probe, surfaces, tolerance, viewers, truth)
        )
        stages.done(pictures + len(results), total)
    return RepresentationTable(tuple(surfaces), truth, tuple(heights), tuple(results))


def _draw_truth(
    probe: Probe,
    surfaces: Sequence[Ggx],
    heights: Sequence[int | None],
    viewers: Sequence[Viewer],
    size: int,
    stages: Stages,
    total: int,
) -> Picture:
    """Draw the surfaces by brute force, shape (surfaces, V, S, S, 3)."""
    pictures: list[Picture] = []

    for surface, rows in zip(surfaces, heights, strict=True):
        truth = Reference(probe, surface, rows, progress=stages.within)
        for viewer in viewers:
            pictures.append(render_sphere(truth, viewer, size))
            stages.done(len(pictures), total)
    return np.stack(pictures).reshape(len(surfaces), len(viewers), size, size, 3)


def _judge(
    representation: Representation,
    probe: Probe,
    surfaces: Sequence[Ggx],
    tolerance: float,
    viewers: Sequence[Viewer],
    truth: Picture,
) -> RepresentationResult:
    """Make, write, read and draw the maps of a representation, and compare with the truth."""
    groups = [[each] for each in surfaces] if representation.needs_brdf else [surfaces]
    pictures: list[Picture | None] = []
    failures, files, stored, seconds = [], 0, 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        for group in groups:
            start = time.perf_counter()
            try:
                made = _make(representation, probe, group, tolerance)
                duration = time.perf_counter() - start
                made.save(path)
                found = open_map(path)
            except ShrmError as reason:
                where = (
                    f"roughness {group[0].number('roughness'):.3g}: "
                    if representation.needs_brdf
                    else ""
                )
                failures.append(where + str(reason).removeprefix(f"{path}: "))
                pictures += [None] * len(group)
                continue
            seconds += duration
            files, stored = files + 1, stored + path.stat().st_size
            pictures += [_draw(_shaded(found, each), viewers, truth.shape[-2]) for each in group]
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


def _draw(reflection_map: ReflectionMap, viewers: Sequence[Viewer], size: int) -> Picture:
    return np.stack([render_sphere(reflection_map, each, size) for each in viewers])


def _make(
    representation: Representation, probe: Probe, surfaces: Sequence[Ggx], tolerance: float
) -> Map:
    """Make the map that `shrm prefilter` would make for these surfaces."""
    given: dict[str, Any] = {}
    if representation.needs_brdf:
        given = {"brdf": surfaces[0], "eps": tolerance}
    elif "roughness" in representation.arguments:
        given = {"roughness": (surfaces[0].number("roughness"), surfaces[-1].number("roughness"))}
    return prefilter_with_facts(probe, representation.name, given).map


def _shaded(found: Map, surface: Ggx) -> ReflectionMap:
    shown: ReflectionMap = found.shaded(surface.number("roughness"), surface.color("f0"))
    return shown
