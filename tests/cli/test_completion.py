"""What shells complete: commands, options, BRDFs, their parameters and the values of these."""

import pytest
from click.testing import CliRunner

from shrm_cli.brdf.library import model_names
from shrm_cli.brdf.vectors import METALS
from shrm_cli.cli.main import cli
from tests.cli.helpers import process


def completed(line):
    """What zsh is told about the last word of a line: kinds and values."""
    words = {"_SHRM_COMPLETE": "zsh_complete", "COMP_WORDS": line}
    words["COMP_CWORD"] = str(line.count(" "))
    result = CliRunner().invoke(cli, env=words, prog_name="shrm")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = result.output.splitlines()
    return list(zip(lines[::3], lines[1::3], strict=True))


@pytest.mark.parametrize(
    ("line", "values"),
    [
        ("shrm pre", ["prefilter"]),
        ("shrm prefilter x.exr --to sp", ["splitsum"]),
        ("shrm prefilter x.exr --brdf oren", ["oren-nayar"]),
        ("shrm prefilter x.exr --brdf ggx:ro", ["ggx:roughness="]),
        (
            "shrm prefilter x.exr --brdf ggx:roughness=0.4,",
            [
                f"ggx:roughness=0.4,{name}="
                for name in ("anisotropy", "mapping", "ax", "ay", "f0", "film", "film_ior")
            ],
        ),
        ("shrm reference x.exr --brdf ggx:f0=go", ["ggx:f0=gold"]),
        ("shrm compare x.exr --brdf 0.5*lambertian+0.5*war", ["0.5*lambertian+0.5*ward"]),
        ("shrm brdf lafortune:fit=sk", ["lafortune:fit=skin"]),
        ("shrm analyze --brdf ggx gg", ["ggx"]),
        ("shrm brdf 1e-1*lambertian+2e+0*gg", ["1e-1*lambertian+2e+0*ggx"]),
    ],
)
@pytest.mark.slow
def test_values(line, values):
    assert completed(line) == [("plain", value) for value in values]


def test_every_model_and_every_metal_is_offered():
    found = {value for _, value in completed("shrm brdf ")}
    assert set(model_names()) <= found
    found = {value for _, value in completed("shrm brdf ggx:f0=")}
    assert found == {f"ggx:f0={metal}" for metal in METALS}


@pytest.mark.parametrize("word", ["paint.bi", "nothing:k", "ggx:roughness=0.", "x/"])
def test_what_no_model_continues_may_be_a_file(word):
    assert completed(f"shrm brdf {word}") == [("file", word)]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_it_is_switched_on_as_the_page_says(monkeypatch, shell):
    monkeypatch.setenv("_SHRM_COMPLETE", f"{shell}_source")
    result = process()
    assert result.code == 0
    assert "_SHRM_COMPLETE" in result.out
