"""Folders of a run: gone at its end, after a later run if it was killed, told if impossible."""

import os
import signal
import sys
import tempfile

import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.whole import scratch_folder
from tests.cli.helpers import MAIN, NO_MODULES, assert_refused, noise, process, start, write_exr

KILLED = """
import os, signal, sys
from shrm_cli.files.whole import scratch_folder
with scratch_folder() as folder:
    (folder / "map.exr").write_text("light")
    print(folder, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Where the system has its temporary files, in this process and in those that it starts."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_it_is_removed_with_all_in_it(place):
    with scratch_folder() as folder:
        assert folder.parent == place
        (folder / "below").mkdir()
        (folder / "below" / "a.exr").write_text("light")
    assert list(place.iterdir()) == []
    with pytest.raises(KeyError), scratch_folder():
        raise KeyError
    assert list(place.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
def test_what_a_killed_process_leaves_the_next_one_removes(place):
    (place / ".shrm-mine").mkdir()
    with start(code=KILLED) as child:
        left = child.stdout.readline().strip()
        assert child.wait(timeout=30) == -signal.SIGKILL
    assert os.path.exists(f"{left}/map.exr")
    with scratch_folder() as folder:
        assert sorted(place.iterdir()) == sorted([place / ".shrm-mine", folder])
        with scratch_folder() as other:  # of a run that is still at work
            assert other != folder
        assert folder.exists()


def test_where_no_folder_can_be_made(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "no"))
    with pytest.raises(OutputError, match=r"no temporary folder can be made .* set TMPDIR"):
        scratch_folder().__enter__()


@pytest.mark.skipif(sys.platform == "win32", reason="has no such limits")
def test_without_room_for_a_scratch_file_the_folder_is_named(tmp_path, monkeypatch):
    """A picture that an export reads back: its file is larger than files may be."""
    probe = write_exr(tmp_path / "probe.exr", noise())
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    limits = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); "
    command = ("export", probe, "--for", "three", "--size", "64", "-o", tmp_path / "out")
    result = process(*command, code=NO_MODULES + "; " + limits + MAIN)
    assert_refused(result, 1, f"{tmp_path}: no room for temporary files", "set TMPDIR")
    assert list(tmp_path.iterdir()) == [probe]


COMMANDS = [
    ("compare", "probe.exr", "--representations", "--roughness", "0.5", "--size", "16"),
    ("report", "probe.exr", "--to", "irradiance", "--no-flip", "--no-view", "--view", "0,0",
     "--picture-size", "16", "--truth-height", "8", "-o", "page.html"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="has no such limits")
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_commands_say_what_they_lack(tmp_path, monkeypatch, command):
    """No file can be written anywhere, so that no folder is usable."""
    monkeypatch.chdir(tmp_path)
    write_exr("probe.exr", noise())
    code = f"{NO_MODULES}; import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (0, 0))\n{MAIN}"
    assert_refused(
        process(*command, code=code),
        1,
        "Error: no temporary folder can be made (No usable",
        "set TMPDIR",
    )
