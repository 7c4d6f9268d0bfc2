"""Grids of probes in three.js itself, by the code of docs/grid.md."""

import json
import re

import numpy as np

from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.rooms.export import as_json
from shrm_cli.rooms.grid import Lattice, ProbeGrid
from tests.cli.helpers import ROOT
from tests.oracles import real_harmonics
from tests.web import ball, proofs
from tests.web.browser import Page

PIXELS = 128


def test_three_shades_by_a_grid(browser, site):
    """A white ball in the middle, beside irradiance between the probes as three.js filters it."""
    folder, address = site
    proofs.prepare(folder, "three_grid")
    rng = np.random.default_rng(6)
    lattice = Lattice(np.array([-3.0, -2, -2.5]), np.array([3.0, 2, 2.5]), (4, 5, 3))
    light = 0.1 * rng.standard_normal((lattice.count, 9, 3))
    light[:, 0] = rng.uniform(1, 4, (lattice.count, 3))
    alive = np.ones(lattice.count, bool)
    grid = ProbeGrid(lattice, light, 0 * light, None, alive)
    code = re.search(r"```js\n(.*?)```", (ROOT / "docs" / "grid.md").read_text(), re.S)[1]
    code = re.sub(r"^import .*\n", "", code, flags=re.M).replace("export function", "function")
    page = Page(browser, address, "three_grid.bundle.js")
    held = json.loads(as_json(grid, direct=True))
    shown = ball.decoded(page.call("shade", PIXELS, proofs.VIEW, code, held), PIXELS)
    errors = page.errors
    page.close()
    assert not errors
    normals, used, _ = proofs.shown(PIXELS)
    of = normals[used]
    # three.js looks half a cell along the normal.
    probes, shares = lattice.corners(of + of * lattice.spacing / 2)
    factors = np.repeat(lambert_factors(2), [1, 3, 5])
    harmonics = real_harmonics(2, of) * factors
    expected = np.einsum("nk,nkjc,nj->nc", shares, light[probes], harmonics) / np.pi
    assert proofs.relative(shown[used], expected) < 0.01
    mirrored = light[probes] * np.where(np.arange(9) == 1, -1, 1)[:, None]
    turned = np.einsum("nk,nkjc,nj->nc", shares, mirrored, harmonics) / np.pi
    assert proofs.relative(shown[used], turned) > 0.02
