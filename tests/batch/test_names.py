"""Which files patterns take for probes, which files outputs replace, and where they may lie."""

import functools
import http.server
import json
import threading
from importlib import import_module
from pathlib import Path

import pytest

from shrm_cli.batch.entry import Entry, found_probes
from shrm_cli.errors import ProbeError
from shrm_cli.files.exr_header import is_output
from tests.batch.helpers import work_here, write_probes
from tests.cli.helpers import MESH, done, noise, run, snapshot, write_exr

IRRADIANCE = ("--to", "irradiance", "--jobs", "1")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with two probes."""
    monkeypatch.chdir(tmp_path)
    work_here(monkeypatch)
    write_probes(tmp_path, 2)
    return tmp_path


OUTPUTS = {
    "map.exr": ("prefilter", "p0.exr", "--brdf", "phong"),
    "product.exr": ("product", "phong", "--size", "8"),
    "table.exr": ("dfg", "--size", "16"),
    "picture.exr": ("reference", "p0.exr", "--brdf", "phong", "--size", "16"),
    "brdf.exr": ("brdf", "phong", "--save"),
}
PROBES = {
    "sky.exr": ("probe", "sky", "--size", "16"),
    "other.exr": ("convert", "p0.exr", "--to", "openexr"),
}


def test_outputs_are_told_from_probes(folder):
    for name, command in (OUTPUTS | PROBES).items():
        assert run(*command, *([name] if "--save" in command else ["-o", name])).code == 0, name
        assert is_output(name) == (name in OUTPUTS), name
    (folder / "mesh.obj").write_text(MESH)
    (folder / "empty.exr").touch()
    cut = folder / "cut.exr"
    cut.write_bytes((folder / "map.exr").read_bytes()[:30])
    for name in ("p0.exr", "mesh.obj", "empty.exr", "cut.exr", "none.exr"):
        assert not is_output(name), name


def test_a_second_run_in_the_folder_of_the_probes_makes_nothing(folder):
    first = run("batch", "*.exr", *IRRADIANCE, "--brdf", "phong", "--to", "shrm")
    assert (first.code, first.err) == (0, "")
    again = run("batch", "*.exr", *IRRADIANCE, "--brdf", "phong", "--to", "shrm")
    assert again.code == 0
    assert "4 there already" in again.out
    assert again.err == (
        "4 files that shrm made, or that hold no light, such as p0.irradiance.exr: left out of "
        "the patterns\n"
    )
    named = run("batch", "p0.phong.shrm.exr", *IRRADIANCE)
    assert named.code == 1
    assert "p0.phong.shrm.exr: " in named.err


def test_files_of_farms_are_no_probes(folder):
    for flag, name in (("--commands", "jobs.txt"), ("--commands", "jobs"), ("--openjd", "j.yaml")):
        assert run("batch", "*.exr", *IRRADIANCE[:2], flag, name).code == 0
    (folder / "light.txt").write_text("1 1 1\n")
    left_out = []
    assert [Path(name).name for name, _ in found_probes(("*",), left_out)] == [
        "light.txt",
        "p0.exr",
        "p1.exr",
    ]
    assert left_out == ["j.yaml", "jobs", "jobs.txt"]


def test_patterns_that_match_outputs_alone_are_refused(folder):
    assert run("batch", "*.exr", *IRRADIANCE).code == 0
    with pytest.raises(ProbeError, match="matches no probe, only 2 files that shrm made"):
        found_probes(["*.irradiance.exr"])
    with pytest.raises(ProbeError, match="matches no probe, only 1 file that shrm made"):
        found_probes(["p0.irradiance.exr*"])


def test_a_file_of_the_users_own_is_kept(folder):
    write_exr(folder / "p0.irradiance.exr", noise())
    before = snapshot(folder)
    refused = run("batch", "p0.exr", *IRRADIANCE, "--log", "log")
    assert refused.code == 1
    assert (
        "Failed: p0.irradiance.exr: exists, and it is no map that can be read; give --force to "
        "replace it, or name another --output\n" in refused.err
    )
    assert snapshot(folder).items() >= before.items()
    assert run("batch", "p0.exr", *IRRADIANCE, "--dry-run").code == 1
    assert run("batch", "p0.exr", *IRRADIANCE, "--force").code == 0
    assert is_output("p0.irradiance.exr")


@pytest.mark.parametrize("more", [(), ("--force",), ("--dry-run",), ("--dry-run", "--force")])
def test_a_directory_in_the_place_of_an_output_is_told_as_one(folder, more):
    """No --force would replace it."""
    (folder / "p0.irradiance.exr").mkdir()
    refused = run("batch", "p0.exr", *IRRADIANCE, *more)
    assert refused.code == 1
    assert "Failed: p0.irradiance.exr: a directory; name a file to write\n" in refused.err


def test_what_begins_with_a_separator_keeps_it(folder):
    """Only a separator that an empty `{folder}` leaves at the front is cut off."""
    for name in ("_p0.exr", "-p0.exr", ".p0.exr"):
        (folder / "p0.exr").rename(folder / name)
        for output, made in (("{probe}.exr", name), ("{folder}/{probe}.{to}.exr", None)):
            entry = Entry((str(folder / name),), to=("irradiance",), output=output)
            named = made or name.replace(".exr", ".irradiance.exr")
            assert [job.output for job in entry.jobs()] == [named]
        (folder / name).rename(folder / "p0.exr")


@pytest.fixture
def server(tmp_path):
    """A web server with a page of links; a function sets the page."""
    probe = tmp_path / "light.exr"
    write_exr(probe, noise())

    class Handler(http.server.BaseHTTPRequestHandler):
        page = ""

        def do_GET(self):
            is_page = self.path.endswith("/")
            body = self.page.encode() if is_page else probe.read_bytes()
            self.send_response(200)
            self.send_header("Content-Type", "text/html" if is_page else "image/x-exr")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            if self.command == "GET":
                self.wfile.write(body)

        do_HEAD = do_GET

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as found:
        threading.Thread(target=functools.partial(found.serve_forever, 0.01), daemon=True).start()
        yield Handler, f"http://127.0.0.1:{found.server_port}"
        found.shutdown()


def test_a_listing_leads_to_no_folder_outside(server, tmp_path, monkeypatch):
    pytest.importorskip("fsspec")
    pytest.importorskip("aiohttp")
    handler, address = server
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    link = f"{address}/d/a/../../../ESCAPED/evil.exr"
    handler.page = f'<a href="{link}">x</a>'
    before = snapshot(tmp_path)
    found = run("batch", f"{address}/d/**", *IRRADIANCE, "-o", "out/{folder}/{probe}.exr")
    assert found.code == 1
    assert not (tmp_path / "ESCAPED").exists()
    assert not (folder / "ESCAPED").exists()
    assert {each for each in snapshot(tmp_path) if each not in before} <= {"here/batch.jsonl"}


@pytest.mark.parametrize(
    "name",
    [
        "a/../../b/evil.exr", "a/%2e%2e/%2E%2E/evil.exr", "a%2f..%2f..%2fb/evil.exr",
        "C:/evil/e.exr", "a\\..\\..\\b/evil.exr", "a/b\n/evil.exr",
    ],
)  # fmt: skip
def test_no_name_of_a_listing_leads_out_of_the_folder(monkeypatch, name):
    """Whatever kind of store it is of."""
    monkeypatch.setattr(
        import_module("shrm_cli.batch.entry"), "matching", lambda pattern: [f"s3://bucket/{name}"]
    )
    entry = Entry(("s3://bucket/**/*.exr",), to=("irradiance",), output="out/{folder}/{probe}.exr")
    with pytest.raises(ProbeError, match=r"the listing has .*; do not trust it"):
        entry.jobs()


def test_usual_names_of_listings_are_taken(monkeypatch):
    monkeypatch.setattr(
        import_module("shrm_cli.batch.entry"),
        "matching",
        lambda pattern: ["s3://bucket/a b/100%/ü..x/e.v.exr"],
    )
    entry = Entry(("s3://bucket/**/*.exr",), to=("irradiance",), output="out/{folder}/{probe}.exr")
    assert [job.output for job in entry.jobs()] == ["out/a b/100%/ü..x/e.v.exr"]


SECRET = "memory://user:hunter2@host/a.exr"
SIGNED = "https://127.0.0.1:9/a*.exr?X-Amz-Signature=hunter2&b=c"


@pytest.mark.parametrize(
    "command",
    [
        ("batch", SECRET, *IRRADIANCE),
        ("batch", SECRET, *IRRADIANCE, "--dry-run"),
        ("batch", "memory://user:hunter2@host/*.exr", *IRRADIANCE),
        ("batch", SECRET, *IRRADIANCE, "-o", "s3://user:hunter2@host/x.png"),
        ("batch", SECRET, *IRRADIANCE, "-o", "memory://user:hunter2@host/{x}.exr"),
        ("batch", SECRET, SECRET + "?a=b", *IRRADIANCE, "-o", "memory://user:hunter2@host/a.exr"),
        ("batch", SIGNED, *IRRADIANCE),
        ("batch", SECRET, *IRRADIANCE, "--json"),
        ("prefilter", SECRET, "--to", "irradiance"),
        ("prefilter", SIGNED, "--to", "irradiance"),
        ("info", SECRET),
        ("info", SIGNED),
    ],
)
def test_passwords_and_signatures_are_told_to_nobody(folder, command):
    found = run(*command)
    assert "hunter2" not in found.out + found.err
    assert all(b"hunter2" not in path.read_bytes() for path in folder.iterdir())


def test_sheets_name_a_url_once(folder):
    done("prefilter", "p0.exr", "--to", "irradiance", "-o", "map.exr")
    address = "https://user:hunter2@127.0.0.1:9/a.exr?sig=hunter2"
    told = "https://***@127.0.0.1:9/a.exr?..."
    for command in (
        ("contact", address, "-o", "none.html"),
        ("contact", "map.exr", address, "-o", "page.html"),
        ("lookdev", address, "p0.exr", "--brdf", "phong", "--size", "16", "-o", "sheet.html"),
    ):
        found = run(*command)
        assert found.code == 1
        assert found.err.count(told) == 1
    assert (folder / "page.html").read_text().count(told) == 1
    for path in folder.glob("*.html"):
        assert "hunter2" not in path.read_text()


def test_farms_are_warned_of_passwords(folder):
    found = run("batch", SECRET, "p0.exr", *IRRADIANCE, "--commands", "farm.sh")
    assert found.code == 0
    assert "Warning: a URL holds a password or a signature" in found.err
    assert "hunter2" not in found.err + found.out


@pytest.mark.parametrize("flag", ["--commands", "--openjd"])
def test_options_of_farms_stand_before_the_end_of_options(folder, flag):
    assert run("batch", *IRRADIANCE, flag, "f", "--chunk", "1", "--", "p0.exr", "p1.exr").code == 0
    text = (folder / "f").read_text()
    if flag == "--openjd":
        (step,) = json.loads(text)["steps"]
        words = step["script"]["actions"]["onRun"]["args"]
        assert words.index("--share") < words.index("--")
        assert "--chunk" not in words
        return
    lines = text.splitlines()
    assert lines == [
        f"shrm batch --share {k}/2 --to irradiance --jobs 1 -- p0.exr p1.exr" for k in (1, 2)
    ]
    for line in lines:
        assert run(*line.split()[1:]).code == 0
    assert sorted(path.name for path in folder.glob("*.irradiance.exr")) == [
        "p0.irradiance.exr", "p1.irradiance.exr",
    ]  # fmt: skip
