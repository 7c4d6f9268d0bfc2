"""What files say of surfaces, in pictures: against what it must look like, and against Mitsuba."""

import copy

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.geometry.paint import Points
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Lens, Viewer, aimed
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.scene_file import Shown
from shrm_cli.render.stage import Stage, transformation
from shrm_cli.render.variation import VariedSurface
from shrm_cli.vocabulary import PRIMARIES
from tests.render.assets import globe, obj_text, packed_glb, png, textures
from tests.render.materials import INFO
from tests.render.test_mitsuba import VIEW, relative_rms, soft_sky

COLORS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]])
LINEAR = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [0.503, 0.503, 0.503]]])
"""Red and green over blue and gray, as pixels and as light; 188 of sRGB reflects a half."""
NEAREST = {"magFilter": 9728}
FRONT = Viewer(0, 0)


def quad(uvs=((0, 1), (1, 1), (1, 0), (0, 0)), turn=0.0):
    """A square that faces +Z; its texture coordinates have v down."""
    c, s = np.cos(turn), np.sin(turn)
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], dtype=float)
    corners[:, :2] = corners[:, :2] @ [[c, s], [-s, c]]
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    return corners, faces, np.broadcast_to([0, 0, 1.0], (4, 3)), np.array(uvs, dtype=float)


def material(**given):
    base = {"baseColorTexture": {"index": 0, **given.pop("texture", {})}}
    return {"name": "m", "pbrMetallicRoughness": {**base, **given.pop("pbr", {})}, **given}


def white():
    """Light from all sides, which a white diffuse surface reflects as 1."""
    return Irradiance(np.array([[np.sqrt(4 * np.pi)] * 3, *[[0.0] * 3] * 8]), INFO)


def picture(path, light, size=40, view=FRONT, shown=None, fov=20.0):
    mesh = load_mesh(path)
    stage = Stage.of([(shown or Shown()).actor(mesh, None)])
    lens = Lens(size, size, fov)
    subject = MeshSubject(stage, lens, aimed(mesh.vertices, [view], lens))
    return subject.draw(stage.reflectors(light), view).astype(float), subject


def quarters(found):
    """The colours in the middles of the four quarters of a square."""
    size = len(found)
    at = [round(size * (0.5 + side * 0.2)) for side in (-1, 1)]
    return found[np.ix_(at, at)]


def drawn(tmp_path, given, shape=None, pictures=None, samplers=(NEAREST,), extra=None, **rest):
    path = tmp_path / "a.glb"
    held = [png(COLORS)] if pictures is None else pictures
    path.write_bytes(packed_glb(shape or quad(), given, held, samplers, extra))
    return picture(path, white(), **rest)[0]


def test_colours_are_linear_and_upright(tmp_path):
    np.testing.assert_allclose(quarters(drawn(tmp_path, material())), LINEAR, atol=2e-3)


def test_factors_and_vertex_colours_multiply(tmp_path):
    extra = {"COLOR_0": np.broadcast_to([0.5, 1.0, 0.25], (4, 3))}
    given = material(pbr={"baseColorFactor": [1, 0.5, 0.5, 1]})
    found = quarters(drawn(tmp_path, given, extra=extra))
    np.testing.assert_allclose(found, LINEAR * [0.5, 0.5, 0.125], atol=2e-3)


def test_the_second_coordinates_and_transforms(tmp_path):
    """Turned by 90 degrees counter-clockwise, coordinates (u, v) become (v, -u), v down."""
    second = quad()[3][:, ::-1]
    given = material(texture={"texCoord": 1})
    found = drawn(tmp_path, given, quad(np.zeros((4, 2))), extra={"TEXCOORD_1": second})
    np.testing.assert_allclose(quarters(found), LINEAR.swapaxes(0, 1), atol=2e-3)
    for moved, expected in (
        ({"rotation": np.pi / 2}, LINEAR[:, ::-1].swapaxes(0, 1)[::-1, ::-1]),
        ({"offset": [0.5, 0]}, LINEAR[:, ::-1]),
        ({"scale": [1, -1]}, LINEAR[::-1]),
        ({"scale": [0.5, 0.5], "offset": [0, 0.5]}, np.broadcast_to(LINEAR[1, 0], (2, 2, 3))),
    ):
        held = {"extensions": {"KHR_texture_transform": moved}}
        found = quarters(drawn(tmp_path, material(texture=held)))
        np.testing.assert_allclose(found, expected, atol=2e-3, err_msg=str(moved))


@pytest.mark.parametrize(("apart", "is_seen"), [(0.01, True), (4.2e-5, True), (1.8e-5, False)])
def test_what_is_cut_out_shows_what_lies_behind(tmp_path, apart, is_seen):
    """Two quads, the nearer one with holes of alpha 0.3 at left; the one behind has none.

    Within 1e-5 of the diagonal they are one.
    """
    near, faces, normals, uvs = quad()
    shape = (
        np.concatenate([near + np.array([0, 0, apart]), near]),
        np.concatenate([faces, faces + 4]),
        np.concatenate([normals, normals]),
        np.concatenate([uvs * 0.5, uvs * 0.5 + 0.5]),
    )
    # Green with holes in the quarter at the top left, opaque blue in that at the bottom right.
    pixels = np.zeros((4, 4, 4))
    pixels[:2, :2] = [[[0, 255, 0, 76], [0, 255, 0, 255]]] * 2
    pixels[2:, 2:] = [0, 0, 255, 255]
    masked = material(alphaMode="MASK", alphaCutoff=0.4)
    found = quarters(drawn(tmp_path, masked, shape, [png(pixels)]))
    np.testing.assert_allclose(found, [[[0, 0, int(is_seen)], [0, 1, 0]]] * 2, atol=1e-6)
    opaque = quarters(drawn(tmp_path, material(), shape, [png(pixels)]))
    np.testing.assert_allclose(opaque, np.broadcast_to([0, 1, 0], (2, 2, 3)), atol=1e-6)


def test_occlusion_and_emission(tmp_path):
    pictures = [png(COLORS), png(np.full((1, 1), 51)), png(np.full((1, 1, 3), 188))]
    given = material(
        occlusionTexture={"index": 1, "strength": 0.5},
        emissiveTexture={"index": 2},
        emissiveFactor=[0, 0, 0.5],
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
    )
    found = quarters(drawn(tmp_path, given, pictures=pictures, samplers=[NEAREST] * 3))
    np.testing.assert_allclose(found, 0.6 * LINEAR + [0, 0, 2 * 0.503], atol=2e-3)


class Normals:
    """A stand-in for a reflector that shows the normals."""

    variation = paint = None

    def radiance(self, normals, views, tangents=None, shares=None, painted=None, points=None):
        return normals


@pytest.mark.parametrize("kind", ["plain", "turned", "mirrored", "tangents", "transform", "obj"])
def test_normal_maps_turn_normals_along_the_texture(tmp_path, kind):
    """A constant normal that leans to the texture's right and upwards, on a turned square."""
    turn, c, s = 0.5, np.cos(0.5), np.sin(0.5)
    right, up = np.array([c, s, 0]), np.array([-s, c, 0])  # of the square
    shape, extra, held = quad(turn=turn), None, {}
    if kind == "turned":  # the texture's right is the square's downwards
        shape, (right, up) = quad([(1, 1), (1, 0), (0, 0), (0, 1)][::-1], turn), (-up, right)
        shape = (*shape[:3], np.array([(0, 0), (0, 1), (1, 1), (1, 0)])[[3, 0, 1, 2]])
        (right, up) = _axes(shape)
    elif kind == "mirrored":
        shape = quad([(1, 1), (0, 1), (0, 0), (1, 0)], turn)
        right = -right
    elif kind == "tangents":  # those of the file hold
        extra = {"TANGENT": np.broadcast_to([0, 1, 0, -1.0], (4, 4))}
        right, up = np.array([0, 1.0, 0]), np.array([1.0, 0, 0])
    elif kind == "transform":
        held = {"extensions": {"KHR_texture_transform": {"rotation": 0.7, "scale": [2, 2]}}}
        # Coordinates turn counter-clockwise, so that the image turns clockwise.
        c, s = np.cos(0.7), np.sin(0.7)
        right, up = c * right - s * up, s * right + c * up
    local = np.array([0.48, 0.36, 0.8])
    pixels = png(np.broadcast_to(np.round((local + 1) * 127.5), (2, 2, 3)))
    path = tmp_path / ("a.obj" if kind == "obj" else "a.glb")
    if kind == "obj":
        (tmp_path / "n.png").write_bytes(pixels)
        (tmp_path / "a.mtl").write_text("newmtl m\nnorm -bm 1 n.png\n")
        path.write_text(obj_text(shape, "a.mtl", "m"))
    else:
        given = {"normalTexture": {"index": 0, **held}}
        path.write_bytes(packed_glb(shape, given, [pixels], extra=extra))
    mesh = load_mesh(path)
    stage = Stage.of([Shown().actor(mesh, None)])
    lens = Lens(16, 16, 20.0)
    subject = MeshSubject(stage, lens, aimed(mesh.vertices, [FRONT], lens))
    found = subject.draw([None, Normals()], FRONT)[8, 8]
    expected = local[0] * right + local[1] * up + local[2] * np.array([0, 0, 1])
    np.testing.assert_allclose(found, expected, atol=0.01)


def _axes(shape):
    """The directions of u and of -v, v down, of a flat mesh, by its first triangle."""
    points, places = shape[0][shape[1][0]], shape[3][shape[1][0]]
    edges = np.stack([points[1] - points[0], points[2] - points[0]], axis=1)
    steps = np.stack([places[1] - places[0], places[2] - places[0]], axis=1)
    right, down = (edges @ np.linalg.inv(steps)).T
    return right / np.linalg.norm(right), -down / np.linalg.norm(down)


def test_an_obj_looks_as_the_same_gltf(tmp_path):
    """With textures beside it: all of them, and two materials."""
    shape = globe(24)
    color, packed, normals = textures(64)
    pictures = [png(each) for each in (color, packed, normals)]
    pbr = {"metallicRoughnessTexture": {"index": 1}}
    given = material(pbr=pbr, normalTexture={"index": 2, "scale": 0.5})
    (tmp_path / "a.glb").write_bytes(packed_glb(shape, given, pictures))
    for name, held in (("c", pictures[0]), ("n", pictures[2])):
        (tmp_path / f"{name}.png").write_bytes(held)
    (tmp_path / "r.png").write_bytes(png(packed[..., 1]))
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "m.png").write_bytes(png(packed[..., 2]))
    (tmp_path / "a.mtl").write_text(
        "# materials\nnewmtl other\nKd 1 0 0\n\nnewmtl worn paint\nNs 10\nKd 1 1 1\nmap_Kd c.png\n"
        "map_Pr -clamp off r.png\nmap_Pm sub\\m.png\nmap_Bump -bm 0.5 n.png\n"
    )
    (tmp_path / "a.obj").write_text(obj_text(shape, "a.mtl", "worn paint"))
    rng = np.random.default_rng(3)
    levels = tuple(rng.random((6 * n, n, 3)) for n in (16, 8, 4))
    light = SplitSum(levels, (0.0, 0.5, 1.0), "linear", INFO)
    shown = Shown(irradiance=white())
    pair = [picture(tmp_path / name, light, 32, VIEW, shown)[0] for name in ("a.glb", "a.obj")]
    assert pair[0].std() > 0.05
    np.testing.assert_allclose(pair[0], pair[1], atol=2e-4)


def test_several_materials_of_an_obj(tmp_path):
    """Each triangle has its own; one whose file lacks it is said to be missing."""
    lines = ["mtllib m.mtl", "v -1 -1 0", "v 1 -1 0", "v 1 1 0", "v -1 1 0"]
    lines += ["usemtl red", "f 1 2 3", "usemtl none", "f 1 3 4"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0.25 0\nNs 6\nPm 0.5\nmap_Ks s.png\nPr x\n")
    found, subject = picture(tmp_path / "a.obj", white())
    np.testing.assert_allclose(found[24, 30], [1, 0.25, 0], atol=1e-6)
    np.testing.assert_allclose(found[10, 16], [1, 1, 1], atol=1e-6)
    first = subject.stage.mesh.materials[0]
    assert first.roughness == pytest.approx((2 / 8) ** 0.25)
    assert first.metallic == 0.5
    unread = subject.stage.unread([white()])
    assert unread == [
        "'red' (map_Ks, Pr without numbers)",
        "'none' (which m.mtl does not have)",
    ]


def test_vertex_colours_of_ply_are_srgb(tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    header += "".join(f"property float {each}\n" for each in "xyz")
    header += "".join(f"property uchar {each}\n" for each in ("red", "green", "blue"))
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    rows = ["-1 -1 0 188 0 255", "1 -1 0 188 0 255", "0 1 0 188 0 255", "3 0 1 2"]
    (tmp_path / "a.ply").write_text(header + "\n".join(rows) + "\n")
    found, _ = picture(tmp_path / "a.ply", white())
    np.testing.assert_allclose(found[20, 20], [0.503, 0, 1], atol=2e-3)
    plain, _ = picture(tmp_path / "a.ply", white(), shown=Shown(plain=True))
    np.testing.assert_allclose(plain[20, 20], [1, 1, 1], atol=1e-6)


@pytest.mark.proof
@pytest.mark.parametrize("form", ["splitsum", "she"])
def test_surfaces_that_vary_lie_between_those_that_do_not(form, rng):
    light = prefilter(Probe.from_array(soft_sky(32), layout="latlong"), None, to=form)
    normals = rng.normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    views = np.roll(normals, 1, axis=0)
    views *= np.sign(np.einsum("ij,ij->i", normals, views))[:, None]
    roughness, f0 = rng.uniform(0.2, 1, 60), rng.uniform(0, 1, (60, 3))
    found = VariedSurface(light).radiance(normals, views, None, roughness, f0)
    each = [light.shaded(roughness[k], tuple(f0[k])) for k in range(60)]
    alone = np.array([each[k].radiance(normals[k], views[k]) for k in range(60)])
    # Exponentials move their lobe with f0; what a surface reflects is linear in it.
    off = np.sqrt(np.mean((found - alone) ** 2) / np.mean(alone**2))
    assert off < (0.001 if form == "splitsum" else 0.005)
    same = VariedSurface(light).radiance(normals, views, None, np.full(60, 0.37), f0[:1] + 0 * f0)
    one = light.shaded(0.37, tuple(f0[0])).radiance(normals, views)
    np.testing.assert_allclose(same, one, rtol=1e-12)


def test_colours_are_converted_to_the_primaries_of_the_light(tmp_path):
    """Red of Rec.709 in ACEScg, as the Academy's transforms have it."""
    (tmp_path / "a.glb").write_bytes(packed_glb(quad(), material(), [png(COLORS)]))
    mesh = load_mesh(tmp_path / "a.glb")
    paint = Shown().actor(mesh, PRIMARIES["acescg"]).looks[1].paint
    points = Points(mesh, np.zeros(1, dtype=int), np.array([[0, 0.25, 0.75]]), np.zeros((1, 3, 2)))
    # At u = 1, v = 1/4 from the top: in the middle between red and green, repeated.
    red, green = np.array([0.6131, 0.0702, 0.0206]), np.array([0.3395, 0.9164, 0.1096])
    np.testing.assert_allclose(paint.at(points).base_color[0], (red + green) / 2, atol=2e-3)


def test_roughness_beyond_what_a_map_was_made_for_is_said(tmp_path):
    given = material(pbr={"metallicRoughnessTexture": {"index": 1}, "roughnessFactor": 0.5})
    pictures = [png(COLORS), png(np.full((2, 2, 3), [[[0, 51, 0]], [[0, 255, 0]]]))]
    (tmp_path / "a.glb").write_bytes(packed_glb(quad(), given, pictures))
    stage = Stage.of([Shown().actor(load_mesh(tmp_path / "a.glb"), None)])
    light = SplitSum((np.ones((24, 4, 3)), np.ones((12, 2, 3))), (0.2, 0.4), "linear", INFO)
    assert stage.warnings("light", light) == [
        f"light: it was made for roughness 0.2 .. 0.4, not {each}" for each in (0.1, 0.5)
    ]


def test_parts_without_coordinates_stand_beside_others_with_a_texture(tmp_path):
    """In a scene of two meshes, of which one has vertex colours, too."""
    (tmp_path / "a.glb").write_bytes(packed_glb(quad(), material(), [png(COLORS)], [NEAREST]))
    textured = load_mesh(tmp_path / "a.glb").transformed(transformation((-1, 0, 0)))
    corners = quad()[0] + [1, 0, 0]
    bare = make_mesh("b.obj", corners, quad()[1])
    stage = Stage.of([Shown().actor(each, None) for each in (textured, bare)])
    lens = Lens(40, 20, 20.0)
    subject = MeshSubject(stage, lens, aimed(stage.mesh.vertices, [FRONT], lens))
    found = subject.draw(stage.reflectors(white()), FRONT)
    np.testing.assert_allclose(found[5, 30], 1, atol=1e-6)
    np.testing.assert_allclose(found[[5, 5], [6, 15]], LINEAR[0], atol=2e-3)


def test_textures_that_nothing_lies_over_are_refused(tmp_path):
    (tmp_path / "a.glb").write_bytes(packed_glb(quad(), material(), [b"nothing"]))
    mesh = load_mesh(tmp_path / "a.glb")
    with pytest.raises(MeshError, match="neither PNG"):
        Shown().actor(mesh, None)
    assert Shown(plain=True).actor(mesh, None).looks[1].paint is None
    given = material(texture={"texCoord": 1})
    (tmp_path / "a.glb").write_bytes(packed_glb(quad(), given, [png(COLORS)]))
    with pytest.raises(MeshError, match="coordinates of the material 'm'"):
        Shown().actor(load_mesh(tmp_path / "a.glb"), None)


# ---- Mitsuba -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    module.set_variant("scalar_rgb")
    return module


def linear(pixels):
    shares = np.asarray(pixels) / 255
    return np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)


class Theirs:
    """Mitsuba's pictures of a shape with texture coordinates (v down) under a lat-long."""

    def __init__(self, mitsuba, shape, sky, aim, size, folder):
        self.mitsuba, self.sky, self.aim, self.size = mitsuba, sky, aim, size
        vertices, faces, normals, uvs = (np.asarray(each) for each in shape)
        names = {"has_vertex_normals": True, "has_vertex_texcoords": True}
        body = mitsuba.Mesh("body", len(vertices), len(faces), **names)
        held = mitsuba.traverse(body)
        for key, values in (("positions", vertices), ("normals", normals), ("texcoords", uvs)):
            held[f"vertex_{key}"] = values.astype(np.float32).ravel()
        held["faces"] = faces.astype(np.uint32).ravel()
        held.update()
        self.path = folder / "body.ply"
        body.write_ply(str(self.path))

    def texture(self, values):
        pixels = self.mitsuba.Bitmap(np.ascontiguousarray(values, dtype=np.float32))
        return {"type": "bitmap", "bitmap": pixels, "raw": True}

    def picture(self, bsdf, seed, samples):
        aim, mitsuba = self.aim, self.mitsuba
        look = mitsuba.ScalarTransform4f().look_at(
            origin=aim.eye(VIEW).tolist(), target=aim.target.tolist(), up=[0, 1, 0]
        )
        film = {"type": "hdrfilm", "width": self.size, "height": self.size, "pixel_format": "rgba",
                "component_format": "float32", "rfilter": {"type": "box"}}  # fmt: skip
        scene = mitsuba.load_dict({
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
            "sensor": {"type": "perspective", "fov": 30.0, "to_world": look, "film": film,
                       "sampler": {"type": "independent", "sample_count": samples}},
            "light": {"type": "envmap", "bitmap": mitsuba.Bitmap(self.sky)},
            "body": {"type": "ply", "filename": str(self.path), "bsdf": bsdf},
        })  # fmt: skip
        found = np.array(mitsuba.render(scene, seed=seed), dtype=float)
        return found[..., :3], found[..., 3]


def dielectric(theirs, color, rough, metal):
    """The parts of glTF's model: what is diffuse, and microfacets with Schlick's term."""
    f0 = 0.04 * (1 - metal) + color * metal
    return [
        {"type": "diffuse", "reflectance": theirs.texture(color * (1 - metal))},
        {"type": "principled", "metallic": 1.0, "base_color": theirs.texture(f0),
         "roughness": theirs.texture(rough)},
    ]  # fmt: skip


JUDGED = {
    "irradiance": lambda theirs, color, rough, metal: [
        {"type": "diffuse", "reflectance": theirs.texture(color)}
    ],
    "ggx": lambda theirs, color, rough, metal: [
        {"type": "roughconductor", "distribution": "ggx", "alpha": 0.36, "material": "none",
         "specular_reflectance": theirs.texture(color)}
    ],
    "splitsum": dielectric,
    "metal": dielectric,
    "she": dielectric,
}  # fmt: skip


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("form", JUDGED)
def test_a_textured_body_looks_as_in_mitsuba(mitsuba, tmp_path, form):
    """Base colour, roughness and gentle bumps: 2 % beyond the noise, and more without the bumps.

    Where bumps are steep, Mitsuba cuts off the light below the smooth surface. Metals of split sums
    need more samples, because noise would hide 2 %.
    """
    size, shape, sky = 96, globe(64, (1.0, 1.2, 0.9)), soft_sky()
    color, packed, normals = textures()
    packed[..., 2] = {"splitsum": 0, "metal": 255}.get(form, packed[..., 2])
    given = material(
        pbr={"metallicRoughnessTexture": {"index": 1}}, normalTexture={"index": 2, "scale": 0.4}
    )
    held = [png(each) for each in (color, packed, normals)]
    (tmp_path / "a.glb").write_bytes(packed_glb(shape, given, held))
    probe = Probe.from_array(sky, layout="latlong")
    diffuse = prefilter(probe, None, to="irradiance")
    light = diffuse if form == "irradiance" else prefilter(
        probe, "ggx:roughness=0.6,f0=1" if form == "ggx" else None,
        **({"eps": 0.003} if form == "ggx" else {"to": "splitsum" if form == "metal" else form}),
    )  # fmt: skip
    shown = Shown(irradiance=diffuse)
    ours, subject = picture(tmp_path / "a.glb", light, size, VIEW, shown, fov=30.0)
    theirs = Theirs(mitsuba, shape, sky, subject.aim, size, tmp_path)
    slope = (normals / 127.5 - 1) * [0.4, 0.4, 1]
    slope /= np.linalg.norm(slope, axis=-1, keepdims=True)
    bumps = theirs.texture((slope + 1) / 2)
    parts = JUDGED[form](theirs, linear(color), packed[..., 1:2] / 255, packed[..., 2:] / 255)
    halves = []
    for half in range(2):
        seen = [
            theirs.picture(
                {"type": "normalmap", "normalmap": bumps, "bsdf": part},
                2 * half + k,
                1024 if form == "metal" else 128,
            )
            for k, part in enumerate(parts)
        ]
        halves.append(sum(each for each, _ in seen))
    coverage = seen[0][1]
    expected = (halves[0] + halves[1]) / 2
    noise = relative_rms(halves[0], halves[1], coverage) / 2
    beyond = np.sqrt(max(relative_rms(ours, expected, coverage) ** 2 - noise**2, 0))
    flat = copy.deepcopy(given)
    flat["normalTexture"]["scale"] = -0.4
    (tmp_path / "a.glb").write_bytes(packed_glb(shape, flat, held))
    dented = picture(tmp_path / "a.glb", light, size, VIEW, shown, fov=30.0)[0]
    wrong = relative_rms(dented, expected, coverage)
    print(f"{form}: {beyond:.2%} beyond {noise:.2%} of noise; {wrong:.2%} with dents for bumps")
    assert noise < 0.04
    assert beyond < 0.02
    assert wrong > 2 * np.hypot(noise, 0.02)
