"""What forms of prefiltered light store, take and miss, side by side, for one probe."""

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import ShrmError
from shrm_cli.files.picture import Picture
from shrm_cli.maps.read import read_map
from shrm_cli.maps.representations import Map
from shrm_cli.maps.she.prefilter import bake_exponential
from shrm_cli.maps.shrm.prefilter import bake
from shrm_cli.maps.splitsum.prefilter import bake_split_sum
from shrm_cli.maps.write import write_map
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import measure
from shrm_cli.render.image import expose
from shrm_cli.render.shading import shade
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import ReflectionMap, render_sphere

Array = NDArray[np.floating]
Progress = Callable[[int, int], object]

_STEPS = 1000
"""Of the progress, for one picture of the truth, or one form."""
_ROWS_OF_LOBE = 24.0
_ROWS = 64, 256


@dataclass(frozen=True)
class Form:
    """A form that light can be prefiltered to.

    Attributes
    ----------
    name : str
        As `--to` has it.
    title : str
    make : callable
        From a probe, the surfaces that the map is for, and the tolerance of orders, to the map.
    is_of_one : bool
        Whether a map is for a single surface.
    """

    name: str
    title: str
    make: Callable[[Probe, Sequence[Ggx], float], Map]
    is_of_one: bool


def _shrm(probe: Probe, surfaces: Sequence[Ggx], tolerance: float) -> Map:
    return bake(probe, surfaces[0], tolerance, dtype=np.float32).map


def _cabral(probe: Probe, surfaces: Sequence[Ggx], tolerance: float) -> Map:
    return bake(probe, surfaces[0], tolerance, dtype=np.float32, representation="cabral").map


def _split_sum(probe: Probe, surfaces: Sequence[Ggx], tolerance: float) -> Map:
    return bake_split_sum(probe).map


def _exponential(probe: Probe, surfaces: Sequence[Ggx], tolerance: float) -> Map:
    roughness = [surface.number("roughness") for surface in surfaces]
    return bake_exponential(probe, roughness=(roughness[0], roughness[-1])).map


FORMS = (
    Form("shrm", "SHRM", _shrm, True),
    Form("splitsum", "split sum", _split_sum, False),
    Form("she", "SH exponential", _exponential, False),
    Form("cabral", "Cabral", _cabral, True),
)


@dataclass(frozen=True)
class FormResult:
    """A form's costs, and its errors.

    Attributes
    ----------
    form : Form
    files, stored : int
        How many were written, and their bytes.
    seconds : float
        Wall clock of making the maps, reading the probe for each included.
    errors : tuple of float or None
        Relative RMS error of the pictures of each surface; None where no map was made.
    error : float or None
        The same over all pictures of all surfaces.
    failures : tuple of str
        Why maps were not made.
    pictures : tuple of ndarray of float32, shape (V, S, S, 3), or None
        Of each surface.
    """

    form: Form
    files: int
    stored: int
    seconds: float
    errors: tuple[float | None, ...]
    error: float | None
    failures: tuple[str, ...]
    pictures: tuple[Picture | None, ...]


@dataclass(frozen=True)
class FormTable:
    """Forms beside each other.

    Attributes
    ----------
    surfaces : tuple of Ggx
        Of one f0, in order of their roughness.
    truth : ndarray of float32, shape (surfaces, V, S, S, 3)
        Pictures by brute force.
    source_heights : tuple of int or None
        Rows that the probe was averaged down to for each surface; None: not at all.
    results : tuple of FormResult
    """

    surfaces: tuple[Ggx, ...]
    truth: Picture
    source_heights: tuple[int | None, ...]
    results: tuple[FormResult, ...]

    def sheet(self, exposure: float = 0.0) -> Picture:
        """A labelled sheet of the first view: a row for each roughness, the truth in front.

        Raises
        ------
        OutputError
            If it would be too large.
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
                labels.append(f"{result.form.name} {share}")
        return draw_sheet(sheet_layout(len(self.surfaces), size), tiles, labels)


def sheet_layout(surfaces: int, size: int) -> SheetLayout:
    """Where the tiles of a sheet lie.

    Raises
    ------
    OutputError
        If it would be too large.
    """
    columns = 1 + len(FORMS)
    return arrange(columns * surfaces, size, columns)


def source_height(probe: Probe, roughness: float) -> int | None:
    """Rows that suffice for the truth of a roughness; None where the probe has no more.

    A lobe of GGX is about ``ggx_alpha`` radians wide. On real probes the pictures differ from
    those of 256 rows by 0.6 % at most, for roughnesses of 0.5 and more.
    """
    enough = int(np.clip(np.ceil(_ROWS_OF_LOBE / roughness**2), *_ROWS))
    return enough if probe.grid.latlong_rows > enough else None


def compare_forms(
    probe: Probe,
    surfaces: Sequence[Ggx],
    tolerance: float,
    viewers: Sequence[Viewer],
    size: int,
    height: int | None = None,
    progress: Progress | None = None,
) -> FormTable:
    """Prefilter a probe to every form, and compare their pictures with brute force.

    What is compared is what the files hold, rounded as they are.

    Parameters
    ----------
    probe : Probe
    surfaces : sequence of Ggx
        Of one f0, in order of their roughness.
    tolerance : float
        Of the orders of forms that have them.
    viewers : sequence of V Viewer
    size : int
        Width and height of each picture, pixels.
    height : int, optional
        Rows that the probe is averaged down to for the truth; `source_height` by default.
    progress : callable, optional
        Called with steps done, and steps in all.

    Raises
    ------
    ProbeError
        If the probe cannot be read. A form that cannot be made says so in its result.
    """
    heights = [height or source_height(probe, each.number("roughness")) for each in surfaces]
    pictures = len(surfaces) * len(viewers)
    total = _STEPS * (pictures + len(FORMS))

    def show(steps: int) -> None:
        if progress is not None:
            progress(steps, total)

    truth = _draw_truth(probe, surfaces, heights, viewers, size, show)
    results = []
    for form in FORMS:
        results.append(_judge(form, probe, surfaces, tolerance, viewers, truth))
        show(_STEPS * (pictures + len(results)))
    return FormTable(tuple(surfaces), truth, tuple(heights), tuple(results))


def _draw_truth(
    probe: Probe,
    surfaces: Sequence[Ggx],
    heights: Sequence[int | None],
    viewers: Sequence[Viewer],
    size: int,
    show: Callable[[int], None],
) -> Picture:
    """Pictures by brute force, shape (surfaces, V, S, S, 3)."""
    pictures: list[Picture] = []

    def note(done: int, points: int) -> None:
        show(_STEPS * len(pictures) + _STEPS * done // points)

    for surface, rows in zip(surfaces, heights, strict=True):
        truth = Reference(probe, surface, rows, progress=note)
        for viewer in viewers:
            pictures.append(render_sphere(truth, viewer, size))
    return np.stack(pictures).reshape(len(surfaces), len(viewers), size, size, 3)


def _judge(
    form: Form,
    probe: Probe,
    surfaces: Sequence[Ggx],
    tolerance: float,
    viewers: Sequence[Viewer],
    truth: Picture,
) -> FormResult:
    """A form's maps: made, written, read, drawn, and compared with the truth."""
    groups = [[each] for each in surfaces] if form.is_of_one else [surfaces]
    pictures: list[Picture | None] = []
    failures, files, stored, seconds = [], 0, 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.exr"
        for group in groups:
            start = time.perf_counter()
            try:
                made = form.make(probe, group, tolerance)
                duration = time.perf_counter() - start
                write_map(path, made)
                found = read_map(path)
            except ShrmError as reason:
                where = f"roughness {group[0].number('roughness'):.3g}: " if form.is_of_one else ""
                failures.append(where + str(reason).removeprefix(f"{path}: "))
                pictures += [None] * len(group)
                continue
            seconds += duration
            files, stored = files + 1, stored + path.stat().st_size
            pictures += [_draw(shade(found, each), viewers, truth.shape[-2]) for each in group]
    errors = tuple(
        None if found is None else measure(found, expected).relative_rmse
        for found, expected in zip(pictures, truth, strict=True)
    )
    whole = [found for found in pictures if found is not None]
    error = measure(np.stack(whole), truth).relative_rmse if len(whole) == len(truth) else None
    return FormResult(form, files, stored, seconds, errors, error, tuple(failures), tuple(pictures))


def _draw(reflection_map: ReflectionMap, viewers: Sequence[Viewer], size: int) -> Picture:
    return np.stack([render_sphere(reflection_map, each, size) for each in viewers])
