"""Files of measured BRDFs: told apart by content, refused with one clear line."""

import hashlib
import os

import numpy as np
import pytest

from shrm_cli.brdf import measured
from shrm_cli.brdf.measured import formats, open_measured
from shrm_cli.brdf.measured.merl import CELLS
from shrm_cli.brdf.measured.reading.file import check_file, file_values
from shrm_cli.brdf.measured.table import sample_table, write_table
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from tests.brdf.measured.goniometer_files import write_goniometer
from tests.cli.helpers import done


@pytest.fixture
def small_table():
    return sample_table(parse_spec("ggx:roughness=0.6"), (6, 5, 4))


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


def test_every_format_states_itself():
    known = formats()
    assert [each.name for each in known] == ["goniometer", "merl", "rgl", "table", "zernike"]
    for each in known:
        assert each.reads
        assert "\n" not in each.reads
        assert each.suffixes
        assert set(each.own_suffixes) <= set(each.suffixes)
    suffixes = [suffix for each in known for suffix in each.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix == suffix.lower() and suffix.startswith(".") for suffix in suffixes)


MERL = np.array(CELLS, "<i4").tobytes()
HEADS = {
    "goniometer": [
        b"3\n450 550 650\n",
        b"# num wls\n31\n\n# wls\n",
        b"# x\n# num wls\n",
        b"# num wls",
    ],
    "merl": [MERL, MERL + b"\0" * 99, MERL + b"# num wls\n3\n"],
    "rgl": [b"tensor_file\0\1\0", b"tensor_file\0\n# num wls\n3\n4 5\n"],
    "table": [
        b"PK\3\4",
        b"\x76\x2f\x31\x01\2\0\0\0comments\0string\0\n# num wls\n3\n400 500 600\n",
    ],
    "zernike": [
        b"theta_i,phi_i,theta_r,phi_r,r,g,b\n",
        b"1, 1, 0, 0, 0, 0, 0, 2.0\n",
        b"# num wls\n1 1 0 0 0 0 0 2.0\n",
        b"# num wls\ntheta_i, phi_i, theta_r, phi_r, value\n",
    ],
    None: [
        b"",
        b"hello\n",
        b"\0" * 99,
        b"\xff\0# num wls\n3\n400 500 600\n",
        b"3 4\n5 6\n",
        b"3\n4\n",
    ],
}


@pytest.mark.parametrize(
    ("name", "head"), [(name, head) for name, heads in HEADS.items() for head in heads]
)
def test_one_format_at_most_recognizes_a_file(name, head):
    expected = [] if name is None else [name]
    assert [each.name for each in formats() if each.recognizes(head)] == expected


def test_no_two_formats_recognize_a_real_file(shared, tmp_path, small_table):
    write_table(tmp_path / "table.exr", small_table)
    write_table(tmp_path / "table.npz", small_table)
    write_goniometer(tmp_path / "made.brdf", parse_spec("ggx:roughness=0.6"))
    counts = {}
    for path in [*(shared / "brdf").rglob("*.*"), *tmp_path.iterdir()]:
        head = path.read_bytes()[:4096]
        names = [each.name for each in formats() if each.recognizes(head)]
        assert len(names) <= 1, path
        for name in names:
            counts[name] = counts.get(name, 0) + 1
    assert counts == {"goniometer": 4, "rgl": 4, "table": 2, "zernike": 4}


def test_their_order_does_not_matter(tmp_path, small_table, monkeypatch):
    write_table(tmp_path / "table.exr", small_table)
    known = formats()
    for order in (known, known[::-1]):
        monkeypatch.setattr(measured, "formats", lambda order=order: order)
        assert open_measured(tmp_path / "table.exr").name == "table"


@pytest.mark.parametrize("suffix", [".binary", ".BSDF"])
def test_content_is_believed_before_the_name(tmp_path, small_table, suffix):
    write_table(tmp_path / "table.exr", small_table)
    path = (tmp_path / "table.exr").rename(tmp_path / f"table{suffix}")
    assert open_measured(path).name == "table"


@pytest.mark.parametrize(
    ("name", "words"), [("a.binary", "not a MERL file"), ("a.Bsdf", "not an RGL .bsdf file")]
)
def test_names_tell_what_is_damaged(tmp_path, name, words):
    (tmp_path / name).write_bytes(b"something else")
    with pytest.raises(BrdfError, match=words):
        open_measured(tmp_path / name)


FLAT = '''
"""A format of one number."""
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import file_values
import numpy as np


class Flat(MeasuredBrdf):
    """A constant."""

    name = "flat"
    reads = "files of one number"
    suffixes = (".flat",)

    @staticmethod
    def recognizes(head):
        return head.startswith(b"flat ")

    @classmethod
    def open(cls, path):
        made = cls()
        made.values = file_values(path)
        made.level = float(path.read_text().split()[1])
        return made

    def evaluate(self, light, view):
        return np.full(np.broadcast_shapes(light.shape, view.shape), self.level)
'''


def test_a_new_format_is_one_new_file(tmp_path, monkeypatch):
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "flat.py").write_text(FLAT)
    (tmp_path / "x.flat").write_text("flat 0.25")
    monkeypatch.setattr(measured, "__path__", [*measured.__path__, str(tmp_path / "package")])
    found = parse_spec(str(tmp_path / "x.flat"))
    assert found.evaluate(np.ones(3), np.ones(3)).tolist() == [0.25] * 3
    assert repr(found) == "x.flat"
    assert found.is_measured
    assert "  flat               files of one number\n" in done("brdf")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BrdfError, match=r"missing\.flat: no such file"):
        parse_spec("missing.flat")


def test_an_unknown_file_is_refused_with_the_formats(tmp_path, rng):
    path = tmp_path / "noise.bin"
    path.write_bytes(rng.bytes(20000))
    with pytest.raises(BrdfError, match="not a measured BRDF") as caught:
        open_measured(path)
    for each in formats():
        assert each.reads in str(caught.value)
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
    with pytest.raises(BrdfError, match=r"cannot be opened|no such file"):
        check_file(tmp_path / name)


def test_values_are_the_name_without_folder_and_the_digest(tmp_path, rng):
    content = rng.bytes(300_000)
    (tmp_path / "a.bsdf").write_bytes(content)
    digest = hashlib.sha256(content).hexdigest()
    assert file_values(tmp_path / "a.bsdf") == {"file": "a.bsdf", "sha256": digest}
