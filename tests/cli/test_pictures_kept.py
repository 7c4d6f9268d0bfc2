"""Pictures under names that a command chooses: drawn anew where `shrm` drew them, else kept."""

import numpy as np
import pytest

from shrm_cli.files.png import write_png
from tests.cli.helpers import MESH, assert_refused, done, run, write_exr

MINE = b"\x89PNG\r\n\x1a\n, of somebody else, with the word shrm in it"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a probe, a map, a mesh and somebody's picture."""
    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "a.exr", np.ones((8, 16, 3), np.float32))
    (tmp_path / "mesh.obj").write_text(MESH)
    done("prefilter", "a.exr", "--to", "irradiance")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "command"),
    [
        ("a.irradiance.png", ["render", "a.irradiance.exr", "--size", "16"]),
        ("a.irradiance.0002.png", ["render", "a.irradiance.exr", "--size", "16", "--frames", "2"]),
        ("sheet.png", ["render", "a.irradiance.exr", "a.irradiance.exr", "--size", "16"]),
        ("compare.png", ["compare", "a.irradiance.exr", "--probe", "a.exr", "--size", "16"]),
        ("lookdev.png", ["lookdev", "a.exr", "--brdf", "lambertian", "--size", "16"]),
        ("basis.png", ["light", "basis", "mesh.obj", "--size", "16"]),
        ("lambertian.energy.png", ["analyze", "--brdf", "lambertian"]),
        ("materials.energy.png", ["analyze", "--brdf", "lambertian", "phong"]),
    ],
)
def test_what_shrm_did_not_draw_is_kept(folder, name, command):
    run(*command, "--quiet")
    first = (folder / name).read_bytes()
    (folder / name).unlink()
    (folder / name).write_bytes(MINE)
    assert_refused(run(*command), 1, name, "shrm did not draw it", "-o")
    assert (folder / name).read_bytes() == MINE
    (folder / name).write_bytes(first)
    assert run(*command, "--quiet").code == 0


def test_a_name_that_is_given_is_written(folder):
    (folder / "compare.png").write_bytes(MINE)
    run("compare", "a.irradiance.exr", "--probe", "a.exr", "--size", "16", "-o", "compare.png")
    assert (folder / "compare.png").read_bytes() != MINE


def test_pictures_that_shrm_drew_are_no_probes(folder):
    done("render", "a.irradiance.exr", "--size", "16")
    write_png(folder / "b.png", np.ones((8, 16, 3), np.uint8))
    (folder / "mine.png").write_bytes((folder / "b.png").read_bytes().replace(b"shrm", b"else"))
    said = run("batch", "*.png", "--linearize", "--to", "irradiance", "--dry-run")
    assert "1 output" in said.out + said.err
    assert "mine.irradiance.exr" in said.out + said.err
