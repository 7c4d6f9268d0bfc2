"""Rooms whose surfaces vary, beside rooms of pieces that do not."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.color import from_rec709
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import SurfaceMaterial, Texture, make_mesh
from shrm_cli.probe.probe import Probe
from shrm_cli.rooms.bake import bake
from shrm_cli.rooms.capture import trace_probe
from shrm_cli.rooms.grid import Lattice
from shrm_cli.rooms.make import open_room
from shrm_cli.rooms.room import Room
from shrm_cli.vocabulary import PRIMARIES
from tests.render.assets import obj_text, packed_glb, png
from tests.rooms.shapes import box, ceiling_lamp

HALVES = png(np.repeat([[[255, 0, 0], [0, 0, 255]]], 2, axis=0))
"""Red on the left, blue on the right."""
NEAREST = Texture(HALVES, is_srgb=True, is_nearest=True)
RED, BLUE, GRAY, DARK = (1.0, 0, 0), (0.0, 0, 1), (0.5, 0.5, 0.5), (0.0, 0, 0)
LATTICE = Lattice(np.zeros(3), np.array([4.0, 3, 4]), (4, 1, 2))


def surface(color=GRAY, **given):
    return SurfaceMaterial(base_color=color, metallic=0.0, roughness=1.0, **given)


def across(low, high, height, is_up=True):
    """A sheet between two lengths of x, all over z, and its texture coordinates."""
    points = np.array([(low, height, 0), (low, height, 4), (high, height, 4), (high, height, 0)])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    uvs = np.array([(0, 0), (0, 1), (1, 1), (1, 0)], float)
    turned = faces if is_up else faces[:, ::-1]
    return points.astype(float), turned, np.tile([0, 1.0 if is_up else -1, 0], (4, 1)), uvs


def room(pieces, sky=None, changes=None, colors=None):
    """A room of a box with a lamp, unless there is a sky, and of pieces with their materials."""
    parts = [(box([0, 0, 0], [4, 3, 4]), surface(GRAY))]
    if sky is None:
        parts.append((ceiling_lamp(2), surface(DARK, emission=(9.0, 8, 7))))
    parts += [(piece, material) for piece, material in pieces]
    points, faces, normals, uvs, owners, start = [], [], [], [], [], 0
    for number, ((vertices, triangles, directions, *rest), _) in enumerate(parts):
        points.append(vertices)
        faces.append(triangles + start)
        normals.append(directions)
        uvs.append(rest[0] if rest else np.zeros((len(vertices), 2)))
        owners.append(np.full(len(triangles), number))
        start += len(vertices)
    mesh = make_mesh(
        "room", *map(np.concatenate, (points, faces, normals, uvs)),
        materials=[material for _, material in parts], face_materials=np.concatenate(owners),
        colors=None if colors is None else np.tile(colors, (start, 1)),
    )  # fmt: skip
    return Room.of(mesh, (0.5,) * 3, changes or {}, sky)


def light_of(*given, **more):
    grid = bake(room(*given, **more), LATTICE, 1, 256)
    return grid.reflected, grid.direct


def difference(found, expected):
    """The RMS of the difference beside that of what is expected."""
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


def test_a_texture_reflects_as_pieces_of_its_colours():
    floor = [(across(0, 4, 0.01), surface((0.8, 0.8, 0.8), color_map=NEAREST))]
    pieces = [
        (across(0, 2, 0.01), surface((0.8, 0, 0))), (across(2, 4, 0.01), surface((0, 0, 0.8))),
    ]  # fmt: skip
    found, expected = light_of(floor)[0], light_of(pieces)[0]
    assert difference(found, expected) < 0.03
    red, _, blue = np.moveaxis(found[:, 0], -1, 0)  # of the probes from the least x on
    assert (red[:2] > 1.1 * red[-2:]).all()
    assert (blue[:2] < blue[-2:]).all()


def test_a_texture_glows_as_lamps_of_its_colours():
    """Lamps are looked for on all of it, and not only by the mean of each triangle."""
    glow = surface(DARK, emission=(5.0, 5, 5), emission_map=NEAREST)
    pieces = [
        (across(0, 2, 2.9, False), surface(DARK, emission=(5.0, 0, 0))),
        (across(2, 4, 2.9, False), surface(DARK, emission=(0.0, 0, 5))),
    ]  # fmt: skip
    found, expected = light_of([(across(0, 4, 2.9, False), glow)]), light_of(pieces)
    assert difference(found[0], expected[0]) < 0.03
    assert difference(found[1], expected[1]) < 0.03


def test_what_is_seen_has_its_texture(monkeypatch):
    monkeypatch.setattr("shrm_cli.rooms.capture._PATCHES", 6)
    floor = [(across(0, 4, 0.01), surface((1, 1, 1), color_map=NEAREST))]
    image = trace_probe(room(floor), np.array([2, 1.5, 2]), 16, 32).pixels
    below = image[13]
    left = slice(4, 12)  # the left quarter is +X
    right = slice(20, 28)
    assert (below[left, 2] > 20 * below[left, 0]).all()
    assert (below[right, 0] > 20 * below[right, 2]).all()


def test_vertex_colours_are_colours():
    painted = [(across(0, 4, 0.01), surface((1, 1, 1), colored="linear"))]
    plain = [(across(0, 4, 0.01), surface((0.25, 0.5, 0.75)))]
    found = light_of(painted, colors=(0.25, 0.5, 0.75))[0]
    np.testing.assert_allclose(found, light_of(plain)[0], rtol=1e-6)


def test_light_passes_through_clear_materials():
    pane = [(across(0, 4, 1.2), surface(opacity=0.2, cutoff=0.5))]
    for found, expected in zip(light_of(pane), light_of([]), strict=True):
        np.testing.assert_array_equal(found, expected)
    with pytest.raises(MeshError, match="all of its materials are clear"):
        Room.of(replace(room([]).mesh, materials=(pane[0][1],) * 2), (0.5,) * 3, {})


def test_walls_of_which_nothing_is_said_reflect_half(tmp_path):
    """They reflected all light: a closed room was forty times too bright, and nothing was said."""
    text = obj_text(across(0, 4, 0), "gone.mtl", "floor")
    (tmp_path / "a.obj").write_text(text)
    with pytest.raises(MeshError, match=r"'floor', whose file 'gone.mtl' is missing\); give"):
        open_room(tmp_path / "a.obj")
    found = open_room(tmp_path / "a.obj", probe=np.ones((8, 16, 3)))
    np.testing.assert_array_equal(found.room.albedo, 0.5)
    assert "half is reflected" in found.warnings[0]
    assert "'floor' (whose file 'gone.mtl' is missing)" in found.warnings[0]
    given = open_room(tmp_path / "a.obj", np.ones((8, 16, 3)), {"floor": (0.2, 0.3, 0.4)})
    np.testing.assert_array_equal(given.room.albedo[0], (0.2, 0.3, 0.4))
    assert not given.warnings
    (tmp_path / "gone.mtl").write_text("newmtl floor\nKd 1 1 1\nnewmtl wall\nKd .5 .5 .5\n")
    np.testing.assert_array_equal(
        open_room(tmp_path / "a.obj", probe=np.ones((8, 16, 3))).room.albedo, 0.5
    )
    (tmp_path / "a.obj").write_text(text + "usemtl wall\nf 1/1/1 2/2/2 3/3/3\n")
    found = open_room(tmp_path / "a.obj", probe=np.ones((8, 16, 3)))
    np.testing.assert_array_equal(found.room.albedo[0], 1)
    assert "nothing is lost of the light" in found.warnings[0]


def test_values_take_the_place_of_textures():
    floor = [(across(0, 4, 0.01), surface(name="floor", color_map=Texture("gone.png")))]
    changes = {"albedo": {"floor": (0.2, 0.3, 0.4)}}
    plain = [(across(0, 4, 0.01), surface((0.2, 0.3, 0.4)))]
    found = light_of(floor, changes=changes)[0]
    np.testing.assert_array_equal(found, light_of(plain)[0])
    with pytest.raises(MeshError, match=r"gone.png; or give colours in their place by `albedo`"):
        room(floor)


def test_colours_are_converted_to_the_primaries_of_the_light():
    """The files of meshes have Rec.709."""
    wide = PRIMARIES["acescg"]
    sky = Probe.from_array(np.ones((8, 16, 3)), layout="latlong", chromaticities=wide)
    color, glow = np.array([0.8, 0.2, 0.1]), np.array([1.0, 2, 3])
    found = room([(across(0, 4, 0.01), surface(tuple(color), emission=tuple(glow)))], sky)
    matrix = from_rec709(wide)
    np.testing.assert_allclose(found.albedo[-1], matrix @ color)
    np.testing.assert_allclose(found.emission[-1], matrix @ glow)


def test_what_does_not_count_is_said(tmp_path):
    holes = png(np.array([[[255] * 4, [255, 255, 255, 0]]]))
    given = {
        "name": "leaf", "alphaMode": "MASK", "emissiveFactor": [1, 1, 1],
        "extensions": {"KHR_materials_transmission": {}},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
    }  # fmt: skip
    path = tmp_path / "a.glb"
    path.write_bytes(packed_glb(across(0, 4, 0), given, [holes]))
    first, second = open_room(path).warnings
    assert "does not pass through the holes in the texture of the material 'leaf'" in first
    assert "'leaf' (KHR_materials_transmission)" in second
