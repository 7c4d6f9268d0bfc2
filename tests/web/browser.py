"""A headless Chromium, npm packages bundled for it, and a loopback server of their pages.

None of these is needed by `shrm` or by its other tests. `absent` says what is missing.

SHRM_CHROMIUM names the browser where it is not on the path, SHRM_NODE_MODULES the folder with the
npm packages, by default ``tests/web/node_modules``.
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
NAMES = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = ("--enable-unsafe-swiftshader", "--no-sandbox", "--ignore-gpu-blocklist")


def node_modules():
    """The folder with the npm packages."""
    return Path(os.environ.get("SHRM_NODE_MODULES", HERE / "node_modules"))


def chromium():
    """The path of the browser; None where there is none."""
    named = os.environ.get("SHRM_CHROMIUM")
    return named or next(filter(None, map(shutil.which, NAMES)), None)


def absent(*packages):
    """What is missing for pages that need some npm packages; None where nothing is."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "playwright is not installed (pip install 'shrm[web-test]')"
    if chromium() is None:
        return "no Chromium on the path; SHRM_CHROMIUM may name one"
    missing = [name for name in packages if not (node_modules() / name).is_dir()]
    if missing:
        return f"npm packages {', '.join(missing)} are not in {node_modules()} (SHRM_NODE_MODULES)"
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
    modules = node_modules()
    esbuild = modules / "esbuild" / "bin" / "esbuild"
    command = [os.fspath(esbuild), os.fspath(script), "--bundle", "--format=iife",
               "--log-level=error", f"--outfile={target}", *flags]  # fmt: skip
    subprocess.run(command, check=True, env={**os.environ, "NODE_PATH": os.fspath(modules)})


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
