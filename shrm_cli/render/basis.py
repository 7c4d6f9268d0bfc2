"""What each harmonic of the light alone does to an object: figure 4.3 of Ramamoorthi's thesis."""

from dataclasses import replace
from typing import Any

import numpy as np

from shrm_cli.geometry.mesh import Mesh
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.messages import whole_number
from shrm_cli.render.camera import DEFAULT_FOV, Lens, Viewer, aimed
from shrm_cli.render.drawing import SphereSubject
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.stage import Actor, Look, Stage
from shrm_cli.render.vertex_colors import vertex_colors
from shrm_cli.transfer.transfer import Transfer

_GREEN, _BLUE = 1, 2
_MOST = 32
"""The largest degree."""


def basis_names(order: int) -> list[str]:
    """Return degree and order of all harmonics, such as ``1,-1``."""
    return [f"{degree},{m}" for degree in range(order + 1) for m in range(-degree, degree + 1)]


def basis_maps(order: int) -> list[Irradiance]:
    """Return irradiance of light of each harmonic alone: green of it, and blue of its negative.

    So the green of a picture is what is positive, and the blue what is negative, once it is cut off
    at 0.

    Examples
    --------
    >>> len(shrm.basis_maps(2))
    9
    """
    count = (whole_number("order", order, 0, _MOST) + 1) ** 2
    info = MapInfo(order, 0, 0.0, 1.0, 0.0)
    found = []
    for index in range(count):
        light = np.zeros((count, 3))
        light[index, _GREEN], light[index, _BLUE] = 1.0, -1.0
        found.append(Irradiance(light, info))
    return found


def basis_subject(
    maps: list[Irradiance], mesh: Mesh | None, transfer: Transfer | None, size: int, viewer: Viewer
) -> tuple[Any, list[Any]]:
    """Return what `Scene` draws: a subject, and its material for each of the maps.

    Without a `mesh` a sphere is drawn. `transfer` is what was baked of the mesh.
    """
    if mesh is None:
        return SphereSubject(size), list(maps)
    stage = Stage.of([Actor(mesh, [Look()] * (1 + len(mesh.materials)))])
    lens = Lens(size, size, DEFAULT_FOV)
    subject = MeshSubject(stage, lens, aimed(mesh.vertices, [viewer], lens))
    if transfer is None:
        return subject, [stage.reflectors(each) for each in maps]
    white = replace(transfer, albedo=np.ones((1, 1)))
    return subject, [[vertex_colors(mesh, white, each)] * len(stage.looks) for each in maps]
