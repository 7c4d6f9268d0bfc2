"""The site of `make site` in Chromium: nothing is loaded from elsewhere, equations are typeset."""

import pytest

from tests.cli.helpers import ROOT
from tests.web.browser import served

SITE = ROOT / "build" / "site"
PAGES = ("index.html", "formats.html", "conventions.html", "theory/parseval.html",
         "reference/python.html", "reference/commands/prefilter.html", "gallery.html")  # fmt: skip

pytestmark = pytest.mark.skipif(not (SITE / "index.html").exists(), reason="make site builds it")


@pytest.fixture(scope="module", params=[(1280, "light"), (390, "light"), (1280, "dark")])
def opened(request, browser):
    """Opens pages on screens of a width; keeps their requests and errors."""
    width, scheme = request.param
    with served(SITE) as address:
        context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)

        def open_page(name):
            page, heard = context.new_page(), []
            page.on("request", lambda asked: heard.append(asked.url))
            page.on("pageerror", lambda error: heard.append(f"error {error}"))
            page.goto(f"{address}/{name}")
            page.wait_for_load_state("networkidle")
            return page, [each for each in heard if not each.startswith((address, "data:"))]

        yield width, open_page
        context.close()


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_whole_and_fit_the_screen(opened, name):
    width, open_page = opened
    page, heard = open_page(name)
    assert heard == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    equations = page.locator(".arithmatex").count()
    assert page.locator(".arithmatex .katex").count() == equations
    assert (equations > 0) == name.startswith("theory")


def test_pages_from_a_disk_are_searched(browser):
    """A browser starts no worker for pages of files, so that they had no field to search in."""
    page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
    page.goto((SITE / "index.html").as_uri())
    page.locator(".md-search__input").click()
    page.keyboard.type("irradiance")
    page.locator(".md-search-result__item").first.wait_for()
    page.context.close()
