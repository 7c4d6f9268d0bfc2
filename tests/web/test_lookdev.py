"""The page of `shrm lookdev` in a browser: its pixels, its sliders, and nothing from a network."""

import numpy as np
import OpenImageIO as oiio

from shrm_cli.render.sheet import Grid
from tests import oracles
from tests.cli.helpers import done, polynomial_light, write_exr

SIZE = 32
READ = """index => {
  const canvas = document.querySelectorAll("canvas")[index];
  return Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data);
}"""


def shown(page, index):
    return np.array(page.evaluate(READ, index)).reshape(SIZE, SIZE, 4)[..., :3]


def test_the_page_shows_the_sheet_and_exposes_it_anew(watched, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    light = polynomial_light(oracles.latlong_pixels(32, 16)).astype(np.float32)
    write_exr(tmp_path / "a.exr", light)
    write_exr(tmp_path / "b.exr", light[:, ::-1] * 7)
    arguments = (
        "a.exr", "b.exr", "--brdf", "lambertian", "--brdf", "phong:exponent=8", "--size", SIZE,
    )  # fmt: skip
    done("lookdev", *arguments, "-o", "p.html")
    done("lookdev", *arguments, "-o", "s.png")
    sheet, grid = oiio.ImageBuf("s.png").get_pixels(oiio.UINT8).astype(int), Grid(2, 2, SIZE)
    page = watched.page
    page.set_viewport_size({"width": 400, "height": 800})
    page.goto(f"file://{tmp_path}/p.html")
    page.wait_for_selector("output:not(:empty)")
    for index, (column, row) in enumerate(np.ndindex(2, 2)):
        top, left = grid.origin(row, column)
        expected = sheet[top : top + SIZE, left : left + SIZE]
        assert np.abs(shown(page, index) - expected).max() <= 1
    before, other = shown(page, 0), shown(page, 2)
    page.locator("input").first.fill("-2")
    page.wait_for_selector("button:not([disabled])")  # the page's policy forbids functions
    assert shown(page, 0).mean() < 0.7 * before.mean()
    np.testing.assert_array_equal(shown(page, 2), other)
    page.locator("button").first.click()
    np.testing.assert_array_equal(shown(page, 0), before)
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert watched.errors == []
    assert {url[:5] for url in watched.requests} <= {"file:", "data:"}
