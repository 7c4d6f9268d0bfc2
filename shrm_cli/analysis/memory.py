"""How much memory comparisons and sheets take, estimated before they begin.

The estimates are sums of rates that were measured as growth of the process's peak, and rounded up.
They are to be large enough, so that a limit is kept, and not to be exact.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from shrm_cli.errors import ArgumentError
from shrm_cli.maps.options import bytes_text
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE

_PROGRAM = 250 * 10**6
"""Bytes of the program with its libraries, and of the coefficients of the sharpest BRDFs."""
_MAP = 24
"""Bytes that it takes to make a map, to write it and to read it, for each of its bytes in half
precision. The second moments of an SHRM's coefficients, in 64-bit floats, take the most."""
_PIXEL_OF_PROBE = 40
"""Bytes for each pixel of a probe while it is averaged down."""
_PIXEL_OF_TRUTH = 150
"""Bytes for each pixel that the truth sums over."""
_POINT = 1000
"""Bytes for each point of a sphere while it is drawn: directions, and what a map looks up."""
_POINTS_AT_ONCE = 2**19
"""The most points that are drawn at a time, beside which those of the rim are few."""
_PIXEL_KEPT = 12
"""Bytes of a pixel of a picture, of which a comparison keeps all."""
_PIXEL_MEASURED = 250
"""Bytes for each pixel of one representation while its pictures are measured."""
_PIXEL_OF_SHEET = 60
"""Bytes for each pixel of the sheet that shows a view of each surface."""
_LEAST_MAX_SIZE = 10**6
"""The least bytes that maps are limited to, before a comparison is refused."""
_UNKNOWN = 8 * 10**9
"""Bytes that a machine is taken to have which does not tell."""
_CONTAINER_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")
"""Files in which Linux tells how much memory a container may take."""


def machine_memory() -> int:
    """Return the bytes of memory of the machine, or of the process where it may have less."""
    return min([*_physical(), *_limits()], default=_UNKNOWN)


def default_max_memory() -> int:
    """Return the bytes that a comparison may take by default: half of the machine's memory."""
    return machine_memory() // 2


@record
class Memory:
    """The memory of a comparison."""

    needed: int
    """Bytes that the process is estimated to take at most."""
    limit: int
    """Bytes that it may take."""
    max_size: int
    """The most bytes of a map in half precision."""

    @property
    def is_reduced(self) -> bool:
        """Whether maps are made smaller than by default, to keep the limit."""
        return self.max_size < DEFAULT_MAX_SIZE


def within_limit(
    probe: Probe,
    heights: Sequence[int | None],
    views: int,
    size: int,
    representations: int,
    limit: int | None = None,
) -> Memory:
    """Estimate the memory of a comparison, and make its maps smaller if it would exceed a limit.

    `heights` are rows that the probe is averaged down to for the truth of each surface; None for
    its own. `limit` is the most bytes that the comparison may take; `default_max_memory` by
    default.
    """
    limit = default_max_memory() if limit is None else limit
    pixels = views * len(heights) * size**2
    columns = 1 + representations  # the truth comes first
    pictures = pixels * (columns * _PIXEL_KEPT + _PIXEL_MEASURED)
    pictures += len(heights) * size**2 * columns * _PIXEL_OF_SHEET
    drawing = _drawing(size)
    fixed = _PROGRAM + pictures + drawing
    own = probe.width * probe.height
    truth = max(own if each is None else 2 * each**2 for each in heights) * _PIXEL_OF_TRUTH
    # Split sums read the whole probe too.
    image = own * _PIXEL_OF_PROBE

    def needed(max_size: int) -> int:
        return fixed + image + max(truth, _MAP * max_size)

    max_size = min(DEFAULT_MAX_SIZE, (limit - fixed - image) // _MAP)
    least = needed(_LEAST_MAX_SIZE)
    if least > limit:
        raise ArgumentError(
            "max_memory",
            f"{bytes_text(limit)} is too little: the comparison takes {bytes_text(least)}, of "
            f"which pictures take {bytes_text(pictures + drawing)} and the probe "
            f"{bytes_text(image + truth)}; raise it, or lower `size`, `steps`, `source_height` or "
            "the number of views",
        )
    return Memory(needed(max_size), limit, max_size)


def check_sheet(pixels: int, size: int, held: int, limit: int | None = None) -> None:
    """Check, before it is drawn, that a sheet of spheres does not take too much memory.

    `pixels` is the number of those of the sheet. `held` is the number of bytes of the frames of a
    moving picture that are kept until it is written. `limit` is the most bytes that it may take;
    `default_max_memory` by default.
    """
    limit = default_max_memory() if limit is None else limit
    needed = _PROGRAM + pixels * _PIXEL_OF_SHEET + _drawing(size) + held
    if needed > limit:
        frames = f", of which its frames take {bytes_text(held)}" if held else ""
        cure = "`frames`, or name .mp4 or frames such as turn.%04d.png" if held else "`size`"
        raise ArgumentError(
            "max_memory",
            f"{bytes_text(limit)} is too little: the sheet takes {bytes_text(needed)}{frames}; "
            f"raise it, lower {'`size` or ' if held else ''}{cure}",
        )


def _drawing(size: int) -> int:
    return _POINT * min(size**2, _POINTS_AT_ONCE)


def _physical() -> list[int]:
    try:
        return [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    except (AttributeError, ValueError, OSError):  # not a POSIX system
        return []


def _limits() -> list[int]:
    """Return what the process and its container are limited to, if they are."""
    found = []
    for name in _CONTAINER_LIMITS:
        try:
            found.append(int(Path(name).read_text()))
        except (OSError, ValueError):  # there is none, or it is "max"
            continue
    try:
        import resource
    except ImportError:  # not a POSIX system
        return found
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return found if soft == resource.RLIM_INFINITY else [*found, soft]
