"""A scene: everything that the pictures of one command share, and how one of them is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from shrm_cli.files.picture import Picture
from shrm_cli.progress import Progress, Stages
from shrm_cli.render.camera import Viewer
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import ReflectionMap, Surroundings, render_background, render_sphere


@dataclass(frozen=True)
class Scene:
    """One sphere, or a sheet of several.

    Attributes
    ----------
    maps : sequence of ReflectionMap
    labels : sequence of str
        A label for each map.
    size : int
        Width and height of a sphere's picture, pixels.
    exposure : float
        Stops, the same for all maps.
    surroundings : Surroundings, optional
        The probe behind the spheres; by default they stand on black.
    columns : int, optional
        Columns of a sheet; by default it is as square as possible.
    """

    maps: Sequence[ReflectionMap]
    labels: Sequence[str]
    size: int
    exposure: float = 0.0
    surroundings: Surroundings | None = None
    columns: int | None = None

    @cached_property
    def layout(self) -> SheetLayout | None:
        """Layout of the sheet; None for a single map."""
        if len(self.maps) == 1:
            return None
        return arrange(len(self.maps), self.size, self.columns)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return (self.size, self.size) if self.layout is None else self.layout.shape

    def picture(self, viewer: Viewer, progress: Progress | None = None) -> Picture:
        """Draw the picture that the viewer sees.

        Parameters
        ----------
        viewer : Viewer
        progress : callable, optional
            Called with the amount done and the amount in all.

        Returns
        -------
        ndarray of float32, shape (*shape, 3)
            Linear. The spheres are exposed; the paper and the labels of a sheet are not.

        Raises
        ------
        OutputError
            If a sheet would be too large, or its labels cannot be drawn.
        """
        layout = self.layout
        behind = None
        if self.surroundings is not None:
            behind = render_background(self.surroundings, viewer, self.size)
        tiles = []
        stages = Stages(progress, len(self.maps))
        for index, each in enumerate(self.maps):
            sphere = render_sphere(each, viewer, self.size, behind, stages.within)
            tiles.append(expose(sphere, self.exposure))
            stages.done(index + 1, len(self.maps))
        return tiles[0] if layout is None else draw_sheet(layout, tiles, self.labels)
