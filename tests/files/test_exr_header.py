"""Counts of an OpenEXR file's headers, which are looked at before a library reads the file."""

import struct
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.files.exr import write
from shrm_cli.files.exr_header import (
    MOST_ATTRIBUTES,
    MOST_CHANNELS,
    MOST_PARTS,
    ends_whole,
    why_too_much,
)
from shrm_cli.files.parts import Part
from tests.cli.helpers import assert_refused, noise, run, write_exr
from tests.fuzz.exr_header import Attribute, parse


def channel_list(count):
    tail = struct.pack("<iB3xii", 1, 0, 1, 1)
    return b"".join(b"c%06d\0" % k + tail for k in range(count)) + b"\0"


@pytest.fixture
def headers(tmp_path):
    """The headers of a sound file, to be changed and written to `bad.exr`."""
    found = parse(write_exr(tmp_path / "sound.exr", noise()).read_bytes())
    return found


def written(headers, folder):
    path = folder / "bad.exr"
    path.write_bytes(headers.packed())
    return path


def add_attributes(headers, count):
    headers.parts[0] += [Attribute(b"a%d" % k, b"int", b"\0\0\0\0") for k in range(count)]


def set_channels(headers, count):
    (channels,) = (each for each in headers.parts[0] if each.name == b"channels")
    channels.data = channel_list(count)


def test_sound_files_have_no_excess(tmp_path):
    assert why_too_much(write_exr(tmp_path / "a.exr", noise())) == ""
    (tmp_path / "a.txt").write_text("no image")
    (tmp_path / "empty").touch()
    assert why_too_much(tmp_path / "a.txt") == why_too_much(tmp_path / "empty") == ""


def test_limits(tmp_path, headers):
    add_attributes(headers, MOST_ATTRIBUTES - len(headers.parts[0]))
    assert why_too_much(written(headers, tmp_path)) == ""
    add_attributes(headers, 1)
    assert why_too_much(written(headers, tmp_path)) == f"more than {MOST_ATTRIBUTES} attributes"


def test_channels(tmp_path, headers):
    set_channels(headers, MOST_CHANNELS)
    assert why_too_much(written(headers, tmp_path)) == ""
    set_channels(headers, MOST_CHANNELS + 1)
    assert why_too_much(written(headers, tmp_path)) == f"more than {MOST_CHANNELS:,} channels"


def test_channels_under_another_name(tmp_path, headers):
    """The library reads every list of channels, and takes as long for it."""
    half = MOST_CHANNELS // 2
    headers.parts[0].append(Attribute(b"chAnnels", b"chlist", channel_list(half)))
    assert why_too_much(written(headers, tmp_path)) == ""
    headers.parts[0].append(Attribute(b"others", b"chlist", channel_list(half)))
    assert why_too_much(written(headers, tmp_path)) == f"more than {MOST_CHANNELS:,} channels"


def test_parts(tmp_path):
    part = b"a\0int\0\4\0\0\0\0\0\0\0\0"
    start = b"\x76\x2f\x31\x01\2\x10\0\0"
    path = tmp_path / "bad.exr"
    path.write_bytes(start + part * MOST_PARTS + b"\0")
    assert why_too_much(path) == ""
    path.write_bytes(start + part * (MOST_PARTS + 1) + b"\0")
    assert why_too_much(path) == f"more than {MOST_PARTS:,} parts"


@pytest.mark.parametrize(
    "change", [lambda h: add_attributes(h, 100_000), lambda h: set_channels(h, 60_000)]
)
def test_every_reader_refuses_it_at_once(tmp_path, headers, change):
    """The libraries take 10 seconds to minutes for such a file."""
    change(headers)
    path = written(headers, tmp_path)
    sound = tmp_path / "sound.exr"
    for command in (
        ("info", path),
        ("prefilter", path, "--to", "irradiance", "-o", tmp_path / "out.exr"),
        ("render", path, "-o", tmp_path / "out.png"),
        ("reference", sound, "--brdf", path, "-o", tmp_path / "out.png"),
    ):
        start = time.process_time()
        assert_refused(run(*command), 1, "bad.exr: more than ", "export it again")
        assert time.process_time() - start < 2


@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_survived(tmp_path_factory, data, multi):
    path = tmp_path_factory.getbasetemp() / "any.exr"
    path.write_bytes(b"\x76\x2f\x31\x01" + struct.pack("<I", 0x1002 if multi else 2) + data)
    assert why_too_much(path) == ""


def test_cut_anywhere(tmp_path, headers):
    data = headers.packed()
    for end in range(0, 400, 7):
        (tmp_path / "cut.exr").write_bytes(data[:end])
        assert why_too_much(tmp_path / "cut.exr") == ""


def test_a_length_beyond_the_file(tmp_path, headers):
    headers.parts[0][0].size = 2**31 - 1
    assert why_too_much(written(headers, tmp_path)) == ""


@pytest.mark.parametrize("count", [1, 3])
def test_the_end_of_a_file(tmp_path, count):
    """Every length but the whole one is told, and a hole in the table of chunks."""
    plane = np.random.default_rng(1).uniform(size=(40, 6)).astype(np.float16)
    parts = [Part({"R": plane, "G": plane[::-1]}, {"name": f"part{k}"}) for k in range(count)]
    write(tmp_path / "a.exr", parts, "half")
    content = (tmp_path / "a.exr").read_bytes()
    cut = tmp_path / "cut.exr"
    cut.write_bytes(content)
    assert ends_whole(cut)
    for length in range(0, len(content), 7):
        cut.write_bytes(content[:length])
        assert not ends_whole(cut)
    cut.write_bytes(content[:-1])
    assert not ends_whole(cut)
    cut.write_bytes(content + b"\0")
    assert not ends_whole(cut)
    chunks = 3 * count
    (table,) = (
        k
        for k in range(len(content) - 8)
        if content[k : k + 8] == struct.pack("<Q", k + 8 * chunks)
    )
    for chunk in range(chunks):
        begin = table + 8 * chunk
        cut.write_bytes(content[:begin] + bytes(8) + content[begin + 8 :])
        assert not ends_whole(cut)
