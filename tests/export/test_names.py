"""Probes of any name: what exports write of it is read again by parsers of the languages."""

import json
import re
import shutil
import subprocess
from functools import cache
from urllib.parse import unquote

import pytest

from shrm_cli.batch.made import without_outputs
from shrm_cli.export.quoting import code_span, comment, markdown, spans, string, uri
from shrm_cli.vocabulary import ENGINES
from tests.cli.helpers import noise, run, write_exr

NAMES = (
    "my probe", 'a"b', "a'b`c``d", "50% #1?x&y=z", "a\nb", "$(rm) ${x}", "</script>", "x -->",
    "a*!b", "[x](y) *z* _w_ <b>", "ü 日本", "back\\slash", "a+b;c,d@e!",
)  # fmt: skip


@pytest.mark.parametrize("engine", ["three", "cesium"])
def test_lines_of_javascript_import_what_they_make(exported, engine):
    files = exported(engine)
    (readme,) = (path for file, path in files.items() if file.endswith("_README.md"))
    code = readme.read_text().partition("\n\n")[2]
    imported = re.findall(r"\w+", " ".join(re.findall(r"import \{(.*?)\} from", code)))
    made = re.findall(r"new (\w+)", code)
    assert made
    assert set(made) <= set(imported)


@pytest.mark.parametrize("name", [*NAMES, "*/ x /*", "// \u2028"])
def test_every_form_stands_for_the_name(name):
    assert json.loads(string(name)) == name
    assert unquote(uri(name)) == name
    assert re.fullmatch(r"[A-Za-z0-9._~%-]*", uri(name))
    said = comment(name)
    assert "\n" not in said
    assert "\u2028" not in said
    assert "*/" not in said
    assert "/*" not in said
    fence = re.match("`+", code_span(name))[0]
    assert spans(f"{code_span(name)}, {code_span('b')}.") == [code_span(name), "`b`"]
    inside = code_span(name)[len(fence) : -len(fence)]
    assert fence not in re.findall("`+", inside)
    assert inside.strip() == name.replace("\n", "?").replace("\u2028", "?").strip()
    shown = re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", markdown(name))
    assert shown == name.replace("\n", "?").replace("\u2028", "?")


HARD = 'my 50% "a`b" #1?x&y ${x}\nz'
"""What breaks lines, quotes, addresses and templates, in one name."""


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """What exports a probe of some name, once for all tests: file names, and their paths."""

    @cache
    def files(engine, name=HARD):
        folder = tmp_path_factory.mktemp("export")
        probe = write_exr(folder / f"{name}.exr", noise(8, 16))
        found = run("export", probe, "--for", engine, "--size", "32", "-o", folder / "out")
        assert found.code == 0, found.err
        return {path.name: path for path in (folder / "out").iterdir()}

    return files


def strings(code):
    """The strings of lines of code, as they are read."""
    code = "\n".join(line for line in code.splitlines() if not line.strip().startswith("//"))
    found = re.findall(r'"(?:[^"\\]|\\.)*"', code)
    return [json.loads(text) for text in found if text != '""']


@pytest.mark.parametrize("engine", ENGINES)
def test_files_are_named_so_that_they_are_found(exported, engine):
    files = exported(engine)
    (readme,) = (path for file, path in files.items() if file.endswith("_README.md"))
    text = readme.read_text()
    assert text.count("\n") == len(text.splitlines())
    head, _, code = text.partition("\n\n")
    assert len(head.splitlines()) == (4 if code else 3)  # no name breaks a line
    for line in head.splitlines():  # names of files stand in spans of code alone
        outside = line
        for each in files:
            outside = outside.replace(code_span(each), "")
        assert "`b" not in outside.replace("\\`b", "")
    assert without_outputs(map(str, files.values()))[0] == []
    for line in code.splitlines():
        assert line.startswith("    "), line
    wanted = [each for each in strings(code) if each.rpartition(".")[2] in
              ("ktx2", "ktx", "env", "dds", "exr", "hdr", "gltf", "json", "js", "png")]  # fmt: skip
    for each in wanted:
        if each.startswith("three/addons/"):  # three.js' own
            continue
        bare = each.removeprefix("./").removeprefix("res://")
        assert bare in files or unquote(bare) in files, each
    for path in files.values():
        if path.suffix == ".gltf":
            tree = json.loads(path.read_text())
            assert all(unquote(image["uri"]) in files for image in tree["images"])
            assert all(re.fullmatch(r"[A-Za-z0-9._~%-]+", image["uri"]) for image in tree["images"])


@pytest.mark.parametrize("engine", ["blender", "usd"])
def test_a_command_of_a_shell_has_the_name_as_one_word(exported, engine):
    """Bash reads the words: what is copied into a terminal must run nothing that a name says."""
    name = 'a\'b "c" $(touch ran) `touch ran`; touch ran #'
    files = exported(engine, name)
    (readme,) = (path for file, path in files.items() if file.endswith("_README.md"))
    line = next(each for each in readme.read_text().splitlines() if each.startswith("    # "))
    command = line.strip().removeprefix("# ").removesuffix(", or a sublayer of your stage")
    words = ["bash", "-c", f'set -- {command}\nprintf "%s\\0" "$@"']
    told = subprocess.run(words, capture_output=True, text=True, check=True, cwd=readme.parent)
    assert told.stdout.split("\0")[-2] in files
    assert not (readme.parent / "ran").exists()


@pytest.mark.skipif(shutil.which("node") is None, reason="node parses the lines of JavaScript")
@pytest.mark.parametrize("engine", ["three", "babylon", "gltf", "cesium", "playcanvas"])
def test_lines_of_javascript_are_javascript(exported, tmp_path, engine):
    files = exported(engine)
    (readme,) = (path for file, path in files.items() if file.endswith("_README.md"))
    code = readme.read_text().partition("\n\n")[2]
    (tmp_path / "code.mjs").write_text(code)
    subprocess.run(["node", "--check", str(tmp_path / "code.mjs")], check=True)
