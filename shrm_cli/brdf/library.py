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

from shrm_cli.brdf.base import Brdf, Parameter, suggestion
from shrm_cli.errors import BrdfError, PluginError
from shrm_cli.vocabulary import CENTERS

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PACKAGE = "shrm_cli.brdf."
"""What the names of the modules of all BRDFs of `shrm` itself begin with."""
MODELS = "shrm_cli.brdf.models"
LAYERED = "shrm_cli.brdf.layered"


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
    return sorted(module_names(MODELS) + module_names(LAYERED))


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
    for package in (MODELS, LAYERED):
        if name in module_names(package):
            return load_class(package, name)
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


def checked_model(found: object, where: str) -> type[Brdf]:
    """What a file or a package calls a BRDF, if it is one.

    Parameters
    ----------
    found : object
        What has the name that the user gave.
    where : str
        Where it is, for the messages: ``mine.py: Mine``.

    Raises
    ------
    BrdfError
        If it is no subclass of `Brdf`, lacks `evaluate`, or says impossible things of itself.
    """
    if not (isinstance(found, type) and issubclass(found, Brdf)):
        raise BrdfError(f"{where} is not a subclass of Brdf; make it one")
    if getattr(found, "__abstractmethods__", None):
        raise BrdfError(f"{where} has no method evaluate(self, light, view); write one")
    if found.center not in CENTERS:
        raise BrdfError(f"{where} has the center {found.center!r}; known: {', '.join(CENTERS)}")
    if not all(isinstance(each, Parameter) for each in found.parameters):
        raise BrdfError(f"{where} has parameters that are no Parameter(name, default, ...)")
    texts = {"name": found.name, "summary": found.summary, "source": found.source}
    for key, text in texts.items():
        if not isinstance(text, str):
            raise BrdfError(f"{where} has a {key} that is no text")
    return found


def _installed() -> dict[str, EntryPoint]:
    from shrm_cli.plugins import BRDFS, installed  # rarely needed

    return installed(BRDFS)


def _load(point: EntryPoint) -> type[Brdf]:
    from shrm_cli.plugins import load, where

    try:
        model = checked_model(load(point), where(point))
    except PluginError as error:
        raise BrdfError(str(error)) from error
    if model.name != point.name:
        raise BrdfError(
            f"{where(point)} is a BRDF that calls itself {model.name!r}; give both one name"
        )
    return model
