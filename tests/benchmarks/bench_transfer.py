"""Transfer beside its rays alone, and the three ways to shade many frames beside each other."""

import os
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli import settings
from shrm_cli.brdf.product import ProductFunctions
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.mesh import Mesh, make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.maps.product.table import product_table
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import open_probe
from shrm_cli.sphere.parabolic import ParabolicSampler
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.modes import FixedLight, FixedView, General, ViewFunctions
from tests.benchmarks.table import Row, measure

Array = NDArray[np.floating]

VERTICES = 2_000, 50_000
"""As many as the bunny has, which fit into the processor's cache, and as many as the paper's."""
MODES = "general", "fixed light", "fixed view"
BRDFS = ("ggx:roughness=0.5,f0=gold", "ward:ax=0.2,ay=0.5")
_PROBES = Path(__file__).parents[2] / "probes"
_LIMIT = 500.0
"""Milliseconds that a frame may take where light and view move: two frames a second."""


def rows() -> Iterable[Row]:
    """Yield the rows of the table that are about transfer."""
    yield _bake_row()
    for count in VERTICES:
        baked = bake(Plan(bumpy_ball(count), samples=16, glossy=True))
        for spec in BRDFS:
            functions = ViewFunctions(Table(spec))
            for what, matrices in (("transfer", baked.matrices), ("no transfer", None)):
                name = f"{spec.partition(':')[0]}, {what}, {count} vertices"
                yield from mode_rows(name, General(functions, baked.frames, matrices))


class Table:
    """A product texture."""

    def __init__(self, spec: str) -> None:
        brdf = parse_spec(spec)
        table = product_table(brdf, ProductFunctions.of(brdf, 4), 4, 128)
        self._shape = 25, table.shape[-1]
        self._sampler = ParabolicSampler(table.reshape(128, 128, -1))

    def values(self, local_views: Array) -> Array:
        found = self._sampler(local_views).reshape(*local_views.shape[:-1], *self._shape)
        return np.broadcast_to(found, (*found.shape[:-1], 3))


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


def mode_rows(name: str, general: General, pairs: int = 9) -> Iterable[Row]:
    """Yield a row for each of the `MODES`, timed `pairs` times."""
    light = project(open_probe(_PROBES / "studio.exr"), 4).coefficients
    view = np.array([0.0, 0.6, 0.8])
    fixed_light, fixed_view = FixedLight(general, light), FixedView(general, view)
    # Frames of small meshes follow each other: the first one after a pause finds its memory cold.
    frames = max(1, VERTICES[-1] // general.local(view).shape[1])

    def shown(work: Callable[[], object]) -> None:
        for _ in range(frames):
            work()

    reference = partial(shown, partial(general.colors, light, view))
    whole = measure(f"{name}: {MODES[0]}", reference, lambda: None, pairs=pairs)
    took = whole.ours / frames
    note = f"{1e3 / took:.1f} frames a second; the reference is two of them"
    yield Row(whole.name, took, _LIMIT, took / _LIMIT, 1, note)
    for kind, bar, work in (
        (MODES[1], 1 / 5, lambda: fixed_light.colors(view)),
        (MODES[2], 1 / 20, lambda: fixed_view.colors(light)),
    ):
        row = measure(f"{name}: {kind}", partial(shown, work), reference, pairs=pairs)
        ours, theirs = row.ours / frames, row.reference / frames
        faster = f"{1 / row.ratio:.0f} times as fast, {1e3 / ours:.0f} frames a second"
        yield Row(row.name, ours, theirs, row.ratio, bar, faster)


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tests.benchmarks.table import print_table

    print_table(rows())
