"""PlayCanvas, CesiumJS and <model-viewer> themselves, with what is exported for them."""

import pytest

from tests.web import others, proofs

ROUGHNESSES = (0.0, 0.2, 0.5, 1.0)


@pytest.fixture(scope="module")
def probe():
    return proofs.made_probe()


def rows_of(browser, site, name, probe, size):
    """Rows by what they show, of a page that complains of nothing and asks nobody else."""
    folder, address = site
    opened = others.Opened(browser, folder, address, name, probe, size, 192)
    rows = {row.what: row for row in others.rows(opened, probe, ROUGHNESSES)}
    opened.page.close()
    assert not opened.page.errors
    assert all(url.startswith((address, "data:", "blob:")) for url in opened.page.requests)
    return rows


@pytest.mark.parametrize("name", ["playcanvas", "cesium"])
def test_engines_that_filter_nothing(browser, site, name, probe):
    """Roughness .5 lies between two levels, and nine coefficients are not all of the light."""
    rows = rows_of(browser, site, name, probe, 256)
    for row in rows.values():
        assert row.rms < 0.03, row
        assert row.turned > 10, row
    for what in ("0", "0.2"):
        assert rows[what].rms < 0.004, rows[what]


def test_model_viewer(browser, site, probe):
    """It filters itself, roughness .5 as if it were less, and less so the more rows there are."""
    coarse, fine = (rows_of(browser, site, "model-viewer", probe, size) for size in (64, 512))
    bounds = {"0": 0.03, "0.2": 0.05, "0.5": 0.25, "1": 0.07, "diffuse": 0.07}
    for what, bound in bounds.items():
        assert fine[what].rms < bound, fine[what]
        assert fine[what].turned > 2.5, fine[what]
    assert fine["0"].turned > 30
    assert fine["0.5"].rms < 0.7 * coarse["0.5"].rms
