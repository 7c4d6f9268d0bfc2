"""Outputs appear whole or not at all, and never in the place of something else."""

import os
import platform
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.whole import check_target, keeping, note, protecting, replacing, together
from tests.cli.helpers import environment

HOST = platform.node()


def gone():
    """The id of a process that has ended."""
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def write(target, text="new"):
    with replacing(target) as temporary:
        temporary.write_text(text)


def fail(target, error):
    with replacing(target) as temporary:
        temporary.write_text("half")
        raise error


def test_file_appears_when_the_block_succeeds(tmp_path):
    target = tmp_path / "a.b.exr"
    target.write_text("old")
    with replacing(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".exr"
        assert temporary.name.startswith(".")
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert names(tmp_path) == ["a.b.exr"]


@pytest.mark.parametrize("old", [None, "old"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit, MemoryError])
def test_nothing_changes_when_the_block_fails(tmp_path, error, old):
    target = tmp_path / "a.exr"
    if old is not None:
        target.write_text(old)
    with pytest.raises(error):
        fail(target, error)
    assert names(tmp_path) == ([] if old is None else ["a.exr"])
    assert old is None or target.read_text() == old


def test_system_errors_become_one_line(tmp_path):
    target = tmp_path / "a.exr"
    with pytest.raises(OutputError) as caught:
        fail(target, OSError(28, "No space left on device"))
    message = str(caught.value)
    assert message.startswith(f"{target}: cannot be written (No space left on device); ")
    assert names(tmp_path) == []


def test_a_block_that_writes_nothing_is_an_error(tmp_path):
    with pytest.raises(OutputError, match="cannot be written"), replacing(tmp_path / "a.exr"):
        pass
    assert names(tmp_path) == []


def test_left_overs_of_dead_processes_are_removed(tmp_path):
    dead = tmp_path / f".a.shrm-{HOST}-{gone()}-00112233.exr"
    kept = [
        f".a.shrm-{HOST}-{os.getpid()}-00112233.exr",  # of a process that runs
        f".a.shrm-{HOST}-1-00112233.exr",
        f".ab.shrm-{HOST}-{gone()}-00112233.exr",  # of another target
        f".a.shrm-{HOST}-{gone()}-00112233.png",
        f".a.shrm-{HOST}-notes-x.exr",
        f".a.shrm-elsewhere-{gone()}-00112233.exr",
        f"a.shrm-{HOST}-{gone()}-00112233.exr",
    ]
    for name in [dead.name, *kept]:
        (tmp_path / name).write_text("half")
    write(tmp_path / "a.exr")
    assert names(tmp_path) == sorted([*kept, "a.exr"])


STOPPED_EARLY = """
import atexit, os, pathlib, sys, tempfile
tempfile.tempdir = "."
from shrm_cli.files.whole import scratch_folder
from shrm_cli.files.whole import replacing, together
blocks = [replacing("a.exr"), scratch_folder(), together(), replacing("b.exr")]
for block in blocks:
    path = block.__enter__()
    if path is not None:
        (path / "c.exr" if path.is_dir() else path).write_text("half")
blocks[3].__exit__(None, None, None)  # it waits for the end of the block of all together
if os.fork() == 0:
    atexit._run_exitfuncs()
    os._exit(0)
os.wait()
print(len(list(pathlib.Path(".").iterdir())))
sys.stdout.flush()
atexit._run_exitfuncs()  # as the command ends
os._exit(1)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="has no fork")
def test_what_a_signal_leaves_is_removed_at_the_end(tmp_path):
    """It may come between the end of a block and the first line that would clean up after it."""
    found = subprocess.run(
        [sys.executable, "-c", STOPPED_EARLY],
        cwd=tmp_path, env=environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert (found.returncode, found.stdout, found.stderr) == (1, "3\n", "")
    assert names(tmp_path) == []


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc")
def test_left_overs_of_processes_that_nobody_has_asked_for_are_removed(tmp_path):
    """In containers the first process may never ask for the children of one that was killed."""
    with subprocess.Popen([sys.executable, "-c", ""], stdout=subprocess.PIPE) as child:
        child.stdout.read()
        state = Path(f"/proc/{child.pid}/stat")
        while state.read_text().rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)
        (tmp_path / f".a.shrm-{HOST}-{child.pid}-00112233.exr").write_text("half")
        write(tmp_path / "a.exr")
        assert names(tmp_path) == ["a.exr"]


@pytest.mark.parametrize("length", [60, 250])
@pytest.mark.parametrize("letter", ["n", "é"])
def test_long_names_can_be_written(tmp_path, letter, length):
    target = tmp_path / (letter * (length // len(letter.encode())) + ".exr")
    write(target)
    assert target.read_text() == "new"


@pytest.mark.parametrize("guard", [check_target, write])
def test_devices_and_pipes_are_not_replaced(tmp_path, guard):
    """As root, a rename would put a file in the place of /dev/null."""
    os.mkfifo(tmp_path / "pipe.exr")
    with pytest.raises(OutputError, match="not a regular file"):
        guard(tmp_path / "pipe.exr")
    assert stat.S_ISFIFO((tmp_path / "pipe.exr").stat().st_mode)
    assert names(tmp_path) == ["pipe.exr"]


def test_targets_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    for target, words in [
        (tmp_path, "a directory; name a file"),
        (tmp_path / "folder", "a directory; name a file"),
        (tmp_path / "no" / "a.exr", "there is no folder .*; make it first"),
        (tmp_path / "file" / "a.exr", "file is a file, not a folder; name another"),
        (tmp_path / ("n" * 300), "File name too long.*; name another"),
        (tmp_path / "n\udcff.exr", "not UTF-8; give it one that is, or name another"),
        (tmp_path / "n\ud800.exr", "not UTF-8; give it one that is, or name another"),
        (tmp_path / "n\udcc3\udcbc.exr", "encoding, .*, lacks; set LC_ALL=C.UTF-8, or name"),
    ]:
        with pytest.raises(OutputError, match=words):
            check_target(target)


def test_permission_is_asked_of_the_folder(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(os, "access", lambda path, mode: asked.append((str(path), mode)))
    with pytest.raises(OutputError, match=f"no permission to write in {tmp_path}"):
        check_target(tmp_path / "a.exr")
    assert asked == [(str(tmp_path), os.W_OK | os.X_OK)]


@pytest.mark.parametrize("way", ["real.exr", "folder/../real.exr", "link.exr", "hard.exr"])
@pytest.mark.parametrize("noted", ["real.exr", "link.exr", "hard.exr"])
def test_inputs_are_not_overwritten(tmp_path, monkeypatch, way, noted):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    for name in ("real.exr", "other.exr"):
        (tmp_path / name).write_text("input")
    (tmp_path / "link.exr").symlink_to("real.exr")
    (tmp_path / "hard.exr").hardlink_to("real.exr")
    with protecting():
        note("missing.exr", "no/such.exr", "n\0ul", noted)
        with pytest.raises(OutputError, match="would overwrite the input; name another output"):
            check_target(way)
        with pytest.raises(OutputError, match="would overwrite"), replacing(way) as temporary:
            temporary.write_text("output")
        check_target("other.exr")
        check_target("new.exr")
    check_target(way)  # the files of one command are none of the next
    note("other.exr")  # and a program of one's own overwrites what it wants
    check_target("other.exr")
    assert (tmp_path / "real.exr").read_text() == "input"
    assert len(list(tmp_path.iterdir())) == 5


def test_what_was_made_and_read_back_may_be_made_anew(tmp_path):
    target = tmp_path / "map.exr"
    with protecting():
        for text in ("one", "two", "three"):
            with replacing(target) as temporary:
                temporary.write_text(text)
            note(target)
            assert target.read_text() == text
    with protecting():
        note(target)
        with pytest.raises(OutputError, match="would overwrite"), replacing(target):
            pass


def test_names_must_end_as_the_content_wants(tmp_path):
    check_target(tmp_path / "a.EXR", suffixes=(".exr",))
    with pytest.raises(OutputError, match=r"a\.png: what is written is \.exr"):
        check_target(tmp_path / "a.png", suffixes=(".exr",))


def test_files_that_belong_together_appear_together(tmp_path):
    targets = [tmp_path / f"{k}.exr" for k in range(3)]
    with together():
        for each in targets:
            write(each)
            assert not any(target.exists() for target in targets)
    assert names(tmp_path) == ["0.exr", "1.exr", "2.exr"]
    assert [each.read_text() for each in targets] == ["new"] * 3


@pytest.mark.parametrize("error", [OutputError, KeyboardInterrupt, SystemExit])
def test_none_appears_where_one_fails(tmp_path, error):
    (tmp_path / "0.exr").write_text("old")

    def write_two():
        with together():
            write(tmp_path / "0.exr")
            fail(tmp_path / "1.exr", error)

    with pytest.raises(error):
        write_two()
    assert names(tmp_path) == ["0.exr"]
    assert (tmp_path / "0.exr").read_text() == "old"
    write(tmp_path / "1.exr")  # as ever
    assert names(tmp_path) == ["0.exr", "1.exr"]


@pytest.mark.parametrize("name", ["a.exr/", "sub/a.exr/", "/"])
def test_a_name_that_ends_as_a_folders_does(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match=f"^{name}: a directory; name a file to write$"):
        check_target(name)


def test_a_file_that_nobody_may_write_stays(tmp_path):
    """Renaming would replace it, whatever its mode."""
    target = tmp_path / "a.exr"
    target.write_text("old")
    target.chmod(0o444)
    for attempt in (check_target, write):
        with pytest.raises(OutputError, match="read-only; change its mode or name another"):
            attempt(target)
    assert target.read_text() == "old"
    assert names(tmp_path) == ["a.exr"]


WHOLE = bytes(range(1, 256)) * 9000
"""More bytes than are looked at together."""


@pytest.mark.parametrize(
    ("there", "is_replaced"),
    [
        (WHOLE, True),
        (WHOLE[:100], True),
        (WHOLE[:-1], True),
        (b"", True),
        (WHOLE[:2_000_000].ljust(len(WHOLE), b"\0"), True),
        (bytes(len(WHOLE)), True),
        (WHOLE[:100] + b"x", False),
        (WHOLE[:100] + bytes(50) + b"x", False),
        (WHOLE[:1_100_000] + b"x" + bytes(500), False),
        (WHOLE + b"\0", False),
        (b"x" + WHOLE[1:], False),
    ],
)
def test_what_is_kept_is_replaced_where_it_is_the_same_or_was_cut(tmp_path, there, is_replaced):
    path = tmp_path / "a.bin"
    path.write_bytes(there)

    def write():
        with keeping(path), replacing(path) as temporary:
            temporary.write_bytes(WHOLE)

    if is_replaced:
        write()
        assert path.read_bytes() == WHOLE
        return
    with pytest.raises(OutputError, match="other inputs or options made it"):
        write()
    assert path.read_bytes() == there
