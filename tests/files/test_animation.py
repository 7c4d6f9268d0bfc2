"""Moving pictures, read by Pillow and by ffmpeg."""

import os
import re
import shutil
import subprocess

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.animation import check_animation, write_animation

Image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")


def frames(count, height=20, width=34):
    """Frames that differ: a bright column that moves over a ramp."""
    ramp = np.linspace(0, 200, width).astype(np.uint8)
    for k in range(count):
        frame = np.repeat(np.repeat(ramp[None, :, None], height, axis=0), 3, axis=2)
        frame[:, 3 * k : 3 * k + 3] = 255, 60, 0
        yield frame


@pytest.mark.parametrize("suffix", [".apng", ".gif"])
def test_pillow_reads_all_frames(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_animation(path, frames(7), 10)
    with Image.open(path) as found:
        assert (found.n_frames, found.size, found.info["loop"]) == (7, (34, 20), 0)
        for k, expected in enumerate(frames(7)):
            found.seek(k)
            assert found.info["duration"] == 100
            pixels = np.asarray(found.convert("RGB")).astype(int)
            assert np.abs(pixels - expected).max() <= (0 if suffix == ".apng" else 4)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("rate", [12.5, 24, 30, 50])
def test_gifs_keep_their_rate_in_the_mean(tmp_path, rate):
    """A frame lasts whole hundredths of a second."""
    write_animation(tmp_path / "a.gif", frames(11), rate)
    with Image.open(tmp_path / "a.gif") as found:
        lasts = []
        for k in range(found.n_frames):
            found.seek(k)
            lasts.append(found.info["duration"])
    assert sum(lasts) == pytest.approx(11_000 / rate, abs=10)
    assert max(lasts) - min(lasts) <= 10


def test_gifs_that_browsers_would_show_slowly_are_refused(tmp_path):
    with pytest.raises(OutputError, match=r"`fps` 50 or less, or name \.apng or \.mp4"):
        write_animation(tmp_path / "a.gif", frames(2), 51)
    assert not [*tmp_path.iterdir()]


def test_smooth_light_has_no_rings_in_gifs(tmp_path):
    """Colours are mixed, so that squares of 8 x 8 pixels keep their means."""
    x, y = np.meshgrid(np.linspace(0, 1, 192), np.linspace(0, 1, 192))
    smooth = np.stack([x, y, (x + y) / 2], axis=-1) * 200 + 40
    write_animation(tmp_path / "a.gif", [smooth.astype(np.uint8)] * 2, 10)
    with Image.open(tmp_path / "a.gif") as found:
        pixels = np.asarray(found.convert("RGB")).astype(float)
    off = (pixels - smooth)[16:-16, 16:-16].reshape(20, 8, 20, 8, 3).mean(axis=(1, 3))
    assert np.abs(off).max() < 3


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    """Put a ffmpeg where it is found: a wheel brings one to every machine."""
    brought = pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg is not installed")
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "ffmpeg").symlink_to(brought.get_ffmpeg_exe())
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)


@pytest.mark.usefixtures("ffmpeg")
@pytest.mark.parametrize("size", [(20, 34), (21, 35)])
def test_ffmpeg_reads_all_frames(tmp_path, size):
    path = tmp_path / "a.mp4"
    write_animation(path, frames(7, *size), 12)
    read = subprocess.run(
        ["ffmpeg", "-i", path, "-vf", "scale=in_color_matrix=bt709",
         "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True, check=True,
    )  # fmt: skip
    stream = re.search(r"Video: h264.*bt709.* (\d+)x(\d+).* 12 fps", read.stderr.decode())
    width, height = int(stream[1]), int(stream[2])
    assert (width, height) == (-(-size[1] // 2) * 2, -(-size[0] // 2) * 2)
    found = np.frombuffer(read.stdout, np.uint8).reshape(-1, height, width, 3).astype(int)
    assert len(found) == 7
    for k, (frame, expected) in enumerate(zip(found, frames(7, *size), strict=True)):
        bright = slice(3 * k, 3 * k + 3)  # has half the resolution of what is grey
        assert frame[4:16, bright, 0].mean() > 180
        grey = np.delete(frame, np.r_[max(3 * k - 4, 0) : 3 * k + 7, 32:width], axis=1)
        same = np.delete(expected, np.r_[max(3 * k - 4, 0) : 3 * k + 7, 32 : size[1]], axis=1)
        assert np.abs(grey[4:16] - same[4:16]).mean() < 4
    before = path.read_bytes()
    write_animation(path, frames(7, *size), 12)
    assert path.read_bytes() == before


def test_what_is_missing_is_said_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(OutputError, match=r"ffmpeg, which is not installed.*\.gif"):
        check_animation(tmp_path / "a.mp4")
    monkeypatch.setitem(__import__("sys").modules, "PIL", None)
    with pytest.raises(OutputError, match=r"Pillow.*pip install pillow"):
        check_animation(tmp_path / "a.gif")
    with pytest.raises(OutputError, match="name such a file"):
        write_animation(tmp_path / "a.avi", frames(1), 10)
    assert not list(tmp_path.iterdir())


def test_a_program_that_fails_leaves_nothing(tmp_path, monkeypatch):
    broken = tmp_path / "bin" / "ffmpeg"
    broken.parent.mkdir()
    broken.write_text("#!/bin/sh\necho no such encoder >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setenv("PATH", str(broken.parent))
    with pytest.raises(OutputError, match=r"ffmpeg failed \(no such encoder\)"):
        write_animation(tmp_path / "a.mp4", frames(2000), 10)
    assert [each.name for each in tmp_path.iterdir()] == ["bin"]
