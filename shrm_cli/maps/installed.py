"""Forms of installed packages, which `registry` asks for where a name is none of `shrm` itself.

A package offers one by an entry point of the group `plugins.FORMS`, which names its description.
The `home` of that is a module with the class of the maps, and with the functions that the modules
of a form of `shrm` have: ``prefilter`` and ``report``, ``encode`` and ``decode``; ``source``,
where the description has `SHADER`; ``converted``, where other maps become such ones; and
``settings`` and ``look_up``, where it says that `choose` makes some.
"""

from collections.abc import Callable
from functools import cache, wraps
from types import ModuleType, SimpleNamespace
from typing import Any

from shrm_cli.errors import ArgumentError, MapError, PluginError, ShrmError
from shrm_cli.maps.options import SHARED, Representation
from shrm_cli.messages import explained
from shrm_cli.plugins import FORMS, installed, load, where
from shrm_cli.vocabulary import AUTO, REPRESENTATIONS

_NEEDED = "prefilter", "report", "encode", "decode"
"""The functions that every form has."""
_OFFERING = "settings", "look_up"
"""The functions that a form which is offered has besides."""


def names() -> list[str]:
    """Return the names of forms of installed packages; none is loaded."""
    return sorted(installed(FORMS).keys() - REPRESENTATIONS.keys())


@cache
def description(name: str) -> Representation:
    """Return the description of a form."""
    point = installed(FORMS).get(name)
    if point is None:
        known = ", ".join([AUTO, *REPRESENTATIONS, *names()])
        raise ArgumentError("to", f"{name!r} is none of {known}")
    found, of = load(point), where(point)
    if not isinstance(found, Representation):
        raise PluginError(f"{of} is no Representation; make it one")
    if found.name != name:
        raise PluginError(f"{of} calls itself {found.name!r}; give both one name")
    if not found.home:
        raise PluginError(f"{of} has no home; name the module that makes its maps")
    taken = [each.name for each in found.options if each.name in SHARED]
    if taken:
        raise PluginError(f"{of} has the option {taken[0]!r}, which others have; rename it")
    return found


def module(name: str, part: str) -> SimpleNamespace:
    """Return the functions of a form, among which are those of a module such as ``file``."""
    found = home(name)
    if part == "shader" and not hasattr(found, "source"):
        raise MapError(f"a map of representation {name} has no shader; look it up by shrm render")
    held = [each for each in (*_NEEDED, *_OFFERING, "source", "converted") if hasattr(found, each)]
    return SimpleNamespace(**{each: _guarded(name, getattr(found, each)) for each in held})


@cache
def home(name: str) -> ModuleType:
    """Import the module of a form, and check that it has what a form needs."""
    from importlib.metadata import EntryPoint  # slow to load, and for lists of names not needed

    described = description(name)
    place = described.home
    found: Any = load(EntryPoint(name, place, FORMS))
    for each in (*_NEEDED, *(_OFFERING if described.is_offered else ())):
        if not callable(getattr(found, each, None)):
            raise PluginError(f"the form {name!r}: {place} has no function {each}; write one")
    return found


def _guarded(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of a form, whose faults are said to be the form's."""

    @wraps(function)
    def guarded(*arguments: Any, **options: Any) -> Any:
        try:
            found = function(*arguments, **options)
        except ShrmError:
            raise
        except Exception as error:
            raise PluginError(f"the form {name!r} failed: {explained(error)}") from error
        if found is None:
            raise PluginError(f"the form {name!r} failed: {function.__name__}() returns None")
        return found

    return guarded
