"""A scene: everything that the pictures of one command share, and how one of them is drawn."""

from collections.abc import Sequence
from functools import cached_property
from typing import Generic, Protocol, TypeVar

from shrm_cli.files.image import Picture
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import Reflecting, Surroundings, render_background, render_sphere

Material = TypeVar("Material")
_Drawn = TypeVar("_Drawn", contravariant=True)


class Subject(Protocol[_Drawn]):
    """What is drawn: a shape, for each of its materials."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture, pixels."""

    def background(self, surroundings: Surroundings, viewer: Viewer) -> Picture:
        """Draw what is behind the subject, shape (*shape, 3), linear."""

    def draw(
        self,
        material: _Drawn,
        viewer: Viewer,
        background: Picture | None,
        progress: Progress | None,
    ) -> Picture:
        """Draw the subject of a material before a background, shape (*shape, 3), linear."""


@record
class SphereSubject:
    """A sphere in a square picture of some width in pixels; its material is a map."""

    size: int

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of a picture, pixels."""
        return self.size, self.size

    def background(self, surroundings: Surroundings, viewer: Viewer) -> Picture:
        """Draw what is behind the sphere; see `render_background`."""
        return render_background(surroundings, viewer, self.size)

    def draw(
        self,
        material: Reflecting,
        viewer: Viewer,
        background: Picture | None,
        progress: Progress | None,
    ) -> Picture:
        """Draw the sphere; see `render_sphere`."""
        return render_sphere(material, viewer, self.size, background, progress)


@record
class Scene(Generic[Material]):
    """One subject of one material, or a sheet of it in several."""

    subject: Subject[Material]
    materials: Sequence[Material]
    """What the subject takes, such as maps."""
    labels: Sequence[str]
    """A label for each material."""
    exposure: float = 0.0
    """Stops, the same for all materials."""
    surroundings: Surroundings | None = None
    """The probe behind the subject; by default it stands on black."""
    columns: int | None = None
    """Columns of a sheet; by default it is as square as possible."""

    @cached_property
    def layout(self) -> SheetLayout | None:
        """Layout of the sheet; None for a single material."""
        if len(self.materials) == 1:
            return None
        height, width = self.subject.shape
        return arrange(len(self.materials), width, self.columns, height)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the picture, pixels."""
        return self.subject.shape if self.layout is None else self.layout.shape

    def picture(self, viewer: Viewer, progress: Progress | None = None) -> Picture:
        """Draw the picture that the viewer sees.

        Returns an array of float32 of shape (*shape, 3): linear. The subjects are exposed; the
        paper and the labels of a sheet are not.
        """
        layout = self.layout
        behind = None
        if self.surroundings is not None:
            behind = self.subject.background(self.surroundings, viewer)
        tiles = []
        stages = Stages(progress, len(self.materials))
        for index, each in enumerate(self.materials):
            drawn = self.subject.draw(each, viewer, behind, stages.within)
            tiles.append(expose(drawn, self.exposure))
            stages.done(index + 1, len(self.materials))
        return tiles[0] if layout is None else draw_sheet(layout, tiles, self.labels)
