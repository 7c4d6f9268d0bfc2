"""The layouts of the sphere in an image: their names, and where a cube has its faces.

This module imports neither numpy nor anything else that takes time, so that ``shrm --help`` may
list the names. A new arrangement of a cube's faces is one row of `CUBES`; a new grid is one module
of `shrm_cli.sphere.grid` and one row of `GRIDS`.
"""

from shrm_cli.records import record
from shrm_cli.vocabulary import Orientation

Layout = str
"""A name out of `LAYOUTS`."""

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
"""The faces of a cube, in the order in which OpenEXR stacks them."""

GRIDS = {
    "latlong": "shrm_cli.sphere.grid.latlong:LatLong",
    "cube": "shrm_cli.sphere.grid.cube:Cube",
    "angular": "shrm_cli.sphere.grid.angular:Angular",
}
"""The grids by their names, and the module and class of each, imported when it is used."""


@record
class CubeArrangement:
    """Where the faces of a cube lie in an image.

    Attributes
    ----------
    columns, rows : int
        The size of the image, in faces.
    places : tuple of (int, int, bool)
        For each face of `FACES`: the column and the row where it lies, and whether it is turned
        by half a turn there.
    orientation : {"openexr", "gl"}
        How the faces are turned in a file that does not tell.
    in_six_files : bool
        Whether each face is a file of its own. The arrangement is then that of the six images
        together.
    """

    columns: int
    rows: int
    places: tuple[tuple[int, int, bool], ...]
    orientation: Orientation
    in_six_files: bool

    @classmethod
    def drawn(
        cls, *lines: str, orientation: Orientation = "gl", in_six_files: bool = False
    ) -> "CubeArrangement":
        """Make an arrangement from a picture of it.

        Parameters
        ----------
        *lines : str
            A line for each row, with the names of its faces. A dot stands for an unused cell, and
            a name in small letters for a face that is turned by half a turn.
        orientation, in_six_files
            The attributes of the same names.
        """
        cells = [line.split() for line in lines]
        found = {
            cell.upper(): (column, row, cell.islower())
            for row, names in enumerate(cells)
            for column, cell in enumerate(names)
            if cell != "."
        }
        if found.keys() != set(FACES) or len({len(names) for names in cells}) != 1:
            raise ValueError(f"{lines} does not show each face of a cube in a rectangle")
        places = tuple(found[face] for face in FACES)
        return cls(len(cells[0]), len(cells), places, orientation, in_six_files)

    @property
    def is_cross(self) -> bool:
        """Whether some cells of the image hold no face."""
        return self.columns * self.rows > len(FACES)

    def unused(self) -> list[tuple[int, int]]:
        """Column and row of each cell that holds no face."""
        used = {place[:2] for place in self.places}
        cells = [(column, row) for row in range(self.rows) for column in range(self.columns)]
        return [cell for cell in cells if cell not in used]

    def face_size(self, width: int, height: int) -> int | None:
        """Texels along a face's edge in an image of this size; None if it cannot be one."""
        size = width // self.columns
        return size if size and (width, height) == (self.columns * size, self.rows * size) else None


CUBES = {
    "openexr": CubeArrangement.drawn("+X", "-X", "+Y", "-Y", "+Z", "-Z", orientation="openexr"),
    "strip": CubeArrangement.drawn("+X -X +Y -Y +Z -Z"),
    "hcross": CubeArrangement.drawn(
        " .  +Y  .  . ",
        "-X  +Z +X -Z ",
        " .  -Y  .  . ",
    ),
    "vcross": CubeArrangement.drawn(
        " .  +Y  . ",
        "-X  +Z +X ",
        " .  -Y  . ",
        " .  -z  . ",
    ),
    "faces": CubeArrangement.drawn("+X", "-X", "+Y", "-Y", "+Z", "-Z", in_six_files=True),
}  # fmt: skip
"""The arrangements of a cube by their names, in the order in which users see them."""


def _image_layouts() -> tuple[Layout, ...]:
    cubes = [name for name, cube in CUBES.items() if not cube.in_six_files]
    return tuple(name for grid in GRIDS for name in (cubes if grid == "cube" else [grid]))


IMAGE_LAYOUTS: tuple[Layout, ...] = _image_layouts()
"""The layouts that are one image."""

LAYOUTS: tuple[Layout, ...] = (
    *IMAGE_LAYOUTS,
    *(name for name, cube in CUBES.items() if cube.in_six_files),
)
"""Every layout."""


def grid_name(layout: Layout) -> str:
    """The name of the grid, out of `GRIDS`, whose pixels a layout arranges."""
    return "cube" if layout in CUBES else layout


def default_orientation(layout: Layout) -> Orientation:
    """How the faces of a layout are turned where nothing tells.

    It is ``openexr`` for the stacked cube, which OpenEXR defines, and the orientation of graphics
    APIs for the others. A layout without faces has ``openexr``, as has all that is written.
    """
    return CUBES[layout].orientation if layout in CUBES else "openexr"
