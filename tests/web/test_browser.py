"""The example of examples/browser: shrm itself in a page, beside what it makes in a process."""

import runpy

import numpy as np
import pytest

from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.probe.open import open_probe
from tests.cli.helpers import ROOT
from tests.probe import scenes
from tests.web import proofs
from tests.web.browser import MODULES

HEADER = 148
"""Bytes of a DDS file before its texels."""
SIZE = 64


@pytest.fixture(scope="module")
def built(site):
    folder, address = site
    program = runpy.run_path(str(ROOT / "examples" / "browser" / "build.py"))
    program["build"](MODULES, folder / "prefilter")
    return f"{address}/prefilter/"


def chosen(watched, address, path, target):
    """Choose a file and an engine in the page, and return the files that it offers."""
    page = watched.page
    if not page.url.startswith(address):
        page.goto(address + "index.html")
    page.set_input_files("#file", path)
    page.wait_for_selector("#go:not([disabled])")
    page.select_option("#engine", target)
    page.select_option("#size", str(SIZE))
    page.click("#go")
    page.wait_for_function(
        "document.querySelector('#files a') || document.querySelector('#error').textContent"
    )
    assert page.text_content("#error") == ""
    return page.evaluate("""async () => Object.fromEntries(await Promise.all(
        [...document.querySelectorAll('#files a')].map(async link =>
            [link.download, [...new Uint8Array(await (await fetch(link.href)).arrayBuffer())]])))
    """)


@pytest.mark.parametrize("suffix", ["hdr", "exr"])
def test_texels_are_those_of_a_process(watched, built, tmp_path, suffix):
    path = tmp_path / f"light.{suffix}"
    scenes.write(path, proofs.made_probe(128).image())
    found = chosen(watched, built, path, "directx")
    made = packaged(
        Source("light", path.name, open_probe(path)), engine("directx"), Asked(size=SIZE)
    )
    paths = write(made, tmp_path / "made")
    assert sorted(found) == sorted(each.name for each in paths)
    texels = np.frombuffer(bytes(found["light.dds"]), np.float16, offset=HEADER)
    expected = np.fromfile(tmp_path / "made" / "light.dds", np.float16, offset=HEADER)
    np.testing.assert_allclose(texels, expected, rtol=2e-3, atol=1e-4)
    assert not watched.errors
    assert all(url.startswith((built, "blob:")) for url in watched.requests)


def test_every_engine_of_the_page_gets_its_files(watched, built, tmp_path):
    path = tmp_path / "light.hdr"
    scenes.write(path, proofs.made_probe(32).image())
    watched.page.goto(built + "index.html")
    watched.page.wait_for_selector("#engine option", state="attached")
    offered = watched.page.evaluate(
        "[...document.querySelector('#engine').options].map(o => o.value)"
    )
    assert {"three", "babylon", "filament", "bevy", "gltf", "directx"} <= set(offered)
    for each in offered:
        assert "light_README.md" in chosen(watched, built, path, each)


def test_what_is_no_panorama_is_refused(watched, built, tmp_path):
    page = watched.page
    page.goto(built + "index.html")
    good = tmp_path / "good.hdr"
    scenes.write(good, proofs.made_probe(32).image())
    for name, data, said in (
        ("light.hdr", b"#?RADIANCE\n", "Bad File Format: missing format specifier"),
        ("light.exr", b"hello", "Provided file doesn't appear to be in OpenEXR format."),
        ("light.png", b"hello", "it is no .hdr or .exr file"),
    ):
        page.set_input_files("#file", good)
        page.wait_for_selector("#preview:not([hidden])")
        (tmp_path / name).write_bytes(data)
        page.set_input_files("#file", tmp_path / name)
        page.wait_for_function("document.querySelector('#error').textContent")
        assert page.text_content("#error").startswith(f"{name}: ")
        assert page.text_content("#error").endswith(said)
        assert page.is_hidden("#preview")
        assert page.is_disabled("#go")
