"""Files of measured BRDFs: told apart by content, refused with one clear line."""

import hashlib
import os

import numpy as np
import pytest

from shrm_cli.brdf.measured.open import FORMATS, check_file, file_values, open_measured
from shrm_cli.brdf.measured.reading.table_writer import write_table
from shrm_cli.brdf.measured.table import tabulate
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError


@pytest.fixture
def small_table():
    return tabulate(parse_spec("ggx:roughness=0.6"), (6, 5, 4))


@pytest.mark.parametrize("suffix", [".exr", ".npz"])
def test_formats_are_told_by_content_not_by_name(tmp_path, small_table, suffix):
    write_table(tmp_path / f"table{suffix}", small_table)
    path = (tmp_path / f"table{suffix}").rename(tmp_path / "material.dat")
    found = open_measured(path)
    assert found.name == "table"
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.values == {"file": "material.dat", "sha256": digest}


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("rgl/paper_white_rgb.bsdf", "rgl"),
        ("cornell/garnet_red.brdf", "goniometer"),
        ("nist/PTFE.532.coeff.csv", "zernike"),
    ],
)
def test_real_files_are_recognised(shared, file, name):
    found = open_measured(shared / "brdf" / file)
    assert found.name == name
    assert found.values["file"] == file.split("/")[1]
    light = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])
    value = found.evaluate(light, np.array([0.0, 0.0, 1.0]))
    assert value.shape == (2, 3)
    assert (value > 0).all()


def test_there_is_a_class_for_every_format():
    import importlib

    for name, (kind, _) in FORMATS.items():
        module = importlib.import_module(f"shrm_cli.brdf.measured.{name}")
        assert getattr(module, kind).name == name


def test_an_unknown_file_is_refused_with_the_formats(tmp_path, rng):
    path = tmp_path / "noise.bin"
    path.write_bytes(rng.bytes(20000))
    with pytest.raises(BrdfError, match="not a measured BRDF") as caught:
        open_measured(path)
    for _, what in FORMATS.values():
        assert what in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"\0" * 5000, b"hello\n", b"PK\x03\x04", b"\x76\x2f\x31\x01"])
def test_what_only_looks_like_a_format_is_refused(tmp_path, content):
    path = tmp_path / "file.dat"
    path.write_bytes(content)
    with pytest.raises(BrdfError, match=r"file\.dat: "):
        open_measured(path)


def test_an_empty_file_is_refused(tmp_path):
    (tmp_path / "empty.bsdf").touch()
    with pytest.raises(BrdfError, match="an empty file"):
        open_measured(tmp_path / "empty.bsdf")


def test_what_is_no_file_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(BrdfError, match="not a regular file"):
        open_measured(tmp_path / "pipe")
    with pytest.raises(BrdfError, match="a directory"):
        open_measured(tmp_path)
    with pytest.raises(BrdfError, match="no such file"):
        open_measured(tmp_path / "missing.bsdf")
    with pytest.raises(BrdfError, match="no such file"):
        file_values(tmp_path / "missing.bsdf")


@pytest.mark.parametrize("name", ["x" * 300, "a\0b"])
def test_names_that_no_file_can_have_are_refused(tmp_path, name):
    with pytest.raises(BrdfError, match=r"cannot be read|no such file"):
        check_file(tmp_path / name)


def test_values_are_the_name_without_folder_and_the_digest(tmp_path, rng):
    content = rng.bytes(300_000)
    (tmp_path / "a.bsdf").write_bytes(content)
    digest = hashlib.sha256(content).hexdigest()
    assert file_values(tmp_path / "a.bsdf") == {"file": "a.bsdf", "sha256": digest}
