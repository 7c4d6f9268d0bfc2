"""Figure 4.1: a scene of diffuse things, one of which is glossy and textured, and a mirror.

It is one of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward and
Inverse Rendering" (2002).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.product.scenes import exposure, surface
from shrm_cli.files.image import write_picture
from shrm_cli.geometry.mesh import Mesh, SurfaceMaterial, make_mesh
from shrm_cli.maps.base import Map
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Lens, Viewer, aimed
from shrm_cli.render.image import expose
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.scene_file import Shown
from shrm_cli.render.stage import Actor, Stage, transformation

Array = NDArray[np.floating]

_NINE, _ALL = 2, 40
"""Degrees of the irradiance: that of the thesis, and one beyond which there is no light left."""
_VIEWER = Viewer(0, 12)
_MIRROR = SurfaceMaterial("mirror", metallic=1.0, roughness=0.05)
_POOL = SurfaceMaterial("pool ball", metallic=0.0, roughness=0.15, colored="linear")


def figure_4_1(probe: Probe, mesh: Mesh, folder: Path, extent: Extent) -> tuple[str, float, float]:
    """Draw the scene with the irradiance of nine coefficients, and below it with all of it.

    Returns
    -------
    str
        The file's name.
    float
        The relative RMS difference where diffuse things are seen.
    float
        The largest difference there, as a part of the mean.
    """
    lens = Lens(2 * extent.product_picture, extent.product_picture)
    split = prefilter(probe, to="splitsum")
    pictures = []
    for order in (_NINE, _ALL):
        white = prefilter(probe, to="irradiance", order_f=order, window="none")
        stage = Stage.of(_actors(mesh, white, split))
        aim = aimed(stage.mesh.vertices, [_VIEWER], lens)
        subject = MeshSubject(stage, lens, aim)
        behind = subject.background(probe, _VIEWER)
        pictures.append(subject.draw(stage.reflectors(None), _VIEWER, behind))
    # Mirrors and the background are the same in both.
    is_diffuse = (pictures[0] != pictures[1]).any(axis=-1)
    nine, whole = (each[is_diffuse].astype(float) for each in pictures)
    error = float(np.sqrt(np.mean((nine - whole) ** 2) / np.mean(whole**2)))
    largest = float(np.abs(nine - whole).max() / whole.mean())
    shown = np.concatenate([expose(each, exposure([whole])) for each in pictures])
    write_picture(folder / "figure-4.1.png", shown)
    return "figure-4.1.png", error, largest


def _actors(mesh: Mesh, white: Map, split: Map) -> list[Actor]:
    """Return the mirror, the white ball, the mesh, the pool ball, and the table below them."""
    size = np.subtract(*mesh.bounds[::-1])
    scale = 1.8 / size.max()
    middle = (mesh.bounds[0] + mesh.bounds[1]) / 2
    shift = np.array([0.5, 0, -0.8]) - scale * (middle - [0, size[1] / 2, 0]) - [0, 1, 0]
    diffuse, glossy = Shown(map=white), Shown(map=split, irradiance=white)
    things = [
        (glossy, replace(_ball(), materials=(_MIRROR,)), (-2.3, 0, 0), 1.0),
        (diffuse, _ball(), (-0.7, -0.4, 0.6), 0.6),
        (diffuse, replace(mesh, colors=None, materials=()), tuple(shift), scale),
        (glossy, replace(_striped(_ball()), materials=(_POOL,)), (2.3, 0, 0), 1.0),
        (diffuse, _table(), (0, -1, 0), 1.0),
    ]
    primaries = white.info.chromaticities
    return [
        shown.actor(each.transformed(transformation(place, scale=factor)), primaries)
        for shown, each, place, factor in things
    ]


def _ball() -> Mesh:
    """Make a sphere of the radius 1, whose triangles are all of one material."""

    def place(down: Array, around: Array) -> Array:
        flat = np.sin(down)
        return np.stack([flat * np.sin(around), np.cos(down), flat * np.cos(around)], axis=-1)

    turn = np.linspace(0, 2 * np.pi, 129)
    made = surface("ball", place, np.linspace(np.pi - 1e-3, 1e-3, 64), turn)
    return replace(made, normals=made.vertices, face_materials=np.zeros(len(made.faces), np.int64))


def _striped(ball: Mesh) -> Mesh:
    """Paint a ball as the one with a red stripe."""
    is_stripe = np.abs(ball.vertices[:, 1:2]) < 0.5
    return replace(ball, colors=np.where(is_stripe, [[0.6, 0.03, 0.02]], [[0.85, 0.85, 0.8]]))


def _table() -> Mesh:
    corners = np.array([[-4, 0, -3], [4, 0, -3], [4, 0, 2], [-4, 0, 2]], float)
    return make_mesh("table", corners, [[0, 2, 1], [0, 3, 2]])
