"""TOML of users: what is no such file is an error of one line, of the class that was asked for."""

import pytest

from shrm_cli.errors import MeshError, ProbeError
from shrm_cli.files.json_text import read_toml

TOO_LARGE = "more than 64 bytes; split it"


def read(path, error=ProbeError):
    return read_toml(str(path), "a list", 64, TOO_LARGE, error)


def test_values_and_bytes_of_a_file(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b'x = 1\r\n[y]\nz = "\xc3\xa9"\n')
    assert read(path) == ({"x": 1, "y": {"z": "é"}}, path.read_bytes())


def test_the_limit_is_the_largest_size(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"#" * 64)
    assert read(path)[0] == {}
    path.write_bytes(b"#" * 65)
    with pytest.raises(ProbeError) as caught:
        read(path)
    assert str(caught.value) == f"{path}: {TOO_LARGE}"


@pytest.mark.parametrize("error", [ProbeError, MeshError])
@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"x = ", "no TOML"), (b"x = 1\nx = 2", "no TOML"), (b'x = "\xff"', "no text"),
     (b"x = " + b"[" * 50, "no TOML")],
)  # fmt: skip
def test_what_is_no_toml_is_told_in_one_line(tmp_path, content, reason, error):
    path = tmp_path / "a.toml"
    path.write_bytes(content)
    with pytest.raises(error, match=reason) as caught:
        read(path, error)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_depth_is_no_recursion_error(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(b"x = " + b"[" * 50_000)
    with pytest.raises(ProbeError, match=r"nested too deeply to be a list; write it anew"):
        read_toml(path, "a list", 2**20, TOO_LARGE, ProbeError)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ProbeError, match=r"none\.toml: no such file; check its name"):
        read(tmp_path / "none.toml")


@pytest.mark.parametrize("text", ["{} = 1", "[{}]", "[[{}]]", "x = {{{} = 1}}", "y = 1\n  {} = 2"])
@pytest.mark.parametrize("key", ["a", '"a b"', r'"\"a"', "'a'"])
@pytest.mark.parametrize("dot", [".", " . "])
def test_keys_of_endless_parts_are_refused(tmp_path, text, key, dot):
    """Python's reader took 93 s and 9.9 GB for 100 kB of them."""
    path = tmp_path / "a.toml"
    for count, is_refused in ((16, False), (17, True), (20_000, True)):
        path.write_text(text.format(dot.join([key] * count)))
        if is_refused:
            with pytest.raises(ProbeError, match="a key of more than 16 parts"):
                read_toml(path, "a list", 2**20, TOO_LARGE, ProbeError)
        else:
            read_toml(path, "a list", 2**20, TOO_LARGE, ProbeError)


def test_long_values_are_no_keys(tmp_path):
    path = tmp_path / "a.toml"
    escaped = r"\"a. " * 100_000  # to look on from each quote would take minutes
    path.write_text(f"x = [{'1.5, ' * 1000}]\ny = '{'word ' * 1000}'\nz = \"{escaped}\"\n")
    values, _ = read_toml(path, "a list", 2**20, TOO_LARGE, ProbeError)
    assert len(values["x"]) == 1000
