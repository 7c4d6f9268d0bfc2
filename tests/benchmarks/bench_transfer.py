"""Transfer beside its rays alone."""

import os
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from shrm_cli import settings
from shrm_cli.geometry.mesh import Mesh, make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.transfer.bake import Plan, bake
from tests.benchmarks.table import Row, measure

Array = NDArray[np.floating]


def rows() -> Iterable[Row]:
    """Yield the row of the table that is about transfer."""
    yield _bake_row()


def bumpy_ball(count: int) -> Mesh:
    """Make a ball with bumps, of `count` vertices that lie on a spiral from pole to pole."""
    points = spiral_directions(count)
    faces = []
    for near, far in _fibonacci_pairs(count):
        first = np.arange(count - near - far)
        faces += [np.stack([first, first + near, first + near + far], 1)]
        faces += [np.stack([first, first + near + far, first + far], 1)]
    x, y, z = points.T
    radius = 1 + 0.15 * np.cos(9 * x) * np.cos(8 * y) * np.cos(7 * z)
    return make_mesh("ball", radius[:, None] * points, np.concatenate(faces), points)


def _fibonacci_pairs(count: int) -> list[tuple[int, int]]:
    """Steps along the spiral to the nearest neighbours at the ball's equator."""
    near, far = 1, 2
    while near * far < count:
        near, far = far, near + far
    return [(near, far)]


def _bake_row() -> Row:
    mesh = bumpy_ball(2000)
    rays = Rays(mesh)
    plan = Plan(mesh)
    rng = np.random.default_rng(4)
    vertices = np.repeat(np.arange(len(mesh.vertices)), plan.samples)
    directions = rng.standard_normal((len(vertices), 3))
    normals = mesh.normals[vertices]
    directions *= np.sign(np.einsum("ki,ki->k", directions, normals))[:, None]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = ((mesh.vertices + 1e-4 * mesh.normals) / rays._radius)[vertices]
    origins, directions = origins.astype(np.float32), directions.astype(np.float32)

    def ours() -> None:
        with settings.using(threads=1):
            bake(plan, rays=rays)

    return measure(
        f"bake {len(mesh.vertices)} vertices, order 4",
        ours,
        lambda: rays._scene.run(origins, directions, query="OCCLUDED"),
        bar=2,
        note="embreex with as many rays, one thread",
        pairs=5,
    )


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tests.benchmarks.table import print_table

    print_table(rows())
