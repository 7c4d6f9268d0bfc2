"""Faults from outside: killed processes, two runs at once, odd caches and environments.

Nothing may be lost or half-written, and what a killed process leaves the next run removes. With
FAULTS=50 in the environment as many moments are tried, and all signals.
"""

import contextlib
import functools
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest

from tests.cli.helpers import (
    FAULTS,
    NO_MODULES,
    ROOT,
    UNPRIVILEGED,
    WHOLE,
    listen,
    mounted,
    noise,
    run,
    snapshot,
    write_exr,
)
from tests.make_project import REAL, Project, free_environment

pytestmark = [
    pytest.mark.proof,
    pytest.mark.skipif(sys.platform == "win32", reason="has no such signals"),
]

COMMANDS = {
    "prefilter": ("prefilter", "probe.exr", "--brdf", "ggx:roughness=0.4", "-o", "out.exr"),
    "frames": ("render", "m.exr", "--frames", "12", "--size", "32", "-o", "out.%04d.png"),
    "convert": ("convert", "m.exr", "--to", "lightfield", "--views", "8", "-o", "out.exr"),
    "faces": ("convert", "probe.exr", "--to", "faces", "--size", "256", "-o", "out_%.exr"),
    "batch": ("make", "batch", "-j2", "PROBES=*probe.exr", "BRDFS=phong", "FORMS=splitsum",
              "FLAGS_splitsum=--size 8", "RENDER_FLAGS=--size 32"),
}  # fmt: skip
SIGNALS = [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with probes, a map, and what `make` needs, among it the real command."""
    folder = tmp_path_factory.mktemp("faults")
    Project(folder).install(REAL)
    write_exr(folder / "probe.exr", noise(32, 64))
    write_exr(folder / "a probe.exr", noise(16, 32))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        made = run("prefilter", "probe.exr", "--brdf", "ggx:roughness=0.5", "-o", "m.exr")
    assert made.code == 0
    return folder


@pytest.fixture(scope="module")
def finished(prepared):
    """A function that tells what a command writes there, and how many seconds it takes."""

    @functools.cache
    def whole(name):
        folder = copied(prepared, prepared.with_name(f"{prepared.name}-{name}"))
        begin = time.monotonic()
        complete(COMMANDS[name], folder)
        return made_in(folder), time.monotonic() - begin

    return whole


def copied(prepared, folder):
    """Copy the folder, with an empty cache and a place for temporary files below it."""
    shutil.copytree(prepared, folder)
    (folder / "cache").mkdir()
    (folder / "tmp").mkdir()
    return folder


def begun(command, folder, code=WHOLE, **changes):
    """Start a command in a session of its own; None removes a variable of the environment."""
    words = command if command[0] == "make" else (sys.executable, "-c", code, *command)
    own = {"SHRM_CACHE_DIR": str(folder / "cache"), "TMPDIR": str(folder / "tmp")}
    changed = {**free_environment(), "PYTHONPATH": str(ROOT), **own, **changes}
    return subprocess.Popen(
        words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=listen,
        env={key: value for key, value in changed.items() if value is not None},
    )  # fmt: skip


def complete(command, folder, **options):
    """Run a command to its end, which must be success, without a word on stderr."""
    with begun(command, folder, **options) as child:
        _, err = child.communicate(timeout=120)
    assert (child.returncode, err) == (0, "")


def made_in(folder):
    """Digests of all that there is, but for whole entries of the cache, logs and stamps.

    Entries depend on how long their content took, logs and stamps on the time.
    """
    return {
        name: digest
        for name, digest in snapshot(folder).items()
        if ".shrm-" in name
        or not name.startswith(("cache/", "build/.pictures", "build/batch.jsonl"))
    }


def strike(child, number):
    """Send a signal as it comes: SIGTERM to one process, the others to all of its session."""
    with contextlib.suppress(ProcessLookupError):
        if number == signal.SIGTERM:
            child.send_signal(number)
        else:
            os.killpg(child.pid, number)


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("name", COMMANDS)
def test_killed_at_any_moment(prepared, finished, tmp_path, name, number):
    """Outputs are whole or not there, and a second run makes what the first would have made."""
    if FAULTS == 1 and (number in (signal.SIGHUP, signal.SIGINT) or name == "faces"):
        pytest.skip("FAULTS=50 tries all")
    whole, seconds = finished(name)
    rng = random.Random(f"{name} {number}")
    codes = []
    for moment in range(FAULTS):
        folder = copied(prepared, tmp_path / str(moment))
        with begun(COMMANDS[name], folder) as child:
            time.sleep(rng.uniform(0.2, 1) * seconds)
            strike(child, number)
            _, err = child.communicate(timeout=60)
        codes.append(child.returncode)
        # A signal that comes while Python starts ends it as every process.
        assert name == "batch" or child.returncode in (0, 128 + number, -number)
        found = made_in(folder)
        left = {each for each in found if ".shrm-" in each}
        assert all(whole[each] == found[each] for each in found.keys() - left), codes
        if number != signal.SIGKILL:
            assert left == set(), (child.returncode, err)
            # Python itself says so if it is interrupted while it starts, as each job does.
            assert "Traceback" not in err or (name, number) == ("batch", signal.SIGINT)
        if number in (signal.SIGKILL, signal.SIGTERM) or moment == 0:
            complete(COMMANDS[name], folder)
            assert made_in(folder) == whole
        shutil.rmtree(folder)
    struck = sum(code != 0 for code in codes)
    print(f"{name}, {signal.Signals(number).name}: {FAULTS} moments, {struck} before the end")
    assert struck >= FAULTS // 4


def test_nothing_is_made_again_after_a_batch_that_was_killed_and_completed(prepared, tmp_path):
    folder = copied(prepared, tmp_path / "batch")
    with begun(COMMANDS["batch"], folder) as child:
        while not list(folder.glob("build/*.exr")) and child.poll() is None:
            time.sleep(0.01)
        strike(child, signal.SIGKILL)
        child.communicate(timeout=60)
    assert child.returncode == -signal.SIGKILL
    complete(COMMANDS["batch"], folder)
    made = [path for path in (folder / "build").iterdir() if path.suffix != ".jsonl"]
    times = {path: path.stat().st_mtime_ns for path in made}
    complete(COMMANDS["batch"], folder)
    assert {path: path.stat().st_mtime_ns for path in made} == times


@pytest.mark.parametrize("name", COMMANDS)
def test_two_runs_at_once(prepared, finished, tmp_path, name):
    """To one output, and with one cold cache."""
    whole, seconds = finished(name)
    rng = random.Random(name)
    for moment in range(FAULTS):
        folder = copied(prepared, tmp_path / str(moment))
        with begun(COMMANDS[name], folder) as first:
            time.sleep(0 if moment % 2 == 0 else rng.uniform(0, 1) * seconds)
            with begun(COMMANDS[name], folder) as second:
                ends = [each.communicate(timeout=120)[1] for each in (first, second)]
        assert (first.returncode, second.returncode, ends) == (0, 0, ["", ""])
        assert made_in(folder) == whole
        shutil.rmtree(folder)


CACHED = ("prefilter", "probe.exr", "--to", "splitsum", "--size", "8", "-o", "out.exr")
"""A command whose coefficients take long enough to be kept."""


@pytest.fixture(scope="module")
def warm(prepared):
    """A folder with a map, and the cache that the command has filled."""
    folder = copied(prepared, prepared.with_name(f"{prepared.name}-warm"))
    complete(CACHED, folder)
    assert len(list((folder / "cache").iterdir())) > 3
    return folder


def cut(path):
    os.truncate(path, path.stat().st_size // 2)


def change(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)


def exchange(path):
    """Give an entry the content of another one."""
    others = sorted(path.parent.iterdir())
    path.write_bytes(others[others.index(path) - 1].read_bytes())


def abandon(path):
    """Leave only what a killed process would leave of an entry."""
    mark = f".shrm-{os.uname().nodename[:40]}-99999999-ab"
    path.with_name(f".{path.stem[:40]}{mark}{path.suffix}").touch()
    path.unlink()


DAMAGE = {
    "cut": cut,
    "empty": lambda path: os.truncate(path, 0),
    "changed": change,
    "exchanged": exchange,
    "abandoned": abandon,
    "a pipe": lambda path: (path.unlink(), os.mkfifo(path)),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_entries_of_the_cache_that_are_of_no_use(warm, tmp_path, damage):
    """The map has the same bytes, nothing is said, and nothing temporary stays."""
    folder = tmp_path / "copy"
    shutil.copytree(warm, folder)
    (folder / "out.exr").unlink()
    for path in sorted((folder / "cache").iterdir()):
        DAMAGE[damage](path)
    complete(CACHED, folder)
    assert made_in(folder) == made_in(warm)


OTHER_VERSION = (
    f"from shrm_cli import sources; sources.fingerprint = lambda folders=(): 'another'\n{WHOLE}"
)


def test_entries_of_another_version_are_left_alone(prepared, warm, tmp_path):
    folder = copied(prepared, tmp_path / "copy")
    complete(CACHED, folder, code=OTHER_VERSION)
    theirs = snapshot(folder / "cache")
    assert len(theirs) > 3
    (folder / "out.exr").unlink()
    complete(CACHED, folder)
    both = snapshot(folder / "cache")
    assert theirs.items() <= both.items()
    assert len(both) > len(theirs)
    assert made_in(folder) == made_in(warm)


@pytest.mark.parametrize("options", ["ro", "size=4k", "size=100k"])
def test_caches_on_read_only_and_full_disks(prepared, warm, tmp_path, options):
    folder = copied(prepared, tmp_path / "copy")
    (folder / "cache").rmdir()
    with mounted(folder / "cache", options) as cache:
        complete(CACHED, folder)
        assert not [path for path in cache.iterdir() if path.name.startswith(".")]
    assert made_in(folder) == made_in(warm)


@pytest.mark.parametrize(("folders", "files"), [(0o555, 0o444), (0o777, 0), (0, 0o444)])
def test_caches_without_permission(warm, tmp_path, folders, files):
    """Whether the entries that are there can be read or not."""
    folder = tmp_path / "copy"
    shutil.copytree(warm, folder)
    (folder / "out.exr").unlink()
    for path in (folder / "cache").iterdir():
        path.chmod(files)
    (folder / "cache").chmod(folders)
    complete(CACHED, folder, code=f"{UNPRIVILEGED}\n{WHOLE}")
    (folder / "cache").chmod(0o755)
    assert made_in(folder) == made_in(warm)


@pytest.mark.parametrize("place", ["a file", "nowhere", "itself"])
def test_caches_that_are_no_folder(prepared, warm, tmp_path, place):
    folder = copied(prepared, tmp_path / "copy")
    (folder / "cache").rmdir()
    if place == "a file":
        (folder / "cache").write_text("in the way")
    else:
        (folder / "cache").symlink_to("/proc/nothing" if place == "nowhere" else "cache")
    complete(CACHED, folder)
    made = {name: digest for name, digest in made_in(folder).items() if name != "cache"}
    assert made == {name: digest for name, digest in made_in(warm).items() if name != "cache"}


NO_FOLDER = {"SHRM_CACHE_DIR": None, "XDG_CACHE_HOME": None}


@pytest.mark.parametrize(
    "changes",
    [
        {**NO_FOLDER, "HOME": None},
        {**NO_FOLDER, "HOME": ""},
        {**NO_FOLDER, "HOME": "/proc/nothing"},
        {"SHRM_CACHE_DIR": "/dev/null/cache"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"LC_ALL": "xx_XX.nothing"},
        {"PYTHONIOENCODING": "ascii", "TERM": "dumb"},
        {"TMPDIR": "/proc/nothing", "PATH": ""},
    ],
    ids=lambda changes: " ".join(f"{name}={value}" for name, value in changes.items()),
)
def test_odd_environments(prepared, warm, tmp_path, changes):
    """The same bytes and no word on stderr, whatever the variables are."""
    folder = copied(prepared, tmp_path / "odd")
    complete(CACHED, folder, code=f"{NO_MODULES}\n{WHOLE}", **changes)
    assert made_in(folder) == made_in(warm)


def test_a_home_that_is_read_only(prepared, warm, tmp_path):
    folder = copied(prepared, tmp_path / "odd")
    with mounted(tmp_path / "home", "ro") as home:
        complete(CACHED, folder, **NO_FOLDER, HOME=str(home))
    assert made_in(folder) == made_in(warm)


def test_an_output_that_the_locale_cannot_spell(prepared, tmp_path):
    """The name is UTF-8; it is the process that takes names for ASCII."""
    folder = copied(prepared, tmp_path / "odd")
    before = snapshot(folder)
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    *command, _ = COMMANDS["convert"]
    with begun([*command, "pr\u00fcfung.exr"], folder, **plain) as child:
        err = child.communicate()[1]
    assert child.returncode == 1
    assert "the locale's encoding, ascii, lacks; set LC_ALL=C.UTF-8, or name another" in err
    assert "not UTF-8" not in err
    assert snapshot(folder) == before
