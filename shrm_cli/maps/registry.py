"""Finding the modules that make, write and read each representation.

No module is loaded before it is needed.
"""

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

from shrm_cli.vocabulary import AUTO, REPRESENTATIONS

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.maps.options import Representation


def module(representation: str, name: str) -> ModuleType:
    """Load a module of a representation's folder, such as ``file``.

    Parameters
    ----------
    representation : str
        One of `vocabulary.REPRESENTATIONS`.
    name : str
        One of the names that the docstring of `shrm_cli.maps.base` lists.
    """
    folder = REPRESENTATIONS[representation].partition(".")[0]
    return importlib.import_module(f"shrm_cli.maps.{folder}.{name}")


def map_class(representation: str) -> "type[Map]":
    """Return the class of the maps of a representation."""
    defining = importlib.import_module(f"shrm_cli.maps.{REPRESENTATIONS[representation]}")
    for candidate in vars(defining).values():
        if isinstance(candidate, type) and candidate.__module__ == defining.__name__:
            named: type[Map] = candidate
            if getattr(named, "representation", None) == representation:
                return named
    raise LookupError(f"{defining.__name__} has no map of representation {representation!r}")


def description(representation: str) -> "Representation":
    """Return the description of a representation and its options, without loading numpy.

    ``auto`` has one too, though it is none.
    """
    if representation == AUTO:
        from shrm_cli.maps.options import AUTOMATIC

        return AUTOMATIC
    found: Representation = module(representation, "options").DESCRIPTIONS[representation]
    return found


def descriptions() -> "dict[str, Representation]":
    """Return the descriptions of all representations, in the order of the vocabulary."""
    return {name: description(name) for name in REPRESENTATIONS}
