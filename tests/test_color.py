"""Colors of other primaries: matrices against colour-science, and where they are used."""

import json
from itertools import pairwise

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.color import REC709, conversion, fault_of, from_rec709, luminance_weights, to_rec709
from shrm_cli.errors import ProbeError
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import PRIMARIES
from tests.cli.helpers import done
from tests.probe import scenes

AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
GOLD = (1.0, 0.782, 0.344)


@pytest.mark.parametrize(
    ("name", "primaries"), [("ACEScg", AP1), ("ITU-R BT.2020", REC2020)], ids=["AP1", "2020"]
)
@pytest.mark.filterwarnings("ignore")
def test_against_colour_science(colour, name, primaries):
    spaces = colour.RGB_COLOURSPACES
    expected = colour.matrix_RGB_to_RGB(spaces[name], spaces["ITU-R BT.709"], "Bradford")
    np.testing.assert_allclose(to_rec709(primaries), expected, atol=5e-4)
    np.testing.assert_allclose(from_rec709(primaries), np.linalg.inv(expected), atol=5e-4)


@pytest.mark.parametrize(
    ("name", "theirs"),
    {
        "rec709": "ITU-R BT.709", "rec2020": "ITU-R BT.2020", "p3": "Display P3",
        "dci-p3": "DCI-P3", "adobe": "Adobe RGB (1998)", "acescg": "ACEScg",
        "aces2065-1": "ACES2065-1",
    }.items(),
)  # fmt: skip
@pytest.mark.filterwarnings("ignore")
def test_every_name_against_colour_science(colour, name, theirs):
    spaces = colour.RGB_COLOURSPACES
    ours = conversion(PRIMARIES[name], PRIMARIES["acescg"])
    expected = colour.matrix_RGB_to_RGB(spaces[theirs], spaces["ACEScg"], "Bradford")
    np.testing.assert_allclose(np.eye(3) if ours is None else ours, expected, atol=5e-4)
    # XYZ is relative to D65, as in sRGB's own matrix; from ACES that needs adaptation.
    back = conversion(PRIMARIES["xyz"], PRIMARIES[name])
    d65 = colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ @ np.ones(3)
    np.testing.assert_allclose(back @ d65, 1, atol=5e-4)
    if name == "rec709":
        np.testing.assert_allclose(
            back, colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB, atol=1e-3
        )
    weights = luminance_weights(PRIMARIES[name])
    np.testing.assert_allclose(weights, spaces[theirs].matrix_RGB_to_XYZ[1], atol=5e-4)


def test_conversions_go_round():
    way = ["rec709", "acescg", "xyz", "aces2065-1", "p3", "rec709"]
    whole = np.eye(3)
    for one, other in pairwise(way):
        whole = conversion(PRIMARIES[one], PRIMARIES[other]) @ whole
    np.testing.assert_allclose(whole, np.eye(3), atol=1e-12)


def test_published_matrix():
    """ITU-R BT.2087, linear Rec.709 in Rec.2020: four digits."""
    expected = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    np.testing.assert_allclose(from_rec709(REC2020), expected, atol=6e-5)


def test_white_stays_white():
    np.testing.assert_allclose(to_rec709(AP1) @ np.ones(3), 1, atol=1e-12)


@pytest.mark.parametrize(
    "primaries",
    [None, REC709, tuple(np.float32(REC709)), (0,) * 8, (np.nan,) * 8, (0.3, 0.3) * 4, AP1[:7]],
)
def test_where_nothing_is_to_be_done(primaries):
    assert to_rec709(primaries) is None
    assert from_rec709(primaries) is None


@pytest.mark.parametrize(("spec", "key"), [("ggx:f0=gold", "f0"), ("ward:color=gold", "color")])
def test_metals_in_other_primaries(spec, key):
    assert parse_spec(spec).color(key) == GOLD
    found = parse_spec(spec, primaries=AP1).color(key)
    np.testing.assert_allclose(found, from_rec709(AP1) @ GOLD, rtol=1e-12)
    # Numbers are the user's own, in the probe's primaries.
    numbers = f"{spec.partition('=')[0]}=1/0.782/0.344"
    assert parse_spec(numbers, primaries=AP1).color(key) == GOLD
    inside = parse_spec(f"0.5*{spec}+0.5*lambertian", primaries=AP1)
    assert inside.terms[0][1].color(key) == found


def test_pictures_and_metals_of_a_probe_in_other_primaries(tmp_path, monkeypatch):
    """A furnace that is red light of Rec.709, stored in AP1, and what gold makes of it."""
    monkeypatch.chdir(tmp_path)
    red = from_rec709(AP1) @ (0.5, 0.1, 0.1)
    pixels = np.broadcast_to(red, (16, 32, 3)).astype(np.float32)
    scenes.write_exr(tmp_path / "p.exr", scenes.rgb(pixels), chromaticities=AP1)
    done("prefilter", "p.exr", "--brdf", "lambertian", "--quiet", "-o", "m.exr")
    done("render", "m.exr", "--size", "16", "--quiet", "-o", "m.png")
    middle = oiio.ImageInput.open("m.png").read_image(oiio.UINT8)[8, 8]
    encoded = [255 * (1.055 * v ** (1 / 2.4) - 0.055) for v in (0.5, 0.1, 0.1)]
    np.testing.assert_allclose(middle, encoded, atol=1)
    made = done("prefilter", "p.exr", "--brdf", "ggx:roughness=1,f0=gold", "--json", "-o", "g.exr")
    f0 = json.loads(made)["brdf"]["parameters"]["f0"]
    np.testing.assert_allclose(f0, from_rec709(AP1) @ GOLD, rtol=1e-6)


@pytest.mark.parametrize(("numbers", "why"), [
    ((0.64, -0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329), "red has y = -0.33"),
    ((0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.0), "white has y = 0"),
    ((0.3, 0.3, 0.4, 0.4, 0.5, 0.5, 0.3127, 0.329), "on one line"),
    ((0.3,) * 8, "on one line"),
    ((0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.9, 0.9), "white is not between"),
])  # fmt: skip
def test_impossible_primaries_are_told_by_what_is_wrong(numbers, why, tmp_path):
    """Of an argument as an error; of a file as a warning, and its numbers count as Rec.709."""
    image = np.ones((16, 32, 3), np.float32)
    with pytest.raises(ProbeError, match=why):
        Probe.from_array(image, primaries=numbers)
    probe = Probe.from_array(image, chromaticities=numbers)
    assert probe.chromaticities is None
    [note] = probe.report.notes
    assert why in note
    told = Probe.from_array(image, chromaticities=numbers, primaries="acescg")
    assert told.chromaticities == PRIMARIES["acescg"]


def test_encodings_whose_blue_is_no_light_are_possible():
    """ACES2065-1 and a camera's gamut (ARRI Wide Gamut 3) have a blue with y < 0; XYZ y = 0."""
    camera = (0.684, 0.313, 0.221, 0.848, 0.0861, -0.102, 0.3127, 0.329)
    assert all(fault_of(each) is None for each in [*PRIMARIES.values(), camera])
