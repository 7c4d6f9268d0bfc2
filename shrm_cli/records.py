"""Frozen dataclasses that are made in a twentieth of the time.

`dataclasses.dataclass` writes the source of each method for each class and compiles it, half a
millisecond a class. A short run loads some fifty classes, so that this was a tenth of it. The
methods here are the same functions for all classes, and look at the class's fields as they run.

`Displayed` is the base of those that notebooks show.
"""

import copy
import dataclasses
import functools
import importlib
import itertools
from collections.abc import Callable, Iterator
from dataclasses import MISSING, FrozenInstanceError, field
from typing import Any, Generic, TypeVar, cast, dataclass_transform, overload

from shrm_cli.errors import ArgumentError

Class = TypeVar("Class", bound=type)
Item = TypeVar("Item")
Method = TypeVar("Method", bound=Callable[..., Any])

MOST_NUMBERS = 12
"""The numbers of an array that the text of a record shows one by one."""


@overload
def record(cls: Class, /) -> Class: ...
@overload
def record(*, eq: bool = True) -> Callable[[Class], Class]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(cls: Any = None, /, *, eq: bool = True) -> Any:
    """Make a class a frozen dataclass, for `dataclasses.replace`, `fields` and `asdict` too.

    `cls` is a class with annotated fields, as of `dataclasses.dataclass`. `eq` tells whether two
    instances are compared, and hashed, by their fields; if not, an instance is equal to itself
    only.
    """
    if cls is None:
        return lambda found: _finished(found, eq)
    return _finished(cls, eq)


def once_each(method: Method) -> Method:
    """Return a method that is called once for each of its arguments, by each instance."""

    @functools.wraps(method)
    def found(self: Any, *arguments: Any, **named: Any) -> Any:
        known = self.__dict__.setdefault(f"{method.__name__} of", {})
        what = (*arguments, *named.items())
        if what not in known:
            known[what] = method(self, *arguments, **named)
        return known[what]

    return cast(Method, found)


class Replayed(Generic[Item]):
    """The items of an iterator, each found once, however often they are gone through."""

    def __init__(self, items: Iterator[Item]) -> None:
        (self._items,) = itertools.tee(items, 1)

    def __iter__(self) -> Iterator[Item]:
        return copy.copy(self._items)


def handed_on(within: str, name: str) -> Any:
    """Return the property that is the one of a name of what an object has within it."""
    return property(lambda self: getattr(getattr(self, within), name))


def _finished(cls: type, eq: bool) -> type:
    dataclasses.dataclass(init=False, repr=False, eq=False)(cls)
    own: list[tuple[str, Any]] = [("__setattr__", _refuse_to_set), ("__delattr__", _refuse_to_drop)]
    own += [("__init__", _initializer(cls)), ("__repr__", _text)]
    if eq:
        own += _comparisons(cls)
    own.append(("__signature__", _Signature()))
    for name, method in own:
        if name not in cls.__dict__ or (name, cls.__dict__[name]) == ("__hash__", None):
            setattr(cls, name, method)
    return cls


def _initializer(cls: type) -> Callable[..., None]:
    """Return an `__init__` that takes the class's fields, by position or by name."""
    given = [each for each in dataclasses.fields(cls) if each.init]
    places = [each.name for each in given if not each.kw_only]
    names = frozenset(each.name for each in given)
    defaults = [
        (each.name, each.default, each.default_factory)
        for each in dataclasses.fields(cls)
        if each.default is not MISSING or each.default_factory is not MISSING
    ]
    needed = [
        each.name for each in given if each.default is MISSING and each.default_factory is MISSING
    ]
    finish = hasattr(cls, "__post_init__")

    def __init__(self: Any, *values: Any, **named: Any) -> None:
        kept = self.__dict__
        kept.update(zip(places, values))  # noqa: B905 (that there are too many is told below)
        kept.update(named)
        if len(values) > len(places) or len(kept) != len(values) + len(named):
            raise ArgumentError(cls.__name__, "is given a field twice, or too many")
        if not names.issuperset(named):
            unknown = min(named.keys() - names)
            raise ArgumentError(unknown, f"is no field of {cls.__name__}: {', '.join(places)}")
        for name in needed:
            if name not in kept:
                raise ArgumentError(name, f"of {cls.__name__} is missing")
        for name, default, make in defaults:
            if name not in kept:
                kept[name] = default if make is MISSING else make()
        if finish:
            self.__post_init__()

    __init__.__qualname__ = f"{cls.__qualname__}.__init__"
    return __init__


class _Signature:
    """The signature of a class, which `help` and editors ask for; it is worked out only then."""

    def __get__(self, instance: object, cls: type) -> Any:
        from inspect import Parameter, Signature

        found = []
        for each in dataclasses.fields(cls):
            kind = Parameter.KEYWORD_ONLY if each.kw_only else Parameter.POSITIONAL_OR_KEYWORD
            is_optional = each.default is not MISSING or each.default_factory is not MISSING
            default = each.default if is_optional else Parameter.empty
            if each.init:
                found.append(Parameter(each.name, kind, default=default, annotation=each.type))
        return Signature(sorted(found, key=lambda each: each.kind))


def _comparisons(cls: type) -> list[tuple[str, Any]]:
    """Return the methods that compare instances by the fields that count for it."""
    names = [each.name for each in dataclasses.fields(cls) if each.compare]

    def values(self: Any) -> list[Any]:
        return [getattr(self, name) for name in names]

    def __eq__(self: Any, other: object) -> Any:
        return values(self) == values(other) if type(other) is type(self) else NotImplemented

    def __hash__(self: Any) -> int:
        return hash(tuple(values(self)))

    return [("__eq__", __eq__), ("__hash__", __hash__)]


def _text(self: Any) -> str:
    shown = [each.name for each in dataclasses.fields(self) if each.repr]
    inside = ", ".join(f"{name}={_shown(getattr(self, name))}" for name in shown)
    return f"{type(self).__qualname__}({inside})"


def _shown(value: Any) -> str:
    """Return a value as text, and an array of many numbers as its shape."""
    if getattr(value, "size", 0) > MOST_NUMBERS and hasattr(value, "dtype"):
        return f"<{' x '.join(map(str, value.shape))} {value.dtype}>"
    if type(value) is tuple:  # such as the levels of a split sum
        inside = [_shown(each) for each in value]
        return f"({', '.join(inside)}{',' * (len(inside) == 1)})"
    return repr(value)


def _refuse_to_set(self: Any, name: str, value: object) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_drop(self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


class Displayed:
    """The base of what notebooks show as a picture with numbers, see `shrm_cli.notebook`."""

    def _repr_html_(self) -> str:
        """Return what IPython shows at the end of a cell."""
        # The module that draws is loaded when a notebook asks.
        return importlib.import_module("shrm_cli.notebook").html(self)
