"""Table 1: frames a second where light and view move, and where either of them stands still."""

from collections.abc import Sequence
from dataclasses import dataclass

from shrm_cli.geometry.mesh import Mesh
from shrm_cli.maps.product.product import surface_frames
from shrm_cli.sphere.directions import horizontal_tangents
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.modes import General, ViewFunctions
from tests.benchmarks.bench_transfer import MODES, bumpy_ball, mode_rows
from tests.paper.extent import Extent
from tests.paper.product.textures import EXAMPLE, ORDER, texture

PAPER = {
    "teapot": (152413, 2.0, 1.64, 9.5, 48.9),
    "head": (50060, 5.24, 4.18, 25.3, 130.0),
    "Buddha": (49990, 4.05, 3.22, 15.6, 127.0),
    "bird": (48668, 6.04, 4.74, 28.4, 128.0),
    "tyra": (100000, 2.62, 2.08, 9.9, 71.5),
}
"""The paper's table 1: vertices, and frames a second without and with transfer, with a light and
with a view that stands still."""
_RAYS = 16
"""Rays a vertex: what they find does not change how long a frame takes."""


@dataclass(frozen=True)
class Speed:
    """One line of the table.

    Attributes
    ----------
    mesh : str
    vertices : int
    plain, transfer : dict of str to float
        Frames a second by the mode, without and with transfer.
    """

    mesh: str
    vertices: int
    plain: dict[str, float]
    transfer: dict[str, float]


def table_1(meshes: Sequence[Mesh], extent: Extent) -> list[Speed]:
    """Measure the meshes at hand, and balls with as many vertices as the paper's models."""
    functions = ViewFunctions(texture(EXAMPLE, extent.product_texels))
    balls = [bumpy_ball(count) for count in extent.product_vertices]
    rows = []
    for mesh in [*meshes, *balls]:
        matrices = bake(Plan(mesh, ORDER, samples=_RAYS, glossy=True)).matrices
        frames = surface_frames(mesh.normals, horizontal_tangents(mesh.normals))
        both = [
            {
                mode: 1e3 / row.ours
                for mode, row in zip(
                    MODES,
                    mode_rows("", General(functions, frames, each), extent.product_pairs),
                    strict=True,
                )
            }
            for each in (None, matrices)
        ]
        rows.append(Speed(mesh.name, len(mesh.vertices), *both))
    return rows
