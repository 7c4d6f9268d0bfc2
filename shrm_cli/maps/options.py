"""The arguments of prefiltering: how representations describe them, and which values they have.

This module loads no numpy, because ``shrm --help`` reads it.
"""

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

from shrm_cli import vocabulary
from shrm_cli.errors import ArgumentError
from shrm_cli.messages import short_repr
from shrm_cli.records import record


@record
class Option:
    """An argument of `shrm_cli.prefilter.prefilter`, which is an option of the command too."""

    name: str
    """The name of the argument. The command line's flag has dashes in place of underscores."""
    help: str
    """What the argument does, for ``shrm prefilter --help``."""
    kind: str
    """What its values are: ``integer`` is a whole number within `limits`, ``fraction`` a number
    between 0 and 1, ``choice`` one of `choices`, ``switch`` yes or no, ``text`` any text,
    ``interval`` two rising numbers within `limits`, ``levels`` the number of levels of a split sum
    or the roughness of each, ``components`` the number of principal components of an SHRM or the
    error that may be added, ``bytes`` an amount of storage."""
    choices: tuple[str, ...] = ()
    """The values that a ``choice`` may have."""
    limits: tuple[float, float] = (0, 1)
    """The least and the largest value."""
    metavar: str = ""
    """What stands for the value in the help; where it is empty, the kind determines it."""
    converts: bool = False
    """Whether ``shrm convert`` takes the argument too."""
    prints: bool = False
    """Whether the argument only asks the command for more output, and does not change the map."""
    default: Any = None
    """The value where it is not given; None where that follows from something else."""

    def checked(self, value: object) -> Any:
        """Return a value as the makers of maps take it: numbers of numpy become Python's."""
        try:
            found = _CHECKS[self.kind](self, value)
        except (TypeError, ValueError, OverflowError):
            found = None
        if found is None:
            raise ArgumentError(self.name, f"{short_repr(value)} is not {self._wanted()}")
        return found

    def _wanted(self) -> str:
        """Return what a value must be, in words."""
        low, high = self.limits
        return {
            "integer": f"a whole number of {low} .. {high}",
            "fraction": "a number between 0 and 1",
            "choice": f"one of {', '.join(self.choices)}",
            "switch": "True or False",
            "text": "text",
            "interval": f"two numbers that rise within {low:g} .. {high:g}",
            "levels": f"a number of levels, 1 .. {vocabulary.MAX_LEVELS}, "
            "or the roughnesses of levels",
            "components": "a number of components, or an error between 0 and 1",
            "bytes": "a number of bytes, such as 32MB, 500kB or 2000000",
        }[self.kind]


def _whole(value: object) -> int | None:
    """Return a whole number, or None for anything else; True and False are no numbers."""
    return None if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]


def _whole_within(option: Option, value: object) -> int | None:
    number = _whole(value)
    low, high = option.limits
    return number if number is not None and low <= number <= high else None


def _fraction(option: Option, value: object) -> float | None:
    number = float(value)  # type: ignore[arg-type]
    return number if 0 < number < 1 and not isinstance(value, str) else None


def _interval(option: Option, value: object) -> tuple[float, float] | None:
    if isinstance(value, str):
        return None
    first, last = (float(end) for end in value)  # type: ignore[attr-defined]
    low, high = option.limits
    return (first, last) if low <= first <= last <= high else None


def _levels(option: Option, value: object) -> int | tuple[float, ...] | None:
    if isinstance(value, str):
        return None
    if hasattr(value, "__iter__"):
        return tuple(float(roughness) for roughness in value) or None
    count = _whole(value)
    return count if count is not None and 1 <= count <= vocabulary.MAX_LEVELS else None


def _components(option: Option, value: object) -> int | float | None:
    if isinstance(value, float):
        return _fraction(option, value)
    count = _whole(value)
    return count if count is not None and count >= 1 else None


def _bytes(option: Option, value: object) -> int | None:
    count = parse_bytes(value) if isinstance(value, str) else _whole(value)
    return count if count is not None and count >= 1 else None


_CHECKS: dict[str, Callable[[Option, object], Any]] = {
    "integer": _whole_within,
    "fraction": _fraction,
    "choice": lambda option, value: value if value in option.choices else None,
    "switch": lambda option, value: value if isinstance(value, bool) else None,
    "text": lambda option, value: value if isinstance(value, str) else None,
    "interval": _interval,
    "levels": _levels,
    "components": _components,
    "bytes": _bytes,
}


@record
class Representation:
    """The description of a representation, and of the arguments that it obeys."""

    name: str
    """The name, as ``--to`` takes it."""
    title: str
    """The name in tables."""
    takes: frozenset[str]
    """The shared arguments of `shrm_cli.prefilter.prefilter` that the representation obeys."""
    options: tuple[Option, ...] = ()
    """The representation's own arguments."""
    why_no_brdf: str = ""
    """Why the representation needs no BRDF; empty where it needs one."""
    own_defaults: Mapping[str, Any] = field(default_factory=dict)
    """Its defaults of shared arguments, where they are others than those in `SHARED`."""
    instead_of_seen: frozenset[str] | None = None
    """Where what is seen tells by default what is made: the arguments that choose it instead."""
    steps: tuple[dict[str, Any], ...] = ()
    """The settings, from the coarsest on, of which an error that is asked for takes the first that
    keeps it; empty where the maker itself chooses. See `shrm_cli.maps.seen`."""
    searched: frozenset[str] = frozenset()
    """Further arguments that an error, or a share of wrong pixels, chooses."""
    is_offered: bool = False
    """Whether `shrm_cli.choose` makes some of its maps to know their errors; the form's module
    ``offers`` says which. See `shrm_cli.maps.offers`."""
    mark: tuple[str, str] = ("0.5", "x")
    """Color and marker of its maps in charts, as matplotlib takes them."""
    home: str = ""
    """Of a form of an installed package: the module that makes, writes and reads its maps; see
    `shrm_cli.maps.installed`."""

    @property
    def needs_brdf(self) -> bool:
        """Whether the representation is made for a BRDF, and not from the light alone."""
        return not self.why_no_brdf

    @property
    def arguments(self) -> frozenset[str]:
        """All arguments of its making, shared ones and its own."""
        return self.takes | {option.name for option in self.options if not option.prints}

    @property
    def chosen(self) -> frozenset[str]:
        """The arguments that apply neither with `error` nor with `seen`, which choose them."""
        return self.searched.union(*self.steps)

    @property
    def defaults(self) -> dict[str, Any]:
        """The values of arguments that are not given, where they follow from nothing else."""
        shared = [SHARED[name] for name in sorted(self.takes & SHARED.keys())]
        found = {option.name: option.default for option in (*shared, *self.options)}
        found |= self.own_defaults
        return {name: value for name, value in found.items() if value is not None}


SHARED = {
    option.name: option
    for option in (
        Option(
            "eps", kind="fraction", metavar="X", default=vocabulary.DEFAULT_EPS,
            help="Fraction of the BRDF's energy that may be missed; it chooses F and P.  "
            f"[default: {vocabulary.DEFAULT_EPS:g}]",
        ),
        Option(
            "error", kind="fraction", metavar="X",
            help="Relative RMS error of this probe's reflected light, all causes together; it "
            "chooses the map of the fewest bytes.",
        ),
        Option(
            "seen", kind="fraction", metavar="X",
            help="Share of what is visible that may be wrong by more than 5 %, as predicted; it "
            "chooses the map of the fewest bytes.",
        ),
        Option("order_f", "Order F to use instead.", "integer", limits=(0, vocabulary.MAX_ORDER_F)),
        Option("order_p", "Order P to use instead.", "integer", limits=(0, vocabulary.MAX_ORDER_P)),
        Option(
            "center", kind="choice", choices=("auto", *vocabulary.CENTERS),
            help="Central direction of the map; auto takes the one with the fewest coefficients.  "
            "[default: the BRDF's own; of principal the best one]",
        ),
        Option(
            "domain", kind="choice", choices=vocabulary.DOMAINS, default="frequency",
            help="Where to prefilter explicit maps; angular takes minutes.  [default: frequency]",
        ),
        Option(
            "source_height", kind="integer", limits=(2, vocabulary.MAX_SOURCE_HEIGHT), metavar="H",
            help="In the angular domain: average the probe down to 2H x H first.",
        ),
        Option(
            "frame", kind="choice", choices=vocabulary.FRAMES, default="global",
            help="Axes of the view in the map: the world's, or each texel's own.  "
            "[default: global]",
        ),
        Option(
            "size", kind="integer", limits=(vocabulary.MIN_CUBE_SIZE, vocabulary.MAX_CUBE_SIZE),
            help="Texels along a face's edge.  [default: from F]",
        ),
        Option(
            "max_size", kind="bytes", metavar="BYTES",
            help="Most bytes of the map in half precision, such as 500kB. Where they are too few "
            "for the orders, the best map within them is made.  "
            f"[default: {vocabulary.DEFAULT_MAX_SIZE // 10**6}MB]",
        ),
        Option(
            "sampling", kind="choice", choices=vocabulary.SAMPLINGS, default="center",
            help="Where the edge texels of the map lie.",
        ),
        Option(
            "sun", kind="choice", choices=("split", "keep"),
            help="split: take the lamps out, as shrm sun does. The map is of what is left, and "
            "they are beside it, integrated where it is used. keep: leave them in.  "
            "[default: keep; auto splits where no map keeps what is asked]",
        ),
    )
}  # fmt: skip
"""The arguments that several representations share, by name."""


def checked_order_p(value: object) -> int | None:
    """Return an order P that is asked for; None stays."""
    return None if value is None else SHARED["order_p"].checked(value)


SHADER = Option(
    "shader", kind="choice", choices=("glsl", "hlsl", "wgsl", "c"), prints=True,
    help="Print code that looks the map up: shrm_radiance(n, v), or (n, v, roughness, f0), without "
    "f0 of another BRDF than GGX; shrm_irradiance(n) of irradiance.",
)  # fmt: skip
"""The argument of representations that shaders can use."""
TEXTURES = Option(
    "textures", kind="choice", choices=("cube-array", "layers"), prints=True,
    help="What the code reads: arrays of cube maps (GLSL 4, HLSL, WGSL), or the 2D arrays that "
    "shrm convert --to layers writes, which fit WebGL2, WebGPU and C.  "
    "[default: cube-array; layers for c]",
)  # fmt: skip
"""The argument that says where the code of `SHADER` finds cubes."""

WINDOW = Option(
    "window", kind="text", metavar="NAME[:WIDTH]", default="auto",
    help="irradiance, product: none, hann, lanczos, or auto, the factors that change the light "
    "least and leave nothing that is seen negative, of a product each color in 1 %.  "
    "[default: auto]",
)  # fmt: skip
"""The argument of representations that hold the light as a short series."""

CUBE_ARGUMENTS = frozenset(("size", "sampling"))
"""The arguments that representations which hold cubes share."""

BRDF_ARGUMENTS = frozenset(("brdf", *SHARED)) - CUBE_ARGUMENTS
"""The arguments that representations which are made for a BRDF share."""

AUTOMATIC = Representation(
    vocabulary.AUTO,
    "the form that the picture needs",
    frozenset(("brdf", "error", "seen", "center", "max_size", "sun")) | CUBE_ARGUMENTS,
    (SHADER, TEXTURES),
    own_defaults={"max_size": vocabulary.DEFAULT_MAX_SIZE},
)
"""What is asked for where the form is not: its arguments are those of every form that may be it."""

_MOST_BYTES = 2.0**63
"""No machine has as many, and numbers beyond it are infinite or longer than Python converts."""
_AMOUNT = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*(?:([kmg]?)(i?)b)?\s*", re.IGNORECASE)
_POWERS = {"": 0, "k": 1, "m": 2, "g": 3}


def parse_bytes(text: str) -> int | None:
    """Return the number of bytes that a text such as ``32MB`` or ``1.5 GiB`` names.

    Units are decimal, unless they have an i: a kB is 1000 bytes, and a KiB is 1024. Their case does
    not matter.

    Returns None where the text names no amount, or one that no number of the machine holds.
    """
    found = _AMOUNT.fullmatch(text)
    if found is None or (found[3] and not found[2]):
        return None
    unit = (1024 if found[3] else 1000) ** _POWERS[(found[2] or "").lower()]
    amount = float(found[1]) * unit
    return round(amount) if amount < _MOST_BYTES else None


def bytes_text(count: int) -> str:
    """Return a number of bytes as people read it, to three digits: ``32 MB``."""
    amount, units = float(count), ["bytes", "kB", "MB", "GB"]
    while amount >= 999.5 and len(units) > 1:
        amount, units = amount / 1000, units[1:]
    return f"{amount:.3g} {units[0]}"


def owners(descriptions: Mapping[str, Representation], argument: str) -> list[str]:
    """Return the names of the representations that obey an argument."""
    return [name for name, each in descriptions.items() if argument in each.arguments]


def all_options(descriptions: Mapping[str, Representation]) -> dict[str, Option]:
    """Return the options of all representations by name, each option once."""
    return {option.name: option for each in descriptions.values() for option in each.options}


def own_options(descriptions: Mapping[str, Representation]) -> list[tuple[list[str], list[Option]]]:
    """Return the options of single representations, with the names of those that share them."""
    sharing: dict[str, list[str]] = {}
    for name, each in descriptions.items():
        for option in each.options:
            sharing.setdefault(option.name, []).append(name)
    found: dict[tuple[str, ...], list[Option]] = {}
    for option in all_options(descriptions).values():
        found.setdefault(tuple(sharing[option.name]), []).append(option)
    return [(list(names), options) for names, options in found.items()]


def listing(names: Sequence[str], word: str) -> str:
    """Join names by commas, and the last by a word: ``a, b or c``."""
    *others, last = names
    return f"{', '.join(others)} {word} {last}" if others else last


def counted(count: int, noun: str) -> str:
    """Return a number with its noun in the singular or the plural: ``1 level``, ``8 levels``."""
    return f"{count:,} {noun}" if count == 1 else f"{count:,} {noun}s"
