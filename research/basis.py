"""Figure 4.3: each harmonic of the light alone on a sphere and on a mesh.

It is one of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward and
Inverse Rendering" (2002). The armadillo is not at hand.
"""

from pathlib import Path

import numpy as np

from shrm_cli.files.image import write_picture
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.render.basis import basis_maps, basis_names, basis_subject
from shrm_cli.render.camera import Viewer
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import Grid, draw_grid

_ORDER, _STOPS, _TILE = 2, 1.0, 120


def figure_4_3(mesh: Mesh, folder: Path) -> str:
    """Write the picture, and return the part of the page."""
    viewer, tiles = Viewer(20, 10), []
    for row, shape in enumerate((None, mesh)):
        subject, materials = basis_subject(basis_maps(_ORDER), shape, None, _TILE, viewer)
        for column, each in enumerate(materials):
            drawn = np.maximum(subject.draw(each, viewer, None, None), 0)
            tiles.append((row, column, expose(drawn, _STOPS)))
    names = basis_names(_ORDER)
    picture = draw_grid(Grid(2, len(names), _TILE), names, ["sphere", mesh.name], tiles)
    write_picture(folder / "figure-4.3.png", picture)
    return f"""
## Figure 4.3: the basis functions of irradiance

Green is positive, blue negative; by degree and order. {mesh.name} takes the place of the
armadillo. `shrm light basis MESH` draws them.

![each harmonic of the light on a sphere and on a mesh](figure-4.3.png)
"""
