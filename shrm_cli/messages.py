"""What messages show of arguments, foreign errors and addresses; arguments that are refused.

Errors and warnings have arguments in backticks. On the command line they are flags; in light files,
manifests and scenes they are keys, which no flag stands for.

An address may let in whoever reads it: by a password before its server, by a signature in its
query, as S3, Google and Azure make them, or by a token after ``#``. Terminals are recorded, logs
are kept, and files are sent to others, so that none of these may be in them: all that is printed or
written goes through `shown`.
"""

import functools
import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from itertools import repeat
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin

from shrm_cli.errors import ArgumentError

Function = TypeVar("Function", bound=Callable[..., Any])

ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)(=False)?`")
"""An argument in a message: its name, and whether it is false."""


def as_keys(message: object) -> str:
    """Return a message about arguments as one about keys of TOML, 'size' or 'split = false'.

    `message` is an error of the library, or its text. It names `size` and `split=False` in
    backticks.
    """
    return ARGUMENT.sub(
        lambda found: f"'{found[1]} = false'" if found[2] else f"'{found[1]}'", str(message)
    )


def printable(text: str) -> str:
    """Return a text with question marks for what cannot be printed, such as line breaks."""
    return "".join(each if each.isprintable() else "?" for each in text)


def short_repr(value: object) -> str:
    """Return a value as messages show it: in one line, and not for long."""
    return f"{' '.join(repr(value).split()):.80}"


def percent(part: float) -> str:
    """Return a part of 1 as a percentage of two digits, and of all that are before the point.

    What is less than a hundredth of one percent is said to be: nobody reads powers of ten.
    """
    if 0 < part < 1e-4:
        return "<0.01"
    return f"{100 * part:.2g}" if part < 0.995 else f"{100 * part:.0f}"


def predicted_error(said: Mapping[str, Any]) -> float | None:
    """Return the error that is predicted of a map, but for look-ups, if one is.

    `said` are numbers that ``shrm prefilter --json`` prints. Where lamps are beside the map it is
    often theirs, for little else is missing then.
    """
    if said.get("predicted_error") is None:
        return None
    causes = "predicted_error", "added_error", "lamp_error"
    return math.hypot(*(said.get(each) or 0.0 for each in causes))


def explained(error: BaseException, path: str | None = None) -> str:
    """An error of foreign code in one line, with the last line of the file that took part in it."""
    import traceback  # slow to load, and rarely needed

    words = f"{type(error).__name__}: {error}".rstrip(": ")
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path is not None and frame.filename == path]
    place = f"line {lines[-1]}: " if lines else ""
    return place + " ".join(words.split())


SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+)://")
"""The start of a URL. A single letter before the colon is a drive of Windows."""
_HIDDEN = "***"
_START = r"[A-Za-z][A-Za-z0-9+.-]{1,30}:/{1,3}"
"""The start of a URL. A single letter before the colon is a drive of Windows, and names that were
paths for a while have one slash."""
_URL = re.compile(rf"((?<![A-Za-z0-9+.-]){_START})([^\s\"'<>]*)")
_AFTER = ".,:;)]}"
"""Signs of the text around a URL, where they end it."""
# The next three are compiled where they are used, because few runs have such texts.
_NAMED = (
    r"(?i)((?:^|[\s?&;,(\"'{])[\"']?(?:x-(?:amz|goog)-(?:signature|credential|security-token)|sig"
    r"|signature|awsaccesskeyid|googleaccessid|key-pair-id|policy|token|access_?token|auth_?token"
    r"|sas_?token|api_?key|passwo?r?d|secret|client_secret)[\"']?\s?[=:]\s?[\"']?)[^\s&;\"'<>,)}]+"
)
"""Values that let in, in texts that leave out the address that they belong to."""
_BARE_LOGIN = r"[^/\s:'\"]{1,100}:[^/\s'\"]{0,400}@(?=[\w.-])"
_BARE_QUERY = r"\?(?!\.\.\.)[^\s?=]{0,100}=[^\s'\"]*"


def is_remote(name: str | os.PathLike[str]) -> bool:
    """Whether a name is a URL, such as ``s3://bucket/a.exr``, and not a path."""
    return SCHEME.match(os.fspath(name)) is not None


def is_url(path: str | os.PathLike[str]) -> bool:
    """Whether a path was a URL before it was taken for a path, which leaves it one slash."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]+:/", os.fspath(path)) is not None


def shown(text: str) -> str:
    """Return a text as it may be printed or written: no URL in it lets anybody in.

    What stands before the server is three stars, and the query is three dots: what it signs is
    nothing that a reader needs. A text without a URL stays as it is.
    """
    return _URL.sub(_shown, text) if ":/" in text else text


def without_name(reason: str, name: str) -> str:
    """Return what a message says of a file behind its name, which the caller prints itself."""
    return reason.removeprefix(f"{name}: ").removeprefix(f"{shown(name)}: ")


def shown_reason(text: str) -> str:
    """Return what a library says of a URL, of which it may have left out any part."""
    text = re.sub(_BARE_LOGIN, f"{_HIDDEN}@", shown(text))
    return re.sub(_NAMED, rf"\1{_HIDDEN}", re.sub(_BARE_QUERY, "?...", text))


def shown_values(value: Any) -> Any:
    """Return a value as JSON has them, with all its texts as `shown` returns them."""
    if isinstance(value, str):
        return shown(value)
    if isinstance(value, dict):
        return {shown_values(key): shown_values(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [shown_values(each) for each in value]
    return value


def has_secret(text: str) -> bool:
    """Whether a text holds a URL that lets in whoever reads it."""
    return shown(text) != text


def without_query(url: str) -> str:
    """Return a URL as far as it names a file: without login, query and what follows ``#``.

    A path stays as it is.
    """
    match = re.match(_START, url)
    if match is None:
        return url
    rest = url[match.end() :]
    return match[0] + _cut(rest[_login(rest) :], match[0])[0]


def _shown(match: re.Match[str]) -> str:
    start, rest = match.groups()
    length = _login(rest)
    name, query = _cut(rest[length:], start)
    after = query[len(query.rstrip(_AFTER)) :]
    if query[1 : len(query) - len(after)]:  # one that was hidden already is dots, and stays
        query = f"{query[0]}...{after}"
    return f"{start}{_HIDDEN}@{name}{query}" if length else f"{start}{name}{query}"


def _login(rest: str) -> int:
    """Return how many characters of a URL, after its start, stand before the server.

    A user or a password, or both. One may hold a slash by mistake, so that what looks like a port
    is none.
    """
    server = re.split("[/?#]", rest, maxsplit=1)[0]
    if "@" in server:
        return server.rindex("@") + 1
    port = server.partition(":")[2]
    if ":" not in server or not port.strip(_AFTER) or port.strip(_AFTER).isdigit():
        return 0
    return re.split("[?#]", rest, maxsplit=1)[0].rfind("@") + 1


def _cut(rest: str, start: str) -> tuple[str, str]:
    """Return a URL without its start up to its query, and the query with its first sign.

    A question mark is one of a pattern, unless there is a web server or a value behind it.
    """
    found = re.search("[?#]", rest)
    if found is None or not (start.lower().startswith("http") or "=" in rest[found.end() :]):
        return rest, ""
    return rest[: found.start()], rest[found.start() :]


def whole_number(argument: str, value: object, low: int, high: int) -> int:
    """Return a whole number within limits, as Python's; else raise an `ArgumentError`."""
    number = value if isinstance(value, int) else getattr(value, "__index__", lambda: None)()
    if number is None or isinstance(value, bool) or not low <= number <= high:
        asked = f"give a whole number of {low} .. {high}"
        raise ArgumentError(argument, f"is {short_repr(value)}; {asked}")
    return int(number)


def several(given: Any, needed: str = "") -> list[Any]:
    """Return what was given as a list, where one of what may be several stands for itself.

    `needed` is the name of the argument, where there has to be one at least.
    """
    is_one = isinstance(given, str) or not isinstance(given, Iterable)
    found = [given] if is_one else list(given)
    if needed and not found:
        raise ArgumentError(needed, "are none; name one at least")
    return found


def first_of(names: Sequence[str], most: int) -> str:
    """The first of some names, and how many more there are: ``a, b and 3 more``."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more:,} more" if more > 0 else "")


def check_names(names: Sized, maps: Sized) -> None:
    """Raise an `ArgumentError` unless there are as many names as maps."""
    if len(names) != len(maps):
        raise ArgumentError("names", f"are {len(names)} of {len(maps)} maps; give one for each")


def refuse_arguments(what: str, **values: object) -> None:
    """Raise an `ArgumentError`, if an argument is given, not None, that would change nothing.

    The message says that it does not apply to `what`, such as ``"a map of representation she"``.
    """
    for name, value in values.items():
        if value is not None:
            raise ArgumentError(name, f"does not apply to {what}")


# ---- arguments of the library, whose kinds are those that their annotations name -----------------

_NAMED_KINDS = {
    NoneType: "",
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "text",
    os.PathLike: "a path",
    Callable: "a function",
    Mapping: "a mapping",
    Sequence: "a list",
    tuple: "a list",
}


def strict(function: Function) -> Function:
    """Return a function that refuses arguments of a wrong kind before it does anything.

    An argument that it does not have, one that it lacks, and one whose value is not what its
    annotation says raise an `ArgumentError`. Numbers may be those of numpy, and sequences may be
    any iterables; NaN, True and False are no numbers.
    """

    @functools.wraps(function)
    def refusing(*values: Any, **named: Any) -> Any:
        check_call(function, *values, **named)
        return function(*values, **named)

    refusing.__module__ = __package__  # where pickle finds it
    return cast(Function, refusing)


def check_call(function: Callable[..., Any], /, *values: Any, **named: Any) -> None:
    """Raise an `ArgumentError` where a function would not be called as its signature says."""
    signature = inspect.signature(function, eval_str=True)
    known = signature.parameters
    given = _bound(function, signature, values, named)
    for name, value in given.items():
        if known[name].kind is not inspect.Parameter.VAR_KEYWORD:
            check_kind(name, value, known[name].annotation)


def known_arguments(function: Function) -> Function:
    """Return a function that refuses arguments that it does not have in an `ArgumentError`."""

    @functools.wraps(function)
    def refusing(*values: Any, **named: Any) -> Any:
        _bound(function, inspect.signature(function), values, named)
        return function(*values, **named)

    return cast(Function, refusing)


def _bound(
    function: Callable[..., Any],
    signature: inspect.Signature,
    values: Sequence[Any],
    named: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the arguments of a call by their names."""
    known = [each for each in signature.parameters if each != "cls"]
    try:
        return signature.bind(*values, **named).arguments
    except TypeError as error:
        names = ", ".join(f"`{each}`" for each in known)
        for name in sorted(named.keys() - {*known}):
            of = f"is no argument of {function.__name__}, which takes {names}"
            raise ArgumentError(name, of) from None
        raise ArgumentError(function.__name__, f"takes {names}: {error}") from None


def check_fields(record: Any) -> None:
    """Raise an `ArgumentError` where a field of a record is not what its annotation says."""
    for name, kind in inspect.get_annotations(type(record), eval_str=True).items():
        check_kind(name, getattr(record, name), kind)


def check_kind(argument: str, value: object, kind: Any) -> None:
    """Raise an `ArgumentError` for a value that is not of a kind, which is an annotation."""
    if not _is_of(value, kind):
        words = [word for each in _alternatives(kind) if (word := _words(each))]
        wanted = "numbers" if _is_array(kind) else " or ".join(dict.fromkeys(words))
        hint = "; give pixels to Probe.from_array" if hasattr(value, "dtype") else ""
        is_path = os.PathLike[str] in _alternatives(kind)
        raise ArgumentError(argument, f"{short_repr(value)} is not {wanted}{hint * is_path}")


def _alternatives(kind: Any) -> tuple[Any, ...]:
    """Return the kinds of which a value may be any."""
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _is_array(kind: Any) -> bool:
    """Whether a kind is numpy's `ArrayLike`, which alone lists complex numbers."""
    return complex in _alternatives(kind)


def _is_of(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind."""
    if kind in (Any, inspect.Parameter.empty):
        return True
    if value is None:
        return NoneType in _alternatives(kind)
    if _is_array(kind):
        return _holds_numbers(value)
    origin, inside = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return any(_is_of(value, each) for each in inside)
    if origin is Literal:
        return isinstance(value, str) and value in inside
    if origin in (tuple, Sequence):
        return _is_listed(value, inside, has_length=origin is tuple and Ellipsis not in inside)
    is_flag = type(value).__name__ in ("bool", "bool_")
    if kind in (float, int):
        has_digits = hasattr(value, "__float__" if kind is float else "__index__")
        # A NaN is not equal to itself.
        is_number = has_digits and not is_flag and not getattr(value, "ndim", 0) and value == value
        return is_number and (kind is int or _is_double(value))
    return is_flag if kind is bool else isinstance(value, origin or kind)


def _is_double(value: Any) -> bool:
    """Whether a number is not beyond the doubles, as whole numbers of hundreds of digits are."""
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_listed(value: Any, kinds: tuple[Any, ...], has_length: bool) -> bool:
    """Whether values are listed that are each of its kind, or, without a length, of the first."""
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    if not isinstance(value, Sized):  # an iterator can be looked through only once
        return not has_length
    if getattr(value, "ndim", 1) == 0 or (has_length and len(value) != len(kinds)):
        return False
    return all(map(_is_of, value, kinds if has_length else repeat(kinds[0])))


def _holds_numbers(value: Any) -> bool:
    """Whether numpy makes an array of numbers of a value."""
    import numpy as np  # --help does without

    try:
        return np.asarray(value).dtype.kind in "biuf"
    except ValueError:  # rows of different lengths
        return False


def _words(kind: Any) -> str:
    """Return a kind in words; nothing for None."""
    origin, inside = get_origin(kind) or kind, get_args(kind)
    if origin is Literal:
        return f"one of {', '.join(inside)}"
    if origin is tuple and Ellipsis not in inside:
        return f"{len(inside)} {'numbers' if {*inside} <= {int, float} else 'values'}"
    name = getattr(origin, "__name__", str(origin))
    return _NAMED_KINDS.get(origin, f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}")
