"""Which files `shrm` itself has made, and for what, told from the beginning of a file."""

import os

from shrm_cli.files.exr_header import beginnings

_ATTRIBUTES = frozenset(
    ("shrm:representation", "shrm:table", "shrm:textures", "shrm:brdf_table")
)  # fmt: skip
"""What maps, tables, textures for shaders and tables of BRDFs have."""
_OF_MAPS = frozenset(("shrm:brdf", "shrm:representation"))
"""What maps alone have; of a header that is cut off the first one is there sooner."""
_RECIPE = "shrm:recipe"
"""What pictures and made probes have."""
_OF_PROBE = b'{"probe"'
"""How the recipe of a made probe begins."""


def is_output(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a map, a table or a picture that `shrm` made, and so no probe.

    Only its first header is read. Made probes, converted ones, and what is left of a probe without
    its lamps are probes. So is what cannot be read: its reader says what is wrong with it.
    """
    found = beginnings(path)
    is_picture = not found.get(_RECIPE, _OF_PROBE).startswith(_OF_PROBE)
    return is_picture or not _ATTRIBUTES.isdisjoint(found)


def says_map(path: str | os.PathLike[str]) -> bool:
    """Return whether a file's first header says, as far as it goes, that the file is a map."""
    return not _OF_MAPS.isdisjoint(beginnings(path))
