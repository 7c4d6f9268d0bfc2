"""Materials of glTF files: formulas written again, textures, and files that are not trusted."""

import base64
import json
import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest

import shrm_cli
from shrm_cli.brdf.spec import file_label, named_files, parse_spec
from shrm_cli.errors import BrdfError, ShrmWarning
from shrm_cli.maps.info import common_brdf
from tests.brdf.models.test_analytic import upper
from tests.cli.helpers import run
from tests.geometry.shapes import glb

ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


def asset(folder, *materials, **more):
    tree = {"asset": {"version": "2.0"}, "materials": list(materials), **more}
    path = folder / "asset.gltf"
    path.write_text(json.dumps(tree))
    return path


def metal_rough(metallic=1.0, roughness=0.5, color=(1, 1, 1), **extensions):
    """A material, with extensions by their names without `KHR_materials_`."""
    return {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*color, 1],
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
        "extensions": {f"KHR_materials_{name}": each for name, each in extensions.items()},
    }


def picture(path, pixels):
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "uint8")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    out.write_image(np.ascontiguousarray(pixels))
    out.close()
    return path


def decoded(values):
    """IEC 61966-2-1, written once more."""
    low, high = values / 12.92, ((values + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high)


def gltf_formula(light, view, material, f90=1.0):
    """Appendix B of glTF 2.0, and KHR_materials_anisotropy, with KHR_materials_specular."""
    color, metal, (ax, ay), f0 = material
    half = light + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    nl, nv, vh = light[:, 2], view[:, 2], np.sum(view * half, axis=1)
    d = 1 / (np.pi * ax * ay * ((half / [ax, ay, 1]) ** 2).sum(axis=1) ** 2)
    lit = nv * np.sqrt(((light * [ax, ay, 1]) ** 2).sum(axis=1))
    seen = nl * np.sqrt(((view * [ax, ay, 1]) ** 2).sum(axis=1))
    specular = (d / (2 * (lit + seen)))[:, None]
    rest = ((1 - vh) ** 5)[:, None]
    metal_part = specular * (color + (1 - color) * rest)
    fresnel = f0 + (f90 - f0) * rest
    dielectric = (1 - fresnel.max(axis=1, keepdims=True)) * color / np.pi + fresnel * specular
    return (1 - metal) * dielectric + metal * metal_part


def test_metal_is_gltfs(tmp_path, rng):
    """With the alphas ``mix(a, 1, s^2)`` and a of brushed metal, though OpenPBR has others."""
    color = np.array([0.9, 0.5, 0.2])
    strength = {"anisotropyStrength": 0.6}
    path = asset(tmp_path, metal_rough(1.0, 0.5, color, anisotropy=strength))
    light, view = upper(rng, 100), upper(rng, 100)
    expected = gltf_formula(light, view, (color, 1, (0.52, 0.25), 0.04))
    found = parse_spec(str(path)).evaluate(light, view)
    np.testing.assert_allclose(found, expected, rtol=2e-5)


@pytest.mark.parametrize("metal", [0.0, 0.3])
def test_a_dielectric_resembles_gltfs(tmp_path, rng, metal):
    """glTF takes Schlick's approximation, and dims what is diffuse by it at each half vector: the
    light of even directions differs by less than a hundredth of what arrives.
    """
    color = np.array([0.6, 0.3, 0.1])
    path = asset(tmp_path, metal_rough(metal, 0.6, color))
    brdf, light = parse_spec(str(path)), upper(rng, 20000)
    for degrees in (10, 40, 65):
        sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
        view = np.broadcast_to([sine, 0, cosine], light.shape)
        expected = gltf_formula(light, view, (color, metal, (0.36, 0.36), 0.04))
        difference = (brdf.evaluate(light, view) - expected) * light[:, 2:]
        assert np.abs(2 * np.pi * difference.mean(axis=0)).max() < 0.01


@pytest.mark.parametrize(
    ("ior", "color"),
    [(1.5, (4.0, 1.0, 0.2)), (1000.0, (0.05, 0.2, 0.1)), (0.0, (0.1, 0.0, 0.02))],
)
def test_borders_beyond_openpbrs_ranges_are_gltfs(tmp_path, rng, ior, color):
    """A color above 1, and the index of infinity that converters of glossiness write."""
    specular = {"specularColorFactor": color}
    path = asset(tmp_path, metal_rough(0.0, 0.5, (0, 0, 0), ior={"ior": ior}, specular=specular))
    light, view = upper(rng, 20000), np.array([0.3, 0.0, np.sqrt(0.91)])
    f0 = np.array(color) * (((ior - 1) / (ior + 1)) ** 2 if ior else 1.0)
    material = np.zeros(3), 0.0, (0.25, 0.25), f0
    expected = gltf_formula(light, np.broadcast_to(view, light.shape), material) * light[:, 2:]
    found = parse_spec(str(path)).evaluate(light, view) * light[:, 2:]
    albedos = 2 * np.pi * found.mean(axis=0), 2 * np.pi * expected.mean(axis=0)
    np.testing.assert_allclose(*albedos, atol=0.01)
    assert albedos[0].max() > 0.08


def test_black_borders_reflect_nothing(tmp_path):
    specular = {"specularColorFactor": [0, 0, 0]}
    path = asset(tmp_path, metal_rough(0.0, 0.5, (0, 0, 0), ior={"ior": 0}, specular=specular))
    assert not parse_spec(str(path)).evaluate(np.eye(3)[2], np.eye(3)[2]).any()


def test_factors_are_those_of_openpbr(tmp_path):
    path = asset(
        tmp_path,
        metal_rough(
            0.0,
            0.5,
            ior={"ior": 1.8},
            specular={"specularFactor": 0.4, "specularColorFactor": [0.5, 1, 1]},
            clearcoat={"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.2},
            sheen={"sheenColorFactor": [0.2, 0.4, 0.6], "sheenRoughnessFactor": 0.3},
        ),
    )
    found = parse_spec(str(path))
    expected = parse_spec(
        "openpbr:base_color=1,specular_roughness=0.5,specular_ior=1.8,specular_weight=0.4,"
        "specular_color=0.5/1/1,coat_weight=0.7,coat_roughness=0.2,coat_ior=1.5,fuzz_weight=1,"
        "fuzz_color=0.2/0.4/0.6,fuzz_roughness=0.3"
    )
    assert found.values == expected.values


def test_films_are_as_thick_as_their_texture_says(tmp_path, rng):
    """From the least thickness at its dark to the most at its bright; the most without one."""
    pixels = rng.integers(0, 256, (6, 5, 3)).astype(np.uint8)
    picture(tmp_path / "t.png", pixels)
    texture = {"index": 0}
    given = {"iridescenceFactor": 0.6, "iridescenceIor": 1.8,
             "iridescenceThicknessMinimum": 200, "iridescenceThicknessMaximum": 900}  # fmt: skip
    both = {"iridescenceTexture": texture, "iridescenceThicknessTexture": texture}
    images = {"images": [{"uri": "t.png"}], "textures": [{"source": 0}]}
    path = asset(
        tmp_path,
        metal_rough(iridescence=given),
        metal_rough(iridescence={**given, **both}),
        **images,
    )
    factor, part, _ = pixels.reshape(-1, 3).mean(axis=0) / 255
    with pytest.warns(ShrmWarning, match="mean of a texture: iridescenceTexture, "):
        textured = parse_spec(f"{path}#1")
    for found, weight, thickness in (
        (parse_spec(f"{path}#0"), 0.6, 0.9),
        (textured, 0.6 * factor, 0.2 + 0.7 * part),
    ):
        assert found.number("thin_film_weight") == pytest.approx(weight, rel=1e-5)
        assert found.number("thin_film_thickness") == pytest.approx(thickness, rel=1e-5)
        assert found.number("thin_film_ior") == 1.8


def test_without_factors_it_is_gltfs_default(tmp_path):
    found = parse_spec(str(asset(tmp_path, {})))
    assert repr(found).startswith("openpbr:base_color=1,base_metalness=1,specular_roughness=1")


@pytest.mark.parametrize("kind", ["file", "folder", "data", "buffer"])
def test_textures_are_averaged(tmp_path, rng, kind):
    """The mean of the color is linear, and that of the others as they are; factors multiply."""
    pixels = rng.integers(0, 256, (6, 5, 3)).astype(np.uint8)
    (tmp_path / "below").mkdir()
    name = "below/a texture.png" if kind == "folder" else "a texture.png"
    data = picture(tmp_path / name, pixels).read_bytes()
    image = {"uri": name.replace(" ", "%20")}
    if kind == "data":
        image = {"uri": "data:image/png;base64," + base64.b64encode(data).decode()}
    if kind == "buffer":
        image = {"bufferView": 0}
    if kind in ("data", "buffer"):
        (tmp_path / name).unlink()
    texture = {"index": 0}
    material = {
        "name": "Steel",
        "pbrMetallicRoughness": {
            "baseColorTexture": texture, "metallicRoughnessTexture": texture,
            "baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0.8,
        },
        "normalTexture": texture,
    }  # fmt: skip
    more = {"images": [image], "textures": [{"source": 0}]}
    path = asset(tmp_path, material, **more)
    if kind == "buffer":
        tree = json.loads(path.read_text())
        tree["buffers"] = [{"byteLength": len(data)}]
        tree["bufferViews"] = [{"buffer": 0, "byteOffset": 0, "byteLength": len(data)}]
        path = tmp_path / "asset.glb"
        path.write_bytes(glb(tree, data))
    with pytest.warns(ShrmWarning) as said:
        found = parse_spec(f"{path}#Steel")
    flat = pixels.reshape(-1, 3) / 255
    color = decoded(flat).mean(axis=0) * [0.5, 1, 1]
    assert found.color("base_color") == pytest.approx(tuple(color), rel=1e-5)
    assert found.number("specular_roughness") == pytest.approx(0.8 * flat[:, 1].mean(), rel=1e-5)
    assert found.number("base_metalness") == pytest.approx(flat[:, 2].mean(), rel=1e-5)
    lines = sorted(str(each.message) for each in said)
    assert lines == [
        f"{path}: left out: normalTexture",
        f"{path}: replaced by the mean of a texture: baseColorTexture, metallicRoughnessTexture",
    ]


def test_colors_are_in_the_primaries_of_the_probe(tmp_path):
    colour = pytest.importorskip("colour")
    path = asset(tmp_path, metal_rough(color=(0.8, 0.4, 0.1)))
    found = parse_spec(str(path), primaries=ACESCG).color("base_color")
    spaces = colour.RGB_COLOURSPACES
    expected = colour.RGB_to_RGB([0.8, 0.4, 0.1], spaces["sRGB"], spaces["ACEScg"], "Bradford")
    assert found == pytest.approx(tuple(expected), abs=1e-3)


def test_materials_of_one_name_are_told_apart_by_their_numbers(tmp_path):
    same = [{"name": "a", **metal_rough(1.0, each)} for each in (0.3, 0.7)]
    path = asset(tmp_path, *same, {"name": "b", **metal_rough()})
    with pytest.raises(BrdfError, match=r"2 materials are called 'a'; name one .* number: 0, 1$"):
        parse_spec(f"{path}#a")
    with pytest.raises(BrdfError, match=r"several materials; name one after a '#': 0, 1, b$"):
        parse_spec(str(path))
    assert parse_spec(f"{path}#1").number("specular_roughness") == pytest.approx(0.7)


def test_names_that_are_numbers_go_before_numbers(tmp_path):
    """The material named 1 was taken for material 1 in silence."""
    named = [{"name": name, **metal_rough(1.0, each)} for name, each in
             (("1", 0.3), ("b", 0.5), ("2", 0.7))]  # fmt: skip
    path = asset(tmp_path, *named)
    with pytest.warns(ShrmWarning, match="'1' is the name of material 0.* material 1 as '#01'"):
        assert parse_spec(f"{path}#1").number("specular_roughness") == pytest.approx(0.3)
    for wanted, roughness in (("01", 0.5), ("b", 0.5), ("2", 0.7), ("0", 0.3)):
        found = parse_spec(f"{path}#{wanted}").number("specular_roughness")
        assert found == pytest.approx(roughness)


def test_materials_are_named_or_numbered(tmp_path):
    first, second = {"name": "A B", **metal_rough(1.0, 0.3)}, metal_rough(1.0, 0.7)
    path = asset(tmp_path, first, second)
    assert parse_spec(f"{path}#A B").number("specular_roughness") == pytest.approx(0.3)
    assert parse_spec(f"{path}#1").number("specular_roughness") == pytest.approx(0.7)
    for wanted, words in (("", "several materials"), ("#C", "no material is called 'C'")):
        with pytest.raises(BrdfError, match=rf"{words}; name one after a '#': A B, 1$"):
            parse_spec(f"{path}{wanted}")
    assert named_files(f"0.5*{path}#1+0.5*fuzzy:base=({path}#0)") == [path, path]
    assert file_label(f"{path}#A B") == "asset-A-B"
    assert [w for w, _ in parse_spec(f"0.5*{path}#1+0.5*lambertian").terms] == [0.5, 0.5]


def test_what_a_map_records_needs_no_file(tmp_path):
    """It opens nothing: the parameters are the whole material."""
    path = asset(tmp_path, metal_rough(0.0, 0.8, (0.2, 0.4, 0.6)))
    probe = tmp_path / "probe.exr"
    assert run("probe", "furnace", "--size", "8", "-o", str(probe)).code == 0
    made = shrm_cli.prefilter(shrm_cli.open_probe(probe), f"{path}", to="shrm", eps=0.3)
    made.save(tmp_path / "map.exr")
    expected = parse_spec(str(path)).values
    path.unlink()
    info = shrm_cli.open_map(tmp_path / "map.exr").info
    assert common_brdf({"map.exr": info}).values == expected
    assert "asset" not in json.dumps(info.brdf)


def huge_png():
    """A sound header of 10000 x 10000 pixels, and nearly nothing after it."""

    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", 10000, 10000, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(100))) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("../out.png", "is not in its folder"),
        ("%2e%2e/out.png", "is not in its folder"),
        ("/etc/hostname", "is not in its folder"),
        ("file:///etc/hostname", "is not in its folder"),
        ("https://example.org/a.png", "is not in its folder"),
        ("link.png", "is not in its folder"),
        ("none.png", "is missing"),
        ("", "is not in its folder"),
        ("text.png", "neither PNG, JPEG"),
        ("huge.png", "10000 x 10000 pixels"),
        ("cut.png", "cut.png (is damaged|cannot be read)"),
        ("data:image/png;base64,AAAA", "neither PNG, JPEG"),
        ("data:image/png,AAAA", "not base64"),
    ],
)
def test_textures_are_not_trusted(tmp_path, rng, uri, words):
    (tmp_path / "in").mkdir()
    out = picture(tmp_path / "out.png", rng.integers(0, 256, (40, 40, 3)).astype(np.uint8))
    (tmp_path / "in" / "link.png").symlink_to(out)
    (tmp_path / "in" / "text.png").write_text("a secret")
    (tmp_path / "in" / "huge.png").write_bytes(huge_png())
    (tmp_path / "in" / "cut.png").write_bytes(out.read_bytes()[:60])
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    more = {"images": [{"uri": uri}], "textures": [{"source": 0}]}
    path = asset(tmp_path / "in", material, **more)
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(str(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (metal_rough(transmission={"transmissionFactor": 0.5}), "light that passes through it"),
        (metal_rough(diffuse_transmission={"diffuseTransmissionFactor": 1}), "passes through"),
        (metal_rough(unlit={}), "unlit takes the place"),
        (metal_rough(pbrSpecularGlossiness={}), "pbrSpecularGlossiness takes the place"),
        (metal_rough(0.0, ior={"ior": 0}), "reflects 100% along the normal"),
        (metal_rough(0.0, ior={"ior": 4}), "reflects 36% along the normal"),
        (metal_rough(0.0, ior={"ior": 0.5}), "its ior is 0.5"),
        (metal_rough(float("nan")), "damaged|not finite"),
        (metal_rough("shiny"), "could not convert"),
        (metal_rough(color=(1, 1)[:1]), "is|baseColor"),
        (metal_rough(1.0, 1e200), "cannot be used"),
        (metal_rough(1.0, -1e9), "is outside"),
        (metal_rough(7.0), "base_metalness=7 is outside"),
        ({"extensions": 3}, "table"),
        (3, "table"),
    ],
)
def test_what_cannot_be_held_is_refused_in_one_line(tmp_path, material, words):
    path = asset(tmp_path, material)
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(str(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_the_command_says_what_is_left_out(tmp_path):
    material = {**metal_rough(), "emissiveFactor": [1, 0, 0], "alphaMode": "BLEND"}
    material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, 0.5]
    found = run("brdf", f"{asset(tmp_path, material)}")
    assert found.code == 0
    for words in ("emission_luminance=1 is left out", "geometry_opacity=0.5 is left out"):
        assert found.err.count(words) == 1
    refused = run("brdf", f"{asset(tmp_path, metal_rough(unlit={}))}")
    assert refused.code == 1
    assert refused.err.count("\n") == 1
