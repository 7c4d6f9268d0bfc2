"""How the directions of a probe are laid out in its image."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import ProbeError
from shrm_cli.sphere.cube import FACES, reorient
from shrm_cli.vocabulary import Orientation

Array = NDArray[np.floating]
Layout = Literal["latlong", "openexr", "strip", "hcross", "vcross", "faces", "angular"]

LAYOUTS: tuple[str, ...] = get_args(Layout)

# Where each face of `FACES` lies in a layout: (column, row), in faces, and whether it is turned
# by half a turn there.
_PLACES: dict[str, tuple[tuple[int, int, bool], ...]] = {
    "openexr": tuple((0, k, False) for k in range(6)),
    "strip": tuple((k, 0, False) for k in range(6)),
    #       +Y                          +Y
    #    -X +Z +X -Z                 -X +Z +X
    #       -Y                          -Y
    #                                   -Z   (upside down)
    "hcross": ((2, 1, False), (0, 1, False), (1, 0, False), (1, 2, False), (1, 1, False),
               (3, 1, False)),
    "vcross": ((2, 1, False), (0, 1, False), (1, 0, False), (1, 2, False), (1, 1, False),
               (1, 3, True)),
}  # fmt: skip
_SHAPES = {"openexr": (1, 6), "strip": (6, 1), "hcross": (4, 3), "vcross": (3, 4)}


def detect_layout(name: str, width: int, height: int, envmap: str) -> Layout:
    """Layout of an image, from its `envmap` attribute, else from its aspect ratio.

    Raises
    ------
    ProbeError
        If they do not tell.
    """
    if envmap == "cube":
        return "openexr"
    if envmap == "latlong" or width == 2 * height:
        return "latlong"
    for layout, (columns, rows) in _SHAPES.items():
        if width * rows == height * columns:
            return layout  # type: ignore[return-value]
    if width == height:
        raise ProbeError(
            f"{name}: a square image may be many things; give --layout angular for a light-probe "
            "ball"
        )
    raise ProbeError(
        f"{name}: {width} x {height} is no known layout (2:1 lat-long, 1:6 or 6:1 cube, 4:3 or "
        "3:4 cross); give --layout"
    )


def check_shape(name: str, layout: Layout, width: int, height: int) -> None:
    """Check that an image's size suits its layout.

    Raises
    ------
    ProbeError
    """
    if layout == "latlong":
        good, wanted = width == 2 * height, "width = 2 x height"
    elif layout in ("angular", "faces"):
        good, wanted = width == height, "a square image"
    else:
        columns, rows = _SHAPES[layout]
        good = width % columns == 0 and height % rows == 0 and width * rows == height * columns
        wanted = f"{columns} x {rows} square faces"
    if not good:
        raise ProbeError(
            f"{name}: {width} x {height} cannot be {layout}, which is {wanted}; give the --layout "
            "that it has, or crop it"
        )
    if height < {"angular": 3, "latlong": 2}.get(layout, 1):  # faces may be single texels
        raise ProbeError(
            f"{name}: {width} x {height} is too small to hold a {layout} probe; use a larger one"
        )


def default_orientation(layout: Layout, file_format: str) -> Orientation:
    """OpenEXR's own for the stacked layout, that of graphics APIs for the others and for DDS."""
    return "openexr" if layout == "openexr" and file_format != "dds" else "gl"


def clear_unused(image: Array, layout: Layout) -> None:
    """Set to 0, in place, the corners of a cross: whatever they hold, it is no radiance."""
    if layout not in ("hcross", "vcross"):
        return
    columns, rows = _SHAPES[layout]
    size = image.shape[1] // columns
    used = {place[:2] for place in _PLACES[layout]}
    for row in range(rows):
        for column in range(columns):
            if (column, row) not in used:
                image[row * size : (row + 1) * size, column * size : (column + 1) * size] = 0


def stack_faces(image: Array, layout: Layout, orientation: Orientation) -> Array:
    """Any cube layout as a stacked cube of OpenEXR's orientation.

    Parameters
    ----------
    image : ndarray, shape (H, W, channels)
        Of a cube layout; for ``"faces"``, the six files stacked.

    Returns
    -------
    ndarray, shape (6N, N, channels)
    """
    place = "openexr" if layout == "faces" else layout
    columns, _ = _SHAPES[place]
    size = image.shape[1] // columns
    faces = np.empty((len(FACES), size, size, image.shape[2]), dtype=image.dtype)
    for face, (column, row, turned) in enumerate(_PLACES[place]):
        part = image[row * size : (row + 1) * size, column * size : (column + 1) * size]
        faces[face] = part[::-1, ::-1] if turned else part
    return reorient(faces, orientation).reshape(6 * size, size, -1)


def arrange_faces(stack: Array, layout: Layout, orientation: Orientation) -> Array:
    """A stacked cube of OpenEXR's orientation in any cube layout: the inverse of `stack_faces`.

    Parameters
    ----------
    stack : ndarray, shape (6N, N, channels)
    layout : Layout
        Of a cube; ``"faces"`` gives the six files stacked.
    orientation : {"openexr", "gl"}
        Of the faces in the result.

    Returns
    -------
    ndarray, shape (rows * N, columns * N, channels)
        The corners of a cross are 0.
    """
    place = "openexr" if layout == "faces" else layout
    columns, rows = _SHAPES[place]
    size = stack.shape[1]
    # Between the two orientations faces are only flipped: the way back is the way there.
    faces = reorient(stack.reshape(len(FACES), size, size, -1), orientation)
    image = np.zeros((rows * size, columns * size, faces.shape[-1]), dtype=stack.dtype)
    for face, (column, row, turned) in enumerate(_PLACES[place]):
        part = faces[face, ::-1, ::-1] if turned else faces[face]
        image[row * size : (row + 1) * size, column * size : (column + 1) * size] = part
    return image
