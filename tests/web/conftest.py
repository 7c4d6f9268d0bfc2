"""A browser for the tests of this folder, and a loopback server of what they write."""

import pytest

from tests.web.browser import absent, launched, served


@pytest.fixture(scope="session")
def browser():
    """Chromium, or a skip that says what is missing."""
    why = absent()
    if why is not None:
        pytest.skip(why)
    with launched() as found:
        yield found


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    """A folder, and the address that serves it."""
    folder = tmp_path_factory.mktemp("site")
    with served(folder) as address:
        yield folder, address


@pytest.fixture
def needs(browser):
    """Skip where npm packages are missing: ``needs("three", "esbuild")``."""

    def check(*packages):
        why = absent(*packages)
        if why is not None:
            pytest.skip(why)

    return check
