"""What docs/layout.md says of adding something: so few files, and every command knows it.

Each test adds the files to a copy of the package and runs the command line of that copy.
Arrangements of cubes and grids are tested in tests/probe/test_new_layouts.py, BRDFs of users in
tests/brdf/test_python_file.py, packages of theirs in tests/test_plugins.py.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.cli.helpers import noise, read_exr, write_exr

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]

MODEL = '''
"""Light is reflected evenly from a grey surface."""
from shrm_cli.brdf.base import Brdf, Parameter, grey
import numpy as np
class FlatGrey(Brdf):
    """A Lambertian surface by another name."""
    name = "flat-grey"
    summary = "a grey wall"
    source = "Lambert 1760"
    center = "normal"
    zonal = True
    parameters = (Parameter("albedo", 0.5, 0.0, 1.0, "reflectance"),)
    def evaluate(self, light, view):
        shape = np.broadcast_shapes(light.shape, view.shape)[:-1]
        return grey(np.full(shape, self.number("albedo") / np.pi))
'''

EXPLICIT = '''
"""Reflection maps for the views along the six axes."""
import numpy as np
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.sphere.harmonics import real_harmonics
AXES = np.concatenate([np.eye(3), -np.eye(3)])
class SixAxes(ExplicitMap):
    """The nearest of six distant views."""
    representation = "six-axes"
    @classmethod
    def image_count(cls, view_count):
        return 6
    @classmethod
    def part_names(cls, count):
        return [f"axis{k}" for k in range(count)]
    @classmethod
    def sample_views(cls, count):
        return AXES
    @classmethod
    def view_weights(cls, count):
        return np.full(6, 4 * np.pi / 6)
    @classmethod
    def basis(cls, order_p, count):
        return real_harmonics(order_p, AXES)
    @classmethod
    def blend(cls, centers, views, count):
        nearest = np.argmax(np.asarray(views) @ AXES.T, axis=-1)[..., None]
        return nearest, np.ones(nearest.shape)
'''

AMBIENT = {
    "__init__": '"""The mean of the light."""\n',
    "ambient": '''
"""One color: the mean radiance of the probe."""
from dataclasses import dataclass
import numpy as np
from shrm_cli.maps.kinds import FixedMap, ReflectionMap
from shrm_cli.maps.info import MapInfo
@dataclass(frozen=True)
class Ambient(FixedMap, ReflectionMap):
    """The mean radiance, shape (1, 3)."""
    mean: np.ndarray
    info: MapInfo
    representation = "ambient"
    center = "normal"
    sampling = "center"
    size = 1
    is_rearrangeable = False
    cube_count = 0
    def radiance(self, normals, views):
        shape = np.broadcast_shapes(np.shape(normals), np.shape(views))
        return np.broadcast_to(self.mean[0], shape)
    def planes(self):
        return ()
    def with_planes(self, planes, sampling, info):
        return self
    def details(self):
        return {"mean": self.mean[0].tolist()}
''',
    "prefilter": '''
"""How the mean is made."""
import numpy as np
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.maps.ambient.ambient import Ambient
from shrm_cli.maps.request import Prefiltered
from shrm_cli.maps.info import provenance
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import project
def prefilter(probe, request):
    mean = request.own["gain"] * project(probe, 0).coefficients / np.sqrt(4 * np.pi)
    made = Ambient(mean, provenance(probe, Lambertian(), Orders(0, 0, 0.0, 1.0)))
    return Prefiltered(made, {"mean": mean[0].tolist()})
def report(result):
    return ["ambient color", "mean           " + " ".join(f"{x:.3f}" for x in result["mean"])]
''',
    "file": '''
"""One pixel."""
from shrm_cli.files.parts import Part
from shrm_cli.maps.ambient.ambient import Ambient
from shrm_cli.maps.stored import common_header, map_info, read_attributes
from shrm_cli.maps.stored import image_channels
def encode(ambient):
    return [Part(image_channels(ambient.mean[None]), common_header(ambient, 0))]
def decode(file):
    attributes = read_attributes(file.first)
    return Ambient(file.first.read("RGB")[0].astype(float), map_info(attributes, file.first))
''',
}

AMBIENT_DESCRIPTION = """
DESCRIPTIONS["ambient"] = Representation(
    "ambient", "ambient color", frozenset(),
    (Option("gain", "ambient: brighter by so much.", "integer", limits=(1, 9), default=1),),
    why_no_brdf="an ambient color is of a white Lambertian surface",
)
"""

CONTAINER = '''
"""Parts as the arrays of a .npz, written only."""
import json
import numpy as np
from shrm_cli.files.whole import replacing
def write(path, parts, pixel_type):
    dtype = np.float32 if pixel_type == "float" else np.float16
    arrays = {
        f"{part.header.get('name', k)}/{name}": plane.astype(dtype)
        for k, part in enumerate(parts)
        for name, plane in part.channels.items()
    }
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        np.savez(stream, **arrays)
def open_file(path):
    return None
'''


@pytest.fixture
def copy(tmp_path):
    """A copy of the package, with its compiled modules, and a probe beside it."""
    shutil.copytree(ROOT / "shrm_cli", tmp_path / "shrm_cli")
    write_exr(tmp_path / "probe.exr", noise(16, 32))
    return tmp_path


def run(folder, *arguments, code=0):
    done = subprocess.run(
        [sys.executable, "-c", "from shrm_cli.cli.main import main; main()", *arguments],
        env={**os.environ, "PYTHONPATH": str(folder)},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def add_row(folder, before, row):
    """Add a row to the vocabulary, in front of another."""
    path = folder / "shrm_cli" / "vocabulary.py"
    text = path.read_text()
    assert text.count(before) == 1
    path.write_text(text.replace(before, row + before))


def test_a_brdf_model_is_one_file(copy):
    (copy / "shrm_cli" / "brdf" / "models" / "flat_grey.py").write_text(MODEL)
    assert "a grey wall" in run(copy, "brdf")
    run(copy, "prefilter", "probe.exr", "--brdf", "flat-grey:albedo=0.25", "-o", "a.exr")
    run(copy, "prefilter", "probe.exr", "--brdf", "lambertian:albedo=0.25", "-o", "b.exr")
    assert "0.00%" in run(copy, "compare", "a.exr", "b.exr", "--size", "16", "--no-picture")


@pytest.mark.proof
def test_an_explicit_map_is_a_file_and_a_row(copy):
    (copy / "shrm_cli" / "maps" / "explicit" / "six_axes.py").write_text(EXPLICIT)
    add_row(copy, '    "irradiance":', '    "six-axes": "explicit.six_axes",\n')
    run(copy, "prefilter", "probe.exr", "--brdf", "microfacet:sigma=0.5", "--to", "six-axes")
    name = "probe.microfacet-sigma-0.5.six-axes.exr"
    assert json.loads(run(copy, "info", name, "--json"))["maps"] == 6
    run(copy, "convert", name, "--to", "shrm", "--order-p", "1", "-o", "back.exr")
    run(copy, "convert", "back.exr", "--to", "six-axes", "-o", "again.exr")
    run(copy, "render", name, "--size", "16", "-o", "picture.png")
    assert "applies with --to kautz-mccool" in run(
        copy,
        "prefilter",
        "probe.exr",
        "--brdf",
        "phong",
        "--to",
        "six-axes",
        "--slices",
        "3",
        code=2,
    )


@pytest.mark.proof
def test_a_map_for_engines_is_a_folder_a_row_and_a_description(copy):
    for name, text in AMBIENT.items():
        path = copy / "shrm_cli" / "maps" / "ambient" / f"{name}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    add_row(copy, '    "she":', '    "ambient": "ambient.ambient",\n')
    with open(copy / "shrm_cli" / "maps" / "registry.py", "a") as stream:
        stream.write(AMBIENT_DESCRIPTION)
    assert "irradiance, splitsum, ambient and she" in " ".join(
        run(copy, "prefilter", "--help").split()
    )
    out = run(copy, "prefilter", "probe.exr", "--to", "ambient", "--gain", "2")
    mean = 2 * noise(16, 32).mean()  # not weighted by solid angle, but the light is noise
    assert float(out.split()[-1]) == pytest.approx(mean, rel=0.05)
    assert json.loads(run(copy, "info", "probe.ambient.exr", "--json"))["mean"]
    run(copy, "render", "probe.ambient.exr", "--size", "16", "-o", "picture.png")
    run(copy, "compare", "probe.ambient.exr", "probe.ambient.exr", "--size", "16", "--no-picture")
    refused = run(copy, "prefilter", "probe.exr", "--to", "she", "--gain", "2", code=2)
    assert "--gain applies with --to ambient" in refused
    refused = run(copy, "prefilter", "probe.exr", "--to", "ambient", "--brdf", "phong", code=2)
    assert "an ambient color is of a white Lambertian surface" in refused


def test_a_container_is_a_file_and_a_row(copy):
    (copy / "shrm_cli" / "files" / "npz.py").write_text(CONTAINER)
    add_row(copy, '{".exr": "exr"', "")
    path = copy / "shrm_cli" / "vocabulary.py"
    path.write_text(path.read_text().replace('{".exr": "exr"}', '{".exr": "exr", ".npz": "npz"}'))
    run(
        copy,
        "prefilter",
        "probe.exr",
        "--brdf",
        "lambertian",
        "-o",
        "map.npz",
        "--precision",
        "float",
    )
    run(
        copy,
        "prefilter",
        "probe.exr",
        "--brdf",
        "lambertian",
        "-o",
        "map.exr",
        "--precision",
        "float",
    )
    with zipfile.ZipFile(copy / "map.npz") as archive:
        names = sorted(archive.namelist())
        assert names == ["0/sh000.B.npy", "0/sh000.G.npy", "0/sh000.R.npy"]
        values = np.lib.format.read_array(archive.open(names[0]))
    assert np.array_equal(values, read_exr(copy / "map.exr")[1]["sh000.B"])
    run(copy, "convert", "map.exr", "--to", "cabral", "-o", "views.npz")
    with zipfile.ZipFile(copy / "views.npz") as archive:
        assert len(archive.namelist()) == 36


def test_a_default_is_one_line(copy):
    path = copy / "shrm_cli" / "vocabulary.py"
    path.write_text(path.read_text().replace("DEFAULT_EPS = 0.03", "DEFAULT_EPS = 0.2"))
    out = run(copy, "prefilter", "probe.exr", "--brdf", "phong", "--json")
    assert json.loads(out)["epsilon"] == 0.2
    code = "import shrm_cli; print(shrm_cli.prefilter('probe.exr', 'phong').info.eps)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(copy)},
        cwd=copy,
        capture_output=True,
        text=True,
    )
    assert float(done.stdout) == 0.2
