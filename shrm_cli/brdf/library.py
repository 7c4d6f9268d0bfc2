"""The BRDF models that have a name: those of `shrm`, and those of packages that are installed.

A package offers one by an entry point of the group ``shrm.brdf``, whose name is that of the model
and whose value is a subclass of `shrm_cli.brdf.base.Brdf`.

The folders of `shrm`, in which each module is one BRDF, need no list of these: the names are those
of the files, so that they are known without loading any of them.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING

from shrm_cli.brdf.base import Brdf, suggestion
from shrm_cli.errors import BrdfError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PACKAGE = "shrm_cli.brdf."
"""What the names of the modules of all BRDFs of `shrm` itself begin with."""
MODELS = "shrm_cli.brdf.models"
GROUP = "shrm.brdf"


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


def built_in_names() -> list[str]:
    """Names of the models of `shrm`, in the order of the alphabet; none is loaded."""
    return module_names(MODELS)


def model_names() -> list[str]:
    """Names of all models, in the order of the alphabet; none is loaded."""
    return sorted({*built_in_names(), *_installed()})


def find_model(name: str) -> type[Brdf]:
    """Load the model of that name, and no other. The names of `shrm` itself come first.

    Raises
    ------
    BrdfError
        If there is none, and then names that look like it are suggested; or if an installed
        package has one that cannot be used.
    """
    if name in built_in_names():
        return load_class(MODELS, name)
    installed = _installed()
    if name in installed:
        return _load(installed[name])
    raise BrdfError(f"no BRDF is called {name!r}; {suggestion(name, model_names())}")


def all_models() -> tuple[list[type[Brdf]], list[str]]:
    """Load every model.

    Returns
    -------
    models : list of Brdf classes
        In the order of the alphabet.
    problems : list of str
        A line for each model of an installed package that cannot be used.
    """
    models, problems = [], []
    for name in model_names():
        try:
            models.append(find_model(name))
        except BrdfError as error:
            problems.append(str(error))
    return models, problems


def _installed() -> dict[str, EntryPoint]:
    """Entry points by name; of several with the same name the first that is found."""
    import importlib.metadata  # slow to load, and rarely needed

    found: dict[str, EntryPoint] = {}
    for each in importlib.metadata.entry_points(group=GROUP):
        found.setdefault(each.name, each)
    return found


def _load(point: EntryPoint) -> type[Brdf]:
    from shrm_cli.brdf.python_file import checked_model, explained

    where = f"{point.name}: the entry point {point.value!r}"
    if point.dist is not None:
        where += f" of the package {point.dist.name}"
    try:
        found = point.load()
    except (Exception, SystemExit) as error:
        raise BrdfError(f"{where} cannot be loaded: {explained(error)}") from error
    model = checked_model(found, where)
    if model.name != point.name:
        raise BrdfError(f"{where} is a BRDF that calls itself {model.name!r}; give both one name")
    return model
