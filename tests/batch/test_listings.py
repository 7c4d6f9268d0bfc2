"""What servers and stores list leads nowhere, and what addresses hide is told to nobody."""

import contextlib
import http.server
import json
import threading
from importlib import import_module
from importlib.util import find_spec

import pytest

from shrm_cli.batch.entry import Entry, found_probes
from shrm_cli.errors import ProbeError
from shrm_cli.naming import probe_stem, unsound
from tests.batch.helpers import write_probes
from tests.cli.helpers import run

fsspec = pytest.importorskip("fsspec", reason="its files are elsewhere")
pytestmark = pytest.mark.skipif(find_spec("aiohttp") is None, reason="aiohttp is not installed")

SECRET = "hUnTeR2"


@contextlib.contextmanager
def served(answer):
    """Context manager that yields the address of a web server, which answers as a function says."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            body = answer(self.path)
            self.send_response(404 if body is None else 200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body or b"")))
            self.end_headers()
            if self.command == "GET":
                self.wfile.write(body or b"")

        do_HEAD = do_GET

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def listing(*names):
    page = "".join(f'<a href="{name}">x</a>' for name in names).encode()
    return lambda path: page if path.rstrip("/").endswith("/p") else b"EXR"


@pytest.mark.parametrize(
    "evil",
    [
        "a/../../../ESCAPED/evil.exr", "a/%2e%2e/%2E./%2e%2e/evil.exr", "a%2f..%2f..%2fevil.exr",
        "a%252f%252e%252e%252fevil.exr", "a\\..\\..\\evil.exr", "a%5c..%5cevil.exr",
        "C:/evil.exr", "a%00b.exr", "a/b%0d%0a.exr",
    ],
)  # fmt: skip
def test_a_listing_leads_nowhere(tmp_path, monkeypatch, evil):
    """Neither into other folders, nor over files there."""
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    with served(listing("sound.exr", evil)) as place:
        done = run(
            "batch", f"http://{place}/p/**", "--to", "irradiance", "-o", "out/{folder}/{probe}.exr"
        )  # fmt: skip
    assert done.code == 1
    assert done.err.count("\n") == 1
    assert "the listing has" in done.err
    assert [path.name for path in tmp_path.rglob("*")] == ["work"]


def test_a_sound_listing_is_taken(tmp_path):
    with served(listing("a.exr", "b..c.exr", "my%20probe.exr")) as place:
        found = found_probes([f"http://{place}/p/*.exr"])
    assert [(name.rpartition("/")[2], folder) for name, folder in found] == [
        ("a.exr", ""), ("b..c.exr", ""), ("my%20probe.exr", ""),
    ]  # fmt: skip


def test_keys_of_a_store_lead_nowhere(tmp_path):
    system = fsspec.filesystem("memory")
    root = f"/{tmp_path.name}"
    system.store[f"{root}/day/../../evil.exr"] = type(system).open(system, "/x", "wb")
    try:
        with pytest.raises(ProbeError, match=r"the listing has .* leads out of its folder"):
            found_probes([f"memory:/{root}/**/*.exr"])
    finally:
        system.store.clear()


@pytest.mark.parametrize("field", ["folder", "probe", "brdf"])
def test_no_field_of_a_name_leads_out(tmp_path, monkeypatch, field):
    """Whatever it comes from: here names of this disk, and a pattern that goes back itself."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path / "a" / "b", 1)
    (tmp_path / "a" / "b" / "p0.exr").rename(tmp_path / "a" / "b" / "C:x.exr")
    patterns = {"folder": "a/*/../b/*.exr", "probe": "a/b/*.exr", "brdf": "a/b/*.exr"}
    if field == "brdf":
        monkeypatch.setattr(import_module("shrm_cli.batch.entry"), "brdf_label", lambda _: "..")
    entry = Entry((patterns[field],), ("phong",), output="out/{%s}/x.exr" % field)  # noqa: UP031
    with pytest.raises(ProbeError, match=rf"{{{field}}} would be .* which may lead out"):
        entry.jobs()


def test_parts_of_names_are_judged():
    for part in ("", "a", "a/b", "a..b", "...", "100%", "a%20b", "é/日本", "12:30", "%", "a b"):
        assert unsound(part) == "", part
    for part in ("..", "a/..", "../a", " .. ", ".", "/a", "C:", "c:a", "\\\\host\\x", "a\0", "a\n",
                 "a\x9b", "%2e%2E", "%252e%252e", "a%2f..", "%2Fa", "a%5Cb", "%00"):  # fmt: skip
        assert unsound(part) != "", part


def test_names_of_files_hold_no_signature():
    assert probe_stem(f"https://u:{SECRET}@h/d/sky.exr?X-Amz-Signature=a/{SECRET}.x") == "sky"
    assert probe_stem(f"https://u:{SECRET}@h") == "h"
    assert probe_stem("https:/h/sky.exr?sig=1.2/3") == "sky"


def test_files_of_a_queue_that_let_in_are_warned_of(tmp_path, monkeypatch):
    """The machines need the whole address, wherever it stands in the command."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path, 1)
    log = f"--log=memory://me:{SECRET}@h/log"
    done = run("batch", "p0.exr", "--to", "irradiance", log, "--commands", "c.txt")
    assert done.code == 0
    assert done.err.startswith("Warning: a URL holds a password")
    assert SECRET not in done.out + done.err
    assert SECRET in (tmp_path / "c.txt").read_text()


@pytest.fixture
def signed(tmp_path, monkeypatch):
    """The addresses of a probe, of none and of a damaged one, with a login and a signature."""
    monkeypatch.chdir(tmp_path)
    probe = (tmp_path / write_probes(tmp_path / "src", 1)[0]).read_bytes()

    def answer(path):
        name = path.partition("?")[0]
        return {"/d/sky.exr": probe, "/d/bad.exr": b"no image"}.get(name)

    with served(answer) as place:
        yield {
            name: f"http://me:{SECRET}@{place}/d/{name}.exr?X-Amz-Signature={SECRET}&sig={SECRET}"
            for name in ("sky", "bad", "none")
        }


@pytest.mark.proof
def test_no_secret_of_an_address_is_told_or_kept(signed, tmp_path):
    """In no output of a command, and in no file that it writes."""
    told = []
    urls = [signed["sky"], signed["bad"]]
    for words in (
        ["batch", *urls, "--to", "irradiance", "--jobs", "1", "--dry-run"],
        ["batch", *urls, "--to", "irradiance", "--jobs", "1", "--dry-run", "--json"],
        ["batch", *urls, "--to", "irradiance", "--jobs", "1", "--collect", "light.npz",
         "--contact", "c.html"],
        ["batch", signed["none"], "--to", "irradiance"],
        ["batch", f"{urls[0]}*", "--to", "irradiance"],
        ["batch", f"nowhere://me:{SECRET}@h/*.exr", "--to", "irradiance"],
        ["batch", urls[0], "--to", "irradiance", "--jobs", "1", "-o",
         f"nowhere://me:{SECRET}@h/a.exr"],
        ["batch", urls[0], "--to", "irradiance", "-o", f"nowhere://me:{SECRET}@h/a.png"],
        ["batch", "src/*.exr", "--to", "irradiance", "--scheduler", f"tls://me:{SECRET}@h:1"],
        ["prefilter", urls[0], "--brdf", "phong"],
        ["prefilter", "src/p0.exr", "--brdf", urls[0]],
        ["batch", "src/p0.exr", "--brdf", urls[0], "--jobs", "1"],
        ["report", "src/p0.exr", "--brdf", urls[0], "-o", "brdf.html"],
        ["prefilter", "src/p0.exr", "--brdf", "phong", "-o", urls[0]],
        ["info", urls[0]],
        ["compare", urls[0], "--probe", urls[1]],
        ["view", urls[0], "-o", urls[1]],
        ["export", urls[0], "--for", "bevy"],
        ["report", urls[0], "--brdf", "phong", "-o", "r.html"],
        ["info", "--nonsense", urls[0]],
    ):  # fmt: skip
        if "--scheduler" in words:
            pytest.importorskip("distributed")
        done = run(*words)
        told.append((words[0], done.code, done.out, done.err))
        assert SECRET not in done.out + done.err, words
        assert done.out + done.err
    assert [code for _, code, _, _ in told if code == 0] == []
    made = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {"sky.irradiance.exr", "light.npz", "batch.jsonl", "c.html"} <= {p.name for p in made}
    for path in made:
        assert SECRET.encode() not in path.read_bytes(), path
        assert SECRET not in path.name
    log = [json.loads(line) for line in (tmp_path / "batch.jsonl").read_text().splitlines()]
    probes = [line["probe"] for line in log if line.get("status") == "made"]
    assert probes
    assert all(name.endswith("/d/sky.exr?...") for name in probes)
