"""What transfer takes of the materials of a mesh: what diffuse surfaces reflect."""

import numpy as np
import pytest

from shrm_cli.color import srgb_to_linear
from shrm_cli.errors import MeshError
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import SurfaceMaterial, Texture, make_mesh
from shrm_cli.transfer.bake import bake, transfer_plan
from tests.render.assets import png

RED, BLUE = (255, 0, 0), (0, 0, 255)
HALVES = Texture(png(np.array([[RED] * 8 + [BLUE] * 8] * 16)), is_srgb=True)
"""Red on the left, blue on the right."""


def sheet(material, **given):
    """A square of two triangles whose texture coordinates are its own."""
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
    faces = [[0, 1, 2], [0, 2, 3]]
    return make_mesh(
        "sheet", points, faces, np.tile([0, 0, 1.0], (4, 1)), 0.02 + 0.96 * points[:, :2],
        materials=() if material is None else (material,), **given,
    )  # fmt: skip


def reflected(mesh, **given):
    return transfer_plan(mesh, samples=1, order=0, **given).reflected()


def test_a_mesh_reflects_what_its_materials_say():
    found = reflected(sheet(SurfaceMaterial(base_color=(0.2, 0.4, 0.6), roughness=0.3)))
    np.testing.assert_allclose(found, [(0.2, 0.4, 0.6)] * 4)
    assert reflected(sheet(SurfaceMaterial())).tolist() == [[0.5]]  # which says nothing of colour
    assert reflected(sheet(None)).tolist() == [[0.5]]
    assert reflected(sheet(SurfaceMaterial()), albedo="mesh").tolist() == [[1, 1, 1]] * 4
    assert reflected(sheet(SurfaceMaterial(base_color=(0, 0, 0))), albedo=0.7).tolist() == [[0.7]]


def test_textures_are_averaged_over_texels():
    """The whole of a texel counts, where the texture is finer than those of the transfer."""
    plan = transfer_plan(sheet(SurfaceMaterial(color_map=HALVES)), samples=1, order=0, texture=16)
    x = plan.sites.positions[:, 0]
    found = plan.reflected()
    left, right = found[np.abs(x - 0.25) < 0.15], found[np.abs(x - 0.75) < 0.15]
    np.testing.assert_allclose(left, [RED] * len(left) / np.array(255), atol=1e-3)
    np.testing.assert_allclose(right, [BLUE] * len(right) / np.array(255), atol=1e-3)
    fine = np.indices((256, 256)).sum(axis=0) % 2 * 255
    checks = Texture(png(np.repeat(fine[..., None], 3, axis=2)), is_srgb=True)
    mesh = sheet(SurfaceMaterial(color_map=checks))
    found = transfer_plan(mesh, samples=1, order=0, texture=16).reflected()
    np.testing.assert_allclose(found, 0.5, atol=0.03)


def test_corners_have_the_texture_about_them():
    found = reflected(sheet(SurfaceMaterial(color_map=HALVES)))
    assert (found[[0, 3], 0] > found[[0, 3], 2]).all()
    assert (found[[1, 2], 2] > found[[1, 2], 0]).all()


@pytest.mark.parametrize("encoding", ["linear", "srgb"])
def test_vertex_colours_are_decoded(encoding):
    """As pictures of the mesh show them."""
    colors = np.array([(0.5, 0.2, 1), (0, 0, 0), (1, 1, 1), (0.7, 0.7, 0.1)])
    mesh = sheet(SurfaceMaterial(colored=encoding), colors=colors)
    expected = srgb_to_linear(colors) if encoding == "srgb" else colors
    for albedo in (None, "vertex", "mesh"):
        np.testing.assert_allclose(reflected(mesh, albedo=albedo), expected)


def test_light_of_bounces_has_the_colour_of_the_texture():
    """Under a red ceiling of a texture a white floor is red."""
    floor, ceiling = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)]), (0, 0.5, 0)
    points = np.concatenate([floor, floor[::-1] + ceiling]).astype(float)
    square = np.array([[0, 1, 2], [0, 2, 3]])
    red = SurfaceMaterial(color_map=Texture(png(np.full((2, 2, 3), RED)), is_srgb=True))
    mesh = make_mesh(
        "corner", points, np.concatenate([square, square + 4]), uvs=np.tile(floor[:, ::2], (2, 1)),
        materials=(SurfaceMaterial(), red), face_materials=[0, 0, 1, 1],
    )  # fmt: skip
    baked = bake(transfer_plan(mesh, order=0, bounces=1, samples=256))
    more = baked.vectors[:4, 0] - baked.direct[:4, 0]
    assert (more[:, 0] > 0.05).all()
    np.testing.assert_allclose(more[:, 1:], 0, atol=1e-6)


def test_textures_that_are_missing_name_the_option(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl x\nmap_Kd gone.png\n")
    text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl x\nf 1/1 2/1 3/1\n"
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(MeshError, match=r"gone.png.*; or give another `albedo`"):
        reflected(load_mesh(tmp_path / "a.obj"))
    assert reflected(load_mesh(tmp_path / "a.obj"), albedo=0.3).tolist() == [[0.3]]


def test_materials_that_are_missing_reflect_half(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl x\nKd 0.2 0.3 0.4\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 5\nv 1 0 5\nv 0 1 5\n"
    (tmp_path / "a.obj").write_text(
        f"mtllib a.mtl\n{corners}usemtl x\nf 1 2 3\nusemtl y\nf 4 5 6\n"
    )
    found = reflected(load_mesh(tmp_path / "a.obj"))
    np.testing.assert_allclose(found, [[0.2, 0.3, 0.4]] * 3 + [[0.5] * 3] * 3, rtol=1e-6)
