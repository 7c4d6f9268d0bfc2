"""What is printed: nothing that a file or an argument holds can command a terminal."""

import json
import sys
import unicodedata

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.cli.terminal import echo, echo_json, escaped
from tests.cli.helpers import assert_refused, done, noise, run, write_exr
from tests.fuzz.exr_header import Attribute, parse
from tests.fuzz.judge import is_json, is_plain

TITLE = "\x1b]0;pwned\x07"  # sets the title of a window
EVIL = TITLE + "\x9b31m\u202eabc\u2066\u200b\x7f\x85\r"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("plain, \u00e9, \u4e2d, \U0001f600, 5 % and\nlines", None),
        ("\x1b[31m\t", "\\x1b[31m\\x09"),
        ("\x9b31m", "\\x9b31m"),
        ("\u202eabc", "\\u202eabc"),
        ("\U000e0041", "\\U000e0041"),
        ("a\udcffb", "a\\xffb"),
        ("\ud800", "\\ud800"),
    ],
)
def test_what_terminals_obey_becomes_an_escape(text, expected):
    assert escaped(text) == (text if expected is None else expected)


@pytest.mark.slow
@given(st.text(st.characters(exclude_categories=()), max_size=60))
def test_no_text_commands_a_terminal(text):
    found = escaped(text)
    assert not {unicodedata.category(c) for c in found if c != "\n"} & {"Cc", "Cf", "Cs"}
    assert found.encode().decode() == found


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters()),
    lambda each: st.lists(each, max_size=3) | st.dictionaries(st.text(), each, max_size=3),
    max_leaves=8,
)


@given(VALUES)
@pytest.mark.slow
def test_json_is_always_json(value):
    text = printed_json(value)
    assert is_json(text)
    assert is_plain(text.replace("\n", ""))


def test_json_holds_what_was_given(capsys):
    value = {"a": [1.5, "\u00e9\x9b\ud800\U0001f600"], "b": {"c": None}, "d": (1, float("inf"))}
    echo_json(value)
    found = json.loads(capsys.readouterr().out)
    assert found == {**value, "d": [1, None]}


def printed_json(value):
    """What `echo_json` prints; a fixture would be shared by all examples of hypothesis."""
    lines = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shrm_cli.cli.terminal.click.echo", lambda text, file: lines.append(text))
        echo_json(value)
    return lines[0]


def test_names_that_the_encoding_lacks(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout", Stream("ascii"))
    echo("\u00e9.exr")
    echo_json(["\u00e9"])
    assert sys.stdout.text == '\\xe9.exr\n[\n  "\\u00e9"\n]\n'


class Stream:
    """A stream of an encoding, which refuses what that lacks."""

    def __init__(self, encoding):
        self.encoding, self.text = encoding, ""

    def write(self, text):
        self.text += text.encode(self.encoding).decode(self.encoding)

    def flush(self):
        pass


def test_names_of_channels(tmp_path):
    planes = np.ones((16, 32, 3), np.float32)
    path = write_exr(tmp_path / "a.exr", planes)
    data = path.read_bytes()
    found = parse(data)
    (channels,) = (each for each in found.parts[0] if each.name == b"channels")
    channels.data = channels.data.replace(b"B\0", TITLE.encode() + b"\0")
    path.write_bytes(found.packed())
    result = run("info", path)
    assert_refused(result, 1, "\\x1b]0;pwned\\x07")
    assert is_plain(result.err)


def test_a_name_breaks_no_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "a\nb.exr", noise())
    for arguments in (
        ("prefilter", "a\nb.exr", "--to", "irradiance"),
        ("convert", "a\nb.exr", "--to", "strip"),
        ("info", "a\nb.exr"),
        ("probe", "furnace", "--size", "8", "-o", "c\nd.exr"),
    ):
        result = run(*arguments)
        assert result.code == 0
        said = result.out + result.err
        assert not [line for line in said.splitlines() if line.startswith(("b.", "d."))]
        assert "\\x0a" in said


@pytest.mark.parametrize("command", [("info",), ("prefilter", "--to", "irradiance")])
@pytest.mark.parametrize("kind", [b"\xe6loat", b"\x9b31m", b"\xff\xfe"])
def test_types_of_attributes_that_are_no_text(tmp_path, monkeypatch, command, kind):
    """The library quotes them in an error that it keeps, although it reads the file."""
    monkeypatch.chdir(tmp_path)
    headers = parse(write_exr(tmp_path / "a.exr", noise()).read_bytes())
    for each in headers.parts[0]:
        if each.name == b"screenWindowWidth":
            each.kind = kind
    (tmp_path / "a.exr").write_bytes(headers.packed())
    result = run(*command, "a.exr")
    assert (result.code, result.err) == (0, "")


def test_attributes_of_maps(tmp_path, a_map):
    path = with_attribute(a_map, tmp_path / "evil.exr", "shrm:probe", EVIL.encode())
    for options in ([], ["--json"]):
        text = done("info", path, *options)
        assert is_plain(text)
        assert "pwned" in text


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", EVIL],
        ["prefilter", "probe.exr", "--brdf", EVIL],
        ["render", "a.exr", "--view", EVIL],
        ["prefilter", "probe.exr", "--brdf", "phong", "--to", EVIL],
        [EVIL],
        ["info", f"--{EVIL}"],
    ],
)
def test_arguments(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    write_exr("probe.exr", noise())
    result = run(*arguments)
    assert result.code in (1, 2)
    assert result.err.count("\n") == 1
    assert is_plain(result.err)
    long = run(*(each.replace(EVIL, "x" * 10_000) for each in arguments))
    assert long.err.count("\n") == 1
    assert len(long.err) < 1300


def test_the_advice_is_not_cut(a_map):
    result = run("render", a_map, "--view", "x" * 10_000)
    assert result.err.startswith("Error: Invalid value for '--view': 'xxx")
    assert result.err.endswith(" is not two numbers AZ,EL such as 30,45; see shrm render --help\n")


@pytest.fixture(scope="module")
def a_map(tmp_path_factory):
    folder = tmp_path_factory.mktemp("map")
    probe = write_exr(folder / "probe.exr", noise())
    path = folder / "a.exr"
    assert run("prefilter", probe, "--brdf", "phong", "--size", 4, "-o", path).code == 0
    return path


def with_attribute(source, target, name, data, kind=b"string"):
    """Copy an EXR with another value of an attribute, which is added if it has none."""
    found = parse(source.read_bytes())
    attributes = found.parts[0]
    attributes[:] = [each for each in attributes if each.name != name.encode()]
    attributes.append(Attribute(name.encode(), kind, data))
    target.write_bytes(found.packed())
    return target
