"""Packages in which each module is one BRDF: what they hold, without a list that names it.

The names are those of the files, so that they are known without loading any of them.
"""

import importlib
import pkgutil
from functools import cache

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import BrdfError

PACKAGE = "shrm_cli.brdf."
"""What the names of the modules of all BRDFs of `shrm` itself begin with."""


def module_names(package: str) -> list[str]:
    """Names of the BRDFs of a package, in the order of the alphabet.

    Parameters
    ----------
    package : str
        Its full name; packages within it are left out.

    Returns
    -------
    list of str
        The names of the modules, with hyphens in the place of underscores.
    """
    return list(_module_names(tuple(importlib.import_module(package).__path__)))


@cache
def _module_names(places: tuple[str, ...]) -> tuple[str, ...]:
    modules = [found.name for found in pkgutil.iter_modules(places) if not found.ispkg]
    return tuple(sorted(name.replace("_", "-") for name in modules))


def load_class(package: str, name: str) -> type[Brdf]:
    """Load one module of a package, and return its BRDF: the class that calls itself `name`.

    Raises
    ------
    BrdfError
        If the module holds none of that name, or several.
    """
    module = importlib.import_module(f"{package}.{name.replace('-', '_')}")
    found = [each for each in brdf_classes(module) if each.name == name]
    if len(found) != 1:
        raise BrdfError(f"{module.__name__}: holds {len(found)} BRDFs called {name!r}, not one")
    return found[0]


def brdf_classes(module: object) -> list[type[Brdf]]:
    """The BRDFs that a module defines itself, in the order in which it does."""
    mine = getattr(module, "__name__", None)
    return [
        each
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, Brdf) and each.__module__ == mine
    ]


def is_built_in(model: type[Brdf]) -> bool:
    """Whether the code of a BRDF is part of this package."""
    return model.__module__.startswith(PACKAGE)
