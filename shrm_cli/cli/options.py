"""Options that several subcommands share, and the functions that print their results."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from shrm_cli import settings
from shrm_cli.cli.completion import Spec
from shrm_cli.cli.terminal import echo, echo_json, echo_message, has_terminal
from shrm_cli.cli.threads import limit_libraries
from shrm_cli.cli.types import STOPS, PrimariesType, click_option
from shrm_cli.cli.usage import Applies, flags
from shrm_cli.layouts import IMAGE_LAYOUTS
from shrm_cli.maps.options import SHARED, Option, all_options
from shrm_cli.maps.registry import descriptions
from shrm_cli.vocabulary import ORIENTATIONS, PRECISIONS, PRIMARIES, SAMPLINGS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shrm_cli.probe.options import ReadOptions

Command = TypeVar("Command", bound=Callable[..., Any])

TURNS = ("yaw", "pitch", "roll")
"""The names of the options that turn light; they apply to some maps, too."""
_READING = ("layout", "orientation", *TURNS, "mirror", "up", "linearize", "part", "layer")
COLORS = ("primaries", "working")
"""The names of the options about colors; they apply to some maps, too."""
_SPEC = (
    "NAME, NAME:key=value,key=value, a measured file, or a sum such as "
    "0.5*lambertian+0.5*ggx; `shrm brdf` lists them."
)
brdf_option = click.option("--brdf", "spec", type=Spec(), metavar="SPEC", required=True, help=_SPEC)
optional_brdf_option = click.option("--brdf", type=Spec(), metavar="SPEC", help=_SPEC)
exposure_option = click.option(
    "--exposure", type=STOPS, metavar="EV", default=0.0, show_default=True,
    help="Stops: pictures are multiplied by 2^EV, in EXR too.",
)  # fmt: skip
precision_option = click.option(
    "--precision", type=click.Choice(PRECISIONS), default="auto",
    show_default=True,
    help="Pixel type of an EXR; auto is float where half overflows or costs dim light digits.",
)  # fmt: skip
probe_sampling_option = click.option(
    "--sampling", type=click.Choice(SAMPLINGS),
    help="Where edge pixels of the probe lie.",
)  # fmt: skip


exact_option = click.option(
    "--exact", is_flag=True,
    help="Sum the truth over all pixels of the probe, which takes up to a hundred times as long.  "
    "[default: adaptively, with an error that is stated]",
)  # fmt: skip


def with_options(command: Command, options: Sequence[Callable[[Command], Command]]) -> Command:
    """Add options to a command, which its help lists in this order."""
    for option in reversed(options):
        command = option(command)
    return command


def _disable_cache(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    if value:
        ctx.with_resource(settings.using(cache=False))


def _limit_threads(ctx: click.Context, param: click.Parameter, value: int | None) -> None:
    if value is not None:
        limit_libraries(value)
        ctx.with_resource(settings.using(threads=value))


def output_options(command: Command) -> Command:
    """Add the options --json and --quiet."""
    return with_options(
        command,
        [
            click.option("--json", "as_json", is_flag=True, help="Print results as JSON."),
            click.option("--quiet", is_flag=True, help="Print errors only."),
        ],
    )


def cache_option(command: Command) -> Command:
    """Add the option --no-cache."""
    return click.option(
        "--no-cache",
        is_flag=True,
        callback=_disable_cache,
        expose_value=False,
        help="Neither read nor keep coefficients of BRDFs.",
    )(command)


def report_options(command: Command) -> Command:
    """Add the options --json, --quiet, --threads and --no-cache."""
    threads = click.option(
        "--threads",
        type=click.IntRange(1, 1024),
        callback=_limit_threads,
        expose_value=False,
        is_eager=True,
        help="Threads for image files and integrals; the rest takes one.  [default: all]",
    )
    return with_options(command, [output_options, threads, cache_option])


def read_options(command: Command) -> Command:
    """Add the options about reading a probe's file; `make_read_options` takes their values."""
    return with_options(
        command,
        [
            click.option("--layout", type=click.Choice(IMAGE_LAYOUTS), help="Layout of the probe."),
            click.option(
                "--orientation",
                type=click.Choice(ORIENTATIONS),
                help="Orientation of its cube faces.",
            ),
            click.option(
                "--yaw", type=float, default=0.0, help="Turn it about +Y, degrees, +Z towards +X."
            ),
            click.option(
                "--pitch", type=float, default=0.0, help="Before that, about +X, +Y towards +Z."
            ),
            click.option(
                "--roll", type=float, default=0.0, help="And before that, about +Z, +X towards +Y."
            ),
            click.option("--mirror", is_flag=True, help="Mirror it, x -> -x."),
            click.option(
                "--up", type=click.Choice(["y", "z"]), default="y", help="Its axis that is up."
            ),
            click.option(
                "--linearize",
                is_flag=True,
                help="Decode its integers, as sRGB where it names no curve.",
            ),
            click.option("--part", metavar="NAME|N", help="Which of its parts is the light."),
            click.option("--layer", metavar="NAME", help="Which of its layers or views is."),
            click.option(
                "--fix-nonfinite",
                is_flag=True,
                help="Fill NaN and infinite pixels from neighbours.",
            ),
            click.option(
                "--clamp", type=float, metavar="X", help="Limit its radiance, keeping the hue."
            ),
            click.option(
                "--primaries",
                type=PrimariesType(),
                help=f"Its primaries, whatever it says: {', '.join(PRIMARIES)}, or x and y of "
                "red, green, blue and white.  [default: as it says, else rec709]",
            ),
            click.option(
                "--working",
                type=PrimariesType(),
                help="Convert its light to these primaries.  [default: it stays as it is]",
            ),
        ],
    )


def make_read_options(sampling: str | None, values: dict[str, Any]) -> ReadOptions:
    """Make `ReadOptions` from the values of `read_options`, which are removed from `values`.

    Raises
    ------
    click.BadParameter
        If --clamp is not positive, or an angle is not finite.
    """
    from shrm_cli.probe.options import ReadOptions, with_keywords

    return with_keywords(ReadOptions(), reading_keywords(sampling, values))  # type: ignore[arg-type]


def reading_keywords(sampling: str | None, values: dict[str, Any]) -> dict[str, Any]:
    """Return the keywords of `open_probe` from the values of `read_options`, which are removed.

    Raises
    ------
    click.BadParameter
        If --clamp is not positive, or an angle is not finite.
    """
    import math

    clamp = values["clamp"]
    if clamp is not None and not (math.isfinite(clamp) and clamp > 0):
        raise click.BadParameter("must be a positive number", param_hint="'--clamp'")
    for name in TURNS:
        if not math.isfinite(values[name]):
            raise click.BadParameter("must be a finite number of degrees", param_hint=f"'--{name}'")
    found = {"sampling": sampling, **{name: values.pop(name) for name in READING_NAMES[1:]}}
    return {name: value for name, value in found.items() if value not in (None, False)}


def reading_rules(holds: bool, words: str) -> dict[str, Applies]:
    """Return rules for `refuse_inapplicable` about the options for reading a probe's file."""
    return dict.fromkeys(READING_NAMES, Applies(holds, words))


READING_NAMES = ("sampling", *_READING, "fix_nonfinite", "clamp", *COLORS)
"""The names of the options for reading a probe's file."""


def shared_options(*names: str) -> Callable[[Command], Command]:
    """Return a decorator that adds options which several representations share, by name."""
    return lambda command: with_options(command, [click_option(SHARED[name]) for name in names])


def representation_options(
    wanted: Callable[[Option], bool] = lambda option: True,
) -> Callable[[Command], Command]:
    """Return a decorator that adds the wanted ones of all representations' own options."""
    options = all_options(descriptions()).values()
    return lambda command: with_options(
        command, [click_option(option) for option in options if wanted(option)]
    )


def conclude(
    result: dict[str, Any],
    lines: Sequence[str],
    warnings: Sequence[str],
    as_json: bool,
    quiet: bool,
    err: bool = False,
) -> None:
    """Print what a command has done, as JSON or as lines of text; warnings go to stderr.

    Parameters
    ----------
    result : dict
        What is printed as JSON; the warnings are added to it.
    lines : sequence of str
        What is printed as text.
    warnings : sequence of str
        Warnings may name arguments of the library in backticks.
    as_json : bool
        Whether to print JSON instead of the lines.
    quiet : bool
        Whether to leave out the lines and the warnings.
    err : bool
        Whether the lines go to stderr, because stdout holds something else.
    """
    if as_json:
        echo_json({**result, "warnings": [flags(line) for line in warnings]})
    elif not quiet:
        echo("\n".join(lines), err=err)
    warn(warnings, quiet)


def warn(lines: Sequence[str], quiet: bool) -> None:
    """Print warnings to stderr; they may name arguments of the library in backticks."""
    for line in [] if quiet else lines:
        echo_message(f"Warning: {flags(line)}")


def announce(lines: Sequence[str], quiet: bool) -> None:
    """Say on a terminal, before long work begins, what it will be."""
    if not quiet and has_terminal():
        echo("\n".join(lines), err=True)
