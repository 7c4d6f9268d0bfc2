"""Parameter types of the command line, and what the shell completes of them.

This module imports nothing heavy, because `shrm --help` loads it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli import vocabulary
from shrm_cli.maps.options import Option, parse_bytes
from shrm_cli.vocabulary import MAX_LEVELS, MAX_PICTURE_SIZE, MAX_STOPS, MOST_DEGREES, PRIMARIES

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


_START = re.compile(r"(?:^|\+|=\()(?:[0-9.eE+-]*\*)?")
"""Where terms begin: with a weight, after a plus or in the parentheses of a value."""


class Parsed(click.ParamType):  # type: ignore[type-arg]  # click's type is generic since 8.5 only
    """A type whose texts a function reads; what is no text, such as a default, is a value already.

    `name` is what the help calls it: a single word in capitals, and what words are a part of, such
    as ``pca:K``, as it is. `parse` returns the value of a text, or raises a ValueError, whose
    message the user reads. `offered` holds texts that the shell completes. Functions of this module
    become types as they are defined: ``@partial(Parsed, "name")``.
    """

    def __init__(self, name: str, parse: Callable[[str], Any], offered: Iterable[str] = ()) -> None:
        self.name, self.parse, self._offered = name, parse, offered

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str | None:
        """Return what stands in the help, which click would write in capitals; see the class."""
        return None if self.name.isalpha() else self.name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the value of a text; what is wrong with it becomes wrong usage of the option."""
        if not isinstance(value, str):
            return value
        try:
            return self.parse(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer the texts that are known."""
        from click.shell_completion import CompletionItem  # slow to load, and rarely needed

        return [CompletionItem(each) for each in self._offered if each.startswith(incomplete)]


@partial(Parsed, "fraction")
def FRACTION(text: str) -> float:
    """A number between 0 and 1, neither included; click's FloatRange would let NaN through."""
    number = _number(text)
    if not 0 < number < 1:
        hint = f"; {number:g} % are {number / 100:g}" if 1 < number < 100 else ""
        raise ValueError(f"{number:g} is not between 0 and 1, neither included{hint}")
    return number


whole = click.IntRange
"""The type of a whole number between two others, or one of them."""


def within(low: float, high: float) -> Parsed:
    """Return the type of a number between two others, or one of them, and never NaN."""

    def parse(text: str) -> float:
        number = _number(text)
        if not low <= number <= high:
            raise ValueError(f"{number:g} is not in the range {low:g} .. {high:g}")
        return number

    return Parsed("number", parse)


STOPS = within(-MAX_STOPS, MAX_STOPS)
"""An exposure value, in stops."""


def _direction(lowest: int) -> Parsed:
    """Return the type of a direction, in degrees, that is no lower than an elevation."""

    def parse(text: str) -> tuple[float, float]:
        numbers = _numbers(text)
        if len(numbers) != 2:
            raise ValueError(f"{text!r} is not two numbers AZ,EL such as 30,45")
        azimuth, elevation = numbers
        if abs(azimuth) > MOST_DEGREES:
            raise ValueError(f"azimuth {azimuth:g} of {text!r} is beyond {MOST_DEGREES:g} degrees")
        if not lowest <= elevation <= 90:
            raise ValueError(
                f"elevation {elevation:g} of {text!r} is outside {lowest} .. 90; give AZ,EL"
            )
        return azimuth, elevation

    return Parsed("AZ,EL", parse)


DIRECTION = _direction(-90)
"""Azimuth from +Z towards +X about +Y, and elevation within -90 .. 90."""
SUN = _direction(0)
"""The same with an elevation within 0 .. 90, for what stands above the horizon."""


@partial(Parsed, "NAME|RX,RY,...", offered=PRIMARIES)
def OF_PRIMARIES(text: str) -> str | tuple[float, ...]:
    """Primaries and white: a name such as ``acescg``, or finite numbers ``RX,RY,GX,GY,...``."""
    if text in PRIMARIES:
        return text
    numbers = _numbers(text)
    if len(numbers) != 8:
        names = ", ".join(PRIMARIES)
        raise ValueError(
            f"{text!r} is none of {names}, and not eight numbers, x and y of red, green, "
            "blue and white"
        )
    return numbers


def way(text: str) -> tuple[str, float, float] | None:
    """Return a parameter with the ends of its way, of NAME=LOW..HIGH and NAME=VALUE.

    Other texts, such as those of files, are None.
    """
    name, _, interval = (part.strip() for part in text.partition("="))
    low, dots, high = interval.partition("..")
    try:
        ends = float(low), float(high if dots else low)
    except ValueError:
        return None
    return (name, *ends) if name and all(map(math.isfinite, ends)) else None


def _several(name: str, wanted: str, largest: float = vocabulary.LARGEST_COORDINATE) -> Parsed:
    """Return the type of as many numbers as its name has, none of which is too large."""

    def parse(text: str) -> tuple[float, ...]:
        numbers = _numbers(text)
        if len(numbers) != name.count(",") + 1 or max(map(abs, numbers)) > largest:
            raise ValueError(f"{text!r} is not {wanted}")
        return numbers

    return Parsed(name, parse)


VECTOR = _several("X,Y,Z", "three numbers X,Y,Z such as 0,1,0")
"""A point or a direction: three finite numbers."""
CIRCLE = _several("X,Y,RADIUS", "X,Y,RADIUS in pixels, such as 960,540,310", 1e9)
"""Where a ball is in a picture: its middle from the left and the top, and its radius."""
BOX = _several("X0,Y0,Z0,X1,Y1,Z1", "six numbers X0,Y0,Z0,X1,Y1,Z1")
"""Two corners of a box."""


@partial(Parsed, "uv|X,Y,Z")
def BRUSH(text: str) -> str | tuple[float, ...]:
    """What tangents follow: ``uv``, or a direction."""
    if text == "uv":
        return text
    direction: tuple[float, ...] = VECTOR.parse(text)
    if not any(direction):
        raise ValueError("0,0,0 is no direction")
    return direction


@partial(Parsed, "AXIS:DEGREES")
def TURN(text: str) -> tuple[tuple[float, ...], float]:
    """A rotation: the axis ``x``, ``y``, ``z`` or ``X/Y/Z``, and an angle in degrees."""
    axis, _, angle = text.rpartition(":")
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    along = axes.get(axis) or _numbers(axis.replace("/", ","))
    degrees = _numbers(angle)
    if len(along) != 3 or len(degrees) != 1 or max(map(abs, along)) > vocabulary.LARGEST_COORDINATE:
        raise ValueError(f"{text!r} is not AXIS:DEGREES such as y:90 or 1/1/0:360")
    if not any(along):
        raise ValueError("0/0/0 is no axis")
    if abs(degrees[0]) > MOST_DEGREES:
        raise ValueError(f"{text!r} turns by more than {MOST_DEGREES:g} degrees")
    return along, degrees[0]


@partial(Parsed, "L,M=X|R,G,B")
def COEFFICIENT(text: str) -> tuple[int, tuple[float, ...]]:
    """A coefficient of a light: its index l(l+1)+m, and one number or three."""
    place, _, value = text.partition("=")
    numbers, rgb = place.split(","), _of_channels(value)
    if len(numbers) != 2 or not rgb or not all(re.fullmatch(r"-?\d{1,3}", n) for n in numbers):
        raise ValueError(f"{text!r} is not L,M=X or L,M=R,G,B such as 1,-1=0.5")
    degree, m = map(int, numbers)
    if abs(m) > degree:
        raise ValueError(f"{place}: a degree L has orders M from -L to L")
    return degree * (degree + 1) + m, rgb


@partial(Parsed, "AZ,EL:X[:W]")
def DIMMING(text: str) -> tuple[tuple[float, float], float, float]:
    """A direction in degrees, what light from there is multiplied by, and how wide that is."""
    parts = text.split(":")
    numbers = [_numbers(part) for part in parts[1:]]
    if not 2 <= len(parts) <= 3 or any(len(each) != 1 for each in numbers):
        raise ValueError(f"{text!r} is not AZ,EL:X or AZ,EL:X:W such as 40,30:0.2:20")
    (factor,), (width,) = numbers[0], numbers[-1] if len(numbers) > 1 else (30.0,)
    low, high = vocabulary.DIMMED_WIDTHS
    if factor < 0 or not low <= width <= high:
        raise ValueError(f"{text!r} has a factor below 0, or a width outside {low:g} .. {high:g}")
    return DIRECTION.parse(parts[0]), factor, width


def _whole(digits: str) -> int | None:
    """Return the number that digits are, or None for one beyond a billion, of any length."""
    shortest = digits.lstrip("0") or "0"
    return int(shortest) if len(shortest) < 10 else None


@partial(Parsed, "N|WxH")
def PICTURE_SIZE(text: str) -> tuple[int, int]:
    """A picture's width and height in pixels."""
    low, high = 16, MAX_PICTURE_SIZE
    parts = text.split("x")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() for part in parts):
        raise ValueError(f"{text!r} is not a size in pixels such as 512 or 800x600")
    sizes = [_whole(part) for part in parts]
    for part, size in zip(parts, sizes, strict=True):
        if size is None or not low <= size <= high:
            raise ValueError(f"{part} is not in the range {low}<=x<={high}.")
    return sizes[0], sizes[-1]  # type: ignore[return-value]


@partial(Parsed, "X|R,G,B")
def RADIANCE(text: str) -> tuple[float, ...]:
    """A linear RGB radiance: one finite number for all channels, or three; none is below 0."""
    numbers = _of_channels(text)
    if not numbers:
        raise ValueError(f"{text!r} is not one number, or three such as 1,0.5,0.2")
    if min(numbers) < 0:
        raise ValueError(f"{text!r} has a number below 0")
    return numbers


@partial(Parsed, "X|R,G,B|mesh|vertex")
def ALBEDO(text: str) -> str | tuple[float, ...]:
    """What a surface reflects: a number or three between 0 and 1, or ``vertex`` or ``mesh``."""
    if text in ("vertex", "mesh"):
        return text
    numbers = _of_channels(text)
    if not numbers or not all(0 <= number <= 1 for number in numbers):
        raise ValueError(f"{text!r} is neither mesh nor vertex, nor one or three numbers in 0 .. 1")
    return numbers


@partial(Parsed, "NAME=R,G,B")
def NAMED_COLOR(text: str) -> tuple[str, tuple[float, ...]]:
    """A name, and three numbers or one for all channels; none is below 0."""
    name, separator, rest = text.rpartition("=")
    if not separator or not name:
        raise ValueError(f"{text!r} is not NAME=R,G,B or NAME=X")
    numbers = RADIANCE.parse(rest)
    return name, numbers * (3 // len(numbers))


@partial(Parsed, "NX,NY,NZ")
def COUNTS(text: str) -> tuple[int, ...]:
    """Three whole numbers, 1 at least."""
    texts = text.split(",")
    counts = [_whole(each) if each.isascii() and each.isdigit() else None for each in texts]
    if len(counts) != 3 or not all(counts):
        raise ValueError(f"{text!r} is not three whole numbers such as 16,8,16")
    return tuple(each for each in counts if each)


@partial(Parsed, "pca:K|pca:X")
def COMPONENTS(text: str) -> int | float:
    """How far to compress: ``pca:K`` components, or ``pca:X`` for a relative RMS error X < 1."""
    method, _, amount = text.partition(":")
    if method == "pca" and amount.isascii() and amount.isdigit() and amount.strip("0"):
        count = _whole(amount)
        if count is None:
            raise ValueError(f"{amount} components are more than any map has")
        return count
    numbers = _numbers(amount)
    if method != "pca" or len(numbers) != 1 or not 0 < numbers[0] < 1:
        raise ValueError(
            f"{text!r} is not pca:K with a number K of components, or pca:X with an error X "
            "between 0 and 1"
        )
    return numbers[0]


def interval(low: float, high: float) -> Parsed:
    """Return the type of a range ``A..B`` within limits; a single number is both of its ends."""

    def parse(text: str) -> tuple[float, float]:
        ends = text.split("..")
        numbers = [_numbers(end) for end in ends]
        if len(ends) > 2 or any(len(each) != 1 for each in numbers):
            raise ValueError(f"{text!r} is not a range A..B such as 0.5..1")
        (first,), (last,) = numbers[0], numbers[-1]
        if not low <= first <= last <= high:
            raise ValueError(f"{text!r} does not rise within {low:g} .. {high:g}")
        return first, last

    return Parsed("A..B", parse)


@partial(Parsed, "N|R,R,...")
def LEVELS(text: str) -> int | tuple[float, ...]:
    """Levels of a split sum: their number, or the rising roughness of each, with commas between."""
    if text.isascii() and text.isdigit():
        count = _whole(text)
        if count is None or not 1 <= count <= MAX_LEVELS:
            raise ValueError(f"{text} levels are not 1 .. {MAX_LEVELS}")
        return count
    numbers = _numbers(text)
    if not numbers or len(numbers) > MAX_LEVELS:
        raise ValueError(
            f"{text!r} is neither a number of levels nor up to {MAX_LEVELS} roughnesses "
            "such as 0.2,0.5,1.0"
        )
    if not all(0 <= number <= 1 for number in numbers):
        raise ValueError(f"{text!r} has a roughness outside 0 .. 1")
    if any(a >= b for a, b in pairwise(numbers)):
        raise ValueError(f"{text!r} does not rise")
    return numbers


@partial(Parsed, "bytes")
def BYTES(text: str) -> int:
    """An amount of storage such as ``32MB``, ``1.5GiB`` or a plain number of bytes, at least 1."""
    count = parse_bytes(text)
    if count is None or count < 1:
        raise ValueError(f"{text!r} is not a number of bytes such as 32MB, 500kB or 2000000")
    return count


PATH, FILE = click.Path(readable=False), click.Path(dir_okay=False, readable=False)
"""The types of paths: of any, and of what must be no folder."""


def option(names: str, type: Any, help: str, **more: Any) -> Callable[[Any], Any]:
    """Return the decorator that adds an option to a command; its help shows the default, if any.

    `names` are the words that click takes one by one, and behind them, with capitals, what the help
    calls the value, unless it is what the type says: ``-o --output PNG``. `more` are other
    arguments of click's.
    """
    *words, last = names.split()
    more.setdefault("show_default", "default" in more)
    more |= {"metavar": last} if last != last.lower() else {}
    words += [last] if last == last.lower() else []
    return click.option(*words, type=type, help=help, **more)


def flag(names: str, help: str, **more: Any) -> Callable[[Any], Any]:
    """Return the decorator that adds an option without a value to a command."""
    return click.option(*names.split(), is_flag=True, help=help, **more)


def click_option(described: Option) -> Any:
    """Return the decorator that adds an option of prefiltering to a command."""
    flag = f"--{described.name.replace('_', '-')}"
    if described.kind == "switch":
        flag += f"/--no-{described.name.replace('_', '-')}"
        return click.option(flag, described.name, default=None, help=described.help)
    low, high = described.limits
    types = {
        "integer": click.IntRange(int(low), int(high)),
        "fraction": FRACTION,
        "choice": click.Choice(described.choices),
        "text": click.STRING,
        "interval": interval(low, high),
        "levels": LEVELS,
        "components": COMPONENTS,
        "bytes": BYTES,
    }
    metavar = described.metavar or None
    return click.option(
        flag, described.name, type=types[described.kind], metavar=metavar, help=described.help
    )


def _number(text: str) -> float:
    """Return the number that a text is; raise the `ValueError` of a type if it is none."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None


def _of_channels(text: str) -> tuple[float, ...]:
    """Return one number for all channels, or three; return () if the text is neither."""
    numbers = _numbers(text)
    return numbers if len(numbers) in (1, 3) else ()


def _numbers(text: str) -> tuple[float, ...]:
    """Split a comma-separated list of finite numbers; return () if any part is not one."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(math.isfinite(number) for number in numbers) else ()


class Named(click.Choice):  # type: ignore[type-arg]  # it is generic since 8.2 only
    """Names of `shrm`; installed packages are asked only for what it has not."""

    def __init__(self, names: Sequence[str], more: Callable[[], Iterable[str]]) -> None:
        super().__init__(names)
        self._more = more

    def _every(self) -> click.Choice:  # type: ignore[type-arg]
        return click.Choice(list(dict.fromkeys([*self.choices, *self._more()])))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a name; what has it is loaded later."""
        return value if value in self.choices else self._every().convert(value, param, ctx)

    def get_metavar(self, *context: Any, **named: Any) -> str | None:
        """Return all names, for the help."""
        return self._every().get_metavar(*context, **named)

    def get_missing_message(self, *context: Any, **named: Any) -> str:
        """Return all names, for the message about an option that is not given."""
        return str(self._every().get_missing_message(*context, **named))

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Offer all names."""
        return self._every().shell_complete(ctx, param, incomplete)


class Spec(click.ParamType):  # type: ignore[type-arg]  # click's type is generic since 8.5 only
    """The specification of a BRDF, as text; `shrm_cli.brdf.spec.parse_spec` judges it."""

    name = "SPEC"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text."""
        return value

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return how the last term may go on, and files where no model is called so."""
        from click.shell_completion import CompletionItem  # slow to load, and rarely needed

        from shrm_cli.brdf.base import masked

        last = max(match.end() for match in _START.finditer(masked(incomplete)))
        endings = _endings(incomplete[last:])
        if endings:
            return [CompletionItem(incomplete[:last] + ending) for ending in endings]
        return [CompletionItem(incomplete, type="file")]


def _endings(term: str) -> list[str]:
    """Return what a term may become: with a name, with a parameter's name, or with its value."""
    from shrm_cli.brdf.base import COMMA, cut
    from shrm_cli.brdf.library import find_model, model_names

    name, colon, values = term.partition(":")
    if not colon:
        return [each for each in model_names() if each.startswith(name)]
    try:
        model = find_model(name)
    except shrm.BrdfError:
        return []
    *given, current = cut(COMMA, values)
    before = f"{name}:{','.join([*given, ''])}"
    return [before + each for each in _settings(model, given, current)]


def _settings(model: type[shrm.Brdf], given: list[str], current: str) -> list[str]:
    """Return what may stand for the last ``key=value``, after those that are given."""
    key, equals, value = current.partition("=")
    if not equals:
        taken = {each.partition("=")[0] for each in given}
        names = [each.name for each in model.parameters if each.name not in taken]
        return [f"{each}=" for each in names if each.startswith(key)]
    known = next((each for each in model.parameters if each.name == key), None)
    choices = () if known is None else (*known.choices, *known.names)
    return [f"{key}={each}" for each in choices if each.startswith(value)]
