"""Parameter types of the command line.

This module imports nothing heavy, because `shrm --help` loads it.
"""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.maps.options import Option, parse_bytes
from shrm_cli.vocabulary import MAX_LEVELS, PRIMARIES

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class Fraction(click.ParamType):  # type: ignore[type-arg]  # click's type is generic since 8.5 only
    """A number between 0 and 1, neither of them included."""

    name = "fraction"

    def convert(
        self, value: str | float, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return a float; click's FloatRange would let NaN through."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)
        if not 0 < number < 1:
            self.fail(f"{number:g} is not between 0 and 1", param, ctx)
        return number


class Within(click.ParamType):  # type: ignore[type-arg]
    """A number between two others, or one of them; click's FloatRange would let NaN through."""

    name = "number"

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high

    def convert(
        self, value: str | float, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return a float within the range."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)
        if not self.low <= number <= self.high:
            self.fail(f"{number:g} is not in the range {self.low:g} .. {self.high:g}", param, ctx)
        return number


_LARGEST = 1e30
"""The largest coordinate, as meshes have it."""

STOPS = Within(-32, 32)
"""The type of an exposure value, in stops."""


class AzimuthElevation(click.ParamType):  # type: ignore[type-arg]
    """A direction ``AZ,EL`` in degrees: azimuth from +Z towards +X about +Y, elevation up."""

    name = "AZ,EL"

    def convert(
        self,
        value: str | tuple[float, float],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, float]:
        """Return two finite numbers, the second within -90 .. 90."""
        if isinstance(value, tuple):
            return value
        numbers = _numbers(value)
        if len(numbers) != 2:
            self.fail(f"{value!r} is not two numbers AZ,EL such as 30,45", param, ctx)
        azimuth, elevation = numbers
        if not -90 <= elevation <= 90:
            self.fail(f"elevation {elevation:g} is outside -90 .. 90", param, ctx)
        return azimuth, elevation


class PrimariesType(click.ParamType):  # type: ignore[type-arg]
    """Primaries and white: a name such as ``acescg``, or eight numbers ``RX,RY,GX,GY,...``."""

    name = "NAME|RX,RY,..."

    def convert(
        self,
        value: str | tuple[float, ...],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> str | tuple[float, ...]:
        """Return a known name, or eight finite numbers."""
        if isinstance(value, tuple) or value in PRIMARIES:
            return value
        numbers = _numbers(value)
        if len(numbers) != 8:
            names = ", ".join(PRIMARIES)
            self.fail(
                f"{value!r} is none of {names}, and not eight numbers, x and y of red, green, "
                "blue and white", param, ctx,
            )  # fmt: skip
        return tuple(numbers)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> "list[CompletionItem]":
        """Offer the names."""
        from click.shell_completion import CompletionItem  # slow to load, and rarely needed

        return [CompletionItem(name) for name in PRIMARIES if name.startswith(incomplete)]


class Vector(click.ParamType):  # type: ignore[type-arg]
    """A point or a direction: three numbers ``X,Y,Z``."""

    name = "X,Y,Z"

    def convert(
        self,
        value: str | tuple[float, float, float],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, float, float]:
        """Return three finite numbers."""
        if isinstance(value, tuple):
            return value
        numbers = _numbers(value)
        if len(numbers) != 3 or not all(abs(number) <= _LARGEST for number in numbers):
            self.fail(f"{value!r} is not three numbers X,Y,Z such as 0,1,0", param, ctx)
        return numbers[0], numbers[1], numbers[2]


class Brush(Vector):
    """What tangents follow: ``uv``, or a direction ``X,Y,Z``."""

    name = "uv|X,Y,Z"

    def convert(
        self,
        value: str | tuple[float, float, float],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:
        """Return ``uv`` or three finite numbers that are not all 0."""
        if value == "uv":
            return value
        direction = super().convert(value, param, ctx)
        if not any(direction):
            self.fail("0,0,0 is no direction", param, ctx)
        return direction


class PictureSize(click.ParamType):  # type: ignore[type-arg]
    """The size of a picture in pixels: its width and height, ``N`` or ``WxH``."""

    name = "N|WxH"

    def __init__(self, low: int, high: int) -> None:
        self.low, self.high = low, high

    def convert(
        self,
        value: str | tuple[int, int],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[int, int]:
        """Return width and height."""
        if isinstance(value, tuple):
            return value
        parts = value.split("x")
        if len(parts) > 2 or not all(part.isascii() and part.isdigit() for part in parts):
            self.fail(f"{value!r} is not a size in pixels such as 512 or 800x600", param, ctx)
        sizes = [int(part[:9]) for part in parts]
        for size in sizes:
            if not self.low <= size <= self.high:
                self.fail(f"{size} is not in the range {self.low}<=x<={self.high}.", param, ctx)
        return sizes[0], sizes[-1]


class Radiance(click.ParamType):  # type: ignore[type-arg]
    """A linear RGB radiance: one number for all channels, or three with commas between."""

    name = "X|R,G,B"

    def convert(
        self,
        value: str | tuple[float, ...],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, ...]:
        """Return one or three finite numbers, none of them below 0."""
        if isinstance(value, tuple):
            return value
        numbers = _numbers(value)
        if len(numbers) not in (1, 3):
            self.fail(f"{value!r} is not one number, or three such as 1,0.5,0.2", param, ctx)
        if min(numbers) < 0:
            self.fail(f"{value!r} has a number below 0", param, ctx)
        return numbers


class Albedo(click.ParamType):  # type: ignore[type-arg]
    """What a surface reflects: a number or three between 0 and 1, or ``vertex``."""

    name = "X|R,G,B|vertex"

    def convert(
        self,
        value: str | tuple[float, ...],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> str | tuple[float, ...]:
        """Return one or three numbers, or "vertex"."""
        if isinstance(value, tuple) or value == "vertex":
            return value
        numbers = _numbers(value)
        if len(numbers) not in (1, 3) or not all(0 <= number <= 1 for number in numbers):
            self.fail(f"{value!r} is not vertex, nor one or three numbers in 0 .. 1", param, ctx)
        return numbers


class Components(click.ParamType):  # type: ignore[type-arg]
    """How far to compress: ``pca:K`` components, or ``pca:X`` for a relative RMS error X < 1."""

    name = "pca:K|pca:X"

    def convert(
        self,
        value: str | float,
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> int | float:
        """Return a number of components as int, or an error as float."""
        if not isinstance(value, str):
            return value
        method, _, text = value.partition(":")
        if method == "pca" and text.isascii() and text.isdigit() and int(text[:9]) > 0:
            return int(text[:9])
        numbers = _numbers(text)
        if method != "pca" or len(numbers) != 1 or not 0 < numbers[0] < 1:
            self.fail(
                f"{value!r} is not pca:K with a number K of components, or pca:X with an error X "
                "between 0 and 1",
                param,
                ctx,
            )
        return numbers[0]


class Interval(click.ParamType):  # type: ignore[type-arg]
    """A range ``A..B`` of numbers between two limits; a single number is both of its ends."""

    name = "A..B"

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high

    def convert(
        self,
        value: str | tuple[float, float],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, float]:
        """Return two numbers, the first no larger than the second."""
        if isinstance(value, tuple):
            return value
        ends = value.split("..")
        numbers = [_numbers(end) for end in ends]
        if len(ends) > 2 or any(len(each) != 1 for each in numbers):
            self.fail(f"{value!r} is not a range A..B such as 0.5..1", param, ctx)
        (first,), (last,) = numbers[0], numbers[-1]
        if not self.low <= first <= last <= self.high:
            self.fail(f"{value!r} does not rise within {self.low:g} .. {self.high:g}", param, ctx)
        return first, last


class Levels(click.ParamType):  # type: ignore[type-arg]
    """Levels of a split sum: their number, or the roughness of each, with commas between."""

    name = "N|R,R,..."

    def convert(
        self,
        value: str | int | tuple[float, ...],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> int | tuple[float, ...]:
        """Return the number of levels, or roughnesses that rise within 0 .. 1."""
        if not isinstance(value, str):
            return value
        if value.isascii() and value.isdigit():
            count = int(value[:9])
            if not 1 <= count <= MAX_LEVELS:
                self.fail(f"{value[:9]} levels are not 1 .. {MAX_LEVELS}", param, ctx)
            return count
        numbers = _numbers(value)
        if not numbers or len(numbers) > MAX_LEVELS:
            self.fail(
                f"{value!r} is neither a number of levels nor up to {MAX_LEVELS} roughnesses "
                "such as 0.2,0.5,1.0",
                param,
                ctx,
            )
        if not all(0 <= number <= 1 for number in numbers):
            self.fail(f"{value!r} has a roughness outside 0 .. 1", param, ctx)
        if any(a >= b for a, b in pairwise(numbers)):
            self.fail(f"{value!r} does not rise", param, ctx)
        return numbers


class Bytes(click.ParamType):  # type: ignore[type-arg]
    """An amount of storage such as ``32MB``, ``1.5GiB`` or a plain number of bytes."""

    name = "bytes"

    def convert(
        self, value: str | int, param: click.Parameter | None, ctx: click.Context | None
    ) -> int:
        """Return a number of bytes, at least 1."""
        count = parse_bytes(value) if isinstance(value, str) else value
        if count is None or count < 1:
            self.fail(
                f"{value!r} is not a number of bytes such as 32MB, 500kB or 2000000", param, ctx
            )
        return count


def click_option(option: Option) -> Any:
    """Return the decorator that adds an option of prefiltering to a command."""
    flag = f"--{option.name.replace('_', '-')}"
    if option.kind == "switch":
        flag += f"/--no-{option.name.replace('_', '-')}"
        return click.option(flag, option.name, default=None, help=option.help)
    low, high = option.limits
    types = {
        "integer": click.IntRange(int(low), int(high)),
        "fraction": Fraction(),
        "choice": click.Choice(option.choices),
        "text": click.STRING,
        "interval": Interval(low, high),
        "levels": Levels(),
        "components": Components(),
        "bytes": Bytes(),
    }
    metavar = option.metavar or None
    return click.option(
        flag, option.name, type=types[option.kind], metavar=metavar, help=option.help
    )


def _numbers(text: str) -> tuple[float, ...]:
    """Split a comma-separated list of finite numbers; return () if any part is not one."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return numbers if all(math.isfinite(number) for number in numbers) else ()
