"""The page of `shrm view` as a text, and the shapes and numbers in it."""

import base64
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.geometry.mesh import face_normals, make_mesh
from shrm_cli.maps.explicit import shader
from shrm_cli.maps.shader.file import pack
from shrm_cli.probe.probe import Probe
from shrm_cli.view.blocks import Blocks
from shrm_cli.view.page import SCRIPTS, embedded, page, section
from shrm_cli.view.scene import Start, Truth, described_map, make_scene
from shrm_cli.view.shapes import described_shapes, distance_of, figure, surface_nets
from shrm_cli.vocabulary import PRIMARIES
from tests.cli.helpers import ROOT
from tests.maps.khronos import compile_fragment
from tests.maps.scenes import make_info
from tests.maps.shader import cases
from tests.maps.shader.test_code import boxed

ASSETS = ROOT / "shrm_cli" / "view" / "assets"
NASTY = (
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "]]>",
    "&lt;",
    "\u2028\u2029",
    "'\"\\",
)


@pytest.mark.parametrize("text", NASTY)
def test_json_in_a_page_ends_no_element_and_keeps_its_texts(text):
    found = embedded({text: [text]})
    assert not set(found) & set("<>&\u2028\u2029")
    assert json.loads(found) == {text: [text]}


def test_names_of_files_are_escaped_everywhere():
    attack = "</script></title><img src=x onerror=alert(1)>"
    made = replace(cases.irradiance(1), info=replace(make_info(1, 0), probe=attack))
    for files in (["a.exr"], [f"b{NASTY[1]}.exr"]):
        text = page(make_scene([made], files))
        assert "<img" not in text
        assert text.count("</script>") == text.count("<script")
        assert text.count("</title>") == 1


def test_what_the_page_calls_is_what_the_form_says(monkeypatch):
    """Whatever stands in its code besides, such as in a comment."""
    honest = described_map(cases.explicit_map("cabral"), "a", "a.exr", Blocks())
    assert honest["call"] == "shrm_radiance(n, v)"
    own = shader.source

    def source(made, textures):
        title = (
            "No shrm_irradiance(n), shrm_brushed_radiance(n, t, v) or shrm_radiance_at(n, v, p)."
        )
        return replace(own(made, textures), title=title)

    monkeypatch.setattr(shader, "source", source)
    found = described_map(cases.explicit_map("cabral"), "a", "a.exr", Blocks())
    assert found["code"] != honest["code"]
    for key in ("call", "boxed_call", "tangents"):
        assert found[key] == honest[key]


def test_brushed_surfaces_have_a_program_of_their_own():
    """Devices compile all that a program may do: in one program, a processor took three seconds."""
    found = described_map(
        cases.split_sum_of("linear", (0.0, 0.5, 1.0), (8, 8, 8)), "a", "a.exr", Blocks()
    )
    assert found["call"] == "shrm_even(n, v, view_roughness, view_f0)"
    assert found["brushed_call"].startswith("shrm_brushed(n, view_tangent(n), v, ")
    assert described_map(cases.irradiance(1), "a", "a.exr", Blocks())["brushed_call"] is None


def test_parameters_that_vary_start_in_the_middle_of_the_first_map():
    """Maps refer to them by number; one of several maps goes over all of their ranges."""
    maps = [
        cases.varying(1, {"rough": (0.2, 0.4), "</script>": (1.0, 2.0, 5.0)}, 3),
        cases.irradiance(1),
        cases.varying(1, {"other": (-1.0, 1.0)}, 2),
        cases.varying(3, {"rough": (0.1, 0.3)}, 2),
    ]
    scene = make_scene(maps, ["a", "b", "c", "d"]).description
    assert scene["ways"] == [
        {"name": "rough", "low": 0.1, "high": 0.4},
        {"name": "</script>", "low": 1.0, "high": 5.0},
        {"name": "other", "low": -1.0, "high": 1.0},
    ]
    assert scene["start"]["values"] == [0.3, 3, 0]  # not .30000000000000004
    held = [[(way["number"], way["low"], way["high"]) for way in m["ways"]] for m in scene["maps"]]
    assert held == [[(0, 0.2, 0.4), (1, 1, 5)], [], [(2, -1, 1)], [(0, 0.1, 0.3)]]
    calls = [m["call"].partition("(")[0] for m in scene["maps"]]
    assert calls == ["shrm_varied_radiance", "shrm_irradiance", *["shrm_varied_radiance"] * 2]


def test_product_textures_are_not_rounded():
    """Where what they reflect is dark, large terms cancel: rounding showed as scratches."""
    made = cases.product(1, 4)
    scene = make_scene([made], ["a.exr"], is_rounded=True)
    held_as = scene.description["maps"][0]["textures"]
    texture = next(each for each in held_as if each["name"] == "shrm_product")
    assert "exponents" not in texture
    held = numbers(scene.blocks, texture["block"], "<f2")
    expected = next(each.values for each in pack(made) if each.name == texture["name"])
    np.testing.assert_allclose(held, expected.ravel(), rtol=2**-11, atol=2**-25)
    assert scene.blocks.rounding_error == 0


def test_every_asset_is_in_the_page():
    assert {path.stem for path in ASSETS.glob("*.js")} == set(SCRIPTS)
    scene = make_scene([cases.irradiance(1)], ["a.exr"])
    text = page(scene)
    for path in ASSETS.iterdir():
        assert path.read_text().strip()[:200] in text, path.name
        assert len(path.read_text().splitlines()) <= 500


def test_a_section_leaves_other_parts_of_a_page_alone():
    parts = section(make_scene([cases.irradiance(1)], ["a.exr"]))
    rules = re.sub(r"/\*.*?\*/|@media[^{]*\{", "", parts.style, flags=re.DOTALL)
    for selectors in re.findall(r"([^{}]+)\{", rules):
        for each in re.split(r",(?![^(]*\))", selectors):
            assert each.strip().startswith(".shrm-view"), each
    assert parts.body.startswith('<div class="shrm-view"')
    assert parts.script.startswith("(function () {")
    assert "</script" not in parts.script
    assert not re.search(r"<script(?! type=)", parts.body)


def numbers(blocks, number, kind):
    """The numbers of a block, whose bytes stand in planes."""
    planes = np.frombuffer(zlib.decompress(blocks.parts[number]), np.uint8)
    assert blocks.widths[number] == np.dtype(kind).itemsize
    return np.frombuffer(planes.reshape(blocks.widths[number], -1).T.tobytes(), kind)


def test_blocks_come_back_as_they_went_in():
    values = np.random.default_rng(2).normal(size=(2, 4, 5, 3)).astype(np.float32)
    blocks = Blocks()
    described = blocks.texture(values, "light")
    assert [described[key] for key in ("width", "height", "depth", "format")] == [5, 4, 2, "rgb16f"]
    assert base64.b64decode(blocks.encoded()[described["block"]]) == blocks.parts[0]
    held = numbers(blocks, described["block"], "<f2")
    np.testing.assert_allclose(held.reshape(values.shape), values, rtol=2**-11)
    assert blocks.encoded_bytes == sum(map(len, blocks.encoded()))
    assert blocks.remarks == []


def unrounded(blocks, described):
    """The values of a rounded texture, one by one."""
    layers = described["depth"] or 1
    shape = layers, described["height"], described["width"]
    steps = numbers(blocks, described["block"], "<u2").reshape(3, *shape).astype(int)
    exponents = numbers(blocks, described["exponents"], "i1").reshape(-1, *shape[1:]).astype(float)
    signed = np.where(steps % 2, -(steps + 1) // 2, steps // 2)
    exponents = np.repeat(exponents, layers // len(exponents), axis=0)
    return np.moveaxis(signed * 2.0**exponents, 0, -1)


@pytest.mark.parametrize("shared", [False, True])
def test_rounded_textures(shared):
    """Each texel is as right as others, however dark it is; what is said of it is so."""
    rng = np.random.default_rng(3)
    brightness = np.exp(rng.normal(scale=4, size=(7, 5, 1)))
    values = (rng.normal(size=(6, 7, 5, 3)) * brightness).clip(-6e4, 6e4).astype(np.float32)
    values[:, 2, 3] = 0
    blocks = Blocks(is_rounded=True)
    described = blocks.texture(values, "light", series=shared)
    apart = unrounded(blocks, described) - values
    axes = (0, 3) if shared else 3
    length = np.sqrt((values.astype(float) ** 2).sum(axis=axes))
    lit = length > 0
    relative = np.sqrt((apart**2).sum(axis=axes))[lit] / length[lit]
    assert relative.max() < (0.011 if shared else 0.007)
    assert described["error"] == pytest.approx(np.sqrt(np.mean(relative**2)), rel=1e-6)
    assert blocks.rounding_error == described["error"]
    assert not apart[:, 2, 3].any()


def test_tables_are_not_rounded():
    blocks, values = Blocks(is_rounded=True), np.full((4, 4, 3), 1 / 3, dtype=np.float32)
    described = blocks.texture(values, "table", is_half=False)
    assert (numbers(blocks, described["block"], "<f4") == values.ravel()).all()
    assert blocks.rounding_error == 0


def test_what_half_cannot_hold_is_clipped_and_said():
    blocks, values = Blocks(), np.ones((4, 4, 3))
    values[1, 2] = 1e6, np.inf, 3
    described = blocks.texture(values, "sky.exr")
    held = numbers(blocks, described["block"], "<f2").reshape(4, 4, 3)
    assert held[1, 2].tolist() == [65504, 65504, 3]
    assert len(blocks.remarks) == 1
    assert blocks.remarks[0].startswith("sky.exr: 1 texels beyond 65504 were clipped")
    values[0, 0, 0] = np.nan
    with pytest.raises(MapError, match=r"sky\.exr: it holds values that are not numbers"):
        blocks.texture(values, "sky.exr")


def test_a_bright_probe_is_said_to_be_clipped():
    light = np.ones((8, 16, 3), dtype=np.float32)
    light[2, 3] = 1e5
    probe = Probe.from_array(light, name="sun.exr")
    made = replace(cases.irradiance(1), info=replace(make_info(1, 0), brdf={}))
    scene = make_scene([made], ["a.exr"], probe)
    assert any("sun.exr behind the shape: 1 texels" in each for each in scene.remarks)
    assert any(each.startswith("no truth: a.exr: its BRDF") for each in scene.remarks)
    assert scene.description["notes"] == scene.remarks


def test_other_primaries_are_said_to_be_converted():
    made = cases.irradiance(1)
    wide = replace(made, info=replace(made.info, chromaticities=PRIMARIES["acescg"]))
    scene = make_scene([made, wide], ["a.exr", "b.exr"])
    first, second = (each["call"] for each in scene.description["maps"])
    assert "mat3" not in first
    columns = [float(x) for x in second[second.index("(") + 1 : second.index(")")].split(",")]
    published = [
        [1.70505, -0.62179, -0.08326],
        [-0.13026, 1.14080, -0.01055],
        [-0.02400, -0.12897, 1.15297],
    ]
    np.testing.assert_allclose(np.reshape(columns, (3, 3)).T, published, atol=2e-4)
    assert any("from ACEScg" in each for each in scene.remarks)


def test_meshes_have_the_tangents_of_their_texture_coordinates():
    """A vertex that no triangle has is left out with its tangent."""
    points, uvs = np.eye(4, 3), [[0, 0], [0, 1], [1, 0], [3, 3]]
    mesh = make_mesh("a.obj", points[[3, 0, 1, 2]], [[1, 2, 3]], uvs=np.array(uvs)[[3, 0, 1, 2]])
    made = cases.FORMS["splitsum linear"]()
    scene = make_scene([made], ["a.exr"], mesh=mesh, start=Start(brush="uv"))
    tangents = numbers(scene.blocks, scene.description["shapes"][2]["tangents"], "<i2")
    # u grows from the first corner, x, to the third one, z.
    expected = [-(0.5**0.5), 0, 0.5**0.5, 0]
    np.testing.assert_allclose(tangents.reshape(3, 4) / 32767, [expected] * 3, atol=1e-4)
    with pytest.raises(ArgumentError, match="no direction"):
        make_scene([made], ["a.exr"], start=Start(brush=(0.0, 0.0, 0.0)))


def test_maps_of_the_same_name_are_told_apart():
    maps = [cases.irradiance(1)] * 3
    scene = make_scene(maps, ["x/a.exr", "y/a.EXR", "a (2).exr"])
    names = [each["name"] for each in scene.description["maps"]]
    assert names[:2] == ["a", "a (2)"]
    assert len(set(names)) == 3
    assert "x/" not in json.dumps(scene.description)  # nobody's folders are in the page


def test_too_many_views_and_no_maps():
    with pytest.raises(ArgumentError, match="`view`"):
        make_scene([cases.irradiance(1)], ["a.exr"], start=Start(((0.0, 0.0),) * 9))
    with pytest.raises(ArgumentError, match="`maps`"):
        make_scene([], [])


# ---- shapes --------------------------------------------------------------------------------------


def is_closed(faces):
    """Whether each edge belongs to one triangle in either direction: there is no hole."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = {tuple(each) for each in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def test_surface_nets_of_a_ball():
    box = np.array([[-1.2, -1.2, -1.2], [1.2, 1.3, 1.2]])
    vertices, faces = surface_nets(lambda p: np.linalg.norm(p, axis=1) - 1, box, 16)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1, atol=1e-6)
    assert is_closed(faces)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6  # positive if they face outwards
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.03)


def test_the_figure_is_whole_and_its_normals_point_outwards():
    mesh = figure()
    assert is_closed(mesh.faces)
    assert len(mesh.vertices) < 2**16  # so that indices take 16 bits
    flat = face_normals(mesh.vertices, mesh.faces)
    agree = np.einsum("ij,ij->i", flat, mesh.normals[mesh.faces].mean(axis=1))
    assert np.mean(agree > 0.8) > 0.98


def test_the_camera_sees_all_of_a_shape():
    """By projecting points by hand, from sides other than those that the distance comes from."""
    points = np.random.default_rng(5).uniform(-1, 1, (500, 3)) * [1, 0.3, 0.6]
    distance = distance_of(points)
    most = 0.0
    for azimuth, elevation in np.random.default_rng(6).uniform((-180, -50), (180, 50), (40, 2)):
        a, e = np.radians([azimuth, elevation])
        view = np.array([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)])
        right = np.array([np.cos(a), 0, -np.sin(a)])
        depth = distance - points @ view
        for axis in (right, np.cross(view, right)):
            most = max(most, np.abs(points @ axis / depth).max())
    edge = np.tan(np.radians(35 / 2))
    assert 0.8 * edge < most < 0.93 * edge


def strings_of(script, name):
    """The lines of a shader, as a script of the page holds them."""
    text = (ASSETS / script).read_text()
    body = text.partition(f"var {name} = ")[2].partition('].join("\\n")')[0]
    lines = re.findall(r'^  "((?:[^"\\]|\\.)*)",', body, flags=re.MULTILINE)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("name", ["shrm sum", "splitsum linear", "lamps", "product"])
def test_meshes_in_rooms_are_looked_up_in_the_box_of_each_map(tmp_path, name):
    """The shader of a mesh as `renderer.js` puts it together, by Khronos's compiler."""
    plain = cases.FORMS[name]()
    made = boxed(plain)
    assert described_map(plain, "a", "a.exr", Blocks())["boxed_call"] is None
    found = described_map(made, "a", "a.exr", Blocks())
    looked_up = "even_at(n, v, p, " if name == "splitsum linear" else "radiance_at(n, "
    assert looked_up in found["boxed_call"]
    assert found["call"] == described_map(plain, "a", "a.exr", Blocks())["call"]
    call = f"view_boxed ? {found['boxed_call']} : {found['call']}"
    shown = "vec3 shrm_shown(vec3 n, vec3 v, vec3 p) { return " + call + "; }\n"
    parts = [strings_of("shaders.js", "HEAD"), strings_of("shaders.js", "COMMON"), found["code"]]
    parts += [shown, strings_of("shaders.js", "MESH")]
    done = compile_fragment(tmp_path, "glsl", "\n".join(parts))
    assert done.returncode == 0, done.stdout
    wrong = "\n".join(parts).replace("view_middle +", "view_nowhere +")
    assert compile_fragment(tmp_path, "glsl", wrong).returncode != 0


def test_a_mesh_tells_the_page_where_it_stands():
    mesh = make_mesh("a.obj", [[2, 1, 5], [4, 1, 5], [2, 3, 5]], [[0, 1, 2]])
    shape = described_shapes(mesh, Blocks())[-1]
    np.testing.assert_allclose(shape["middle"], [3, 2, 5])
    assert shape["radius"] == pytest.approx(np.sqrt(2))


def test_a_page_begins_with_the_mesh_unless_there_is_a_truth():
    mesh = make_mesh("a.obj", [[2, 1, 5], [4, 1, 5], [2, 3, 5]], [[0, 1, 2]])
    light = Probe.from_array(np.ones((8, 16, 3), np.float32))
    for given, size, expected in ((None, 16, "a.obj"), (light, 0, "a.obj"), (light, 16, "Sphere")):
        scene = make_scene(
            [cases.irradiance(1)], ["a.exr"], given, mesh=mesh, truth=Truth(size=size)
        )
        shapes, start = scene.description["shapes"], scene.description["start"]
        assert shapes[start["shape"]]["name"] == expected
    plain = make_scene([cases.irradiance(1)], ["a.exr"])
    assert plain.description["start"]["shape"] == 0
