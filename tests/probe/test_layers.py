"""Which part, layer or view of a file is the light: the plain one, or none without a word."""

import json

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.image_file import ImageFile
from shrm_cli.probe.open import open_probe
from tests.cli.helpers import assert_refused, done, run
from tests.fuzz.exr_header import Attribute, parse
from tests.probe import scenes

HEIGHT, WIDTH = 8, 16


def plane(value):
    return np.full((HEIGHT, WIDTH), value, np.float32)


def layers(folder, names, **header):
    """A file whose k-th layer has radiance k + 1; a name that ends in a channel is that alone."""
    planes = {}
    for k, name in enumerate(names):
        prefix, _, channel = name.rpartition(".")
        if channel in ("Z", "Y", "AO"):
            planes[name] = plane(k + 1)
        else:
            prefix = f"{name}." if name else ""
            planes.update({f"{prefix}{c}": plane(k + 1) for c in "RGB"})
    return scenes.write_exr(folder / "a.exr", planes, **header)


def parts(folder, names):
    """A file whose k-th part has radiance k + 1."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    made = []
    for k, name in enumerate(names):
        channels = {"Z": plane(k + 1)} if name == "depth" else dict.fromkeys("RGB", plane(k + 1))
        made.append(OpenEXR.Part({**header, "name": name}, channels))
    with OpenEXR.File(made) as file:
        file.write(str(folder / "a.exr"))
    return folder / "a.exr"


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["albedo", "beauty"], 1),
        (["AlbedoPass.albedo", "env"], 1),
        (["diffuse", ""], 1),
        (["depth.Z", "sky"], 1),
        (["View.Depth.Z", "View.DiffCol", "View.Combined"], 2),
        (["normal", "albedo", "sky"], 2),
        (["AO", "rgba"], 1),
        (["a.AO", "env"], 1),
        (["sky.Y", "z.Z"], 0),
    ],
)
def test_layers(tmp_path, names, chosen):
    assert open_probe(layers(tmp_path, names)).image()[0, 0, 1] == chosen + 1


def test_all_of_many_parts_are_counted_and_found(tmp_path):
    path = parts(tmp_path, [f"p{k}" for k in range(1100)])
    with pytest.raises(ProbeError, match="part p11 and 1,088 more; give `part`"):
        open_probe(path)
    for name in ("p1099", "1099"):
        assert open_probe(path, part=name).image()[0, 0, 1] == 1100


@pytest.mark.parametrize(
    ("names", "chosen"),
    [(["depth", "beauty"], 1), (["albedo", "beauty"], 1), (["depth", "x"], 1), (["x"], 0),
     (["albedo", "normal", "sky"], 2)],
)  # fmt: skip
def test_parts(tmp_path, names, chosen):
    assert open_probe(parts(tmp_path, names)).image()[0, 0, 1] == chosen + 1


def test_what_is_not_plain_is_listed(tmp_path):
    path = layers(tmp_path, ["diffuse", "specular"])
    with pytest.raises(ProbeError, match=r"any of layer diffuse, layer specular; give `layer`$"):
        open_probe(path)
    path = parts(tmp_path, ["key", "fill"])
    with pytest.raises(ProbeError, match=r"any of part key, part fill; give `part`$"):
        open_probe(path)


def test_stereo(tmp_path):
    """OpenEXR leaves the first view out of its channels' names."""
    path = layers(tmp_path, ["", "right"], multiView=["left", "right"])
    with pytest.raises(ProbeError, match=r"any of layer left, layer right; give `layer`$"):
        open_probe(path)
    assert open_probe(path, layer="left").image()[0, 0, 0] == 1
    assert open_probe(path, layer="right").image()[0, 0, 0] == 2


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        (b"float", b"\0\0\x80?"),
        (b"m44f", bytes(64)),
        (b"chromaticities", bytes(32)),
        (b"int", b"1234"),
    ],
)
def test_views_that_are_no_texts(tmp_path, kind, data):
    path = layers(tmp_path, [""])
    headers = parse(path.read_bytes())
    headers.parts[0].append(Attribute(b"multiView", kind, data))
    path.write_bytes(headers.packed())
    assert open_probe(path).image()[0, 0, 0] == 1


@pytest.mark.parametrize("names", [["Z"], ["depth.Z"]])
def test_depth_alone_is_no_light(tmp_path, names):
    with pytest.raises(ProbeError, match="is depth, not light; "):
        open_probe(layers(tmp_path, names))


def test_a_part_or_layer_that_is_wanted(tmp_path):
    path = layers(tmp_path, ["Key", "fill"])
    assert open_probe(path, layer="fill").image()[0, 0, 0] == 2
    assert open_probe(path, layer="key").image()[0, 0, 0] == 1
    with pytest.raises(ProbeError, match="no layer rim; it has layer Key, layer fill"):
        open_probe(path, layer="rim")
    path = parts(tmp_path, ["albedo", "beauty"])
    for name in ("albedo", "0"):
        file = ImageFile.open(path, part=name)
        np.testing.assert_array_equal(file.read(2, 5), 1)
    with pytest.raises(ProbeError, match="no part rim; it has albedo, beauty"):
        open_probe(path, part="rim")


def test_the_command_says_what_it_took(tmp_path):
    path = parts(tmp_path, ["albedo", "beauty"])
    values = json.loads(done("info", str(path), "--json"))
    assert (values["part"], values["channels"]) == ("beauty", ["R", "G", "B"])
    values = json.loads(done("info", str(path), "--part", "albedo", "--json"))
    assert (values["part"], values["mean"]) == ("albedo", pytest.approx([1, 1, 1]))
    path = layers(tmp_path, ["key", "fill"])
    assert_refused(run("info", str(path)), 1, "give --layer")
