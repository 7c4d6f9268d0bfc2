"""What pictures are drawn of: a sphere or a mesh, in several materials, at each moment.

A `Scene` is everything that the pictures of one command share, and how one of them is drawn.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.files.image import Picture
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import MapInfo
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.render.boxed import Placed, outside
from shrm_cli.render.camera import DEFAULT_FOV, Lens, Viewer, aimed, background_rows, whole_coverage
from shrm_cli.render.image import expose
from shrm_cli.render.lit import in_same_primaries, one_of, shaded_maps
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.moving import Moment
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import Reflecting, Surroundings, render_background, render_sphere
from shrm_cli.render.stage import Stage


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

    def covers(self, viewer: Viewer) -> NDArray[np.bool_]:
        """Return which pixels show nothing but the sphere, which looks alike to all viewers."""
        return whole_coverage(self.size) == 1

    def draw(
        self, material: Reflecting, viewer: Viewer, background: Picture | None, progress: Progress
    ) -> Picture:
        """Draw the sphere; see `render_sphere`."""
        return render_sphere(material, viewer, self.size, background, progress)


@record
class Scene:
    """One subject of one material, or a sheet of it in several."""

    subject: SphereSubject | MeshSubject
    materials: Sequence[Any]
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

        Returns an array of float32 of shape (*shape, 3): linear.
        """
        return self.put_together(self.tiles(viewer, progress))

    def tiles(self, viewer: Viewer, progress: Progress | None = None) -> list[Picture]:
        """Draw the subject in each material, not exposed.

        Where few harmonics are negative, beside lamps, it is black, as no light is less than none.
        """
        _ = self.layout  # which refuses a sheet that is too large, before anything is drawn
        behind = None
        if self.surroundings is not None:
            behind = self.subject.background(self.surroundings, viewer)
        tiles = []
        stages = Stages(progress, len(self.materials))
        for index, each in enumerate(self.materials):
            drawn = self.subject.draw(each, viewer, behind, stages.within)
            tiles.append(np.maximum(drawn, 0).astype(np.float32, copy=False))
            stages.done(index + 1, len(self.materials))
        return tiles

    def put_together(self, tiles: Sequence[Picture]) -> Picture:
        """Expose the tiles, which one picture is of; the paper and labels of a sheet are not."""
        exposed = [expose(each, self.exposure) for each in tiles]
        layout = self.layout
        return exposed[0] if layout is None else draw_sheet(layout, exposed, self.labels)


@record(eq=False)
class Lit:
    """Maps of the light at rest, and of the light that it becomes, with their files' names."""

    maps: Sequence[Map]
    names: Sequence[str]
    others: Sequence[Map]
    """`maps` and `others`: there are no others where the light becomes no other."""
    other_names: Sequence[str]


@record(eq=False)
class Drawing:
    """Something to draw, in several materials."""

    subject: Any
    drawn: list[Any]
    """Its materials under the light at rest."""
    become: list[Any] | None
    """Its materials under the light that it becomes."""
    seen: list[MapInfo]
    """How the maps were made, in the primaries of the picture."""
    primaries: tuple[float, ...] | None
    """The primaries of the picture."""
    rows: int
    """The rows of a lat-long that is fine enough to be its background."""
    said: dict[str, Any]
    """What results and recipes say of it."""
    warnings: list[str]
    recolored: bool = False
    """Whether materials are maps, which may have other primaries."""

    def at(self, moment: Moment) -> list[Any]:
        """Return the materials under the light of a moment."""
        lit: list[Any] = moment.moved(self.drawn, self.become)
        return in_same_primaries(lit, self.primaries) if self.recolored else lit


@record(eq=False)
class Film:
    """Pictures of something at some moments, before the same surroundings."""

    drawing: Drawing
    moments: Sequence[Moment]
    labels: Sequence[str]
    """One for each material, for sheets."""
    exposure: float = 0.0
    """Stops."""
    skies: tuple[Probe | None, Probe | None] = (None, None)
    """What is behind, and what that becomes."""
    columns: int | None = None
    """The columns of a sheet."""

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of each picture, pixels."""
        return self._first.shape

    def pictures(self, progress: Progress | None = None) -> Iterator[Picture]:
        """Draw the pictures, linear, in the primaries of the drawing."""
        return map(self.put_together, self.tiles(progress))

    def tiles(self, progress: Progress | None = None) -> Iterator[list[Picture]]:
        """Draw what `put_together` makes a picture of, for each moment; see `Scene.tiles`."""
        drawing = self.drawing
        behind, becomes = (
            None if sky is None else coarse_probe(sky.in_primaries(drawing.primaries), drawing.rows)
            for sky in self.skies
        )
        stages = Stages(progress, len(self.moments))
        for number, each in enumerate(self.moments, 1):
            around = None if behind is None else each.behind(behind, becomes)
            yield self._scene(each, around).tiles(each.viewer, stages.within)
            stages.done(number, len(self.moments))

    def put_together(self, tiles: Sequence[Picture]) -> Picture:
        """Expose the tiles of a moment, and make one picture of them."""
        return self._first.put_together(tiles)

    def parts(self, picture: Picture) -> list[tuple[str, Picture]]:
        """Return each material's label and what a picture shows of it; of one it has no label."""
        layout = self._first.layout
        if layout is None:
            return [("", picture)]
        return list(zip(self.labels, layout.cut(picture), strict=True))

    def of_subject(self, picture: Picture) -> Picture:
        """Return the pixels of a material in the first picture, shape (n, 3), or (H, W, 3).

        What is behind is left out, where anything is: it says nothing about an exposure.
        """
        return picture if self._covered is None else picture[self._covered]

    @cached_property
    def _covered(self) -> NDArray[np.bool_] | None:
        """Which pixels of the first picture show the subject; None where nothing is behind it."""
        if self.skies[0] is None:
            return None
        covered: NDArray[np.bool_] = self.drawing.subject.covers(self.moments[0].viewer)
        return covered

    @cached_property
    def _first(self) -> Scene:
        """The scene of the first moment without what is behind."""
        return self._scene(self.moments[0], None)

    def _scene(self, moment: Moment, around: Any) -> Scene:
        drawing = self.drawing
        return Scene(
            drawing.subject, drawing.at(moment), self.labels, self.exposure, around, self.columns
        )


def on_sphere(lit: Lit, size: int, values: Mapping[str, Any]) -> Drawing:
    """Return a sphere that is drawn.

    `values` are ``roughness``, ``f0``, ``anisotropy`` and ``taps``, as `shaded_maps` takes them;
    and ``place`` and ``radius``, where the sphere is within the boxes of its maps.
    """
    asked = [values[name] for name in ("roughness", "f0", "anisotropy", "taps")]
    drawn, surface, warnings = shaded_maps(lit.maps, lit.names, *asked)
    place, radius = values["place"], values["radius"]
    if place is not None:
        pairs = zip(lit.maps, drawn, lit.names, strict=True)
        placed = [Placed.of(*each, place, radius) for each in pairs]
        surface |= {"place": list(place), "radius": placed[0].radius}
        reach = np.array([place]) + placed[0].radius * np.vstack([np.eye(3), -np.eye(3)])
        warnings = warnings + outside(lit.maps, lit.names, reach)
        drawn = [*placed]
    become: list[Any] | None = None
    if lit.others:
        become, _, more = shaded_maps(lit.others, lit.other_names, *asked)
        warnings = warnings + more
    primaries = lit.maps[0].info.chromaticities
    seen = [each.info for each in in_same_primaries(drawn, primaries)]
    return Drawing(
        SphereSubject(size), list(drawn), become, seen, primaries, background_rows(size),
        {"size": size, **surface}, warnings, True,
    )  # fmt: skip


def on_stage(
    lit: Lit,
    stage: Stage,
    size: tuple[int, int],
    moments: Sequence[Moment],
    values: Mapping[str, Any],
    drawn: tuple[list[Any], list[Any]] | None = None,
) -> Drawing:
    """Return a mesh or a scene that is drawn, seen by the viewers of all moments.

    `values` are ``fov``, ``target`` and ``distance`` of the camera, None for the defaults; and
    ``no_box``, whether the boxes of maps are left out. `drawn` is its materials under the maps and
    under the others, where these are not those of the stage under each: with their own shadows, or
    beside other light that moves.
    """
    lens = Lens(*size, DEFAULT_FOV if values["fov"] is None else values["fov"])
    viewers = [each.viewer for each in moments]
    aim = aimed(stage.mesh.vertices, viewers, lens, values["target"], values["distance"])
    subject = MeshSubject(stage, lens, aim, not values["no_box"])
    seen = [each.info for each in (*lit.maps, *stage.maps())]
    warnings: list[str] = []
    if drawn is None:
        first = [stage.reflectors(each) for each in lit.maps] or [stage.reflectors(None)]
        drawn = first, [stage.reflectors(each) for each in lit.others]
        if not values["no_box"]:
            turns = any(each.turn is not None for each in moments)
            told = stage.boxes_left_out if turns else stage.outside_boxes
            warnings = told(lit.maps, lit.names)
    return Drawing(
        subject, drawn[0], drawn[1] or None, seen, one_of({each.chromaticities for each in seen}),
        subject.lens.background_rows(), {"size": list(size)}, warnings,
    )  # fmt: skip
