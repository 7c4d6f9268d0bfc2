"""Figures 5 and 7: glossy surfaces with their own shadows, brushed in several directions."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.product.orders import relative
from research.product.scenes import UPRIGHT, Direction, Shot, exposure, write_sheet
from research.product.textures import ORDER, light_of, texture
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.vertex_colors import VertexColors
from shrm_cli.sphere.harmonics import real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.gather import OFFSET

Array = NDArray[np.floating]

ISOTROPIC = "ashikhmin-shirley:nu=14"
ANISOTROPIC = "ashikhmin-shirley:nu=48,nv=4"
"""The exponents have nearly the same geometric mean, sqrt((nu+1) (nv+1)) - 1."""
ACROSS: Direction = (1.0, 0.0, 0.0)
_CASES = (
    ("isotropic", ISOTROPIC, UPRIGHT),
    ("anisotropic", ANISOTROPIC, UPRIGHT),
    ("brushed across", ANISOTROPIC, ACROSS),
)


@dataclass(frozen=True)
class Shadowed:
    """What figures 5 and 7 say of one material, over the vertices that face the camera.

    Attributes
    ----------
    what, spec : str
    left : float
        The mean radiance with shadows, divided by that without them.
    change : float
        Relative RMS difference from the first material.
    expected : float
        Relative RMS error at vertices drawn at random, against a sum over rays under light of the
        same order: what the order of the transfer matrices and of the product functions costs.
    """

    what: str
    spec: str
    left: float
    change: float
    expected: float


def figures_5_and_7(
    probe: Probe, mesh: Mesh, folder: Path, extent: Extent
) -> tuple[str, list[Shadowed]]:
    """Draw a mesh without shadows above the same mesh with them, of three materials."""
    light = light_of(probe)
    rows: list[list] = [[], []]
    found: list[Shadowed] = []
    first = np.empty(0)
    for what, spec, brush in _CASES:
        shot = Shot(mesh, Viewer(0, 10), extent.product_picture, brush)
        product = texture(spec, extent.product_texels)
        lit = product.lit(light)
        plan = Plan(mesh, ORDER, samples=extent.product_rays, glossy=True, tangents=shot.tangents)
        surface = VertexColors(mesh, bake(plan), light, product)
        rows[0].append((shot.picture(lit), f"{what}, no shadows"))
        rows[1].append((shot.picture(surface), f"{what}, shadows"))
        facing = shot.facing
        with_shadows = surface.seen_from(shot.aim.eye(shot.viewer))[0][facing]
        without = lit.brushed_radiance(
            *(each[facing] for each in (mesh.normals, shot.tangents, shot.views))
        )
        first = first if len(first) else with_shadows
        found.append(Shadowed(
            what, spec, float(with_shadows.mean() / without.mean()),
            relative(with_shadows, first), _error(shot, with_shadows, light, spec, extent),
        ))  # fmt: skip
    stops = exposure([picture for row in rows for picture, _ in row])
    return write_sheet(folder / "figure-5-7.png", rows, [stops] * 2), found


def _error(shot: Shot, colors: Array, light: Array, spec: str, extent: Extent) -> float:
    """Return the relative RMS error of colours of the facing vertices, at some of them."""
    rng = np.random.default_rng(7)
    chosen = rng.choice(len(colors), min(extent.product_points, len(colors)), replace=False)
    exact = traced(shot, shot.facing[chosen], light, parse_spec(spec), extent.product_rays)
    return relative(colors[chosen], exact)


def traced(
    shot: Shot, vertices: NDArray[np.integer], light: Array, brdf: Brdf, count: int
) -> Array:
    """Sum over directions what vertices reflect of light that the mesh does not block.

    Nothing but the rays is shared with the transfer: no rotation, no product function, no matrix.

    Parameters
    ----------
    shot : Shot
        The mesh, its tangents, and the camera.
    vertices : ndarray of int, shape (n,)
    light : ndarray, shape ((order+1)^2, 3)
        World axes; it is taken to be this series, also where that is negative.
    brdf : Brdf
    count : int
        Four times as many directions are taken over the sphere.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    mesh, rays = shot.mesh, Rays(shot.mesh)
    directions = spiral_directions(4 * count)
    radiance = real_harmonics(ORDER, directions) @ light
    low, high = mesh.bounds
    lift = OFFSET * float(np.linalg.norm(high - low))
    tangents, views = shot.tangents, shot.views
    result = np.empty((len(vertices), 3))
    for k, vertex in enumerate(vertices):
        normal, tangent = mesh.normals[vertex], tangents[vertex]
        frame = np.stack([tangent, np.cross(normal, tangent), normal])
        own = directions @ frame.T
        above = np.flatnonzero(own[:, 2] > 0)
        start = mesh.vertices[vertex] + lift * normal
        free = above[~rays.occluded(start[None], directions[above])]
        values = brdf.transfer(own[free], np.broadcast_to(frame @ views[vertex], (len(free), 3)))
        result[k] = np.sum(values * radiance[free], axis=0) * (4 * np.pi / len(directions))
    return result
