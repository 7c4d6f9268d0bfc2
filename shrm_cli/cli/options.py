"""Options that several subcommands share, and how they report."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from shrm_cli import settings
from shrm_cli.cli.flags import with_flags
from shrm_cli.cli.threads import limit_libraries
from shrm_cli.cli.types import STOPS, Components
from shrm_cli.layouts import IMAGE_LAYOUTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from shrm_cli.maps.representations import Compression
    from shrm_cli.probe.options import ReadOptions

Command = TypeVar("Command", bound=Callable[..., Any])

REPRESENTATIONS = ("shrm", "cabral", "kautz-mccool", "lightfield")
ENGINE_REPRESENTATIONS = ("irradiance", "splitsum", "she")
ALL_REPRESENTATIONS = (*REPRESENTATIONS, *ENGINE_REPRESENTATIONS)


_SPEC = (
    "NAME, NAME:key=value,key=value, a measured file, or a sum such as "
    "0.5*lambertian+0.5*ggx; `shrm brdf` lists them."
)
brdf_option = click.option("--brdf", "spec", metavar="SPEC", required=True, help=_SPEC)
optional_brdf_option = click.option("--brdf", "spec", metavar="SPEC", help=_SPEC)
exposure_option = click.option(
    "--exposure", type=STOPS, metavar="EV", default=0.0, show_default=True,
    help="Stops: pictures are multiplied by 2^EV, in EXR too.",
)  # fmt: skip
precision_option = click.option(
    "--precision", type=click.Choice(["auto", "half", "float"]), default="auto",
    show_default=True, help="Pixel type of an EXR; auto is float where half would overflow.",
)  # fmt: skip
probe_sampling_option = click.option(
    "--sampling", type=click.Choice(["center", "border"]),
    help="Where edge pixels of the probe lie.",
)  # fmt: skip


def _apply(command: Command, options: list[Callable[[Command], Command]]) -> Command:
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


def report_options(command: Command) -> Command:
    """--json, --quiet, --threads."""
    return _apply(
        command,
        [
            click.option("--json", "as_json", is_flag=True, help="Print results as JSON."),
            click.option("--quiet", is_flag=True, help="Print errors only."),
            click.option(
                "--threads",
                type=click.IntRange(1, 1024),
                callback=_limit_threads,
                expose_value=False,
                is_eager=True,
                help="Threads for image files and integrals; the rest takes one.  [default: all]",
            ),
            click.option(
                "--no-cache",
                is_flag=True,
                callback=_disable_cache,
                expose_value=False,
                help="Neither read nor keep coefficients of BRDFs.",
            ),
        ],
    )


def read_options(command: Command) -> Command:
    """How a probe's file is to be understood; pass the values on to `make_read_options`."""
    return _apply(
        command,
        [
            click.option("--layout", type=click.Choice(IMAGE_LAYOUTS), help="Layout of the probe."),
            click.option(
                "--orientation",
                type=click.Choice(["openexr", "gl"]),
                help="Orientation of its cube faces.",
            ),
            click.option(
                "--yaw", type=float, default=0.0, help="Turn it about +Y, degrees, +Z towards +X."
            ),
            click.option("--mirror", is_flag=True, help="Mirror it, x -> -x."),
            click.option(
                "--up", type=click.Choice(["y", "z"]), default="y", help="Its axis that is up."
            ),
            click.option("--linearize", is_flag=True, help="Decode integer pixels as sRGB."),
            click.option(
                "--fix-nonfinite",
                is_flag=True,
                help="Fill NaN and infinite pixels from neighbours.",
            ),
            click.option(
                "--clamp", type=float, metavar="X", help="Limit its radiance, keeping the hue."
            ),
        ],
    )


def make_read_options(sampling: str | None, values: dict[str, Any]) -> ReadOptions:
    """`ReadOptions` from the values of `read_options`."""
    import math

    from shrm_cli.probe.options import ReadOptions
    from shrm_cli.probe.pixels import PixelPolicy

    clamp = values.pop("clamp")
    if clamp is not None and not (math.isfinite(clamp) and clamp > 0):
        raise click.BadParameter("must be a positive number", param_hint="'--clamp'")
    if not math.isfinite(values["yaw"]):
        raise click.BadParameter("must be a finite number of degrees", param_hint="'--yaw'")
    policy = PixelPolicy(values.pop("fix_nonfinite"), clamp)
    return ReadOptions(sampling=sampling, pixels=policy, **values)  # type: ignore[arg-type]


def refuse_read_options(why: str) -> None:
    """Refuse options about a probe's file where there is none: nothing would obey them."""
    context = click.get_current_context()
    about_probes = {"sampling", "layout", "orientation", "yaw", "mirror", "up", "linearize"}
    about_probes |= {"fix_nonfinite", "clamp"}
    for param in context.command.params:
        given = param.name in about_probes and context.get_parameter_source(param.name)
        if given is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{param.opts[-1]} is about a light probe; {why}", context)


def refuse_foreign(
    representation: str, owners: Mapping[str, Sequence[str]], notes: Mapping[str, str]
) -> None:
    """Refuse options that say nothing with the representation that --to names.

    Parameters
    ----------
    representation : str
    owners : mapping
        By the name of an option's parameter: the representations that it is for. What it does
        not name is for all.
    notes : mapping
        By the same names: what to add to the refusal.
    """
    context = click.get_current_context()
    for param in context.command.params:
        of = owners.get(param.name or "", (representation,))
        given = context.get_parameter_source(param.name or "") is ParameterSource.COMMANDLINE
        if given and representation not in of:
            *others, last = of
            names = f"{', '.join(others)} or {last}" if others else last
            note = notes.get(param.name or "", "")
            raise click.BadParameter(
                f"is for --to {names}{note and '; '}{note}",
                context,
                param_hint=f"'{param.opts[0]}'",
            )


def refuse_options(owner: str, **values: Any) -> None:
    """Refuse options, by their names, whose values are not None where nothing obeys them."""
    for name, value in values.items():
        if value is not None:
            option = f"--{name.replace('_', '-')}"
            raise click.BadParameter(f"says nothing with {owner}", param_hint=f"'{option}'")


def view_options(command: Command) -> Command:
    """--slices, --views, --compress; pass the values on to `view_count` and `compression`."""
    return _apply(
        command,
        [
            click.option(
                "--slices", type=click.IntRange(1, 1024), metavar="T",
                help="Angles theta_o of a kautz-mccool map.  [default: 10 P]",
            ),
            click.option(
                "--views", type=click.IntRange(1, 128), metavar="T",
                help="A lightfield has T x T views.  [default: 10 P]",
            ),
            click.option(
                "--compress", type=Components(),
                help="Keep K principal components of an SHRM, or as many as an error X needs.",
            ),
        ],
    )  # fmt: skip


def view_count(representation: str, slices: int | None, views: int | None) -> int | None:
    """Samples along an axis of the view, from the option that belongs to the representation."""
    for option, value, owner in (
        ("--slices", slices, "kautz-mccool"),
        ("--views", views, "lightfield"),
    ):
        if value is not None and representation != owner:
            raise click.BadParameter(f"is for --to {owner}", param_hint=f"'{option}'")
    return slices or views


def compression(
    representation: str, components: tuple[int | None, float] | None
) -> Compression | None:
    """What --compress asks for."""
    from shrm_cli.maps.representations import Compression

    if components is None:
        return None
    if representation != "shrm":
        raise click.BadParameter("is for --to shrm", param_hint="'--compress'")
    return Compression(*components)


def probe_stem(probe: str) -> str:
    """Name of the outputs of a probe; six files have their ``%`` left out."""
    return Path(probe).stem.replace("%", "").rstrip("_-.") or "probe"


def warn(lines: list[str], quiet: bool) -> None:
    """Print warnings to stderr."""
    for line in [] if quiet else lines:
        click.echo(f"Warning: {with_flags(line)}", err=True)


def print_json(value: Any) -> None:
    """Print a result as JSON, with its keys as they are, to stdout."""
    click.echo(json.dumps(value, indent=2, ensure_ascii=False))


@contextmanager
def progress_bar(label: str, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A callable (done, all) that shows progress on a terminal, once the work takes a second."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(desc=label, delay=1.0, leave=False, file=sys.stderr) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show
