"""Every form with every kind of code: it is made, or refused in one line."""

from importlib import import_module

import pytest

from shrm_cli.maps.shader.language import LANGUAGES
from shrm_cli.vocabulary import REPRESENTATIONS
from tests.cli.helpers import noise, run, write_exr

PREFILTER = import_module("shrm_cli.prefilter")  # `shrm_cli` has a function of that name
REFUSED = {"irradiance": "has no textures"}
"""Forms without layers, and what is said of them."""


SMALL = {
    "shrm": ("--size", "8"),
    "product": ("--texels", "8", "--order", "1"),
    "splitsum": ("--levels", "2", "--size", "8"),
    "lightfield": ("--views", "4", "--eps", "0.3"),
    "kautz-mccool": ("--slices", "3"),
}
"""What makes maps quickly: it is their code that counts."""


def making(form):
    """The command that makes a small map of a form."""
    light = ("irradiance", "splitsum", "she")
    brdf = () if form in light else ("--brdf", "phong:exponent=2")
    return ("prefilter", "probe.exr", *brdf, "--to", form, *SMALL.get(form, ()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a map of each form."""
    folder = tmp_path_factory.mktemp("forms")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_exr(folder / "probe.exr", noise(8, 16))
        for form in REPRESENTATIONS:
            made = run(*making(form), "-o", f"{form}.exr")
            assert made.code == 0, made.err
        made = run("product", "ward", "--vary", "ay=0.3..0.4", "--steps", "2", "--size", "8",
                   "--order", "1", "-o", "varying.exr")  # fmt: skip
        assert made.code == 0, made.err
    return folder


@pytest.mark.parametrize("code", [(), *(("--shader", language) for language in LANGUAGES)])
@pytest.mark.parametrize("form", [*REPRESENTATIONS, "varying"])
def test_layers(folder, monkeypatch, form, code):
    monkeypatch.chdir(folder)
    found = run("convert", f"{form}.exr", "--to", "layers", *code, "-o", "layers.exr")
    said = REFUSED.get(form)
    if said is None:
        assert found.code == 0, found.err
        return
    assert found.code == 1
    assert said in found.err
    assert found.err.count("\n") == 1
    assert "internal error" not in found.err


@pytest.fixture(scope="module")
def once():
    """What makes the map of each form a single time: it is the same for all that is printed."""
    make, made = PREFILTER.make, {}

    def known(probe, request, progress):
        if request.to not in made:
            made[request.to] = make(probe, request, progress)
        return made[request.to]

    return known


@pytest.mark.parametrize("code", LANGUAGES)
@pytest.mark.parametrize("form", REPRESENTATIONS)
@pytest.mark.parametrize("textures", [None, "cube-array", "layers"])
def test_code(folder, once, monkeypatch, form, code, textures):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(PREFILTER, "make", once)
    given = () if textures is None else ("--textures", textures)
    found = run(*making(form), "--shader", code, *given, "-o", "made.exr")
    assert "internal error" not in found.err
    if found.code:
        assert found.err.count("\n") == 1
    else:
        assert "shrm_" in found.out
