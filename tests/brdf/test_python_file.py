"""BRDFs in files of the user: named, run when named, and refused with one line."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss

from shrm_cli.brdf import cache
from shrm_cli.brdf.cache import cached_coefficients
from shrm_cli.brdf.examine import examine
from shrm_cli.brdf.python_file import file_term
from shrm_cli.brdf.spec import file_label, named_files, names_file, parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import BrdfError
from tests.cli.helpers import assert_refused, done, run

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "my_brdf.py"

HEAD = """
import numpy as np
from shrm_cli.brdf.base import Brdf, Parameter

"""
FLAT = """
class {name}(Brdf):
    parameters = (Parameter("level", 0.5, 0, 1),)

    def evaluate(self, light, view):
        return np.full(np.broadcast_shapes(light.shape, view.shape), self.number("level"))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(HEAD + FLAT.format(name="Mine") + FLAT.format(name="Other"))
    return tmp_path


def test_the_example_is_minnaerts_law():
    brdf = parse_spec(f"{EXAMPLE}:Minnaert:k=2.5,albedo=0.8/0.5/0.25")
    light, view = np.array([0.6, 0, 0.8]), np.array([0, np.sqrt(0.75), 0.5])
    expected = 3.5 / (2 * np.pi) * (0.8 * 0.5) ** 1.5
    np.testing.assert_allclose(brdf.evaluate(light, view), expected * np.array([0.8, 0.5, 0.25]))
    assert not brdf.evaluate(-light, view).any()
    for theta, albedo in zip((0, 15, 30, 45, 60, 75), examine(brdf).albedo, strict=True):
        expected = np.cos(np.radians(theta)) ** 1.5 * np.array([0.8, 0.5, 0.25])
        np.testing.assert_allclose(albedo, expected, rtol=2e-3)
    assert examine(brdf).reciprocity_error < 1e-12


def test_the_example_with_k_1_is_lambertian():
    one = compute_coefficients(parse_spec(f"{EXAMPLE}:Minnaert:k=1,albedo=0.3"), 6, 2)
    other = compute_coefficients(parse_spec("lambertian:albedo=0.3"), 6, 0)
    np.testing.assert_allclose(one.values[:, 0, 0], other.values[:, 0, 0], atol=2e-4)
    np.testing.assert_allclose(one.values[:, 1:], 0, atol=2e-4)


def test_coefficients_of_the_example_are_integrals_over_light_and_view():
    """rho_hat = c z^k |v|^(k-1) about the normal: l and p come apart, and q is 0."""
    found = compute_coefficients(parse_spec(f"{EXAMPLE}:Minnaert:k=3"), 3, 2, 1e-8).values
    nodes, weights = leggauss(40)
    z, weight = (nodes + 1) / 2, weights / 2

    def y(degree, t):
        return np.sqrt((2 * degree + 1) / (4 * np.pi)) * Legendre.basis(degree)(t)

    for degree in range(4):
        for order in range(3):
            light = 2 * np.pi * np.sum(weight * z**3 * y(degree, z))
            view = 2 * np.pi * np.sum(weight * z**2 * (y(order, z) + y(order, -z)))
            expected = 4 / (2 * np.pi) * light * view
            assert found[degree, order, 0, 0] == pytest.approx(expected, abs=1e-6)


def test_the_command_line_takes_the_example(folder):
    text = done("brdf", f"{EXAMPLE}:Minnaert:k=2")
    assert text.startswith("minnaert:k=2,albedo=1: diffuse reflection whose rim is darker")
    assert "centre      normal" in text
    assert "reciprocity exact" in text
    assert json.loads(done("brdf", f"{EXAMPLE}:Minnaert", "--json"))["name"] == "minnaert"
    done("probe", "studio", "--size", 16, "-o", "p.exr")
    done("prefilter", "p.exr", "--brdf", f"{EXAMPLE}:Minnaert:k=2", "--quiet")
    (made,) = folder.glob("p.Minnaert-k-2.*.exr")
    result = json.loads(done("info", made.name, "--json"))
    assert result["brdf"] == {"name": "minnaert", "parameters": {"k": 2.0, "albedo": 1.0}}


def test_terms():
    assert file_term("ggx") is None
    assert file_term("folder.py/paint.bsdf") is None
    assert file_term("mine.pyc:Mine") is None
    term = file_term(" a/b.py:Mine:k=1/2/3 ")
    assert (term.path, term.name, term.values) == (Path("a/b.py"), "Mine", "k=1/2/3")
    assert file_term("b.py").name == ""
    assert file_term("b.py:Mine").values is None
    assert file_term("x.py/b.py:Mine").path == Path("x.py/b.py")
    assert file_term("ggx.py:Mine") is not None


def test_one_of_several_classes(folder):
    brdf = parse_spec("mine.py:Other:level=0.25")
    assert (brdf.name, brdf.values) == ("other", {"level": 0.25})
    assert (brdf.summary, brdf.source) == ("", "not stated")
    assert parse_spec(str(folder / "mine.py") + ":Mine").values == {"level": 0.5}


def test_terms_of_sums(folder):
    brdf = parse_spec("0.5*mine.py:Mine:level=1+2*lambertian+mine.py:Other")
    assert brdf.evaluate(np.ones(3), np.ones(3)).tolist() == pytest.approx(
        [0.5 + 2 / np.pi + 0.5] * 3
    )
    assert repr(brdf) == "0.5*mine:level=1+2*lambertian:albedo=1+1*other:level=0.5"
    assert parse_spec("2*mine.py:Mine").evaluate(np.ones(3), np.ones(3))[0] == 1


def test_a_folder_with_a_plus(folder):
    (folder / "c++").mkdir()
    (folder / "mine.py").rename(folder / "c++" / "mine.py")
    assert parse_spec("c++/mine.py:Mine").name == "mine"
    assert named_files("c++/mine.py:Mine") == [Path("c++/mine.py")]
    assert file_label("c++/mine.py:Mine:level=0.1") == "Mine-level-0.1"


def test_the_file_is_never_overwritten(folder):
    assert named_files("mine.py:Mine:level=1") == [Path("mine.py")]
    assert named_files("0.5*ggx+0.5*mine.py:Mine") == [Path("mine.py")]
    assert named_files("mine.py") == [Path("mine.py")]
    assert named_files("none.py:Mine") == []
    os.link(folder / "mine.py", folder / "mine.exr")
    before = (folder / "mine.py").read_text()
    for spec in ("mine.py:Mine", "2*mine.py:Mine"):
        result = run("brdf", spec, "--save", "mine.exr")
        assert_refused(result, 1, "mine.exr: would overwrite the input")
    assert (folder / "mine.py").read_text() == before


def test_labels(folder):
    assert file_label("mine.py:Mine") == "Mine"
    assert file_label("/some/where/mine.py:Mine:level=0.5") == "Mine-level-0.5"
    assert not names_file("mine.py:Mine")
    assert not names_file("mine.py")


def test_names_of_models_come_first(folder):
    """What looks like a file is a value of theirs, which they judge."""
    with pytest.raises(BrdfError, match=r"f0=x\.py is neither a colour"):
        parse_spec("ggx:f0=x.py")


def test_the_file_is_run_only_when_it_is_named(folder):
    (folder / "mine.py").write_text(
        "open('done', 'w').close()\n" + (folder / "mine.py").read_text()
    )
    file_term("mine.py:Mine")
    file_label("mine.py:Mine")
    named_files("mine.py:Mine")
    names_file("mine.py:Mine")
    with pytest.raises(BrdfError, match="names code, which is run only where you name it"):
        parse_spec("mine.py:Mine", run_code=False)
    assert not (folder / "done").exists()
    parse_spec("mine.py:Mine")
    assert (folder / "done").exists()


def test_what_was_changed_is_run_anew_and_nothing_is_left_beside_it(folder):
    for level in ("0.125", "0.625"):
        text = HEAD + FLAT.format(name="Mine").replace("0.5, 0, 1", f"{level}, 0, 1")
        (folder / "mine.py").write_text(text)
        os.utime(folder / "mine.py", (10**9, 10**9))
        assert parse_spec("mine.py:Mine").values == {"level": float(level)}
    assert [path.name for path in folder.iterdir()] == ["mine.py"]


def test_dataclasses_and_helpers_work(folder):
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\n" + HEAD
    text += "@dataclass\nclass Level:\n    value: float = 0.5\n\n"
    text += "def level():\n    return Level().value\n"
    text += FLAT.format(name="Mine").replace('self.number("level")', "level()")
    (folder / "mine.py").write_text(text)
    assert parse_spec("mine.py:Mine").evaluate(np.ones(3), np.ones(3))[0] == 0.5


def test_coefficients_are_not_kept(folder, monkeypatch):
    monkeypatch.setenv("SHRM_CACHE_DIR", str(folder / "cache"))
    monkeypatch.setattr(cache, "_SLOW", -1.0)
    for spec in ("mine.py:Mine", "2*mine.py:Mine", "mine.py:Mine+lambertian"):
        cached_coefficients(parse_spec(spec), 4, 2, 1e-2, compute_coefficients)
    assert not (folder / "cache").exists()
    cached_coefficients(parse_spec("phong"), 4, 2, 1e-2, compute_coefficients)
    assert (folder / "cache").exists()


def body(text, name="Mine", start="(Brdf):\n"):
    return HEAD + f"class {name}{start}" + "".join(f"    {line}\n" for line in text.split("\n"))


RETURNS = "def evaluate(self, light, view):\n    return {}"
WRONG = {
    "no file": (None, "none.py:Mine", "none.py: no such file; give path/to/file.py:Class"),
    "a folder": (None, "folder.py:Mine", "folder.py: no such file"),
    "no class": (
        HEAD + FLAT.format(name="Mine") + FLAT.format(name="Other"),
        "x.py:Min",
        "x.py: has no class 'Min'; give x.py:Mine or x.py:Other",
    ),
    "none named": (
        HEAD + FLAT.format(name="Mine"),
        "x.py",
        "x.py: a class is to be named; give x.py:Mine",
    ),
    "empty name": (HEAD + FLAT.format(name="Mine"), "x.py::level=1", "; give x.py:Mine"),
    "nothing in it": ("", "x.py:Mine", "it defines no subclass of Brdf"),
    "a function": ("def Mine(): pass\n", "x.py:Mine", "has no class 'Mine'"),
    "another class": ("class Mine: pass\n", "x.py:Mine", "x.py: Mine is not a subclass of Brdf"),
    "no evaluate": (body("name = 'x'"), "x.py:Mine", "x.py: Mine has no method evaluate(self"),
    "fails": ("\n\n1 / 0\n", "x.py:Mine", "running it fails: line 3: ZeroDivisionError"),
    "syntax": ("def f(:\n", "x.py:Mine", "running it fails: SyntaxError"),
    "exits": ("raise SystemExit(0)\n", "x.py:Mine", "running it fails: line 1: SystemExit"),
    "null": ("a = 1\0\n", "x.py:Mine", "running it fails: "),
    "several lines": ("raise ValueError('one\\ntwo')", "x.py:Mine", "ValueError: one two"),
    "center": (
        body("center = 'mirror'\n" + RETURNS.format(1)),
        "x.py:Mine",
        "the center 'mirror'; known: ",
    ),
    "parameters": (
        body("parameters = ('k',)\n" + RETURNS.format(1)),
        "x.py:Mine",
        "no Parameter(name",
    ),
    "text": (body("source = 3\n" + RETURNS.format(1)), "x.py:Mine", "has a source that is no text"),
    "default": (
        body("parameters = (Parameter('k', 7.0),)\n" + RETURNS.format(1)),
        "x.py:Mine",
        "k=7 is outside 0 .. 1",
    ),
    "range": (HEAD + FLAT.format(name="Mine"), "x.py:Mine:level=2", "level=2 is outside 0 .. 1"),
    "unknown": (HEAD + FLAT.format(name="Mine"), "x.py:Mine:k=2", "unknown parameter 'k'"),
    "no value": (HEAD + FLAT.format(name="Mine"), "x.py:Mine:", "expected key=value"),
    "init": (
        body("def __init__(self):\n    self.k = 1\n" + RETURNS.format(1)),
        "x.py:Mine",
        "lacks super().__init__(**values)",
    ),
    "init fails": (
        body("def __init__(self):\n    self.k = self.j\n" + RETURNS.format(1)),
        "x.py:Mine",
        "cannot be made: AttributeError",
    ),
    "number": (body(RETURNS.format("0.5")), "x.py:Mine", "evaluate() returns 0.5, not an array"),
    "integers": (
        body(RETURNS.format("np.ones(3, int)")),
        "x.py:Mine",
        "int64 numbers, not an array",
    ),
    "shape": (
        body(RETURNS.format("light[..., 2] * view[..., 2]")),
        "x.py:Mine",
        "returns the shape (6, 6) for light (6, 1, 3) and view (6, 3); it must be (6, 6, 3)",
    ),
    "one side": (body(RETURNS.format("light * 1.0")), "x.py:Mine", "it must be (6, 6, 3)"),
    "raises": (body(RETURNS.format("light['x']")), "x.py:Mine", "cannot be evaluated: "),
    "a name of shrm": (
        body("name = 'ggx'\n" + RETURNS.format("light * view")),
        "x.py:Mine",
        "Mine calls itself 'ggx', as a model of shrm does; give it another name",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_mistakes_are_one_line(folder, case):
    text, spec, words = WRONG[case]
    (folder / "folder.py").mkdir()
    if text is not None:
        (folder / "x.py").write_text(text)
    for term in (spec, f"0.5*{spec}+0.5*lambertian"):
        with pytest.raises(BrdfError) as caught:
            parse_spec(term)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)
    assert_refused(run("brdf", spec), 1, words)


def test_the_error_of_a_file_can_be_traced(folder):
    (folder / "x.py").write_text("\n\n1 / 0\n")
    with pytest.raises(BrdfError) as caught:
        parse_spec("x.py:Mine")
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
