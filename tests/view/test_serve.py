"""The server of `shrm view`: what it prints when a browser leaves in the middle of an answer."""

import socket
import struct
import threading
from urllib.parse import urlsplit

import pytest

from shrm_cli.view import serve
from shrm_cli.view.scene import make_scene
from tests.maps.shader import cases


@pytest.fixture
def answered(monkeypatch):
    """Ask a server for a large page and leave; it has dealt with that when this returns."""
    monkeypatch.setattr(serve, "page", lambda scene, urls: "x" * 2**25)

    def ask():
        with serve.PageServer(make_scene([cases.FORMS["shrm"]()], ["a.exr"])) as server:
            server.daemon_threads = False  # so that closing it waits
            thread = threading.Thread(target=server.serve_forever)
            thread.start()
            url = urlsplit(server.url)
            with socket.create_connection((url.hostname, url.port)) as client:
                client.sendall(f"GET {url.path} HTTP/1.1\r\nHost: {url.netloc}\r\n\r\n".encode())
                assert client.recv(400)
                # Closing resets the connection.
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            server.shutdown()
            thread.join()

    return ask


def test_browsers_that_leave_are_not_spoken_of(answered, capfd):
    answered()
    assert capfd.readouterr().err == ""


def test_other_failures_are(answered, capfd, monkeypatch):
    def fail(self, *args):
        raise ValueError("no header")

    monkeypatch.setattr(serve.BaseHTTPRequestHandler, "end_headers", fail)
    with pytest.raises(AssertionError):
        answered()
    assert "ValueError: no header" in capfd.readouterr().err
