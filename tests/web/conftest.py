"""A page in a real browser: headless Chromium, whose software renderer draws floats exactly.

`make web` sets SHRM_WEB and runs these tests; without it they are skipped, whatever is installed.
With it none may be: what is missing makes them fail.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.web.browser import absent, launched, served

HERE = Path(__file__).parent
PATIENCE = 120_000
"""Milliseconds that a page may take on a busy machine without a graphics device."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave all tests of this folder to `make web`."""
    if not os.environ.get("SHRM_WEB"):
        for item in items:
            if HERE in item.path.parents:
                item.add_marker(pytest.mark.skip(reason="make web"))


@dataclass
class Watched:
    """What a page said and asked for, besides the page itself."""

    page: Any
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Start Chromium once for each process of the tests."""
    why = absent()
    if why is not None:
        pytest.fail(why)
    with launched() as started:
        yield started


@pytest.fixture
def watched(browser: Any) -> Iterator[Watched]:
    """Open a page, and record errors and requests."""
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
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


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Yield a folder, and the loopback address that serves it."""
    folder = tmp_path_factory.mktemp("site")
    with served(folder) as address:
        yield folder, address
