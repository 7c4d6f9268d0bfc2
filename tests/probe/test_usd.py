"""Stages of USD as probes: where their lights are by USD's schema, and what is refused."""

import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.lights.light_files import light_file_text, usd_text
from shrm_cli.lights.split import split_lamps
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from tests.brute_force import latlong_samples
from tests.cli.helpers import assert_refused, run, write_exr

ROWS = 16
CENTER, LEFT, TOP = (1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)
"""The color of what lies in the middle of the texture, in its left quarter, and on top."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    pytest.importorskip("pxr.Usd", reason="no OpenUSD (pip install usd-core)")
    monkeypatch.chdir(tmp_path)
    rows, columns = np.mgrid[:ROWS, : 2 * ROWS]
    image = np.zeros((ROWS, 2 * ROWS, 3), np.float32)
    is_level = abs(rows - 7.5) < 3
    image[is_level & (abs(columns - 15.5) < 3)] = CENTER
    image[is_level & (abs(columns - 7.5) < 3)] = LEFT
    image[rows < 2] = TOP
    write_exr(tmp_path / "sky.exr", image)
    return tmp_path


def stage(text, up="Y", name="s.usda", more=""):
    with open(name, "w") as stream:
        stream.write(f'#usda 1.0\n(\n    upAxis = "{up}"\n    {more}\n)\n{text}\n')
    return name


def dome(lines="", kind="DomeLight", file="./sky.exr", name="Dome"):
    return f'def {kind} "{name}" {{\n asset inputs:texture:file = @{file}@\n {lines}\n}}\n'


def turned(**operations):
    """Lines that turn a prim by some operations, the first of which is done last."""
    lines = [
        f"float3 xformOp:{name} = {degrees}"
        if name == "rotateXYZ"
        else f"float xformOp:{name} = {degrees}"
        for name, degrees in operations.items()
    ]
    names = ", ".join(f'"xformOp:{name}"' for name in operations)
    return "\n".join([*lines, f"uniform token[] xformOpOrder = [{names}]"])


def pole(axis):
    return f'uniform token poleAxis = "{axis}"'


PLACES = {
    "Y": ("Y", dome(), (0, 0, 1), (1, 0, 0)),
    "Y turned about Y": ("Y", dome(turned(rotateY=90)), (1, 0, 0), (0, 0, -1)),
    "Y turned about X": ("Y", dome(turned(rotateX=90)), (0, -1, 0), (1, 0, 0)),
    "Y turned twice": ("Y", dome(turned(rotateZ=90, rotateX=90)), (1, 0, 0), (0, 1, 0)),
    "Y of the scene": ("Y", dome("", "DomeLight_1"), (0, 0, 1), (1, 0, 0)),
    "pole Z in Y": ("Y", dome(pole("Z"), "DomeLight_1"), (0, -1, 0), (1, 0, 0)),
    "Z of the scene": ("Z", dome("", "DomeLight_1"), (0, 0, 1), (1, 0, 0)),
    "pole Z in Z": ("Z", dome(pole("Z"), "DomeLight_1"), (0, 0, 1), (1, 0, 0)),
    "pole Y in Z": ("Z", dome(pole("Y"), "DomeLight_1"), (0, 1, 0), (1, 0, 0)),
    "Z, an old dome": ("Z", dome(), (0, 1, 0), (1, 0, 0)),
    "Z, turned": ("Z", dome(turned(rotateZ=90), "DomeLight_1"), (1, 0, 0), (0, 0, -1)),
    "as Blender 5 writes it": (
        "Z", dome(turned(rotateXYZ=(90, 0, 90))), (1, 0, 0), (0, 0, -1),
    ),
}  # fmt: skip
"""The up axis of a stage, its dome, and where the middle and the left quarter of the texture are
then, with +Y up, by the words of USD's schema: a lat-long lies as OpenEXR defines it, and where its
pole is +Z, its middle points into the negative Y direction.
"""


@pytest.mark.parametrize("case", PLACES)
def test_where_the_texture_lies(folder, case):
    up, text, center, left = PLACES[case]
    probe = open_probe(stage(text, up))
    top = np.cross(center, left)  # +Z, +X and +Y of an upright one
    seen = probe.radiance(np.array([center, left, top], dtype=float))
    np.testing.assert_allclose(seen, [CENTER, LEFT, TOP], atol=0.02)


def test_what_turns_a_probe_turns_the_stage(folder):
    probe = open_probe(stage(dome(turned(rotateY=30))), yaw=60)
    assert probe.radiance([1.0, 0, 0]) == pytest.approx(CENTER, abs=0.02)


def test_a_dome_under_a_turned_parent_and_in_other_layers(folder):
    (folder / "rig").mkdir()
    stage(dome(file="../sky.exr"), name="rig/light.usda", more='defaultPrim = "Dome"')
    rig = 'def Xform "Rig" {\n' + turned(rotateY=90) + "\n"
    rig += ' def "Light" (references = @./rig/light.usda@) {}\n}\n'
    stage(rig, name="rig.usda")
    probe = open_probe(stage("", more="subLayers = [@./rig.usda@]"))
    assert probe.radiance([1.0, 0, 0]) == pytest.approx(CENTER, abs=0.02)
    stage(dome("float inputs:intensity = 4", file="../sky.exr"), name="rig/light.usda",
          more='defaultPrim = "Dome"')  # fmt: skip
    again = open_probe("s.usda")  # though OpenUSD may still have the layer in memory
    assert again.radiance([1.0, 0, 0]) == pytest.approx(np.multiply(CENTER, 4), abs=0.1)
    assert again.digest() != probe.digest()


def test_how_bright(folder):
    """Intensity times 2^exposure times color; domes add up; a dome without a texture is even."""
    lines = (
        "float inputs:intensity = 3\nfloat inputs:exposure = -1\ncolor3f inputs:color = (2, 1, 1)"
    )
    even = 'def DomeLight_1 "Even" {\n color3f inputs:color = (0.5, 0.25, 1)\n}'
    probe = open_probe(stage(dome(lines) + even))
    assert probe.radiance([0.0, 0, 1]) == pytest.approx([3.5, 0.25, 1], abs=0.02)
    assert probe.radiance([0.0, -1, 0]) == pytest.approx([0.5, 0.25, 1], abs=1e-6)


def test_color_temperature(folder):
    """Rec. 709 of black bodies: a warm one is red, and its luminance is that of white."""
    warm = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000"
    red, green, blue = open_probe(stage(f'def DomeLight "D" {{\n{warm}\n}}')).radiance([0.0, 0, 1])
    assert red > 1.5 > green > 0.5 > blue > 0.2
    assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("is_normal", [0, 1])
def test_a_distant_light(folder, is_normal):
    """It shines along -Z of its own axes, and is its own radiance unless it is normalized."""
    lines = (
        f"float inputs:angle = 10\nfloat inputs:intensity = 6\nbool inputs:normalize = {is_normal}"
    )
    text = f'def DistantLight "Sun" {{\n{lines}\n{turned(rotateX=-90)}\n}}'
    (disc,) = open_probe(stage(text)).discs
    np.testing.assert_allclose(disc.direction, [0, 1, 0], atol=1e-9)
    assert disc.radius == pytest.approx(np.radians(5))
    facing = np.pi * np.sin(np.radians(5)) ** 2
    assert disc.radiance == pytest.approx([6 / facing if is_normal else 6] * 3)


def test_what_is_written_is_read(folder, rng):
    """The stage of `shrm sun` is the sum that its light file is, which is the probe."""
    directions, _ = latlong_samples(64)
    image = (1 + 0.4 * np.asarray(directions)).reshape(64, 128, 3)
    image[12:14, 20:22], image[25:27, 60:62] = (900, 700, 500), (90, 200, 400)
    split = split_lamps(Probe.from_array(image, "latlong"))
    assert len(split.discs) == 2
    write_exr(folder / "rest.exr", split.residual.astype(np.float32))
    (folder / "sun.usda").write_text(usd_text(split, "rest.exr"))
    (folder / "sun.toml").write_text(light_file_text(split, "rest.exr"))
    found, wanted = (
        project(open_probe(f"sun.{each}"), 8).coefficients for each in ("usda", "toml")
    )
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6 * abs(wanted).max())
    whole = project(Probe.from_array(image, "latlong"), 2).coefficients
    np.testing.assert_allclose(found[:9], whole, rtol=0, atol=2e-3 * abs(whole).max())


@pytest.mark.parametrize("suffix", ["usdc", "usd"])
def test_binary_layers(folder, suffix):
    from pxr import Sdf

    Sdf.Layer.FindOrOpen(stage(dome(turned(rotateY=90)))).Export(f"b.{suffix}")
    assert open_probe(f"b.{suffix}").radiance([1.0, 0, 0]) == pytest.approx(CENTER, abs=0.02)


def test_a_package(folder):
    from pxr import UsdUtils

    assert UsdUtils.CreateNewUsdzPackage(stage(dome(turned(rotateY=90))), "p.usdz")
    (folder / "sky.exr").unlink()
    probe = open_probe("p.usdz")
    assert probe.radiance([1.0, 0, 0]) == pytest.approx(CENTER, abs=0.02)
    assert probe.paths == [probe.images[0].path]


def test_a_package_leads_to_none_but_its_own_files(folder):
    """Names in a ZIP may climb out of the folder that it is unpacked into."""
    outside = stage('def DistantLight "Sun" {}', name="outside.usda")
    with zipfile.ZipFile("p.usdz", "w") as package:
        package.writestr(f"{40 * '../'}{folder / outside}".replace("//", "/"), "#usda 1.0\n")
    assert_refused(run("info", "p.usdz"), 1, "p.usdz: its lights cannot be read (it has no Dome")


def test_what_cannot_be_honored_is_said(folder):
    text = dome("rel portals = </Door>\nfloat inputs:diffuse = 0.5\nrel light:filters = </Door>")
    text += 'def PortalLight "Door" {}\ndef RectLight "Window" {}\ndef SphereLight "Bulb" {}\n'
    text += dome('token visibility = "invisible"', name="Unseen")
    text += 'def DistantLight "Sun" {\n float inputs:intensity.timeSamples = {1: 3, 2: 5}\n}'
    probe = open_probe(stage(text))
    assert probe.report.notes == (
        "Dome: its diffuse and specular factors are ignored",
        "Dome: its filters are ignored",
        "Dome: its portals are ignored; all of it is seen",
        "Unseen is invisible, and is left out",
        "near lights are left out: 2",
        "Sun is animated, and is as in its first frame",
    )  # fmt: skip
    assert probe.discs[0].radiance == pytest.approx([3, 3, 3])


DEEP = 'def "A0" { }\n' + "".join(
    f'def "A{k}" {{\n def "l" (references = </A{k - 1}>) {{}}\n'
    f' def "r" (references = </A{k - 1}>) {{}}\n}}\n'
    for k in range(1, 40)
)  # fmt: skip
BAD = {
    "elsewhere": (dome(file="../sky.exr"), "the texture '../sky.exr' is not in its folder"),
    "missing": (dome(file="./no.exr"), "the texture 'no.exr' is missing"),
    "no light": ('def Xform "X" {}', "it has no DomeLight"),
    "a layer elsewhere": ('def "X" (references = @/etc/passwd@) {}', "is not in its folder"),
    "a layer missing": ('def "X" (payload = @./no.usda@) {}', "the layer 'no.usda' is missing"),
    "too many prims": (DEEP, "prims; write its lights into a layer of their own"),
    "a ball": (dome('token inputs:texture:format = "mirroredBall"'), "mirroredBall is no layout"),
    "another type": (dome("string inputs:color = 'red'"), "inputs:color has no value of its type"),
    "too bright": (dome("float inputs:exposure = 1e30"), "give no light"),
    "not finite": (dome("float inputs:intensity = inf"), "give no light"),
    "flat": (dome("float3 xformOp:scale = (1, 0, 1)\n"
                  'uniform token[] xformOpOrder = ["xformOp:scale"]'), "is no rotation"),
    "clips": ('def "X" ( clips = { dictionary default = {} } ) {}', "value clips"),
    "damaged": ('def DomeLight "D" {', "damaged, or no USD: see line 7 of s.usda)"),
    "a long name": (f'def "{100_000 * "["}" {{}}', "damaged, or no USD"),
    "nested": (3000 * 'def "a" {\n' + 3000 * "}\n", "nested too deeply; flatten"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_what_is_refused_is_one_line(folder, case):
    text, words = BAD[case]
    assert_refused(run("info", stage(text)), 1, "s.usda: its lights cannot be read (", words)


def test_bytes_that_are_no_text_are_damage(folder):
    """OpenUSD's error quotes them, and cannot be made a text."""
    Path(stage('def Xform "X" {}')).write_bytes(b'#usda 1.0\ndef Xform "\x9b" {\n def "a\n')
    said = "s.usda: its lights cannot be read (damaged, or no USD"
    assert_refused(run("info", "s.usda"), 1, said)


def test_it_names_the_package(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ProbeError, match=r"need the package usd-core; pip install usd-core$"):
        open_probe(tmp_path / "s.usda")


def test_an_export_is_read(folder, rng):
    """Lamps of `shrm export --for usd --sun split` are distant lights, and the sum is the probe."""
    image = np.full((64, 128, 3), 0.5, np.float32)
    image[12:14, 20:22] = (900, 700, 500)
    write_exr(folder / "sun.exr", image)
    assert run("export", "sun.exr", "--for", "usd", "--sun", "split", "-o", "out").code == 0
    found = open_probe("out/sun.usda")
    assert len(found.discs) == 1
    both = [project(each, 2).coefficients for each in (found, open_probe("sun.exr"))]
    np.testing.assert_allclose(both[0], both[1], rtol=0, atol=2e-3 * abs(both[1]).max())
