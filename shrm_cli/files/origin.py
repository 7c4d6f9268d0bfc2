"""Which files `shrm` itself has made, and for what, told from the beginning of a file."""

import mmap
import os
import struct

from shrm_cli.files.exr_header import MAGIC, header_attributes

_ATTRIBUTES = (b"shrm:representation", b"shrm:table", b"shrm:textures", b"shrm:brdf_table")
"""What maps, tables, textures for shaders and tables of BRDFs have."""
_RECIPE = b"shrm:recipe"
"""What pictures and made probes have."""
_OF_PROBE = b'{"probe"'
"""How the recipe of a made probe begins."""


def is_output(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a map, a table or a picture that `shrm` made, and so no probe.

    Only its first header is read. Made probes, converted ones, and what is left of a probe without
    its lamps are probes. So is what cannot be read: its reader says what is wrong with it.
    """
    try:
        if os.path.getsize(path) <= len(MAGIC):
            return False
        with (
            open(path, "rb") as stream,
            mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data,
        ):
            for name, _, begin, size in header_attributes(data):
                if name in _ATTRIBUTES:
                    return True
                if name == _RECIPE:
                    return not data[begin : begin + size].startswith(_OF_PROBE)
    except (OSError, IndexError, struct.error, ValueError):
        pass
    return False
