"""`shrm view` in a browser: its pictures are those of `shrm render`, and its controls work."""

import io
import threading
from dataclasses import dataclass, replace

import numpy as np
import pytest
from PIL import Image

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.geometry.tangents import projected_tangents
from shrm_cli.maps.info import record_of
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.product.make import product
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sphere import render_background, render_sphere
from shrm_cli.sphere.directions import turn_matrix
from shrm_cli.sphere.grid.latlong import latlong_directions
from shrm_cli.view.page import page as make_page
from shrm_cli.view.scene import Start, Truth, make_scene
from shrm_cli.view.serve import PageServer
from shrm_cli.view.shapes import figure
from shrm_cli.vocabulary import DEFAULT_EVEN_TAPS, PRIMARIES
from tests.cli.helpers import write_exr
from tests.maps.scenes import make_info
from tests.maps.shader import cases

HALF = 2.0**-11
"""Half a unit in the last place of 16-bit floats, relative."""
SIZE = 24
VIEW = {"azimuth": 33, "elevation": -21, "zoom": 1}
SIDE = {"kind": "map", "number": 0}


@pytest.fixture(scope="module")
def probe():
    """A sky with a lamp that reaches over a few pixels, and colours that have no symmetry."""
    directions = latlong_directions(64, 32)
    x, y, z = np.moveaxis(directions, -1, 0)
    light = np.stack([1 + 0.5 * x, 1 + 0.4 * y, 1.2 - 0.5 * z * x], axis=-1)
    lamp = np.exp(-12 * (1 - directions @ np.array([0.6, 0.64, 0.48])))
    return Probe.from_array((light + 6 * lamp[..., None]).astype(np.float32), name="lamp.exr")


@dataclass
class Shaded:
    """A map whose cubes are filtered as shaders do, on a surface."""

    made: object
    roughness: float
    f0: tuple

    def radiance(self, normals, views):
        normals = normals.reshape(-1, 3)
        views = np.broadcast_to(views, normals.shape)
        taps = DEFAULT_EVEN_TAPS
        return cases.expected(self.made, normals, views, self.roughness, self.f0, taps)


def opened(watched, html, tmp_path, size=(700, 500), **options):
    """Open a page from a file, and wait until it is drawn."""
    path = tmp_path / "page.html"
    path.write_text(html, encoding="utf-8")
    page = watched.page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(path.as_uri())
    return ready(watched)


def ready(watched):
    page = watched.page
    page.wait_for_selector(".shrm-view:not([data-state=loading])")
    assert page.locator(".problem").text_content() == ""
    page.wait_for_selector(".shrm-view[data-state=ready]")
    return page


def view(page, code, *arguments):
    """Run code on the page with `view`, and return its value."""
    text = f"async (given) => {{ const view = await window.shrm.views[0]; {code} }}"
    return page.evaluate(text, list(arguments))


def read(page, size=SIZE, side=0, **state):
    """RGBA of a square picture, shape (size, size, 4)."""
    code = "view.set(given[0]); return Array.from(view.read(given[1], given[2]));"
    values = view(page, code, state, size, side)
    return np.reshape(values, (size, size, 4))


def state(page, name):
    return view(page, f"return view.state.{name};")


# ---- pictures ------------------------------------------------------------------------------------


def test_pictures_of_every_form(watched, tmp_path, monkeypatch):
    """They are those of `shrm render` of the same texels, filtered bilinearly."""
    forms = {name: make() for name, make in cases.FORMS.items()}
    forms["irradiance"] = cases.irradiance(2)
    scene = make_scene(list(forms.values()), [f"{name}.exr" for name in forms])
    page = opened(watched, make_page(scene), tmp_path)
    cases.filter_bilinearly(monkeypatch)
    surface = {"roughness": 0.62, "f0": [0.9, 0.5, 0.04]}
    for number, (name, made) in enumerate(forms.items()):
        side = {"kind": "map", "number": number}
        values = list(scene.description["start"]["values"])
        for way in scene.description["maps"][number]["ways"]:
            values[way["number"]] = (way["low"] + way["high"]) / 2
        found = read(page, a=side, view=VIEW, background="plain", values=values, **surface)
        thing = Shaded(made, 0.62, (0.9, 0.5, 0.04)) if isinstance(made, LightMap) else made
        expected = render_sphere(thing, Viewer(33, -21), SIZE)
        # Rounding to half moves each coefficient by HALF of itself at most; a dozen of random sign
        # and size add up to a few times that of the largest radiance, which is what is compared.
        np.testing.assert_allclose(
            found[..., :3], expected, rtol=0, atol=2 * HALF * np.abs(expected).max(), err_msg=name
        )
    assert watched.errors == []
    assert [url[:8] for url in watched.requests] == ["file:///"]


@pytest.mark.parametrize("taps", [3, 8])
def test_brushed_surfaces_of_split_sums(watched, tmp_path, probe, taps, monkeypatch):
    """The page shows those of `shrm render --anisotropy --taps`, and even ones at anisotropy 0."""
    made, f0 = prefilter(probe, to="splitsum"), (1, 0.5, 0.1)
    start = Start(((33.0, -21.0),), None, 0.5, f0, 0.7, taps)
    truth = Truth(None, 64, 32)
    page = opened(
        watched, make_page(make_scene([made], ["a"], probe, None, start, truth)), tmp_path
    )
    surfaces = {
        0.7: BrushedSplitSum(made, 0.5, f0, 0.7, taps),
        0.0: Shaded(made, 0.5, f0),
    }
    cases.filter_bilinearly(monkeypatch)
    for anisotropy, surface in surfaces.items():
        found = read(page, 48, background="plain", anisotropy=anisotropy)[..., :3]
        expected = render_sphere(surface, Viewer(33, -21), 48)
        np.testing.assert_allclose(found, expected, rtol=0, atol=2 * HALF * expected.max())
        assert page.locator(".missing").is_hidden() == (anisotropy == 0.7)
    view(page, "view.set({anisotropy: 0.7});")
    brdf = Ggx(roughness=0.5, anisotropy=0.7, f0=f0)
    exact = render_sphere(Reference(probe, brdf, 32, exact=True), Viewer(33, -21), 32)
    found = read(page, 32, 1, background="plain")[..., :3]
    assert np.sqrt(np.mean((found - exact) ** 2) / np.mean(exact**2)) < 0.005
    page.locator('[name="anisotropy"]').fill("0.25")
    assert state(page, "anisotropy") == 0.25
    assert watched.errors == []


def ball():
    """A ball of triangles whose u runs around +Y."""
    u, v = (
        each.ravel() for each in np.meshgrid(np.linspace(0, 1, 49), np.linspace(0.02, 0.98, 25))
    )
    around, polar = 2 * np.pi * u, np.pi * v
    points = np.stack(
        [np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=1
    )
    first = (np.arange(24)[:, None] * 49 + np.arange(48)).ravel()
    faces = [[first, first + 49, first + 1], [first + 1, first + 49, first + 50]]
    faces = np.concatenate([np.stack(each, axis=1) for each in faces])
    return make_mesh("ball.obj", points, faces, normals=points, uvs=np.stack([u, v], axis=1))


@dataclass
class Along:
    """What a map or the truth reflects where tangents follow a direction."""

    source: object
    brush: tuple

    def radiance(self, normals, views):
        tangents = projected_tangents(normals, self.brush)
        return self.source.brushed_radiance(normals, tangents, views)


@pytest.mark.parametrize("form", ["splitsum", "principal", "product"])
def test_tangents_can_be_chosen(watched, tmp_path, probe, form, monkeypatch):
    """Along a direction they are those of `brushed_radiance`; on meshes they may be those of u."""
    brdf = parse_spec("ggx:roughness=0.6,anisotropy=0.6")
    made = prefilter(probe, None if form == "splitsum" else brdf, to=form)
    start = Start(((33.0, -21.0),), None, 0.6, (1, 1, 1), 0.6, brush=(0.0, 3.0, 3.0))
    scene = make_scene([made], ["a"], probe, ball(), start, Truth(brdf, 64, 32))
    page = opened(watched, make_page(scene), tmp_path)
    cases.filter_bilinearly(monkeypatch)
    shown = BrushedSplitSum(made, 0.6, (1, 1, 1), 0.6, 5) if form == "splitsum" else made

    def error(found, source, brush):
        expected = render_sphere(Along(source, brush), Viewer(33, -21), 48)
        return np.sqrt(np.mean((found[..., :3] - expected) ** 2) / np.mean(expected**2))

    assert page.locator(".missing").is_hidden()
    first = read(page, 48, background="plain")
    truth = read(page, 48, 1, background="plain")
    assert error(first, shown, (0, 1, 1)) < 0.01
    assert error(truth, Reference(probe, brdf, 32, exact=True), (0, 1, 1)) < 0.01
    page.locator('[name="brush"]').select_option(label="X")
    page.wait_for_selector(".missing:visible")
    assert error(read(page, 48, background="plain"), shown, (1, 0, 0)) < 0.01
    assert error(first, shown, (1, 0, 0)) > 0.05
    drawn = [
        read(page, 48, background="plain", shape=2, brush=each)[12:36, 12:36, :3]
        for each in (None, "uv", (1, 0, 0))
    ]
    apart = [np.linalg.norm(each - drawn[0]) / np.linalg.norm(drawn[0]) for each in drawn]
    print(f"{form}: u is {apart[1]:.2%} from around +Y, x {apart[2]:.2%}")
    assert apart[1] < 0.01 < 0.015 < apart[2]
    assert watched.errors == []


@pytest.mark.parametrize("axes", [("ay",), ("ax", "ay")])
def test_parameters_that_vary_have_sliders(watched, tmp_path, probe, axes):
    """Keys move them; a file's pictures are those of `shrm render --vary`, but for its rounding."""
    vary = [(name, 0.3, 0.5 + 0.2 * (name == "ay")) for name in axes]
    light = project(probe, 4).coefficients
    made = product("ward:ax=0.4", 4, 32, vary, 3).lit(light)
    scene = make_scene(
        [made],
        ["w.exr"],
        probe,
        None,
        Start(((33.0, -21.0),)),
        Truth(None, 32, 32),
        None,
        None,
        True,
    )
    page = opened(watched, make_page(scene), tmp_path)
    rows = page.locator('[data-group="ways"] label').all()
    assert [each.locator("span").text_content() for each in rows] == list(axes)
    sliders = [each.locator("input") for each in rows]
    assert page.locator(".missing").is_hidden()  # the truth is of the middle
    for share in (0, 0.2, 1):
        values = {name: low + share * (high - low) for name, low, high in vary}
        if len(axes) > 1:
            values["ax"] = 0.5 - 0.2 * share
        for slider, name in zip(sliders, axes, strict=True):
            slider.fill(f"{values[name]:.3f}")
        found = read(page, 48, background="plain")[..., :3]
        expected = render_sphere(made.with_values(values), Viewer(33, -21), 48)
        middle = render_sphere(made.with_values({}), Viewer(33, -21), 48)
        size = np.sqrt(np.mean(expected**2))
        assert np.sqrt(np.mean((found - expected) ** 2)) < 0.006 * size
        assert np.sqrt(np.mean((found - middle) ** 2)) > 0.04 * size
    assert page.locator(".missing").is_visible()
    assert rows[-1].locator("output").text_content() == "0.7"
    sliders[-1].focus()
    page.keyboard.press("ArrowLeft")
    assert state(page, "values")[-1] == pytest.approx(0.698)
    page.keyboard.press("t")
    assert state(page, "values") == pytest.approx([(low + high) / 2 for _, low, high in vary])
    page.wait_for_selector(".missing", state="hidden")
    assert watched.errors == []


def test_brushed_principal_maps(watched, tmp_path, probe):
    """Their tangents run around +Y, as in `shrm render`."""
    made = prefilter(probe, "ggx:roughness=0.6,anisotropy=0.6", to="principal")
    page = opened(watched, make_page(make_scene([made], ["a"])), tmp_path)
    assert page.locator('[name="anisotropy"]').is_hidden()
    found = read(page, 48, view=VIEW, background="plain")[..., :3]
    expected = render_sphere(made, Viewer(33, -21), 48)
    error = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert error < np.hypot(made.info.filter_error, HALF) + 4e-3  # of 24 azimuths a quarter turn
    assert watched.errors == []


def test_pages_of_rounded_textures(watched, tmp_path, probe):
    """Their pictures differ from those of whole ones by about as much as is said."""
    glossy = prefilter(probe, "microfacet:sigma=0.3", to="shrm")
    maps, names = [glossy, prefilter(probe, to="splitsum")], ["a.exr", "b.exr"]
    pictures = []
    for is_rounded in (False, True):
        scene = make_scene(maps, names, is_rounded=is_rounded)
        page = opened(watched, make_page(scene), tmp_path)
        sides = [{"kind": "map", "number": number} for number in range(2)]
        pictures.append([read(page, 48, a=side, view=VIEW)[..., :3] for side in sides])
    for number, (whole, rounded) in enumerate(zip(*pictures, strict=True)):
        error = np.linalg.norm(rounded - whole) / np.linalg.norm(whole)
        stated = scene.description["maps"][number]["textures"][0]["error"]
        print(f"{names[number]}: {error:.2e} of the picture, {stated:.2e} stated")
        assert 0.05 * stated < error < 1.5 * stated
    assert watched.errors == []


def test_pictures_are_those_of_render(watched, tmp_path, probe):
    """With its cubic filter, apart from the error that maps state of the bilinear look-up."""
    glossy = parse_spec("microfacet:sigma=0.3")
    wanted = {
        "shrm": {"brdf": glossy},
        "principal": {"brdf": glossy},
        "cabral": {"brdf": glossy},
        "irradiance": {},
        "splitsum": {},
        "she": {},
    }
    maps = {to: prefilter(probe, to=to, **given) for to, given in wanted.items()}
    maps["pca"] = maps["shrm"].converted("shrm", compress=4)
    page = opened(watched, make_page(make_scene(list(maps.values()), list(maps))), tmp_path)
    for number, (name, made) in enumerate(maps.items()):
        side = {"kind": "map", "number": number}
        given = {"a": side, "view": VIEW, "background": "plain"}
        found = read(page, 48, roughness=0.5, f0=[1, 0.5, 0.1], **given)[..., :3]
        expected = render_sphere(made.shaded(0.5, (1, 0.5, 0.1)), Viewer(33, -21), 48)
        error = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
        # The stated error is the mean over all orientations and views, so that one of them may have
        # more. The table of the environment-BRDF of 128 entries is filtered, too: 1e-3.
        stated = np.hypot(made.info.filter_error, HALF) + 1e-3 * isinstance(made, LightMap)
        print(f"{name}: {error:.2e}, stated {stated:.2e}")
        print(stated), name


def test_other_primaries_are_shown_as_those_of_screens(watched, tmp_path, probe):
    """The same numbers once in ACEScg and once in Rec.709, beside their probe and their truth."""
    import colour

    wide = Probe.from_array(probe.image(), name="wide.exr", chromaticities=PRIMARIES["acescg"])
    made = prefilter(wide, "microfacet:sigma=0.4", size=16)
    html = make_page(make_scene([made], ["wide.exr"], wide, truth=Truth(size=24)))
    page = opened(watched, html, tmp_path)
    source = colour.RGB_COLOURSPACES["ACEScg"]
    matrix = colour.matrix_RGB_to_RGB(source, "ITU-R BT.709", "Bradford")
    straight = {"view": {"azimuth": 0, "elevation": 0, "zoom": 1}}
    ball = read(page, 32, a=SIDE, background="plain", **straight)[..., :3]
    expected = render_sphere(made, Viewer(0, 0), 32) @ matrix.T
    # Bilinear look-ups cost some of it; without the matrix it would be a tenth.
    np.testing.assert_allclose(ball, expected, rtol=0, atol=0.01 * expected.max())
    truth = read(page, 32, a={"kind": "truth"}, background="plain", **straight)[..., :3]
    # A map of this size differs from the truth, but by far less than colours of other primaries.
    unconverted = render_sphere(made, Viewer(0, 0), 32)
    assert np.linalg.norm(truth - expected) < 0.03 * np.linalg.norm(expected)
    assert np.linalg.norm(truth - unconverted) > 0.06 * np.linalg.norm(expected)
    whole = read(page, 32, a=SIDE, background="probe", **straight)
    off = whole[..., 3] == 0
    behind = render_background(wide, Viewer(0, 0), 32)[off] @ matrix.T
    np.testing.assert_allclose(whole[off, :3], behind, rtol=0, atol=0.005 * behind.max())


def test_the_probe_is_behind_the_sphere(watched, tmp_path, probe):
    html = make_page(make_scene([cases.irradiance(2)], ["a.exr"], probe, truth=Truth(size=0)))
    page = opened(watched, html, tmp_path)
    found = read(page, 32, view=VIEW)
    expected = render_background(probe, Viewer(33, -21), 32)
    off = found[..., 3] == 0
    assert 0.2 < off.mean() < 0.5
    # Half precision of the pixels, and single precision of the places between them.
    np.testing.assert_allclose(found[off, :3], expected[off], rtol=4 * HALF)


def test_pictures_of_a_mesh(watched, tmp_path):
    """The inner pixels are those of `shrm render --mesh`; the page smooths edges otherwise."""
    from shrm_cli.render.camera import Aim, Lens
    from shrm_cli.render.mesh import MeshSubject
    from shrm_cli.render.stage import Actor, Look, Stage

    made = cases.irradiance(2)
    mesh = figure()
    moved = make_mesh("moved.obj", 3 * mesh.vertices + [5, 1, 2], mesh.faces, normals=mesh.normals)
    scene = make_scene([made], ["a.exr"], mesh=moved)
    shape = scene.description["shapes"][2]
    page = opened(watched, make_page(scene), tmp_path)
    size = 192
    found = read(page, size, shape=2, view=VIEW)
    middle = (moved.vertices.min(axis=0) + moved.vertices.max(axis=0)) / 2
    stage = Stage.of([Actor(moved, [Look()])])
    aim = Aim(middle, shape["distance"] * shape["radius"])
    subject = MeshSubject(stage, Lens(size, size), aim)
    expected = subject.draw(stage.reflectors(made), Viewer(33, -21))
    inside = found[..., 3] == 1
    inner = inside.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(inside, step, axis)
    assert inner.sum() > 3000
    apart = np.abs(found[..., :3] - expected).max(axis=-1)
    slope = sum(np.abs(np.gradient(expected, axis=k)).max(axis=-1) for k in (0, 1))
    # Rasterizers round vertices to a 16th of a pixel. Creases and outlines within the mesh have 16
    # samples in one picture, and one in the other.
    share = apart[inner] / (slope[inner] + 1e-3 * np.abs(expected).max())
    print(f"mesh: {np.median(share):.3f} pixels, {np.mean(share > 0.25):.1%} beyond a quarter")
    assert np.median(share) < 1 / 16
    assert np.mean(share > 0.25) < 0.1


def test_the_truth_beside_a_map(watched, tmp_path, probe):
    """It is the brute-force picture of its own view, and of no other."""
    brdf = parse_spec("microfacet:sigma=0.3")
    made = replace(cases.irradiance(2), info=replace(make_info(2, 0), brdf=record_of(brdf)))
    start = Start(((33.0, -21.0), (100.0, 10.0)))
    html = make_page(make_scene([made], ["a.exr"], probe, start=start, truth=Truth(None, 64, 32)))
    page = opened(watched, html, tmp_path)
    found = read(page, 32, 1, background="plain")[..., :3]
    expected = render_sphere(Reference(probe, brdf, 32, exact=True), Viewer(33, -21), 32)
    error = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert error < 0.005  # of interpolating between 64 points across the sphere
    page.locator("canvas").first.focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_selector(".missing", state="visible")
    page.keyboard.press("t")
    page.wait_for_selector(".missing", state="hidden")
    assert state(page, "view.azimuth") == 33
    view(page, "view.set({view: {azimuth: 90, elevation: 0, zoom: 1}});")
    page.locator('[data-do="truth-view"]').click()
    assert state(page, "view.azimuth") == 100


def test_the_error_is_that_of_compare(watched, tmp_path):
    from shrm_cli.render.comparison import measure

    maps = [cases.irradiance(2), cases.irradiance(1)]
    page = opened(watched, make_page(make_scene(maps, ["a.exr", "b.exr"])), tmp_path)
    page.locator("canvas").first.focus()
    page.keyboard.press("d")
    page.wait_for_selector(".measure:has-text('%')")
    shown = float(page.locator(".measure").text_content().split(":")[1].rstrip(" %")) / 100
    pictures = [render_sphere(each, Viewer(0, 0), 128) for each in maps]
    assert shown == pytest.approx(measure(*pictures).relative_rmse, rel=0.01)


TURNING = {
    "product": {"brdf": "ggx:roughness=0.5,f0=0.9/0.6/0.3", "order": 6, "texels": 64},
    "irradiance": {"order_f": 4},
    "zh3": {"form": "zh3"},
    "she": {},
    "splitsum": {},
    "shrm": {"brdf": "microfacet:sigma=0.3"},
}
"""Maps whose light is turned on a page: product textures, SH exponentials and others."""
UPDATE = """
    const target = { width: 8, height: 8, frame: null };
    const gl = view.gl, drawn = () => view.renderer.draw(target, view.state.a, view.state, [0, 0]);
    let bytes = 0, draws = 0;
    const counted = [];
    for (const name in gl) if (/^(tex|buffer|compressedTex)|^uniform|^draw/.test(name)) {
        counted.push(name);
        gl[name] = function (...given) {
            draws += name.startsWith("draw");
            for (const each of given) bytes += each && (each.byteLength || 4 * each.length) || 0;
            return Object.getPrototypeOf(gl)[name].apply(gl, given);
        };
    }
    for (let k = 1; k < 5; k++) { view.turnLight(given[0] * k); drawn(); }
    for (const name of counted) delete gl[name];
    view.turnLight(0);
    return [bytes / 4, draws / 4];
"""
"""Bytes that a turn of the light sends to the device, and its draws: no map is sent anew."""


def test_turned_light_is_that_of_maps_of_the_turned_probe(watched, tmp_path, probe):
    """A frame of turned light is what `shrm prefilter --yaw` and `shrm render` draw."""
    path, yaw = tmp_path / "lamp.exr", 73.0
    write_exr(path, probe.image())
    straight, yawed = open_probe(path), open_probe(path, ReadOptions(yaw=yaw))
    pairs = {}
    for name, given in TURNING.items():
        spec = {"brdf": parse_spec(given["brdf"])} if "brdf" in given else {}
        to = "irradiance" if name == "zh3" else name
        pairs[name] = [prefilter(each, to=to, **{**given, **spec}) for each in (straight, yawed)]
    maps = [made for made, _ in pairs.values()]
    scene = make_scene(maps, list(pairs), straight, truth=Truth(size=0))
    page = opened(watched, make_page(scene), tmp_path)
    surface = 0.5, (1.0, 0.6, 0.2)
    for number, (name, (made, turned)) in enumerate(pairs.items()):
        state = {"a": {"kind": "map", "number": number}, "view": VIEW, "background": "plain"}
        state |= {"light": yaw, "roughness": surface[0], "f0": surface[1]}
        found = read(page, 48, **state)[..., :3]
        expected, still = (
            render_sphere(each.shaded(*surface), Viewer(33, -21), 48) for each in (turned, made)
        )
        error, moved = (
            np.linalg.norm(each - expected) / np.linalg.norm(expected) for each in (found, still)
        )
        sent, draws = view(page, UPDATE, 0.5)
        print(f"{name}: {error:.2e} of a turned frame, {moved:.0%} unturned, {sent:.0f} bytes sent")
        stated = np.hypot(turned.info.filter_error, HALF) + 1e-3 * isinstance(made, LightMap)
        if name == "she":  # whose fit to the pixels of the turned probe is a little different
            own = render_sphere(made.turned(turn_matrix(yaw)).shaded(*surface), Viewer(33, -21), 48)
            stated += np.linalg.norm(own - expected) / np.linalg.norm(expected)
        assert error < 2 * stated
        assert moved > 20 * error
        assert 0 < sent < 1024
        assert draws == 1
    whole = read(page, 32, light=yaw, background="probe")
    off = whole[..., 3] == 0
    behind = render_background(yawed, Viewer(33, -21), 32)[off]
    np.testing.assert_allclose(whole[off, :3], behind, rtol=0.02)
    assert watched.errors == []


def test_the_light_turns_until_it_is_stopped(two):
    assert two.evaluate("document.activeElement === document.body")  # keys need no click first
    two.keyboard.press("l")
    two.wait_for_selector('[name="light"] + output:not(:has-text("0\u00b0"))')
    two.locator('[data-do="spin"]').click()
    light = state(two, "light")
    two.wait_for_timeout(200)
    assert state(two, "light") == light
    two.locator('[name="light"]').fill("-40")
    assert state(two, "light") == -40
    two.locator('[data-do="reset"]').click()
    assert state(two, "light") == 0


def test_resized_while_it_loads(watched, tmp_path, probe):
    """The picture is that of a page which had the last size at once."""
    glossy = prefilter(probe, "microfacet:sigma=0.3", to="shrm")
    path = tmp_path / "page.html"
    path.write_text(make_page(make_scene([glossy], ["a.exr"])), encoding="utf-8")
    page, pictures = watched.page, []
    for sizes in ([(700, 500), (500, 600), (640, 420)], [(640, 420)]):
        page.set_viewport_size({"width": sizes[0][0], "height": sizes[0][1]})
        page.goto(path.as_uri(), wait_until="commit")
        for width, height in sizes[1:]:
            page.set_viewport_size({"width": width, "height": height})
        ready(watched)
        page.wait_for_timeout(1500)
        pictures.append(page.locator("canvas").first.screenshot())
    assert pictures[0] == pictures[1]
    assert page.evaluate("window.innerWidth") == 640


# ---- controls ------------------------------------------------------------------------------------


@pytest.fixture
def two(watched, tmp_path):
    """A page of two maps that are drawn fast, one of them wanting a surface."""
    maps = [cases.irradiance(2), cases.exponential("lobe")]
    return opened(watched, make_page(make_scene(maps, ["one.exr", "two.exr"])), tmp_path)


def test_keys(two, watched):
    two.locator("canvas").first.focus()
    before = state(two, "view")
    for key, name, expected in (
        ("ArrowRight", "view.azimuth", before["azimuth"] + 5),
        ("Shift+ArrowUp", "view.elevation", before["elevation"] + 1),
        ("+", "view.zoom", pytest.approx(1.1)),
        ("2", "a.number", 1),
        ("Shift+1", "b.number", 0),
        ("x", "a.number", 0),
        ("s", "shape", 1),
        ("d", "mode", 1),
        ("d", "mode", 2),
        ("d", "mode", 3),
        ("d", "mode", 0),
        (">", "divider", pytest.approx(0.55)),
        (".", "roughness", pytest.approx(0.55)),
        ("r", "shape", 0),
    ):
        two.keyboard.press(key)
        assert state(two, name) == expected, key
    exposure = state(two, "exposure")
    two.keyboard.press("]")
    assert state(two, "exposure") == exposure + 0.25
    two.keyboard.press("?")
    assert two.locator(".help").is_visible()
    two.keyboard.press("Escape")
    assert not two.locator(".help").is_visible()
    assert watched.errors == []


def test_a_blend_is_the_map_of_blended_light(watched, tmp_path, probe):
    """Three quarters of the way from one probe to another; the slider moves it."""
    first = np.asarray(probe.image())
    second = np.roll(first, 11, axis=1) * [0.4, 1.0, 2.0]
    lights = first, second, 0.25 * first + 0.75 * second
    maps = [
        prefilter(
            Probe.from_array(light.astype(np.float32), "latlong"), "phong:exponent=20", to="shrm"
        )
        for light in lights
    ]
    names = ["a.exr", "b.exr", "c.exr"]
    page = opened(watched, make_page(make_scene(maps, names, is_rounded=False)), tmp_path)

    def screen():
        page.wait_for_timeout(1500)
        data = page.locator("canvas").first.screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(float)

    side = '{kind: "map", number: %d}'
    view(page, f"view.set({{a: {side % 2}, b: null, exposure: -2}});")
    wanted = screen()
    view(page, f"view.set({{a: {side % 0}, b: {side % 1}, mode: 3}});")
    page.locator('[name="divider"]').fill("75")
    blended = screen()
    page.locator('[name="divider"]').fill("25")
    other = screen()
    last, drawn = view(
        page,
        """var draw = view.renderer.draw, count = 0;
        view.renderer.draw = function () { count++; return draw.apply(this, arguments); };
        for (var k = 0; k < 100; k++) { view.divide(k / 100); view.show(); }
        await new Promise((done) => setTimeout(done, 300));
        view.renderer.draw = draw;
        return [view.state.divider, count];""",
    )
    assert last == 0.99
    assert drawn == 0  # neither picture is drawn anew
    assert np.ptp(wanted) > 50
    # Tags lie upon the corners, and the maps' own errors are within a step or two of 8 bits.
    middle = np.s_[100:-100, 60:-60]
    assert np.abs(blended[middle] - wanted[middle]).max() <= 3
    assert np.abs(other[middle] - wanted[middle]).max() > 20
    assert watched.errors == []


def test_fields_and_the_mouse(two):
    two.locator('[name="exposure"]').fill("2")
    assert state(two, "exposure") == 2
    two.locator('[name="roughness"]').fill("0.8")
    assert state(two, "roughness") == 0.8
    two.locator('[name="metal"]').select_option(label="Gold")
    assert state(two, "f0") == [1, 0.782, 0.344]
    two.locator('[name="shape"]').select_option(label="Figure")
    assert state(two, "shape") == 1
    two.locator('[name="shape"]').select_option(label="Sphere")
    canvas = two.locator("canvas").first.bounding_box()
    middle = canvas["x"] + canvas["width"] / 2, canvas["y"] + canvas["height"] / 2
    two.mouse.move(*middle)
    two.mouse.down()
    two.mouse.move(canvas["x"] + 0.25 * canvas["width"], middle[1])
    two.mouse.up()
    assert state(two, "divider") == pytest.approx(0.25, abs=0.01)
    two.mouse.move(*middle)
    two.mouse.down()
    two.mouse.move(middle[0] - 40, middle[1])
    two.mouse.up()
    assert state(two, "view.azimuth") > 5  # the camera goes to the right
    two.mouse.wheel(0, -200)
    two.wait_for_selector("[data-row=zoom] output:not(:has-text('1.00'))")
    assert state(two, "view.zoom") > 1.2


def test_values_under_the_mouse_are_radiance(two):
    view(two, "view.set({b: null, exposure: 3});")
    two.wait_for_timeout(300)
    box = two.locator("canvas").first.bounding_box()
    place = box["x"] + 0.6 * box["width"], box["y"] + 0.4 * box["height"]
    two.mouse.move(*place)
    two.wait_for_selector(".readout:not(:empty)")
    numbers = two.locator(".readout").text_content()[1:].split("Y")[0]
    shown = [float(each) for each in numbers.split()]
    edge = min(box["width"], box["height"])
    x = (0.1 * box["width"]) / (0.45 * edge)
    y = (0.1 * box["height"]) / (0.45 * edge)
    normal = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    expected = cases.irradiance(2).radiance(normal, [0, 0, 1])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(shown, expected, rtol=0, atol=0.02 * scale)  # a pixel is 1/180


def test_the_picture_button_saves_a_png(two):
    with two.expect_download() as started:
        two.locator('[data-do="picture"]').click()
    assert started.value.suggested_filename == "one.png"
    with open(started.value.path(), "rb") as file:
        assert file.read(8) == b"\x89PNG\r\n\x1a\n"


def test_every_control_has_a_name_and_a_phone_shows_all(two):
    two.set_viewport_size({"width": 400, "height": 800})
    assert two.evaluate("document.documentElement.scrollWidth") <= 400
    assert two.evaluate("document.querySelector('.panel').scrollWidth") <= 400
    unnamed = two.evaluate("""
        [...document.querySelectorAll('input, select, button')].filter(each =>
            !(each.labels && each.labels.length && each.labels[0].textContent.trim())
            && !each.getAttribute('aria-label') && !each.textContent.trim()
        ).map(each => each.outerHTML)
    """)
    assert unnamed == []


# ---- what must not happen ------------------------------------------------------------------------


def test_names_of_files_are_text(watched, tmp_path):
    attack = "</script><img src=x onerror=window.hacked=1><!--"
    made = replace(cases.irradiance(2), info=replace(make_info(2, 0), probe=attack))
    name = "<img src=x onerror=window.hacked=1>.exr"
    page = opened(watched, make_page(make_scene([made], [name])), tmp_path)
    assert page.evaluate("window.hacked") is None
    assert page.locator("img").count() == 0
    assert attack in page.locator(".facts").text_content()
    assert page.locator("h1").text_content() == name[:-4]
    assert watched.errors == []


def test_a_served_page_asks_its_own_server_alone(watched):
    scene = make_scene([cases.FORMS["shrm"]()], ["a.exr"])
    with PageServer(scene) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            watched.page.goto(server.url)
            page = ready(watched)
            found = read(page, 16)
        finally:
            server.shutdown()
            thread.join()
    assert np.abs(found).max() > 0
    assert all(url.startswith(server.url) for url in watched.requests)
    assert len(watched.requests) == 1 + len(scene.blocks.parts)
    assert watched.errors == []


def test_frames_a_second(watched, tmp_path, probe):
    """Printed for whoever wonders; processors draw in tests, so nothing is asked of it."""
    made = prefilter(probe, to="shrm", brdf=parse_spec("microfacet:sigma=0.3"))
    page = opened(watched, make_page(make_scene([made], ["a.exr"])), tmp_path, (300, 400))
    found = view(page, "return view.framesPerSecond(1024, 2);")
    print(f"SHRM of P = {made.order_p}, 1024 x 1024: {found:.2f} frames a second")
    assert np.isfinite(found)
