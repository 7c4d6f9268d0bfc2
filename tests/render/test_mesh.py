"""Pictures of meshes, against those of spheres, pinholes and what surfaces must show."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.geometry.mesh import SurfaceMaterial, make_mesh
from shrm_cli.geometry.paint import Paint, Points
from shrm_cli.geometry.textures import Shelf
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.render.camera import Aim, Lens, Viewer, aimed
from shrm_cli.render.mesh import MIN_COSINE, MeshSubject, facing
from shrm_cli.render.sphere import render_background, render_sphere
from shrm_cli.render.stage import Actor, Look, Stage, transformation
from tests.geometry.shapes import icosphere
from tests.render.materials import INFO, furnace, spot

VIEW = Viewer(30, 20)


class Painter:
    """A stand-in for a reflector: radiance as a function of normals, views and tangents."""

    variation = paint = None

    def __init__(self, shown):
        self.shown = shown

    def radiance(self, normals, views, tangents=None, shares=None, painted=None, points=None):
        assert shares is None
        assert painted is None
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)
        assert np.einsum("ij,ij->i", normals, views).min() >= MIN_COSINE - 1e-12
        return np.broadcast_to(self.shown(normals, views, tangents), normals.shape)


WHITE = Painter(lambda *_: np.ones(3))


def sphere(splits=4):
    vertices, faces = icosphere(splits)
    return make_mesh("sphere", vertices, faces, normals=vertices)


def crumpled(splits=4):
    """A sphere with deep folds, whose smooth normals often face away where it is seen."""
    vertices, faces = icosphere(splits)
    radius = 1 + 0.3 * np.sin(9 * vertices[:, :1]) * np.sin(8 * vertices[:, 1:2] + 1)
    return make_mesh("crumpled", radius * vertices, faces)


def quad(height=0.0, half=1.0):
    corners = [(-half, -half, height), (half, -half, height), (half, half, height)]
    corners.append((-half, half, height))
    uvs = [(0, 0), (0, 1), (-1, 1), (-1, 0)]
    return make_mesh("quad", corners, [(0, 1, 2), (0, 2, 3)], uvs=uvs)


def subject(mesh, lens, viewers=(VIEW,), brush=None, **aim):
    stage = Stage.of([Actor(mesh, [Look()], brush)])
    return MeshSubject(stage, lens, aimed(mesh.vertices, viewers, lens, **aim))


def test_a_sphere_of_triangles_is_the_sphere():
    """By a camera so far away that it sees as the distant viewer does."""
    size, shown = 128, spot((0.3, 0.5, 0.8))
    mesh = subject(sphere(5), Lens(size, size, 0.02))
    painter = Painter(lambda normals, views, _: shown.radiance(normals, views))
    found = mesh.draw([painter], VIEW)
    expected = render_sphere(shown, VIEW, size)
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    inside = np.hypot(x, y) < 0.45 * size - 1
    scale = expected.max()
    # 20480 triangles: a flat edge of 2 / 82 lies 1e-4 inside, and normals are as far off in angle.
    assert np.abs(found - expected)[inside].max() < 0.01 * scale
    assert np.abs(found - expected).max() < 0.06 * scale  # a pixel of the rim, of 16 samples
    assert np.abs(found - expected).mean() < 4e-4 * scale
    outside = np.hypot(x, y) > 0.45 * size + 1
    assert (found[outside] == 0).all()


@pytest.mark.parametrize(("width", "height", "fov"), [(90, 60, 40.0), (50, 80, 100.0)])
def test_quads_are_as_large_as_a_pinhole_shows_them(width, height, fov):
    for depth, half, distance in [(0.0, 1.0, 6.0), (1.5, 0.7, 5.0), (-2.0, 1.1, 7.0)]:
        mesh = quad(depth, half)
        lens = Lens(width, height, fov)
        shown = subject(mesh, lens, [Viewer()], target=(0, 0, 0), distance=distance)
        picture = shown.draw([WHITE], Viewer())
        # Half the shorter edge is tan(fov / 2) at distance 1.
        scale = min(width, height) / 2 / np.tan(np.radians(fov) / 2)
        edge = 2 * half / (distance - depth) * scale
        row, column = picture[height // 2, :, 0], picture[:, width // 2, 0]
        assert row.sum() == pytest.approx(edge, abs=0.26)  # four samples along a pixel
        assert column.sum() == pytest.approx(edge, abs=0.26)
        np.testing.assert_allclose(picture[..., 0], picture[::-1, ::-1, 0], atol=0.26)


def test_edges_are_blended_with_the_background():
    """A white mesh before white is not seen, and before black it is its coverage."""
    lens = Lens(64, 48)
    shown = subject(crumpled(), lens)
    white = np.ones((48, 64, 3), dtype=np.float32)
    np.testing.assert_allclose(shown.draw([WHITE], VIEW, white), 1, atol=1e-6)
    alone = shown.draw([WHITE], VIEW)
    assert ((alone > 0.01) & (alone < 0.99)).sum() > 100
    parts = np.unique(np.round(alone * 16, 4))
    assert (parts == np.round(parts)).all()


def test_a_furnace_leaves_no_specks():
    """All BRDFs reflect the light of a furnace, also where normals had to be bent."""
    shown = subject(crumpled(), Lens(96, 96))
    gray = furnace((0.5, 0.25, 1.0))
    painter = Painter(lambda normals, views, _: gray.radiance(normals, views))
    picture = shown.draw([painter], VIEW, np.full((96, 96, 3), (0.5, 0.25, 1.0), np.float32))
    np.testing.assert_allclose(picture, np.broadcast_to((0.5, 0.25, 1.0), picture.shape), rtol=1e-3)


def test_the_background_is_that_of_spheres_at_their_angle(rng):
    probe = spot((0.3, 0.5, 0.8))

    class Room:
        def radiance(self, directions):
            return probe.radiance(directions, np.array([0, 0, 1.0]))

    found = subject(quad(), Lens(40, 40, 50.0)).background(Room(), VIEW)
    np.testing.assert_allclose(found, render_background(Room(), VIEW, 40), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("size", [(64, 64), (128, 40), (30, 90)])
def test_all_of_a_mesh_is_in_the_picture(size):
    mesh = crumpled(3).transformed(transformation((40, -3, 7), (10, 20, 30), (3, 1, 0.2)))
    viewers = [Viewer(15.0 * k, 10.0) for k in range(24)]
    lens = Lens(*size, 60.0)
    aim = aimed(mesh.vertices, viewers, lens)
    largest = 0.0
    for viewer in viewers:
        right, up, towards = viewer.axes() @ (mesh.vertices - aim.eye(viewer)).T
        half = np.tan(np.radians(30)) / min(size)
        seen = np.array([right / -towards / half / size[0], up / -towards / half / size[1]])
        assert (towards < 0).all()
        largest = max(largest, np.abs(seen).max())
    assert largest == pytest.approx(0.9, rel=1e-9)


def test_cameras_that_cannot_be():
    lens = Lens(32, 32)
    for wrong in ({"distance": 0.0}, {"distance": np.nan}, {"target": (0, np.inf, 0)}):
        with pytest.raises(ArgumentError):
            aimed(quad().vertices, [VIEW], lens, **wrong)
    with pytest.raises(ArgumentError):
        Lens(32, 32, 180.0)


def test_normals_are_bent_no_more_than_they_must(rng):
    normals, flat, views = (
        each / np.linalg.norm(each, axis=1, keepdims=True) for each in rng.normal(size=(3, 500, 3))
    )
    normals[0], normals[1] = views[0], -views[1]
    flat[1] = views[1]
    found = facing(normals, flat, views)
    cosine = np.einsum("ij,ij->i", found, views)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    assert cosine.min() == pytest.approx(MIN_COSINE)
    # The side that the viewer sees: the smooth normal's own, or the other.
    seen = np.einsum("ij,ij->i", flat, views) * np.einsum("ij,ij->i", flat, normals)
    side = np.where(seen < 0, -1, 1)[:, None] * normals
    kept = np.einsum("ij,ij->i", side, views) > MIN_COSINE
    np.testing.assert_array_equal(found[kept], side[kept])
    # Bent normals lie in the plane of the smooth one and the view.
    bent = ~kept & (np.arange(500) > 1)
    volume = np.linalg.det(np.stack([found, side, views], axis=1))
    np.testing.assert_allclose(volume[bent], 0, atol=1e-12)


def test_both_sides_of_a_sheet_look_alike():
    lens = Lens(24, 24)
    shown = subject(quad(), lens, [Viewer(0, 0), Viewer(180, 0)])
    for azimuth in (0, 180):
        normals = []

        def paint(normal, view, _, normals=normals):
            normals.append(normal)
            return np.ones(3)

        shown.draw([Painter(paint)], Viewer(azimuth, 0))
        np.testing.assert_allclose(
            np.concatenate(normals),
            [[0, 0, 1 if azimuth == 0 else -1]] * len(np.concatenate(normals)),
        )


@pytest.mark.parametrize(
    ("brush", "tangent"), [("uv", (0, -1, 0)), ((3.0, 0.0, 9.0), (1, 0, 0)), (None, None)]
)
def test_tangents_reach_the_map(brush, tangent):
    given = []

    def paint(normals, views, tangents):
        given.append(tangents)
        return np.ones(3)

    subject(quad(), Lens(16, 16), [Viewer()], brush).draw([Painter(paint)], Viewer())
    assert given
    for tangents in given:
        if tangent is None:
            assert tangents is None
        else:
            np.testing.assert_allclose(
                tangents, np.broadcast_to(tangent, tangents.shape), atol=1e-9
            )


def test_tangents_of_coordinates_need_some():
    with pytest.raises(ArgumentError, match="texture coordinates"):
        Stage.of([Actor(sphere(1), [Look()], "uv")])


def light(rng):
    levels = tuple(rng.random((6 * size, size, 3)) for size in (8, 4))
    return SplitSum(levels, (0.0, 1.0), "linear", INFO)


def test_materials_are_split_into_metal_and_the_rest(rng):
    split, diffuse = light(rng), Irradiance(rng.random((9, 3)), INFO)
    material = SurfaceMaterial("paint", (0.8, 0.5, 0.1), 0.25, 0.6)
    normals = rng.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    views = normals[::-1] * np.sign(np.einsum("ij,ij->i", normals, normals[::-1]))[:, None]
    f0 = tuple(0.75 * 0.04 + 0.25 * np.array(material.base_color))
    expected = split.shaded(0.6, f0).radiance(normals, views)
    mesh = sphere(1)
    paint = Paint(mesh, material, Shelf())
    points = Points(mesh, np.arange(20), np.full((20, 3), 1 / 3), np.zeros((20, 3, 2)))
    alone, both = (
        Look(paint=paint, irradiance=each)
        .of(split)
        .radiance(normals, views, painted=paint.at(points))
        for each in (None, diffuse)
    )
    np.testing.assert_allclose(alone, expected)
    added = 0.75 * np.array(material.base_color) * diffuse.irradiance(normals) / np.pi
    np.testing.assert_allclose(both, expected + added)


def test_each_mesh_of_a_scene_has_its_own_map():
    red, blue = furnace((1.0, 0, 0)), furnace((0, 0, 1.0))
    left = sphere(2).transformed(transformation((-2, 0, 0)))
    right = sphere(2).transformed(transformation((2, 0, 0)))
    stage = Stage.of([Actor(left, [Look(red)]), Actor(right, [Look()])])
    assert stage.needs_map
    lens = Lens(60, 30)
    shown = MeshSubject(stage, lens, aimed(stage.mesh.vertices, [Viewer()], lens))
    picture = shown.draw(stage.reflectors(blue), Viewer())
    np.testing.assert_allclose(picture[15, 15], (1, 0, 0), atol=1e-3)
    np.testing.assert_allclose(picture[15, 45], (0, 0, 1), atol=1e-3)
    assert (picture[15, 30] == 0).all()


def test_transformations_scale_then_rotate_then_move():
    matrix = transformation((1, 2, 3), (90, 0, 90), (2, 1, 1))
    # (1, 1, 0): scaled (2, 1, 0); about x (2, 0, 1); about z (0, 2, 1); moved.
    np.testing.assert_allclose(matrix @ [1, 1, 0, 1], [1, 4, 4, 1], atol=1e-12)


def test_a_camera_within_a_mesh_sees_its_inside():
    lens = Lens(16, 16, 90.0)
    stage = Stage.of([Actor(sphere(2), [Look()])])
    shown = MeshSubject(stage, lens, Aim(np.zeros(3), 0.1))
    np.testing.assert_allclose(shown.draw([WHITE], Viewer()), 1)
