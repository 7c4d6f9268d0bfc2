"""Files behind URLs: in memory, on disk, on a web server, and in a store that speaks S3."""

import functools
import http.server
import importlib
import socket
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from shrm_cli import messages
from shrm_cli.errors import RemoteError
from shrm_cli.files import remote

fsspec = pytest.importorskip("fsspec")


@pytest.fixture(autouse=True)
def _copies(tmp_path, monkeypatch):
    """Copies lie where a test sees them."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@pytest.fixture
def memory():
    """Return fsspec's file system in memory, empty."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    system.pseudo_dirs[:] = [""]
    yield system
    system.store.clear()


def fetched_bytes(url):
    with remote.fetched(url) as path:
        return path.name, path.read_bytes()


def test_urls_are_told_from_paths():
    for url in ("s3://b/a.exr", "memory://a", "https://h/a.exr", "file:///a", "GS://b/c"):
        assert messages.is_remote(url), url
    for path in ("a.exr", "/a//b.exr", "C:\\a.exr", "C://a.exr", "sky_%.exr", "://a", "a b://c"):
        assert not messages.is_remote(path), path
    assert not messages.is_remote(Path("probes/a.exr"))


def test_a_pattern_gives_the_files_that_match_in_order(memory):
    for name in ("p/b.exr", "p/a.exr", "p/c.hdr", "p/deep/d.exr", "q/e.exr"):
        memory.pipe_file(f"/{name}", b"x")
    memory.makedirs("/p/folder.exr")
    assert remote.matching("memory://p/*.exr") == ["memory://p/a.exr", "memory://p/b.exr"]
    assert remote.matching("memory://p/**/*.exr") == [
        "memory://p/a.exr", "memory://p/b.exr", "memory://p/deep/d.exr",
    ]  # fmt: skip
    assert remote.matching("memory://p/c.hdr") == ["memory://p/c.hdr"]
    assert remote.matching("memory://p/none*.exr") == []
    assert remote.exists("memory://p/a.exr")
    assert not remote.exists("memory://p/z.exr")
    assert not remote.exists("memory://p/deep")


def test_a_copy_has_the_name_and_the_bytes_and_is_removed(memory, tmp_path):
    content = bytes(range(256)) * 40_000  # more than two blocks
    assert len(content) > 2 * remote._BLOCK
    memory.pipe_file("/p/my probe.exr", content)
    with remote.fetched("memory://p/my probe.exr") as path:
        assert path.name == "my probe.exr"
        assert path.is_relative_to(tmp_path)
        assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == []
    with (
        pytest.raises(KeyError, match="the caller's own"),
        remote.fetched("memory://p/my probe.exr"),
    ):
        raise KeyError("the caller's own")
    assert list(tmp_path.iterdir()) == []


def test_no_more_is_fetched_than_allowed(memory, tmp_path, monkeypatch):
    memory.pipe_file("/a.exr", bytes(1000))
    monkeypatch.setattr(remote, "_MOST_BYTES", 1000)
    with remote.fetched("memory://a.exr"):
        pass
    monkeypatch.setattr(remote, "_MOST_BYTES", 999)
    with (
        pytest.raises(RemoteError, match=r"memory://a\.exr: has 1,000 bytes.*above 999"),
        remote.fetched("memory://a.exr"),
    ):
        pass
    lie = type(memory).info
    for stated, match in ((10, "above 999"), (None, "above 999"), (2000, "above 999")):
        monkeypatch.setattr(
            type(memory), "info", lambda self, path, s=stated: {**lie(self, path), "size": s}
        )
        with (
            pytest.raises(RemoteError, match=match),
            remote.fetched("memory://a.exr"),
        ):
            pass
    monkeypatch.setattr(remote, "_MOST_BYTES", 2000)
    with (
        pytest.raises(RemoteError, match="ended after 1,000 of 2,000 bytes"),
        remote.fetched("memory://a.exr"),
    ):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_is_published_is_read_back(memory, tmp_path):
    (tmp_path / "a.exr").write_bytes(b"new" * 1000)
    for url in ("memory://out/deep/a.exr", f"file://{tmp_path}/out/deep/b.exr"):
        remote.publish(tmp_path / "a.exr", url)
        remote.publish(tmp_path / "a.exr", url)  # over the first
        assert fetched_bytes(url) == (url.rsplit("/")[-1], b"new" * 1000)
    assert [path.name for path in (tmp_path / "out" / "deep").iterdir()] == ["b.exr"]


def test_a_failed_upload_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    target = tmp_path / "out" / "a.exr"
    target.parent.mkdir()
    target.write_bytes(b"old")
    (tmp_path / "new.exr").write_bytes(b"new")
    system = fsspec.filesystem("file")

    def put_half(self, local, path, **_):
        Path(path).write_bytes(b"ne")
        raise OSError("the line is cut")

    monkeypatch.setattr(type(system), "put_file", put_half)
    with pytest.raises(RemoteError, match=r"a\.exr: the line is cut; check"):
        remote.publish(tmp_path / "new.exr", f"file://{target}")
    assert [path.name for path in target.parent.iterdir()] == ["a.exr"]
    assert target.read_bytes() == b"old"


def test_servers_that_never_replace_by_renaming_are_served(tmp_path, monkeypatch):
    system = fsspec.filesystem("file")

    def move(self, source, target, **_):
        if Path(target).exists():
            raise FileExistsError(target)
        Path(source).rename(target)

    monkeypatch.setattr(type(system), "mv", move)
    for content in (b"old", b"new"):
        (tmp_path / "made.exr").write_bytes(content)
        remote.publish(tmp_path / "made.exr", f"file://{tmp_path}/out/a.exr")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.exr"]
    assert (tmp_path / "out" / "a.exr").read_bytes() == b"new"


def test_errors_are_one_line_that_holds_no_password(memory, tmp_path, monkeypatch):
    def error(url):
        with pytest.raises(RemoteError) as caught, remote.fetched(url):
            pass
        text = str(caught.value)
        assert "\n" not in text
        return text

    assert error("memory://gone.exr").startswith("memory://gone.exr: there is no such file")
    assert "Protocol not known: nosuch" in error("nosuch://a.exr")
    assert "not a single URL" in error("zip://a.exr::memory://b.zip")

    def refuse(self, path, **_):
        raise ValueError(f"no\nentry to https://me:se@cret@host/a.exr?sig=secret for {path}")

    monkeypatch.setattr(type(memory), "info", refuse)
    said = error("memory://me:sec@ret@host/a.exr?sig=secret")
    assert "cret" not in said
    assert "ret@" not in said
    assert said.startswith("memory://***@host/a.exr?...: no entry to https://***@host/a.exr?...")


@pytest.mark.parametrize(
    ("missing", "advice"),
    [
        ("fsspec.core", r"s3://b/a\.exr: .*pip install fsspec"),
        ("s3fs", r"s3://b/a\.exr: s3:// needs a package .*Install s3fs.*; pip install s3fs"),
    ],
)
def test_missing_packages_are_named(missing, advice, monkeypatch):
    registry = importlib.import_module("fsspec.registry")
    monkeypatch.delitem(registry._registry, "s3", raising=False)
    monkeypatch.setitem(sys.modules, missing, None)  # makes its import fail
    with pytest.raises(RemoteError, match=advice):
        remote.exists("s3://b/a.exr")


class Quiet(http.server.SimpleHTTPRequestHandler):
    """A web server that asks for no password and prints nothing."""

    def log_message(self, *_):
        pass


def test_a_web_server_is_read(tmp_path):
    pytest.importorskip("aiohttp")
    (tmp_path / "www").mkdir()
    (tmp_path / "www" / "my probe.exr").write_bytes(b"light" * 1000)
    handler = functools.partial(Quiet, directory=tmp_path / "www")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        place = f"http://127.0.0.1:{server.server_port}"
        url = f"{place}/my%20probe.exr"
        assert fetched_bytes(f"{url}?sig=1") == ("my probe.exr", b"light" * 1000)
        assert remote.matching(f"{place}/*.exr") == [url]
        assert not remote.exists(f"{place}/none.exr")
        with pytest.raises(RemoteError, match="check the URL"):
            remote.publish(tmp_path / "www" / "my probe.exr", f"{place}/new.exr")
        server.shutdown()
    with pytest.raises(RemoteError, match="or its place cannot be reached"):
        fetched_bytes(url)
    with pytest.raises(RemoteError, match=r"check the URL and the network$"):
        remote.matching(f"{place}/*.exr")  # of a server that is away, no login is to blame


@pytest.mark.parametrize("what", ["a.exr", "*.exr"])
def test_a_web_server_that_says_nothing_is_given_up(tmp_path, monkeypatch, what):
    """It was waited for without a word, for five minutes."""
    pytest.importorskip("aiohttp")
    monkeypatch.setattr(remote, "_PATIENCE", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}/{what}"
        with pytest.raises(RemoteError, match=r"[Tt]imeout|cannot be reached"):
            remote.matching(url) if "*" in url else fetched_bytes(url)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the packages of the store and of its server
def test_a_store_that_speaks_s3(tmp_path, monkeypatch):
    """The extra `dev` leaves these packages out, whose installation takes longer than the tests:
    ``pip install s3fs 'moto[s3]' flask flask-cors``.
    """
    s3fs = pytest.importorskip("s3fs")
    server_module = pytest.importorskip("moto.server")
    server = server_module.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    try:
        s3fs.S3FileSystem().mkdir("bucket")
        content = bytes(range(256)) * 40_000
        (tmp_path / "a.exr").write_bytes(content)
        remote.publish(tmp_path / "a.exr", "s3://bucket/probes/a.exr")
        remote.publish(tmp_path / "a.exr", "s3://bucket/probes/b c.exr")
        assert remote.matching("s3://bucket/probes/*.exr") == [
            "s3://bucket/probes/a.exr", "s3://bucket/probes/b c.exr",
        ]  # fmt: skip
        assert fetched_bytes("s3://bucket/probes/b c.exr") == ("b c.exr", content)
        assert remote.exists("s3://bucket/probes/a.exr")
        assert not remote.exists("s3://bucket/probes/z.exr")
        with pytest.raises(RemoteError, match=r"^s3://nobucket/a\.exr: "):
            remote.publish(tmp_path / "a.exr", "s3://nobucket/a.exr")
        with pytest.raises(RemoteError, match=r"^s3://nobucket/a\.exr: there is no such file"):
            fetched_bytes("s3://nobucket/a.exr")
        assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
    finally:
        server.stop()
        s3fs.S3FileSystem.clear_instance_cache()
