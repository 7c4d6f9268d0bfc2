"""Everything that pictures of one command share, and the picture for one viewer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from shrm_cli.files.picture import Picture
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
        One for each map.
    size : int
        Width and height of a sphere's picture, pixels.
    exposure : float
        Stops, the same for all.
    surroundings : Surroundings, optional
        What is behind the spheres.
    columns : int, optional
        Of a sheet.
    """

    maps: Sequence[ReflectionMap]
    labels: Sequence[str]
    size: int
    exposure: float = 0.0
    surroundings: Surroundings | None = None
    columns: int | None = None

    @cached_property
    def layout(self) -> SheetLayout | None:
        """Of the sheet; None for a single map."""
        if len(self.maps) == 1:
            return None
        return arrange(len(self.maps), self.size, self.columns)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return (self.size, self.size) if self.layout is None else self.layout.shape

    def picture(self, viewer: Viewer, progress: Callable[[int], object] | None = None) -> Picture:
        """What the viewer sees.

        Parameters
        ----------
        viewer : Viewer
        progress : callable, optional
            Called with the rows done since the last call, `size` in all for each map.

        Returns
        -------
        ndarray of float32, shape (*shape, 3)
            Linear and exposed; the paper and the labels of a sheet are not.

        Raises
        ------
        OutputError
            If a sheet would be too large.
        """
        layout = self.layout
        behind = None
        if self.surroundings is not None:
            behind = render_background(self.surroundings, viewer, self.size)
        tiles = [
            expose(render_sphere(each, viewer, self.size, behind, progress), self.exposure)
            for each in self.maps
        ]
        return tiles[0] if layout is None else draw_sheet(layout, tiles, self.labels)
