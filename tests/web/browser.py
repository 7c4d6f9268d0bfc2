"""A headless Chromium, npm packages bundled for it, and a loopback server of their pages.

Nothing of this is needed by `shrm` or by its other tests. `tests.web.install` brings it here.

SHRM_CHROMIUM names the browser where it is not on the path.
"""

import contextlib
import functools
import http.server
import os
import shutil
import subprocess
import threading
from pathlib import Path

HERE = Path(__file__).parent
MODULES = HERE / "node_modules"
"""The folder with the npm packages of package-lock.json."""
NAMES = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--enable-unsafe-swiftshader", "--no-sandbox", "--ignore-gpu-blocklist",
    "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan",
    # Nothing is asked of a network.
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-quic", "--disable-sync",
)  # fmt: skip


def chromium():
    """The path of the browser; None where there is none."""
    named = os.environ.get("SHRM_CHROMIUM")
    return named or next(filter(None, map(shutil.which, NAMES)), None)


def complete():
    """Whether the npm packages are those of package-lock.json, all of them."""
    stamp, lock = MODULES / ".complete.json", HERE / "package-lock.json"
    return stamp.is_file() and stamp.read_bytes() == lock.read_bytes()


def absent():
    """What is missing for pages with engines; None where nothing is."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "playwright is not installed; `make web` or `make engines` installs it"
    if chromium() is None:
        return "there is no Chromium on the path; `make web` or `make engines` installs it"
    if not complete():
        return f"{MODULES} is not that of package-lock.json; `make web` or `make engines` makes it"
    return None


@contextlib.contextmanager
def launched():
    """Context manager that yields a browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=ARGUMENTS)
        try:
            yield browser
        finally:
            browser.close()


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def served(folder):
    """Context manager that serves a folder on loopback, and yields its address."""
    handler = functools.partial(_Quiet, directory=os.fspath(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def bundle(script, target, *flags):
    """Write a module with all that it imports as one classic script; flags are esbuild's."""
    esbuild = MODULES / "esbuild" / "bin" / "esbuild"
    command = [os.fspath(esbuild), os.fspath(script), "--bundle", "--format=iife",
               "--log-level=error", "--define:import.meta.url=document.baseURI",
               f"--outfile={target}", *flags]  # fmt: skip
    subprocess.run(command, check=True, env={**os.environ, "NODE_PATH": os.fspath(MODULES)})


class Page:
    """A page that runs a script, with its errors and requests.

    Attributes
    ----------
    errors : list of str
        What the console called an error, and exceptions that nobody caught.
    requests : list of str
        The addresses of all that was asked for.
    """

    def __init__(self, browser, address, script):
        self.errors, self.requests = [], []
        self._page = browser.new_page()
        self._page.on("pageerror", lambda error: self.errors.append(str(error)))
        self._page.on("console", self._heard)
        self._page.on("request", lambda request: self.requests.append(request.url))
        self._page.goto(f"{address}/{script}".rpartition("/")[0] + "/blank.html")
        self._page.add_script_tag(url=f"{address}/{script}")

    def _heard(self, message):
        if message.type == "error":
            self.errors.append(message.text)

    def call(self, name, *arguments):
        """What a global function of the script returns, or what its promise becomes."""
        return self._page.evaluate("([name, given]) => window[name](...given)", [name, arguments])

    def close(self):
        """Close the page."""
        self._page.close()
