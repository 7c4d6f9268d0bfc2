"""A page on this machine alone, for maps that are too large for a file.

The server answers on the loopback address, on a port that was free, and sends the page and its
blocks to whoever asks it by that address. Other users of the machine reach the port too, so all
paths begin with a word that nobody can guess. Names that other sites lead here are refused, so that
they cannot read the maps through a browser.
"""

import secrets
import sys
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from shrm_cli.view.page import page
from shrm_cli.view.scene import Scene

_ADDRESS = "127.0.0.1"
_TOKEN_BYTES = 24
"""Bytes of chance in the address."""


class PageServer(ThreadingHTTPServer):
    """Serves one page.

    `url` is where the page is; whoever knows it may read the maps.
    """

    daemon_threads = True

    def __init__(self, scene: Scene) -> None:
        self._start = f"/{secrets.token_urlsafe(_TOKEN_BYTES)}/"
        files = _files(scene, self._start)
        super().__init__((_ADDRESS, 0), _handler(files, lambda: self.server_address[1]))

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print what failed, but nothing where a browser left, as it does to load a page anew."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)

    @property
    def url(self) -> str:
        return f"http://{_ADDRESS}:{self.server_address[1]}{self._start}"


def _files(scene: Scene, start: str) -> dict[str, tuple[str, bytes]]:
    """Return the types and the bytes of everything that is sent, by path."""
    urls = [f"{start}{k}.bin" for k in range(len(scene.blocks.parts))]
    files = {start: ("text/html; charset=utf-8", page(scene, urls).encode("utf-8"))}
    for url, part in zip(urls, scene.blocks.parts, strict=True):
        files[url] = ("application/octet-stream", part)
    return files


def _handler(
    files: dict[str, tuple[str, bytes]], port: Callable[[], int]
) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        """Answers GET and HEAD for known paths."""

        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            self._answer(with_body=True)

        def do_HEAD(self) -> None:
            self._answer(with_body=False)

        def _answer(self, with_body: bool) -> None:
            own = {f"{name}:{port()}" for name in (_ADDRESS, "localhost")}
            found = files.get(self.path) if self.headers.get("Host") in own else None
            kind, body = found or ("text/plain", b"not found\n")
            self.send_response(200 if found else 404)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Cross-Origin-Resource-Policy", "same-origin")
            self.send_header("Referrer-Policy", "no-referrer")  # the address lets one in
            self.end_headers()
            if with_body:
                self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing of each request."""

    return Handler
