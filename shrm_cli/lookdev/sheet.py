"""`lookdev`: a sheet with a row for each material and a column for each probe."""

from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter
from typing import Any

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.files.picture import Picture
from shrm_cli.lookdev.columns import Column, Wanted, make_column
from shrm_cli.lookdev.page import lookdev_page, material_names, probe_names
from shrm_cli.maps.request import check_arguments
from shrm_cli.probe.options import ReadOptions
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sheet import Grid, draw_grid
from shrm_cli.vocabulary import AUTO


@record(eq=False)
class Lookdev:
    """Materials under probes."""

    columns: tuple[Column, ...]
    """The probes with the maps of all materials."""
    specs: tuple[str, ...]
    """The materials."""
    to: str
    arguments: Mapping[str, Any]
    """The other arguments that they were made with."""
    size: int

    @property
    def grid(self) -> Grid:
        """The cells of the sheet."""
        return Grid(len(self.specs), len(self.columns), self.size)

    @property
    def names(self) -> list[str]:
        """Short names of the probes."""
        return probe_names([each.path for each in self.columns])

    @property
    def sides(self) -> list[str]:
        """Short names of the materials."""
        return material_names(self.specs)

    @property
    def failures(self) -> list[str]:
        """A line for each cell without a map, which says why."""
        return [
            f"{column.path}, {spec}: {cell.removeprefix(f'{column.path}: ')}"
            for column in self.columns
            for spec, cell in zip(self.specs, column.cells, strict=True)
            if isinstance(cell, str)
        ]

    def sheets(
        self, viewers: Sequence[Viewer], progress: Progress | None = None
    ) -> Iterator[Picture]:
        """Yield the sheet for each viewer, linear Rec.709."""
        heads = [
            name if column.surroundings is None else f"{name}  EV {column.exposure:+.1f}"
            for column, name in zip(self.columns, self.names, strict=True)
        ]
        stages, begun = Stages(progress, len(viewers)), perf_counter()
        for done, viewer in enumerate(viewers, 1):
            yield draw_grid(self.grid, heads, self.sides, self._tiles(viewer, stages.within))
            stages.done(done, len(viewers))
            if done == 1:
                stages.tell_time_left((perf_counter() - begun) * (len(viewers) - 1))

    def page(self, viewer: Viewer, progress: Progress | None = None) -> str:
        """Return the sheet as a page of HTML with a slider for each column, to be UTF-8."""
        cells: list[list[Picture | str]] = [[] for _ in self.columns]
        for _, index, tile in self._tiles(viewer, progress):
            cells[index].append(tile)
        return lookdev_page(self.columns, self.names, self.sides, cells, self.size)

    def _tiles(
        self, viewer: Viewer, progress: Progress | None
    ) -> Iterator[tuple[int, int, Picture | str]]:
        """Yield row, column and picture of each cell, or why it has none."""
        for index, column in enumerate(self.columns):
            for row, tile in enumerate(column.tiles(viewer, self.size)):
                yield row, index, tile
            if progress is not None:
                progress(index + 1, len(self.columns))


def lookdev(
    probes: Sequence[str],
    brdfs: Sequence[str],
    to: str = AUTO,
    *,
    size: int = 256,
    exposure: float | None = None,
    reading: ReadOptions | None = None,
    progress: Progress | None = None,
    **arguments: Any,
) -> Lookdev:
    """Make the maps of materials under probes, to be drawn as one sheet.

    What goes wrong with one pair leaves the others alone; its cell says why.

    Parameters
    ----------
    probes : sequence of str
        Paths of light probes.
    brdfs : sequence of str
        The materials, as specifications.
    to : str
        The representation of the maps, one that is made for a BRDF, or ``auto``: what the picture
        needs, with lamps beside the map where nothing else gives the right picture.
    size : int
        Width and height of a cell, pixels.
    exposure : float, optional
        Stops; by default each probe has its own, see `shrm_cli.lookdev.columns`.
    reading : ReadOptions, optional
        How the probes are read.
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **arguments
        Other arguments of `prefilter`.

    Returns
    -------
    Lookdev

    Raises
    ------
    ArgumentError, BrdfError
        If an argument or a material is wrong for all probes.
    OutputError
        If the sheet would be too large.

    Examples
    --------
    >>> made = shrm.lookdev(["probes/studio.exr"], ["lambertian"], size=32)
    >>> made.sides, made.failures
    (['lambertian'], [])
    >>> [picture.shape[2] for picture in made.sheets([shrm.Viewer(30, 10)])]
    [3]
    """
    check_arguments(to, [*arguments, "brdf"])
    for spec in brdfs:
        parse_spec(spec)  # what is wrong with a material is said before the work begins
    Grid(len(brdfs), len(probes), size).check()
    wanted = Wanted(brdfs, to, arguments, size, exposure)
    columns: list[Column] = []
    stages = Stages(progress, len(probes))
    for path in probes:
        columns.append(make_column(path, reading or ReadOptions(), wanted, stages.within))
        stages.done(len(columns), len(probes))
    return Lookdev(tuple(columns), tuple(brdfs), to, arguments, size)
