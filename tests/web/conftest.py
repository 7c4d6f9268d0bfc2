"""A page in a real browser: headless Chromium, whose software renderer draws floats exactly."""

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

ARGUMENTS = ["--enable-unsafe-swiftshader", "--no-sandbox", "--ignore-gpu-blocklist"]
NAMES = ("chromium", "chromium-browser", "google-chrome")


@dataclass
class Watched:
    """What a page said and asked for, besides the page itself."""

    page: Any
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Start Chromium once for each process of the tests; skip where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="pip install 'shrm[web-test]'")
    path = os.environ.get("SHRM_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium; install one, or name it in SHRM_CHROMIUM")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield started
        started.close()


@pytest.fixture
def watched(browser: Any) -> Iterator[Watched]:
    """Open a page, and record errors and requests."""
    page = browser.new_page()
    found = Watched(page)
    page.on("console", lambda m: found.errors.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: found.errors.append(str(error)))
    page.on("request", lambda request: found.requests.append(request.url))
    yield found
    page.close()


@pytest.fixture
def page(watched: Watched) -> Any:
    """Return the page alone; its records are those of `watched`."""
    return watched.page
