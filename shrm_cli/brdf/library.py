"""The BRDF models that have a name: those of `shrm`, and those of packages that are installed.

What files record is read here, too: specifications that hold names of models alone.

A package offers one by an entry point of the group ``shrm.brdf``, whose name is that of the model
and whose value is a subclass of `shrm_cli.brdf.base.Brdf`. What is not of `shrm` is checked before
it is used, so that each mistake is one clear line.

The folders of `shrm`, in which each module is one BRDF, need no list of these: the names are those
of the files, so that they are known without loading any of them.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.brdf.base import COMMA, Brdf, Parameter, Value, check_number, cut, inside, suggestion
from shrm_cli.brdf.sums import is_sum, parse_sum
from shrm_cli.color import Primaries, from_rec709
from shrm_cli.errors import BrdfError, PluginError
from shrm_cli.vocabulary import CENTERS

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PACKAGE = "shrm_cli.brdf."
"""What the names of the modules of all BRDFs of `shrm` itself begin with."""
MODELS = "shrm_cli.brdf.models"
LAYERED = "shrm_cli.brdf.layered"


def module_names(package: str) -> list[str]:
    """Names of the BRDFs of a package in alphabetical order: its modules, with hyphens.

    `package` is its full name; packages within it are left out.
    """
    return list(_module_names(tuple(importlib.import_module(package).__path__)))


@cache
def _module_names(places: tuple[str, ...]) -> tuple[str, ...]:
    modules = [found.name for found in pkgutil.iter_modules(places) if not found.ispkg]
    return tuple(sorted(name.replace("_", "-") for name in modules))


def load_class(package: str, name: str) -> type[Brdf]:
    """Load one module of a package, and return its BRDF: the class that calls itself `name`."""
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


def foreign_parts(brdf: Brdf) -> list[Brdf]:
    """Return what is not of this package of a BRDF: itself, and those that it is made of."""
    found: list[Brdf] = []
    pending: list[object] = [brdf]
    while pending:
        part = pending.pop()
        if isinstance(part, tuple | list):
            pending += part
        elif isinstance(part, Brdf):
            found += [] if is_built_in(type(part)) else [part]
            pending += vars(part).values()
    return found


def foreign_modules(brdf: Brdf) -> set[str]:
    """Return the names of modules, none of this package, of a BRDF and of those it is made of."""
    return {type(part).__module__ for part in foreign_parts(brdf)}


def built_in_names() -> list[str]:
    """Names of the models of `shrm`, in the order of the alphabet; none is loaded."""
    return sorted(module_names(MODELS) + module_names(LAYERED))


def model_names() -> list[str]:
    """Names of all models, in the order of the alphabet; none is loaded."""
    return sorted({*built_in_names(), *_installed()})


def find_model(name: str) -> type[Brdf]:
    """Load the model of that name, and no other. The names of `shrm` itself come first."""
    for package in (MODELS, LAYERED):
        if name in module_names(package):
            return load_class(package, name)
    installed = _installed()
    if name in installed:
        return _load(installed[name])
    raise BrdfError(f"no BRDF is called {name!r}; {_instead_of(name)}")


_EVERYDAY = {
    **dict.fromkeys(("chrome", "metal", "mirror"), "ggx:roughness=0.1"),
    **dict.fromkeys(("diffuse", "matte"), "lambertian:albedo=0.8"),
    **dict.fromkeys(("disney", "plastic", "principled", "standard"), "openpbr"),
    **dict.fromkeys(("cloth", "fabric", "sheen", "velvet"), "charlie:roughness=0.5"),
}
"""Specifications of what a material is called by who does not know the models yet."""


def _instead_of(name: str) -> str:
    """Return what to write in place of a name that no model has."""
    from shrm_cli.brdf.vectors import METALS  # many models need nothing of it

    lower = name.lower()
    if lower in METALS:
        return f"take ggx:roughness=0.3,f0={lower}"
    if lower in _EVERYDAY:
        return f"take {_EVERYDAY[lower]}"
    model, *rest = re.split(r"[\s(]+", lower, maxsplit=1)
    if rest and model in model_names():
        return f"parameters follow a colon: {model}:{rest[0].rstrip(') ')}"
    return suggestion(name, model_names())


def all_models() -> tuple[list[type[Brdf]], list[str]]:
    """Load every model.

    Returns `models`, in the order of the alphabet; and `problems`, a line for each model of an
    installed package that cannot be used.
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

    `found` is what has the name that the user gave. `where` is where it is, for the messages:
    ``mine.py: Mine``.
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


def check_given(brdf: Brdf) -> None:
    """Check what is not of `shrm` of a BRDF that was passed to a function, once."""
    for part in foreign_parts(brdf):
        from shrm_cli.brdf.foreign import check_instance  # most BRDFs are of `shrm`

        where = type(part).__name__
        check_instance(part, where)
        checked_model(type(part), where)


def parse_recorded(
    spec: str,
    open_file: Callable[[str], Brdf | None] = lambda term: None,
    primaries: Primaries | None = None,
) -> Brdf:
    """The BRDF of a specification that a file records, which may come from anywhere.

    No part of it is taken for a path, and none for code: terms are names of models, or whatever
    the caller knows to be files.

    `open_file` returns the measured BRDF that a term stands for, or None where it is the name of a
    model, which all of them are by default. `primaries` are the chromaticities that the colors of
    metals are converted to; those of Rec.709 by default.
    """

    def parse(term: str) -> Brdf:
        return parse_recorded(term, open_file, primaries)

    if is_sum(spec):
        return parse_sum(spec, parse)
    found = open_file(spec.strip())
    return of_model(spec, primaries, parse) if found is None else found


def of_model(spec: str, primaries: Primaries | None, parse: Callable[[str], Brdf]) -> Brdf:
    """The BRDF of a model that has a name, and of the values after it."""
    name, colon, rest = spec.strip().partition(":")
    model = find_model(name)
    check_number(spec)
    values: dict[str, Any] = given_values(spec, rest) if colon else {}
    values = {key: _converted(model, key, each, primaries) for key, each in values.items()}
    for each in model.parameters:
        if each.is_brdf and each.name in values:
            values[each.name] = parse(inside(each.name, values[each.name]))
    if is_built_in(model):
        return model(**values)
    from shrm_cli.brdf.foreign import make_checked

    return make_checked(model, values, name)


def given_values(spec: str, text: str) -> dict[str, Value]:
    """The values of ``key=value,key=value``."""
    values: dict[str, Value] = {}
    for part in cut(COMMA, text):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not key:
            raise BrdfError(f"{spec!r}: expected key=value, got {part!r}")
        if key in values:
            raise BrdfError(f"{spec!r}: {key} is given twice")
        values[key] = _value(value)
    return values


def _converted(model: type[Brdf], key: str, value: Value, primaries: Primaries | None) -> Value:
    """A value, or, where it is the name of a color, that color in the probe's primaries."""
    matrix = from_rec709(primaries)
    for parameter in model.parameters if matrix is not None and isinstance(value, str) else ():
        if parameter.name == key and value in parameter.names:
            color = matrix @ np.asarray(parameter.names[str(value)])
            return [float(each) for each in np.clip(color, parameter.minimum, parameter.maximum)]
    return value


def _value(text: str) -> Value:
    """A number, the numbers between slashes, or the text itself; the parameter judges it."""
    try:
        numbers = [float(part) for part in text.split("/")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else numbers[0]


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
