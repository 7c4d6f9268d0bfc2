"""A new grid is one module and one row; a new arrangement of a cube is one row.

The rows are added to the text of `shrm_cli.vocabulary` before anything else is imported, and the
command line is asked for what it can do with a layout.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from tests.probe import scenes

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """
import sys, types
from pathlib import Path
before, row, *arguments = sys.argv[1:]
path = Path("shrm_cli/vocabulary.py").resolve()
source = path.read_text()
assert source.count(before) == 1
layouts = types.ModuleType("shrm_cli.vocabulary")
sys.modules["shrm_cli.vocabulary"] = layouts
exec(compile(source.replace(before, before + row), str(path), "exec"), layouts.__dict__)
from shrm_cli.cli.main import main
main(arguments)
"""
GRID = (
    '    "angular": "shrm_cli.sphere.grid.angular:Angular",\n',
    '    "octahedral": "tests.sphere.grid.octahedral:Octahedral",\n',
)
CUBE = (
    '    "strip": CubeArrangement.drawn("+X -X +Y -Y +Z -Z"),\n',
    '    "block": CubeArrangement.drawn("+Z -X -y", "+Y -Z +X"),\n',
)


@pytest.fixture
def shrm(tmp_path):
    """A function that runs the command line with a row added, and returns its stdout."""

    def run(row, *arguments):
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM, *row, *map(str, arguments), "--no-cache"],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
            cwd=ROOT,
        )
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run


def octahedral(size):
    """The scene on a square: the upper half of an octahedron amid, the other half folded out."""
    s = (2 * np.arange(size) + 1) / size - 1
    x, y = -s[None, :] + 0 * s[:, None], -s[:, None] + 0 * s[None, :]
    z = 1 - abs(x) - abs(y)
    out = z < 0
    x[out], y[out] = (1 - abs(y[out])) * np.sign(x[out]), (1 - abs(x[out])) * np.sign(y[out])
    points = np.stack([x, y, z], axis=-1)
    return scenes.radiance(points / np.linalg.norm(points, axis=-1, keepdims=True))


def test_a_new_grid_is_read_and_written(tmp_path, shrm):
    path = scenes.write(tmp_path / "probe.exr", octahedral(64))
    described = shrm(GRID, "info", path, "--layout", "octahedral")
    assert "octahedral" in described
    assert "64" in described
    back, there = tmp_path / "back.exr", tmp_path / "there.exr"
    shrm(GRID, "convert", path, "--layout", "octahedral", "--to", "latlong", "-o", back)
    found = project(open_probe(back), 4).coefficients
    assert scenes.error(found, scenes.coefficients(4)) < 5e-3
    small = scenes.write(tmp_path / "latlong.exr", scenes.latlong(256))
    shrm(GRID, "convert", small, "--to", "octahedral", "--size", "32", "-o", there)
    pixels = open_probe(there, layout="angular").images[0].read(0, 32)
    # The mean over a cell against the middle of it.
    np.testing.assert_allclose(pixels, octahedral(32), rtol=0.08)


@pytest.mark.proof
@pytest.mark.slow
def test_light_on_a_new_grid_is_reflected(tmp_path, shrm):
    """In the frequency domain and by brute force: the mean of both spheres is as of a lat-long."""
    images = {"octahedral": octahedral(48), "latlong": scenes.latlong(48)}
    means = []
    for layout, image in images.items():
        path = scenes.write(tmp_path / f"{layout}.exr", image)
        made, truth = tmp_path / f"{layout}.shrm.exr", tmp_path / f"{layout}.truth.exr"
        options = ("--brdf", "lambertian", "--layout", layout)
        shrm(GRID, "prefilter", path, *options, "--size", "4", "-o", made)
        shrm(GRID, "reference", path, *options, "--size", "16", "-o", truth)
        drawn = tmp_path / f"{layout}.drawn.exr"
        shrm(GRID, "render", made, "--size", "16", "-o", drawn)
        means.append([open_probe(p, layout="angular").image().mean(axis=(0, 1)) for p in
                      (drawn, truth)])  # fmt: skip
    np.testing.assert_allclose(means[0], means[1], rtol=0.01)
    np.testing.assert_allclose(means[0][0], means[0][1], rtol=0.02)


@pytest.mark.proof
@pytest.mark.slow
def test_a_new_arrangement_of_a_cube(tmp_path, shrm):
    """It is listed, detected, read and written, for probes and for maps."""
    for command in ("info", "convert"):
        assert "strip|block|hcross" in shrm(CUBE, command, "--help").replace("\n", "")
    px, nx, py, ny, pz, nz = scenes.cube_faces(16, orientation="gl")
    rows = [np.concatenate(row, axis=1) for row in ([pz, nx, ny[::-1, ::-1]], [py, nz, px])]
    image = np.concatenate(rows)
    path = scenes.write(tmp_path / "probe.exr", image)
    assert "block" in shrm(CUBE, "info", path)
    stacked = tmp_path / "stacked.exr"
    shrm(CUBE, "convert", path, "--to", "openexr", "-o", stacked, "--precision", "float")
    expected = scenes.cube_faces(16).reshape(96, 16, 3)
    np.testing.assert_array_equal(open_probe(stacked).image(), expected)
    again = tmp_path / "again.exr"
    shrm(CUBE, "convert", stacked, "--to", "block", "-o", again, "--precision", "float")
    with pytest.raises(ProbeError, match="48 x 32 is no known layout"):
        open_probe(again)  # without the row
    assert "block" in shrm(CUBE, "info", again)
    made, turned = tmp_path / "map.shrm.exr", tmp_path / "map.block.exr"
    shrm(CUBE, "prefilter", path, "--brdf", "lambertian", "--size", "4", "-o", made)
    shrm(CUBE, "convert", made, "--to", "block", "-o", turned)
    back = tmp_path / "map.back.exr"
    shrm(CUBE, "convert", turned, "--to", "openexr", "-o", back)
    compared = shrm(CUBE, "compare", made, back, "--size", "16", "--json", "-o", tmp_path / "c.png")
    assert '"relative_rmse": 0.0' in compared
