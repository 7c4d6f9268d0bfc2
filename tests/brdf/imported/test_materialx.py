"""Materials of MaterialX files, against the definitions of the package itself."""

import sys
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.brdf.imported.surfaces import SURFACES
from shrm_cli.brdf.layered.openpbr import OpenPbr
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError, ShrmWarning
from tests.brdf.imported.test_gltf import decoded, picture

MaterialX = pytest.importorskip("MaterialX", reason="the extra materialx is not installed")

LIBRARY = Path(MaterialX.__file__).parent / "libraries" / "bxdf"


def document(folder, body, root=""):
    path = folder / "material.mtlx"
    path.write_text(f'<?xml version="1.0"?>\n<materialx version="1.39" {root}>{body}</materialx>')
    return path


def surface(*inputs, node="open_pbr_surface", name="paint"):
    return f'<{node} name="{name}" type="surfaceshader">{"".join(inputs)}</{node}>'


def value(name, kind, text, more=""):
    return f'<input name="{name}" type="{kind}" value="{text}" {more}/>'


def defaults(node):
    """The defaults of a surface as its definition in the package has them, in single precision."""
    library = MaterialX.createDocument()
    MaterialX.readFromXmlFile(library, str(LIBRARY / f"{node}.mtlx"))
    found = {}
    for each in library.getNodeDefs():
        if each.getNodeString() == node and each.getType() == "surfaceshader":
            for given in [i for d in (each.getInheritsFrom(), each) if d for i in d.getInputs()]:
                held = given.getValue()
                if isinstance(held, float | int | bool):
                    found[given.getName()] = round(float(held), 6)
                elif held is not None:
                    found[given.getName()] = [round(x, 6) for x in held.asTuple()]
            if each.getDefaultVersion():
                return found
    raise AssertionError(node)


def test_openpbr_has_the_defaults_of_its_definition():
    given = defaults("open_pbr_surface")
    assert len(given) > 35
    for each in OpenPbr.parameters:
        assert given[each.name] == pytest.approx(each.default), each.name
    assert OpenPbr(**given).values == OpenPbr().values  # and every name is known


@pytest.mark.parametrize("node", SURFACES)
def test_what_a_material_leaves_out_has_the_default_of_its_definition(node):
    assert OpenPbr(**SURFACES[node](defaults(node))).values == OpenPbr(**SURFACES[node]({})).values


def test_constants_are_taken(tmp_path):
    path = document(
        tmp_path,
        surface(
            value("base_color", "color3", "0.2, 0.4, 0.6"),
            value("base_metalness", "float", "0.3"),
            value("coat_weight", "float", "1"),
            value("geometry_thin_walled", "boolean", "true"),
        ),
    )
    expected = "openpbr:base_color=0.2/0.4/0.6,base_metalness=0.3,coat_weight=1"
    assert parse_spec(str(path)).values == parse_spec(expected).values


@pytest.mark.parametrize("node", ["gltf_pbr", "standard_surface"])
def test_other_surfaces_have_openpbrs_parameters(tmp_path, node):
    names = {
        "gltf_pbr": ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "sheen_color"),
        "standard_surface": ("metalness", "specular_roughness", "coat", "coat_roughness", "sheen"),
    }[node]
    inputs = [value(name, "float", "0.4") for name in names[:4]]
    path = document(tmp_path, surface(*inputs, node=node))
    if node == "gltf_pbr":
        found = parse_spec(str(path))
    else:
        with pytest.warns(ShrmWarning, match="coat_darkening=0 is left out"):
            found = parse_spec(str(path))
    assert found.number("base_metalness") == found.number("coat_weight") == 0.4
    assert found.number("specular_roughness") == found.number("coat_roughness") == 0.4
    assert found.number("coat_ior") == 1.5


def test_brushed_standard_surfaces_have_their_alphas(tmp_path):
    """``r^2 / sqrt(1 - s)`` across and ``r^2 sqrt(1 - s)`` along, by MaterialX's own node."""
    inputs = [value("specular_roughness", "float", "0.5"), value("metalness", "float", "1"),
              value("specular_anisotropy", "float", "0.64")]  # fmt: skip
    path = document(tmp_path, surface(*inputs, node="standard_surface"))
    (_, lobe), *_ = parse_spec(str(path)).terms
    assert lobe.alphas == pytest.approx((0.25 / 0.6, 0.25 * 0.6), rel=1e-5)


@pytest.mark.parametrize(
    ("node", "names", "thickness"),
    [
        ("gltf_pbr", ("iridescence", "iridescence_thickness", "iridescence_ior"), "700"),
        ("standard_surface", ("", "thin_film_thickness", "thin_film_IOR"), "700"),
        (
            "open_pbr_surface",
            ("thin_film_weight", "thin_film_thickness", "thin_film_ior"),
            "0.7",
        ),
    ],
)
def test_films_are_as_thick_as_their_surfaces_say(tmp_path, node, names, thickness):
    """In nanometers, but for OpenPBR's micrometers."""
    given = zip(names, ("1", thickness, "1.7"), strict=True)
    inputs = [value(name, "float", each) for name, each in given if name]
    found = parse_spec(str(document(tmp_path, surface(*inputs, node=node))))
    keys = ("thin_film_weight", "thin_film_thickness", "thin_film_ior")
    assert [found.number(key) for key in keys] == pytest.approx([1, 0.7, 1.7])


@pytest.mark.parametrize(
    ("node", "meters"), [("standard_surface", 1e-9), ("open_pbr_surface", 1e-6)]
)
@pytest.mark.parametrize(("thickness", "unit"), [("550", "nanometer"), ("0.55", "micrometer"),
                                                 ("0.00055", "millimeter")])  # fmt: skip
def test_films_have_the_units_that_are_said(tmp_path, node, meters, thickness, unit):
    """550 nanometers of OpenPBR were taken for micrometers."""
    said = f'type="float" value="{thickness}" unittype="distance" unit="{unit}"'
    nodes = f'<constant name="c" type="float"><input name="value" {said}/></constant>'
    weight = value("thin_film_weight", "float", "1") if node == "open_pbr_surface" else ""
    for given in (f"{said}/>", 'type="float" nodename="c"/>'):
        film = f'<input name="thin_film_thickness" {given}'
        found = parse_spec(str(document(tmp_path, nodes + surface(weight, film, node=node))))
        assert found.number("thin_film_thickness") == pytest.approx(0.55)
    film = f'<input name="thin_film_thickness" {said}/>'.replace(unit, "parsec")
    with pytest.raises(BrdfError, match="its unit 'parsec' is no length"):
        parse_spec(str(document(tmp_path, surface(film, node=node))))


@pytest.mark.parametrize(
    ("space", "expected"),
    [
        ("", (0.2, 0.4, 0.6)),
        ("lin_rec709", (0.2, 0.4, 0.6)),
        ("srgb_texture", tuple(decoded(np.array([0.2, 0.4, 0.6])))),
    ],
)
def test_colors_have_their_space_or_that_of_what_they_are_in(tmp_path, space, expected):
    color = value("base_color", "color3", "0.2, 0.4, 0.6")
    for root, more in ((f'colorspace="{space}"', ""), ('colorspace="acescg"', space)):
        given = color.replace("/>", f' colorspace="{more}"/>') if more else color
        found = parse_spec(str(document(tmp_path, surface(given), root if space else "")))
        assert found.color("base_color") == pytest.approx(expected, rel=1e-5)


def test_colors_of_acescg_are_converted(tmp_path):
    colour = pytest.importorskip("colour")
    color = value("base_color", "color3", "0.4, 0.4, 0.3")
    found = parse_spec(str(document(tmp_path, surface(color), 'colorspace="acescg"')))
    spaces = colour.RGB_COLOURSPACES
    expected = colour.RGB_to_RGB([0.4, 0.4, 0.3], spaces["ACEScg"], spaces["sRGB"], "Bradford")
    assert found.color("base_color") == pytest.approx(tuple(expected), abs=1e-3)


GRAPH = """<nodegraph name="graph">
  <input name="where" type="filename" value="below/t.png"/>
  <image name="picture" type="color3">
    <input name="file" type="filename" interfacename="where" colorspace="srgb_texture"/></image>
  <image name="data" type="vector3"><input name="file" type="filename" value="below/t.png"/></image>
  <multiply name="tinted" type="color3"><input name="in1" type="color3" nodename="picture"/>
    <input name="in2" type="color3" value="0.5, 1, 1"/></multiply>
  <extract name="green" type="float"><input name="in" type="vector3" nodename="data"/>
    <input name="index" type="integer" value="1"/></extract>
  <separate3 name="parts" type="multioutput"><input name="in" type="vector3" nodename="data"/>
  </separate3>
  <mix name="mixed" type="color3"><input name="fg" type="color3" nodename="picture"/></mix>
  <multiply name="square" type="color3"><input name="in1" type="color3" nodename="picture"/>
    <input name="in2" type="color3" nodename="picture"/></multiply>
  <multiply name="round" type="color3"><input name="in1" type="color3" nodename="round"/>
    <input name="in2" type="color3" value="1, 1, 1"/></multiply>
  <normalmap name="bumps" type="vector3">
    <input name="in" type="vector3" nodename="data"/></normalmap>
  <output name="color" type="color3" nodename="tinted"/>
  <output name="roughness" type="float" nodename="green"/>
  <output name="metal" type="float" nodename="parts" output="outz"/>
  <output name="mixed_out" type="color3" nodename="mixed"/>
  <output name="square_out" type="color3" nodename="square"/>
  <output name="round_out" type="color3" nodename="round"/>
  <output name="normal" type="vector3" nodename="bumps"/>
</nodegraph>"""


def linked(name, kind, output):
    return f'<input name="{name}" type="{kind}" nodegraph="graph" output="{output}"/>'


def test_textures_are_averaged(tmp_path, rng):
    (tmp_path / "below").mkdir()
    pixels = rng.integers(0, 256, (6, 5, 3)).astype(np.uint8)
    picture(tmp_path / "below" / "t.png", pixels)
    inputs = [
        linked("base_color", "color3", "color"),
        linked("specular_roughness", "float", "roughness"),
        linked("base_metalness", "float", "metal"),
        linked("geometry_normal", "vector3", "normal"),
    ]
    path = document(tmp_path, GRAPH + surface(*inputs))
    with pytest.warns(ShrmWarning) as said:
        found = parse_spec(str(path))
    flat = pixels.reshape(-1, 3) / 255
    color = decoded(flat).mean(axis=0) * [0.5, 1, 1]
    assert found.color("base_color") == pytest.approx(tuple(color), rel=1e-5)
    assert found.number("specular_roughness") == pytest.approx(flat[:, 1].mean(), rel=1e-5)
    assert found.number("base_metalness") == pytest.approx(flat[:, 2].mean(), rel=1e-5)
    assert sorted(str(each.message) for each in said) == [
        f"{path}: left out: geometry_normal",
        f"{path}: replaced by the mean of a texture: "
        "base_color, specular_roughness, base_metalness",
    ]


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ("mixed_out", "computed by a node 'mix'; bake it"),
        ("square_out", "square multiplies two textures"),
        ("round_out", "too many nodes"),
    ],
)
def test_what_cannot_be_averaged_is_refused(tmp_path, rng, output, words):
    (tmp_path / "below").mkdir()
    picture(tmp_path / "below" / "t.png", rng.integers(0, 256, (2, 2, 3)).astype(np.uint8))
    path = document(tmp_path, GRAPH + surface(linked("base_color", "color3", output)))
    with pytest.raises(BrdfError, match=words):
        parse_spec(str(path))


FACTORS = """<gltf_colorimage name="color" type="multioutput">
    <input name="file" type="filename" value="t.png" colorspace="srgb_texture"/>
    <input name="color" type="color4" value="0.5, 0.25, 0.1, 0.5"/>
    <input name="geomcolor" type="color4" value="1, 0.5, 1, 0.5"/></gltf_colorimage>
  <gltf_image name="tinted" type="color3">
    <input name="file" type="filename" value="t.png" colorspace="srgb_texture"/>
    <input name="factor" type="color3" value="0.5, 0.25, 0.1"/></gltf_image>
  <gltf_image name="rough" type="float"><input name="file" type="filename" value="t.png"/>
    <input name="factor" type="float" value="0.5"/></gltf_image>
  <gltf_image name="square" type="color3"><input name="file" type="filename" value="t.png"/>
    <input name="factor" type="color3" nodename="tinted"/></gltf_image>"""


def of_node(name, kind, node, output=""):
    more = f'output="{output}"' if output else ""
    return f'<input name="{name}" type="{kind}" nodename="{node}" {more}/>'


def test_textures_of_gltf_nodes_are_multiplied_by_their_factors(tmp_path, rng):
    """The curve of sRGB was not decoded where there are several outputs, nor factors read."""
    pixels = rng.integers(0, 256, (4, 3, 4)).astype(np.uint8)
    picture(tmp_path / "t.png", pixels)
    flat = pixels.reshape(-1, 4) / 255
    color = decoded(flat[:, :3]).mean(axis=0)
    for given, expected in (
        (of_node("base_color", "color3", "color", "outcolor"), color * [0.5, 0.125, 0.1]),
        (of_node("base_color", "color3", "tinted"), color * [0.5, 0.25, 0.1]),
    ):
        path = document(
            tmp_path,
            FACTORS
            + surface(
                given,
                of_node("base_metalness", "float", "color", "outa"),
                of_node("specular_roughness", "float", "rough"),
            ),
        )
        with pytest.warns(ShrmWarning, match="replaced by the mean of a texture"):
            found = parse_spec(str(path))
        assert found.color("base_color") == pytest.approx(tuple(expected), rel=1e-5)
        assert found.number("base_metalness") == pytest.approx(flat[:, 3].mean() / 4, rel=1e-5)
        assert found.number("specular_roughness") == pytest.approx(flat[:, 0].mean() / 2, rel=1e-5)


def test_factors_that_are_textures_are_refused(tmp_path):
    picture(tmp_path / "t.png", np.full((2, 2, 3), 99, np.uint8))
    body = FACTORS + surface(of_node("base_color", "color3", "square"))
    with pytest.raises(BrdfError, match="square multiplies two textures"):
        parse_spec(str(document(tmp_path, body)))


def test_what_a_coat_of_standard_surface_does_below_is_told(tmp_path):
    inputs = [value("coat", "float", "1"), value("coat_affect_color", "float", "1"),
              value("coat_affect_roughness", "float", "0")]  # fmt: skip
    with pytest.warns(ShrmWarning) as said:
        parse_spec(str(document(tmp_path, surface(*inputs, node="standard_surface"))))
    assert any(str(each.message).endswith("left out: coat_affect_color") for each in said)


@pytest.mark.parametrize("also", ["", surface(name="Gold")])
def test_surfaces_that_are_not_read_are_told_as_what_they_are(tmp_path, also):
    """They were no material at all."""
    body = (
        surface(node="UsdPreviewSurface", name="preview")
        + '<surfacematerial name="Usd" type="material">'
        '<input name="surfaceshader" type="surfaceshader" nodename="preview"/></surfacematerial>'
    )
    path = document(tmp_path, body + also)
    with pytest.raises(BrdfError, match="'Usd' is of the kind 'UsdPreviewSurface', which is not"):
        parse_spec(f"{path}#Usd")
    if also:
        assert parse_spec(f"{path}#Gold").values == parse_spec(str(path)).values
    else:
        with pytest.raises(BrdfError, match="'Usd' is of the kind 'UsdPreviewSurface'"):
            parse_spec(str(path))


def test_materials_are_named(tmp_path):
    body = "".join(
        surface(value("base_metalness", "float", metal), name=f"s{metal}")
        + f'<surfacematerial name="{name}" type="material">'
        f'<input name="surfaceshader" type="surfaceshader" nodename="s{metal}"/></surfacematerial>'
        for name, metal in (("Gold", "1"), ("Paint", "0"))
    )
    path = document(tmp_path, body)
    assert parse_spec(f"{path}#Gold").number("base_metalness") == 1
    assert parse_spec(f"{path}#1").number("base_metalness") == 0
    with pytest.raises(BrdfError, match=r"it has several materials; .*: Gold, Paint"):
        parse_spec(str(path))


BOMB = "<!DOCTYPE x [<!ENTITY a '" + "a" * 99 + "'>]>"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no element found"),
        ("<materialx", "material cannot be used"),
        ("<other/>", "No root MaterialX element"),
        ('<materialx version="1.39"/>', "it has no material"),
        (f'{BOMB}<materialx version="1.39"/>', "document type"),
        ("<a>" * 40 + "</a>" * 40, "nested too deeply"),
        ("<materialx>" + "<a/>" * 70000 + "</materialx>", "too many elements"),
        (
            '<materialx version="1.39" xmlns:xi="http://www.w3.org/2001/XInclude">'
            '<xi:include href="other.mtlx"/></materialx>',
            "includes other files",
        ),
        (
            f'<materialx version="1.39">{surface(value("transmission_weight", "float", "1"))}'
            "</materialx>",
            "light that passes through it",
        ),
        (
            f'<materialx version="1.39">{surface(value("base_color", "color3", "1, 2"))}'
            "</materialx>",
            "material cannot be used",
        ),
        (
            '<materialx version="1.39" colorspace="mine">'
            f"{surface(value('base_color', 'color3', '1, 1, 1'))}</materialx>",
            "color space 'mine' is not read",
        ),
    ],
)
def test_files_are_not_trusted(tmp_path, text, words):
    path = tmp_path / "bad.mtlx"
    path.write_text(text)
    (tmp_path / "other.mtlx").write_text(f"<materialx>{surface()}</materialx>")
    with pytest.raises(BrdfError, match=words) as caught:
        parse_spec(str(path))
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_textures_lie_beside_it(tmp_path):
    body = GRAPH.replace("below/t.png", "../secret.png")
    (tmp_path / "in").mkdir()
    picture(tmp_path / "secret.png", np.zeros((2, 2, 3), np.uint8))
    path = document(tmp_path / "in", body + surface(linked("base_color", "color3", "color")))
    with pytest.raises(BrdfError, match="not in its folder"):
        parse_spec(str(path))


def test_without_the_package_it_is_told_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    with pytest.raises(BrdfError, match="pip install MaterialX"):
        parse_spec(str(document(tmp_path, surface())))
