"""Moving pictures: animated PNG and GIF by Pillow, MP4 by the program ffmpeg.

Pictures are 8-bit sRGB. MP4 takes them one after the other; Pillow wants all of them at hand.
"""

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import OutputError
from shrm_cli.extras import install
from shrm_cli.files.whole import replacing

Image8 = NDArray[np.uint8]

ANIMATED = (".apng", ".gif", ".mp4")
"""The suffixes of moving pictures."""

_HELD = {".apng": 10, ".gif": 4}
"""Bytes for each pixel of all frames, measured as growth of the process's peak and rounded up."""

_GIF_RATE = 50
"""The most frames a second of a GIF: browsers take a tenth of a second for one of a hundredth."""
_MP4_OPTIONS = (
    # Sizes must be even, and the colours are those of HDTV and not of old television.
    "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv",
    "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p",
    "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1",
    "-movflags", "+faststart", "-fflags", "+bitexact", "-flags:v", "+bitexact",
)  # fmt: skip


def is_animated(path: str | os.PathLike[str]) -> bool:
    """Whether a file's name is that of a moving picture."""
    return Path(path).suffix.lower() in ANIMATED


def held_bytes(path: str | os.PathLike[str], pixels: int, frames: int) -> int:
    """Return how many bytes of memory the frames of a moving picture take while it is written."""
    return _HELD.get(Path(path).suffix.lower(), 0) * pixels * frames


def check_animation(path: str | os.PathLike[str]) -> None:
    """Check, before the work begins, that what writes a moving picture is installed."""
    if Path(path).suffix.lower() == ".mp4":
        _ffmpeg(path)
    else:
        _pillow(path)


def write_animation(path: str | os.PathLike[str], frames: Iterable[Image8], rate: float) -> None:
    """Write a moving picture that begins anew at its end, whole or not at all.

    `path` is ``.apng``, ``.gif`` or ``.mp4``. `frames`, each of shape (H, W, 3), are sRGB. A GIF
    has 256 colours in each of them. An MP4 has an even number of rows and of columns: the last ones
    are repeated in black where it must be. `rate` is in frames a second. GIFs count in hundredths
    of a second, and have 50 frames in it at most.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ANIMATED:
        raise OutputError(f"{path}: moving pictures are {', '.join(ANIMATED)}; name such a file")
    if suffix == ".gif" and rate > _GIF_RATE:
        raise OutputError(
            f"{path}: browsers show a GIF of more than {_GIF_RATE} frames a second slowly; give "
            f"`fps` {_GIF_RATE} or less, or name .apng or .mp4"
        )
    with replacing(path) as temporary:
        if suffix == ".mp4":
            _write_mp4(path, temporary, iter(frames), rate)
        else:
            _write_by_pillow(path, temporary, iter(frames), rate, suffix)


def _pillow(path: str | os.PathLike[str]) -> Any:
    try:
        from PIL import Image
    except ImportError:
        raise OutputError(
            f"{path}: made by Pillow, which is not installed; {install('lookdev')}"
        ) from None
    return Image


def _write_by_pillow(
    path: str | os.PathLike[str],
    temporary: Path,
    frames: Iterator[Image8],
    rate: float,
    suffix: str,
) -> None:
    library = _pillow(path)
    shown = (library.fromarray(frame) for frame in frames)
    images = [_dithered(library, image) if suffix == ".gif" else image for image in shown]
    durations: float | list[int] = 1000 / rate
    if suffix == ".gif":
        # Hundredths of a second that add up to the rate: Pillow rounds each of them down.
        ends = [round(100 * k / rate) for k in range(len(images) + 1)]
        durations = [10 * (after - before) for before, after in pairwise(ends)]
    temporary.touch()  # raises the system's error in its own words
    images[0].save(
        temporary,
        format="GIF" if suffix == ".gif" else "PNG",
        save_all=True,
        append_images=images[1:],
        duration=durations,
        loop=0,
    )


def _dithered(library: Any, image: Any) -> Any:
    """Return a picture in 256 colours, which are mixed: smooth light would have rings otherwise."""
    # Pillow mixes only those of a palette that it is given.
    return image.quantize(palette=image.quantize(256), dither=library.Dither.FLOYDSTEINBERG)


def _ffmpeg(path: str | os.PathLike[str]) -> str:
    found = shutil.which("ffmpeg")
    if found is None:
        raise OutputError(
            f"{path}: MP4 is made by ffmpeg, which is not installed; install it, or name .gif, "
            ".apng or frames such as sheet.%04d.png"
        )
    return found


def _write_mp4(
    path: str | os.PathLike[str], temporary: Path, frames: Iterator[Image8], rate: float
) -> None:
    program = _ffmpeg(path)
    first = next(frames)
    height, width, _ = first.shape
    command = [
        program, "-hide_banner", "-loglevel", "error", "-y",
        "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:g}",
        "-i", "pipe:0", *_MP4_OPTIONS, os.fspath(temporary.absolute()),
    ]  # fmt: skip
    # What it says goes into a file: a pipe that nobody reads would stop it when it is full.
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said
        )
        assert process.stdin is not None
        try:
            process.stdin.write(first.tobytes())
            for frame in frames:
                process.stdin.write(frame.tobytes())
            process.stdin.close()
            code = process.wait()
        except BrokenPipeError:  # it has ended, and says why
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
            code = process.wait() or 1
        except BaseException:
            process.kill()
            process.wait()
            raise
        if code:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
            raise OutputError(
                f"{path}: ffmpeg failed ({lines[-1] if lines else f'exit code {code}'}); name .gif "
                "or .apng"
            )
