"""The numbered files and the views of a turntable."""

import os
import re

from shrm_cli.errors import OutputError
from shrm_cli.render.camera import Viewer

_NUMBER = re.compile(r"%0([1-9]\d?)d")


def frame_paths(pattern: str, count: int) -> list[str]:
    """Return the names of frames, numbered from 1 where the pattern has ``%04d`` or the like.

    Raises
    ------
    OutputError
        If the pattern, without its folder, does not have exactly one such place.
    """
    folder, name = os.path.split(pattern)
    if len(_NUMBER.findall(name)) != 1:
        raise OutputError(
            f"{pattern}: frames need one place for their number, such as {_example(name)}"
        )
    before, digits, after = _NUMBER.split(name)
    return [os.path.join(folder, f"{before}{k:0{digits}d}{after}") for k in range(1, count + 1)]


def check_one_file(name: str) -> None:
    """Check that the name of a moving picture, which is one file, has no place for a number.

    Raises
    ------
    OutputError
        If it has one.
    """
    if _NUMBER.search(name):
        raise OutputError(f"{name}: a moving picture is one file; leave the number out of its name")


def turntable(first: Viewer, count: int) -> list[Viewer]:
    """Return views at equal steps of a full turn about +Y, towards growing azimuth."""
    return [first.turned(360 * k / count) for k in range(count)]


def _example(name: str) -> str:
    stem, suffix = os.path.splitext(name)
    return f"{_NUMBER.sub('', stem).rstrip('.') or 'frame'}.%04d{suffix}"
