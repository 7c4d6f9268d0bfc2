"""The primaries that a PNG states outside its ICC profile, which image libraries leave out."""

import struct
from collections.abc import Iterator
from pathlib import Path

from shrm_cli.color import is_possible
from shrm_cli.vocabulary import PRIMARIES

_MAGIC = b"\x89PNG\r\n\x1a\n"
_MOST_CHUNKS = 1000
_CODES = {1: "rec709", 9: "rec2020", 11: "dci-p3", 12: "p3"}
"""Names of ColourPrimaries in ITU-T H.273 that are known here."""


def png_primaries(path: Path, has_profile: bool) -> tuple[float, ...] | None:
    """Return the primaries that the chunks of a PNG state.

    Parameters
    ----------
    path : Path
        Of any file; only a PNG states something.
    has_profile : bool
        Whether its ICC profile tells primaries, over which only ``cICP`` stands.

    Returns
    -------
    tuple of 8 float or None
        CIE x and y of red, green, blue and white.

    References
    ----------
    Portable Network Graphics (PNG) Specification, third edition, 4.3: the order of precedence is
    cICP, iCCP, sRGB, cHRM.
    """
    found = dict(_chunks(path))
    code = found.get(b"cICP", b"")
    if len(code) == 4 and code[0] in _CODES:
        return PRIMARIES[_CODES[code[0]]]
    if has_profile:
        return None
    if b"sRGB" in found:
        return PRIMARIES["rec709"]
    if len(found.get(b"cHRM", b"")) == 32:
        white_x, white_y, *others = (each / 1e5 for each in struct.unpack(">8I", found[b"cHRM"]))
        stated = (*others, white_x, white_y)
        return stated if is_possible(stated) else None
    return None


def _chunks(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Yield names and contents of the short chunks before the pixels."""
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return
        for _ in range(_MOST_CHUNKS):
            head = file.read(8)
            if len(head) < 8 or head[4:] == b"IDAT":
                return
            size = int.from_bytes(head[:4], "big")
            if size <= 32:
                yield head[4:], file.read(size)
            else:
                file.seek(size, 1)
            file.seek(4, 1)  # its checksum, which was checked when the file was opened
