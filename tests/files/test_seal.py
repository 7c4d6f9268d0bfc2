"""The digest within a file: whatever is changed of a file, it is noticed, and readers ignore it."""

import hashlib

import numpy as np
import OpenEXR
import pytest

from shrm_cli.files.exr_header import condition
from shrm_cli.files.parts import Part, write_parts
from tests.cli.helpers import noise, write_exr


@pytest.fixture
def sealed(tmp_path):
    """A file of two parts."""
    plane = np.random.default_rng(1).uniform(0, 2, (12, 24)).astype(np.float32)
    path = tmp_path / "file.exr"
    write_parts(path, [Part({"R": plane}, {"name": name}) for name in "ab"])
    return path


def test_it_is_the_digest_of_all_other_bytes(sealed):
    data = sealed.read_bytes()
    told = OpenEXR.File(str(sealed)).parts[0].header["shrm:digest"]
    assert hashlib.sha256(data.replace(told.encode(), b"")).hexdigest() == told
    assert condition(sealed) == "intact"
    assert "shrm:digest" not in OpenEXR.File(str(sealed)).parts[1].header


def test_all_damage_is_noticed(sealed):
    data = sealed.read_bytes()
    damaged = [
        data[:-1],
        data[: len(data) // 2],
        data[:40],
        b"",
        data[:-50] + bytes(50),
        data + b"x",
    ]
    places = np.random.default_rng(2).integers(0, len(data), 40)
    damaged += [data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :] for at in map(int, places)]
    for each in damaged:
        sealed.write_bytes(each)
        assert condition(sealed) != "intact"


def test_files_of_others_are_not_known(tmp_path):
    assert condition(write_exr(tmp_path / "other.exr", noise())) == "unknown"
    (tmp_path / "text.exr").write_text("no image")
    assert condition(tmp_path / "text.exr") == "unknown"
