"""What readers of materials return and say."""

from collections.abc import Sequence
from typing import Any

from shrm_cli.errors import BrdfError
from shrm_cli.records import record

_LISTED = 12


@record
class Material:
    """A material as a file has it."""

    surface: str
    """One of `surfaces.SURFACES`."""
    values: dict[str, Any]
    """Numbers, and colors in linear Rec.709."""
    averaged: list[str]
    """The textures whose mean is in the values."""
    left_out: list[str]
    """What is not read."""


def chosen(name: str, names: Sequence[str], wanted: str) -> int:
    """The place of a material among those of a file, by its name or else by its number.

    Raises BrdfError if there is none, or several and none is named.
    """
    if wanted in names and wanted:
        return names.index(wanted)
    if wanted.isascii() and wanted.isdigit() and int(wanted[:9]) < len(names):
        return int(wanted)
    if not names:
        raise BrdfError(f"{name}: it has no material that can be read; name another file")
    if not wanted and len(names) == 1:
        return 0
    listed = ", ".join(each or str(k) for k, each in enumerate(names[:_LISTED]))
    more = ", ..." if len(names) > _LISTED else ""
    what = f"no material is called {wanted[:40]!r}" if wanted else "it has several materials"
    raise BrdfError(f"{name}: {what}; name one after a '#': {listed}{more}")
