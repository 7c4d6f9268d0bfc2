"""`shrm report` and `shrm contact` in a browser: pages are whole, quiet, and fit a telephone."""

import numpy as np
import pytest

from shrm_cli.analysis.probe_statistics import probe_statistics
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.report.contact import contact_page, draw_contacts
from shrm_cli.report.measure import Plan, measure_maps
from shrm_cli.report.report import report_page

SPEC = "ggx:roughness=0.6"


@pytest.fixture(scope="module")
def probe():
    light = np.ones((16, 32, 3), dtype=np.float32) + np.arange(32)[None, :, None] / 8
    light[4, 9] = 200
    name = "</script><img src=x onerror=alert(1)>.exr"
    return Probe.from_array(light.astype(np.float32), name=name)


@pytest.fixture(scope="module")
def report(probe, tmp_path_factory):
    """The page of two forms of a material, as a file."""
    plan = Plan((SPEC,), ("principal", "splitsum"), {"size": 8}, ((10, 20), (90, 0)), 24, 16)
    text, _ = report_page(measure_maps(probe, plan), probe_statistics(probe))
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def contact(probe, tmp_path_factory):
    """The page of a dozen maps, which is wider than a telephone."""
    folder = tmp_path_factory.mktemp("contact")
    for exponent in range(2, 14):
        made = prefilter(probe, f"phong:exponent={exponent}")
        made.save(folder / f"{exponent}.exr")
    files = [str(path) for path in sorted(folder.glob("*.exr"))]
    path = folder / "index.html"
    path.write_text(contact_page(draw_contacts(files), str(path)), encoding="utf-8")
    return path


def opened(watched, path, width, scheme="light"):
    page = watched.page
    page.emulate_media(color_scheme=scheme)
    page.set_viewport_size({"width": width, "height": 800})
    page.goto(path.as_uri())
    return page


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ["report", "contact"])
def test_pages_are_quiet_and_as_wide_as_the_screen(watched, request, name, width):
    path = request.getfixturevalue(name)
    page = opened(watched, path, width)
    pictures = "Array.from(document.images, each => each.complete && each.naturalWidth > 0)"
    page.wait_for_function(f"{pictures}.every(Boolean)")
    assert len(page.evaluate(pictures)) >= 10
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert watched.errors == []
    outside = [url for url in watched.requests if not url.startswith(("data:", "about:", "blob:"))]
    assert outside == [path.as_uri()]
    assert "<img src=x onerror=alert(1)>.exr" in page.inner_text("main")


def test_the_view_in_the_page_draws(watched, report):
    page = opened(watched, report, 1280)
    frame = page.locator("iframe")
    frame.scroll_into_view_if_needed()
    inner = frame.element_handle().content_frame()
    inner.wait_for_selector(".shrm-view[data-state=ready]")
    code = """async () => {
        const view = await window.shrm.views[0];
        return Array.from(view.read(16, 0, true));
    }"""
    colors = np.array(inner.evaluate(code), dtype=float).reshape(16, 16, -1)
    assert colors[8, 8, :3].min() > 0
    assert watched.errors == []


def test_light_and_dark(watched, report):
    papers = []
    for scheme in ("light", "dark"):
        page = opened(watched, report, 1280, scheme)
        color = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
        papers.append([int(each) for each in color[4:-1].split(",")])
    assert min(papers[0]) > 200
    assert max(papers[1]) < 60


def test_printed_pages_leave_the_view_out(watched, report):
    page = opened(watched, report, 1280)
    page.emulate_media(media="print")
    assert not page.locator("iframe").is_visible()
    assert page.locator("figure").first.is_visible()
