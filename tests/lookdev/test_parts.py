"""Names, exposures and the grid of a sheet."""

import base64
import re

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.lookdev.sheet import Column, lookdev_page, material_names, metered, probe_names
from shrm_cli.probe.probe import Probe
from shrm_cli.render.image import weighted_quantiles
from shrm_cli.render.sheet import PAPER, Grid, draw_grid
from tests import oracles


def test_short_names():
    given = {
        "ggx": "ggx",
        "ggx:roughness=0.4,f0=gold": "ggx 0.4 gold",
        "lambertian:albedo=0.8/0.1/0.05": "lambertian 0.8/0.1/0.05",
        "/x/y/paint.binary": "paint",
        "0.9*lambertian+0.1*phong:exponent=1e+2": "lambertian + phong",
        "cook-torrance:sigma=0.1234567,n=1.512345,k=3.5": "cook-torrance 0.12345...",
    }
    assert material_names(list(given)) == list(given.values())


def test_names_that_would_be_alike_are_told_apart():
    sums = ["0.9*lambertian+0.1*phong", "0.5*lambertian+0.5*phong"]
    names = material_names([*sums, "ggx"])
    assert len(set(names)) == 3
    assert "0.9" in names[0]
    assert names[2] == "ggx"
    assert probe_names(["a/x.exr", "b/x.exr", "sky_%.exr"]) == ["a/x.exr", "b/x.exr", "sky"]


@pytest.mark.parametrize("radiance", [0.01, 0.8, 37.0])
def test_a_white_ball_in_even_light_is_shown_at_four_fifths(radiance):
    """Even light lights a white surface as brightly as itself: E / pi = L."""
    probe = Probe.from_array(np.full((16, 32, 3), radiance, dtype=np.float32))
    stops = metered(probe)
    assert stops == pytest.approx(round(stops, 1), abs=1e-9)
    assert radiance * 2**stops == pytest.approx(0.8, rel=2**0.05 - 1)


def test_a_black_probe_and_colours():
    assert metered(Probe.from_array(np.zeros((8, 16, 3), dtype=np.float32))) == 0
    green = np.zeros((16, 32, 3), dtype=np.float32)
    green[..., 1] = 1
    stops = metered(Probe.from_array(green))
    assert 2**stops == pytest.approx(0.8 / 0.7152, rel=2**0.05 - 1)


def test_a_lamp_counts_as_what_it_lights():
    """Light from +Y as cos+ lights a ball as E / pi; its tenth quantile is by our own sum."""
    pixels = oracles.latlong_pixels(128, 64)
    light = np.repeat(np.maximum(pixels[..., 1:2], 0), 3, axis=-1).astype(np.float32)
    rng = np.random.default_rng(2)
    normals = rng.normal(size=(1500, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    solid = np.sin((np.arange(64) + 0.5) / 64 * np.pi)[:, None] * (np.pi / 64) ** 2
    weights = (light[..., 0] * solid).ravel()
    cosines = np.maximum(normals @ pixels.reshape(-1, 3).T, 0)
    level = np.quantile(cosines @ weights / np.pi, 0.9)
    assert metered(Probe.from_array(light)) == pytest.approx(np.log2(0.8 / level), abs=0.1)


def test_quantiles_by_weight():
    values, weights = np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 8.0])
    fractions = (0.05, 0.5, 0.89, 0.95, 1)
    assert weighted_quantiles(values, weights, fractions) == [1, 2, 2, 3, 3]


@pytest.mark.parametrize("size", [16, 64, 200])
def test_cells_and_labels_are_in_their_places(size):
    grid = Grid(2, 3, size)
    rng = np.random.default_rng(1)
    tiles = {
        (r, c): rng.uniform(0, 2, (size, size, 3)).astype(np.float32)
        for r in range(2) for c in range(3) if (r, c) != (1, 1)
    }  # fmt: skip
    content = [(*place, tile) for place, tile in tiles.items()]
    heads, sides = ["ab", "c", "d"], ["mm", "n"]
    sheet = draw_grid(grid, heads, sides, [*content, (1, 1, "it is no probe")])
    assert sheet.shape == (*grid.shape, 3)
    for (row, column), tile in tiles.items():
        top, left = grid.origin(row, column)
        np.testing.assert_array_equal(sheet[top : top + size, left : left + size], tile)
        assert top + size + grid.gap <= grid.shape[0]
        assert left + size + grid.gap <= grid.shape[1]
    top, left = grid.origin(1, 1)
    failed = sheet[top : top + size, left : left + size]
    assert failed.min() == pytest.approx(0.05)
    assert size < 64 or failed.max() > 0.3
    for column in range(3):  # a label is above the middle of its column, and not wider
        _, left = grid.origin(0, column)
        strip = sheet[: grid.label, left : left + size, 0]
        inked = np.argwhere(strip > PAPER + 0.3)
        assert abs(inked[:, 1].mean() - size / 2) < max(size / 10, 5)
    for row in range(2):
        top, _ = grid.origin(row, 0)
        assert sheet[top : top + size, : grid.label].max() > 0.9
    assert sheet[: grid.label, : grid.label].max() == np.float32(PAPER)


def test_names_beside_rows_are_read_from_below():
    """A text turned to the left: what is at its left stands below."""
    grid = Grid(1, 1, 200)
    tile = np.zeros((200, 200, 3), dtype=np.float32)
    sheet = draw_grid(grid, ["i........"], ["i........"], [(0, 0, tile)])
    _, left = grid.origin(0, 0)
    head = sheet[: grid.label, left : left + 200, 0]
    side = sheet[grid.origin(0, 0)[0] :, : grid.label, 0][:200]
    np.testing.assert_array_equal(side[::-1].T, head)


def test_sheets_that_are_too_large_are_refused():
    with pytest.raises(OutputError, match="fewer probes or materials"):
        Grid(100, 100, 256).check()


def test_a_page_holds_its_pictures_as_halves_and_nothing_else():
    tile = np.linspace(-1, 1e6, 4 * 4 * 3).reshape(4, 4, 3).astype(np.float32)
    hostile = "</script><b>&\"'"
    column = Column(f"x/{hostile}.exr", ("bad", "bad"), None, -1.5)
    text = lookdev_page([column], [hostile], ["one", hostile], [[tile, hostile]], 4)
    assert "</script><b>" not in text
    assert "://" not in text
    data = re.search(r'<script type="text/plain">(.*?)</script>', text)[1]
    found = np.frombuffer(base64.b64decode(data), "<f2").reshape(4, 4, 3)
    np.testing.assert_array_equal(found, np.clip(tile, -65504, 65504).astype(np.float16))
    assert 'data-own="-1.5"' in text
    assert text.count("<canvas") == 1
    assert text.count('class="failed"') == 1
