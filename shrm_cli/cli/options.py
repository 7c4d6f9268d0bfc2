"""Options that several subcommands share, and their headings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import click

import shrm_cli as shrm
from shrm_cli import settings, vocabulary
from shrm_cli.cli.types import (
    DIRECTION,
    NAMED_COLOR,
    OF_PRIMARIES,
    PATH,
    STOPS,
    Named,
    Spec,
    click_option,
    flag,
    option,
    whole,
)
from shrm_cli.cli.usage import Applies, given_options, remember
from shrm_cli.errors import PluginError
from shrm_cli.maps.options import SHARED, Option, all_options
from shrm_cli.maps.registry import description, descriptions, is_known
from shrm_cli.settings import limit_libraries

if TYPE_CHECKING:
    from shrm_cli.brdf.base import Color

Command = TypeVar("Command", bound=Callable[..., Any])

TURNS = ("yaw", "pitch", "roll")
"""The names of the options that turn light; they apply to some maps, too."""
_READING = ("layout", "orientation", *TURNS, "mirror", "up", "linearize", "part", "layer")
COLORS = ("primaries", "working")
"""The names of the options about colors; they apply to some maps, too."""
READING_NAMES = ("sampling", *_READING, "fix_nonfinite", "clamp", *COLORS)
"""The names of the options for reading a probe's file."""


_OWN = "Options of the form of an installed package"


def several(*options: Callable[[Any], Any]) -> Callable[[Command], Command]:
    """Return a decorator that adds options to a command, which its help lists in this order."""

    def decorate(command: Command) -> Command:
        for each in reversed(options):
            command = each(command)
        return command

    return decorate


def command_with_headings(
    headings: dict[str, list[str]],
    last: str = "Running",
    wanted: Callable[[Option], bool] = lambda option: True,
) -> type[click.Command]:
    """Return a class of commands whose help lists options under headings.

    They take options of the installed forms that ``--to`` names, too. They keep the words that they
    were called with, for command lines that are shown or written.

    `headings` are the names of options' values, by the heading that they stand under. All others
    come last, under `last`. `wanted` tells whether an option of an installed form is one of the
    command's.
    """
    place = {name: heading for heading, names in headings.items() for name in names}

    class WithHeadings(click.Command):
        def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
            ctx.meta["shrm.words"] = list(args)
            ctx.meta["shrm.own"] = _own_options(self, args, ctx.resilient_parsing, wanted)
            return super().parse_args(ctx, args)

        def make_parser(self, ctx: click.Context) -> Any:
            parser = super().make_parser(ctx)
            # click looks for -o among long options first, and loads difflib if it is not there.
            known = vars(parser)
            known.get("_long_opt", {}).update(known.get("_short_opt", {}))
            return parser

        def get_params(self, ctx: click.Context) -> list[click.Parameter]:
            return [*super().get_params(ctx), *ctx.meta.get("shrm.own", [])]

        def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
            rows: dict[str, list[tuple[str, str]]] = {each: [] for each in (*headings, last)}
            for param in self.get_params(ctx):
                record = param.get_help_record(ctx)
                if isinstance(param, click.Option) and record is not None:
                    is_own = param in ctx.meta.get("shrm.own", [])
                    heading = _OWN if is_own else place.get(param.name or "", last)
                    rows.setdefault(heading, []).append(record)
            for heading, records in rows.items():
                if records:
                    with formatter.section(heading):
                        formatter.write_dl(records)

    return WithHeadings


def _own_options(
    command: click.Command,
    words: Sequence[str],
    is_lenient: bool,
    wanted: Callable[[Option], bool],
) -> list[Any]:
    """Return the options of the installed forms that words of a command line name by ``--to``.

    `command` has the options that it shares with other forms already. `is_lenient` tells whether a
    form that cannot be used has none, because a shell completes.
    """
    kinds = [e.type for e in command.params if isinstance(e.type, Named) and "--to" in e.opts]
    if not kinds:
        return []
    named = [second for first, second in pairwise(words) if first == "--to"]
    named += [word.removeprefix("--to=") for word in words if word.startswith("--to=")]
    shared = {each.name for each in command.params}
    new = [name for name in named if name not in kinds[0].choices and is_known(name)]
    try:
        options = [option for name in new for option in description(name).options if wanted(option)]
    except PluginError:
        if is_lenient:
            return []
        raise
    return [_made_option(each) for each in options if not (each.prints or each.name in shared)]


def _made_option(option: Option) -> Any:
    """Return an option itself, which click makes as it decorates a function."""

    def decorated() -> None: ...

    click_option(option)(decorated)
    (made,) = decorated.__click_params__  # type: ignore[attr-defined]
    return made


def words_of_call() -> list[str]:
    """Return the words that the running command, which has headings, was called with."""
    return click.get_current_context().meta["shrm.words"]


def words_of_reading() -> list[str]:
    """Return the words about how a probe is read that the running command was called with."""
    values, words = click.get_current_context().params, []
    for name, word in given_options().items():
        if name in READING_NAMES:
            value = values[name]
            words += [word] if value is True else [word, value_word(value)]
    return words


def value_word(value: Any) -> str:
    """Return the word of a value on the command line; numbers of one option have commas between."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


_SPEC = (
    "NAME, NAME:key=value,key=value, a measured file, or a sum such as "
    "0.5*lambertian+0.5*ggx; `shrm brdf` lists them."
)
brdf_option = option("--brdf spec SPEC", Spec(), _SPEC, required=True)
optional_brdf_option = option("--brdf SPEC", Spec(), _SPEC)
brdfs_option = option(
    "--brdf brdfs SPEC", Spec(), multiple=True,
    help="A BRDF, as `shrm prefilter` takes it. May be repeated.",
)  # fmt: skip
materials_option = option(
    "--brdf specs SPEC", Spec(), multiple=True, required=True,
    help="A material, as `shrm prefilter` takes it. May be repeated.",
)  # fmt: skip
_DIRECTION = "Direction to the viewer, degrees: azimuth from +Z towards +X, elevation."
view_option = option("--view", DIRECTION, _DIRECTION, default="0,0")
_VIEWS = ("0,0", "120,20", "240,-20")


def views_option(name: str) -> Callable[[Command], Command]:
    """Return the option --view, whose value has a name: the directions to several viewers."""
    return option(
        f"--view {name}", DIRECTION, multiple=True, default=_VIEWS, show_default=False,
        help=f"{_DIRECTION} May be given several times.  [default: {' '.join(_VIEWS)}]",
    )  # fmt: skip


stops = partial(option, "--exposure EV", STOPS)
lit_by = partial(option, "--probe PROBE", PATH)
written_to = partial(option, "-o --output", PATH)
"""`stops`, `lit_by` and `written_to`: options with a help of their own."""
exposure_option = stops(
    "Stops: pictures are multiplied by 2^EV, in EXR too.  [default: 0, or, where most of a PNG "
    "would be white, or all but black, what shows it, which is said]"
)


def told_of_exposure(asked: float | None, exposure: float) -> list[str]:
    """Return a line about the exposure of a picture that would else show nothing."""
    if asked is not None or not exposure:
        return []
    looks = "most of a picture is white" if exposure < 0 else "it is all but black"
    return [f"  exposure       {exposure:g}, as at 0 {looks}; --exposure takes another"]


_PRECISION = "Pixel type of an EXR; auto is float where half overflows or costs dim light digits"
precision_option = option(
    "--precision", click.Choice(vocabulary.PRECISIONS), default="auto", help=f"{_PRECISION}."
)
kept_precision_option = option(
    "--precision", click.Choice(vocabulary.PRECISIONS), default="auto",
    help=f"{_PRECISION}, and wherever a map is changed, so that nothing is rounded twice.",
)  # fmt: skip
exact_option = flag(
    "--exact",
    help="Sum the truth over all pixels of the probe, as points, which takes up to a hundred times "
    "as long and is wrong for lobes that are narrower than a pixel.  "
    "[default: adaptively, with an error that is stated]",
)  # fmt: skip
truth_options = several(
    option(
        "--source-height ROWS", whole(2, vocabulary.MAX_SOURCE_HEIGHT),
        help="Rows that the probe is averaged down to for the truth.  [default: all]",
    ),
    exact_option,
)  # fmt: skip
_sampling = click.Choice(vocabulary.SAMPLINGS)


def _disable_cache(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        ctx.with_resource(settings.using(cache=False))


def _limit_threads(ctx: click.Context, param: click.Parameter, value: int | None) -> None:
    if value is not None:
        limit_libraries(value)
        ctx.with_resource(settings.using(threads=value))


output_options = several(
    flag("--json as_json", "Print results as JSON.", callback=remember, expose_value=False),
    flag("--quiet", "Print errors only.", callback=remember, expose_value=False),
)  # fmt: skip
cache_option = flag(
    "--no-cache", callback=_disable_cache, expose_value=False,
    help="Neither read nor keep coefficients of BRDFs.",
)  # fmt: skip
report_options = several(
    output_options,
    option(
        "--threads", whole(1, 1024), callback=_limit_threads, expose_value=False,
        is_eager=True,
        help="Threads for image files and integrals; the rest takes one.  [default: all]",
    ),
    cache_option,
)  # fmt: skip
read_options = several(
    option("--layout", click.Choice(vocabulary.IMAGE_LAYOUTS), "Layout of the probe."),
    option(
        "--orientation", click.Choice(vocabulary.ORIENTATIONS), "Orientation of its cube faces."
    ),
    option(
        "--yaw", float, "Turn it about +Y, degrees, +Z towards +X.", default=0.0, show_default=False
    ),
    option(
        "--pitch", float, "Before that, about +X, +Y towards +Z.", default=0.0, show_default=False
    ),
    option(
        "--roll", float, default=0.0, show_default=False,
        help="And before that, about +Z, +X towards +Y.",
    ),
    flag("--mirror", "Mirror it, x -> -x."),
    option(
        "--up", click.Choice(["y", "z"]), "Its axis that is up.", default="y", show_default=False
    ),
    flag("--linearize", "Decode its integers, as sRGB where it names no curve."),
    option("--part NAME|N", str, "Which of its parts is the light."),
    option("--layer NAME", str, "Which of its layers or views is."),
    flag("--fix-nonfinite", "Fill NaN and infinite pixels from neighbours."),
    option("--clamp X", float, "Limit its radiance, keeping the hue."),
    option(
        "--primaries", OF_PRIMARIES,
        help=f"Its primaries, whatever it says: {', '.join(vocabulary.PRIMARIES)}, or x and y of "
        "red, green, blue and white.  [default: as it says, else rec709]",
    ),
    option(
        "--working", OF_PRIMARIES,
        help="Convert its light to these primaries.  [default: it stays as it is]",
    ),
)  # fmt: skip
"""The options about reading a probe's file, but --sampling; `make_read_options` takes them all."""
probe_options = several(
    option("--sampling", _sampling, "Where edge pixels of the probe lie."),
    read_options,
)


def make_read_options(values: dict[str, Any], sampling: str | None = None) -> shrm.ReadOptions:
    """Make `ReadOptions` from the values of `probe_options`, which are removed from `values`.

    `sampling` is where the edge pixels lie, in place of the value of --sampling. Raises
    click.BadParameter if --clamp is not positive, or an angle is not finite.
    """
    from shrm_cli.probe.options import with_keywords

    return with_keywords(shrm.ReadOptions(), reading_keywords(values, sampling))  # type: ignore[arg-type]


def reading_keywords(values: dict[str, Any], sampling: str | None = None) -> dict[str, Any]:
    """Return the keywords of `open_probe`, from what `make_read_options` takes."""
    clamp = values["clamp"]
    if clamp is not None and not (math.isfinite(clamp) and clamp > 0):
        raise click.BadParameter("must be a positive number", param_hint="'--clamp'")
    for name in TURNS:
        if not math.isfinite(values[name]):
            raise click.BadParameter("must be a finite number of degrees", param_hint=f"'--{name}'")
    found = {name: values.pop(name, None) for name in READING_NAMES} | (
        {"sampling": sampling} if sampling else {}
    )
    return {name: value for name, value in found.items() if value not in (None, False)}


def reading_rules(holds: bool, words: str) -> dict[str, Applies]:
    """Return rules for `refuse_inapplicable` about the options for reading a probe's file."""
    return dict.fromkeys(READING_NAMES, (holds, words))


def shared_options(*names: str) -> Callable[[Command], Command]:
    """Return a decorator that adds options which several representations share, by name."""
    return several(*(click_option(SHARED[name]) for name in names))


def representation_options(
    wanted: Callable[[Option], bool] = lambda option: True,
) -> Callable[[Command], Command]:
    """Return a decorator that adds the wanted ones of all representations' own options."""
    options = all_options(descriptions()).values()
    return several(*(click_option(option) for option in options if wanted(option)))


def making_options(
    probes: str, cubes: str, wanted: Callable[[Option], bool] = lambda option: True
) -> Callable[[Command], Command]:
    """Return a decorator that adds the options of making maps, each of them once.

    `probes` and `cubes` are what the command calls what it reads and writes: ``probe`` or
    ``probes``.
    """
    return several(
        shared_options("eps", "error", "seen", "order_f", "order_p", "center"),
        representation_options(wanted),
        shared_options("domain", "source_height", "frame", "size", "max_size", "sun"),
        precision_option,
        option(
            "--sampling", _sampling,
            help=f"Where edge pixels lie, in the {probes} and in the written {cubes}.",
        ),
        option("--probe-sampling", _sampling, f"The same, of the {probes} alone."),
        option("--map-sampling", _sampling, f"The same, of the written {cubes} alone."),
    )  # fmt: skip


NamedColors = tuple[tuple[str, "Color"], ...]

room_options = several(
    option("--probe", PATH, "Light that is seen past the room, such as through windows."),
    option(
        "--albedo", NAMED_COLOR, multiple=True,
        help="What a material reflects, in place of its base colour. May be repeated.",
    ),
    option(
        "--emit", NAMED_COLOR, multiple=True,
        help="Radiance that a material sends. May be repeated.",
    ),
)  # fmt: skip
"""The options of commands that light rooms."""
