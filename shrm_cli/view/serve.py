"""A page on this machine alone, for maps that are too large for a file.

The server answers on the loopback address, on a port that was free, and sends the page and its
blocks to whoever asks it by that address. Names that other sites lead here are refused, so that
they cannot read the maps through a browser.
"""

from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from shrm_cli.view.page import page
from shrm_cli.view.scene import Scene

_ADDRESS = "127.0.0.1"


class PageServer(ThreadingHTTPServer):
    """Serves one page.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    url : str
        Where the page is.
    """

    daemon_threads = True

    def __init__(self, scene: Scene) -> None:
        super().__init__((_ADDRESS, 0), _handler(_files(scene), lambda: self.server_address[1]))

    @property
    def url(self) -> str:
        return f"http://{_ADDRESS}:{self.server_address[1]}/"


def _files(scene: Scene) -> dict[str, tuple[str, bytes]]:
    """Return the types and the bytes of everything that is sent, by path."""
    urls = [f"/{k}.bin" for k in range(len(scene.blocks.parts))]
    files = {"/": ("text/html; charset=utf-8", page(scene, urls).encode("utf-8"))}
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
            self.end_headers()
            if with_body:
                self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Say nothing of each request."""

    return Handler
