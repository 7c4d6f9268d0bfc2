"""`shrm` itself finds the subcommand, and turns errors into one line and an exit code."""

from __future__ import annotations

import importlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click

import shrm_cli
from shrm_cli import settings
from shrm_cli.cli import usage
from shrm_cli.cli.terminal import echo_message, tell_nobody, warn
from shrm_cli.cli.types import flag
from shrm_cli.errors import ArgumentError, PluginError, ShrmError, ShrmWarning
from shrm_cli.files.whole import protecting
from shrm_cli.settings import limit_small_products

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_REQUIRED = ("numpy", "OpenImageIO", "OpenEXR", "click", "tqdm", "platformdirs")
"""The packages without which there is no shrm, such as where its folder alone was copied."""
# The module of a command is imported only when the command runs, so that --help is immediate.
_COMMANDS = {
    "prefilter": "Prefilter a light probe for a BRDF.",
    "batch": "Make maps of many probes.",
    "render": "Render spheres and meshes from maps.",
    "view": "Show maps in a browser, interactively.",
    "lookdev": "Show materials under probes, on one sheet.",
    "report": "Report on a probe and its maps: a page to send.",
    "contact": "Put many maps onto one page.",
    "choose": "Say which form of a map to ship.",
    "compare": "Set maps, and the truth, side by side.",
    "convert": "Convert maps and probes.",
    "export": "Make the files that an engine loads.",
    "reference": "Render the correct sphere, by brute force.",
    "analyze": "Analyse the orders and the accuracy of a BRDF.",
    "info": "Print what a file is.",
    "brdf": "List the BRDFs, or explain one.",
    "probe": "Make a light probe.",
    "light": "Edit light by its coefficients, and show their basis.",
    "sun": "Take the sun and other lamps out of a probe.",
    "product": "Make the product texture of a BRDF, brushed ones too.",
    "transfer": "Bake how a mesh shadows and lights itself.",
    "grid": "Bake a grid of probes in a room.",
    "dfg": "Make the environment-BRDF table of the split sum.",
    "cache": "Clear the cache of BRDF coefficients.",
}


_STOPPING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""The signals that end a process; Windows has no SIGHUP."""


_PLAINER = {
    "integer range": "whole number", "integer": "whole number", "float range": "number",
    "float": "number",
}  # fmt: skip
"""What click calls its types of numbers, and what they are."""

_A_WHILE = 0.01
"""The seconds after which a signal is raised again that could not be obeyed."""


class _LazyGroup(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*_COMMANDS, *_installed()]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name in _COMMANDS:
            return getattr(importlib.import_module(f"shrm_cli.cli.{name}"), name)
        point = _installed().get(name)
        try:
            return None if point is None else _load(point)
        except PluginError:
            if ctx.resilient_parsing:  # a shell completes, and goes on with what there is
                return None
            raise

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in _COMMANDS and not args[0].startswith("-"):
            known = self.list_commands(ctx)
            if args[0] not in known:
                import difflib

                near = difflib.get_close_matches(args[0], known, n=1)
                hint = f" Did you mean {near[0]!r}?" if near else ""
                ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))
        rows, problems = [], []
        for name, point in _installed().items():
            try:
                rows.append((name, _load(point).get_short_help_str(formatter.width)))
            except PluginError as error:
                problems.append(str(error))
        if rows:
            with formatter.section("Commands of installed packages"):
                formatter.write_dl(rows)
        warn(problems)


def _installed() -> dict[str, EntryPoint]:
    """Return the commands of installed packages; names of `shrm` itself come first."""
    from shrm_cli.plugins import COMMANDS, installed  # rarely needed

    found = installed(COMMANDS)
    return {name: found[name] for name in sorted(found) if name not in _COMMANDS}


def _load(point: EntryPoint) -> click.Command:
    from shrm_cli.plugins import load, where

    found = load(point)
    if not isinstance(found, click.Command):
        raise PluginError(f"{where(point)} is no click.Command; make it one")
    return found


def _tell_version(context: click.Context, parameter: click.Parameter, asked: bool) -> None:
    """Print the version, which is read only now, and end."""
    if asked and not context.resilient_parsing:
        click.echo(f"shrm, version {shrm_cli.__version__}")
        context.exit()


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@flag(
    "--version", expose_value=False, is_eager=True, callback=_tell_version,
    help="Show the version and exit.",
)  # fmt: skip
@flag("--debug", "Show tracebacks.")
def cli(debug: bool) -> None:
    """Prefilter light probes for real materials, with a stated and kept error bound.

    \b
      shrm prefilter probe.exr --brdf microfacet --eps 0.03
      shrm render probe.microfacet.shrm.exr
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 failed, 2 wrong usage, 130 interrupted."""
    arguments = sys.argv[1:] if arguments is None else arguments
    _open_standard_streams()
    for number in _STOPPING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it
            signal.signal(number, _stop)
    sys.unraisablehook = _raise_signal_again
    limit_small_products()
    if "--debug" not in arguments:
        # Numpy's warnings are hidden, because values are checked to be finite when written.
        warnings.simplefilter("ignore")
    warnings.simplefilter("default", ShrmWarning)
    warnings.showwarning = _show_warning
    try:
        # A command that fails halfway leaves no settings behind.
        with _unwrapped(), settings.using(), protecting():
            code = cli.main(arguments, prog_name="shrm", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.exceptions.Exit as stop:
        sys.exit(stop.exit_code)
    except click.UsageError as error:
        # If no command is given, click raises an error whose own `show` prints the help.
        if type(error).show is not click.UsageError.show:
            error.show()
            sys.exit(error.exit_code)
        _fail(_with_hint(error, arguments), error.exit_code)
    except click.ClickException as error:
        _fail(error.format_message(), error.exit_code)
    except ArgumentError as error:
        _fail(f"{usage.flags(str(error), arguments)}; see {_path(arguments)} --help", 2)
    except (KeyboardInterrupt, click.Abort) as stop:
        cause = stop.__cause__
        if not isinstance(cause, EOFError):  # which click takes for Ctrl-D
            _fail("interrupted", 130)
        if "--debug" in arguments:
            raise
        _fail(_one_line(cause, arguments), 1)
    except _Stopped as stop:
        # A terminal that was closed, which sends SIGHUP, has nobody to tell.
        if stop.number == signal.SIGTERM:
            echo_message("Error: stopped by SIGTERM")
        sys.exit(stop.code)
    except Exception as error:
        if "--debug" in arguments:
            raise
        _fail(_one_line(error, arguments), 1)


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Say what the library warns of, such as what of a material is left out."""
    warn([str(message)])


def _one_line(error: BaseException, arguments: list[str]) -> str:
    if isinstance(error, ShrmError):
        return usage.flags(str(error), arguments)
    if isinstance(error, MemoryError):
        return "out of memory; lower --size or the orders"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'standard output'}: {error.strerror}"
    if isinstance(error, ModuleNotFoundError) and error.name in _REQUIRED:
        return f"shrm needs the package {error.name}, which this Python has not; install it"
    what = f"{type(error).__name__}: {error}"
    named = _named(arguments)
    told = "internal error, please report it"
    if named and named not in _COMMANDS:
        told = f"the installed command {named!r} failed, please report it to its authors"
    elif (plugins := sys.modules.get("shrm_cli.plugins")) and (package := plugins.culprit(error)):
        told = f"the installed package {package!r} failed, please report it to its authors"
    return f"{told} ({what}); shrm --debug ... tells more"


def _named(arguments: list[str]) -> str:
    """Return the name of the command; the options before it take no values."""
    return next((each for each in arguments if not each.startswith("-")), "")


def _path(arguments: list[str]) -> str:
    """Return what the command is called, such as ``shrm probe ball``."""
    words = [each for each in arguments if not each.startswith("-")][:2]
    group = getattr(sys.modules.get(f"shrm_cli.cli.{_named(arguments)}"), _named(arguments), None)
    known = group.commands if isinstance(group, click.Group) else {}
    return " ".join(["shrm", *words[:1], *(each for each in words[1:] if each in known)])


def _with_hint(error: click.UsageError, arguments: list[str]) -> str:
    message = error.format_message().rstrip(".")
    for name, plain in _PLAINER.items():
        message = message.replace(f"is not a valid {name}", f"is no {plain}")
    if isinstance(error, click.NoSuchOption):
        for each in arguments:
            if each.startswith("-") and os.path.lexists(each):
                return f"{message}; the file of that name is ./{each}"
    if message.endswith(("?", "?)")):  # the message already says what to do
        return message
    command = error.ctx.command_path if error.ctx else _path(arguments)
    return f"{message}; see {command} --help"


def _fail(message: str, code: int) -> NoReturn:
    echo_message(f"Error: {message}")
    sys.exit(code)


def _open_standard_streams() -> None:
    """Give streams that were closed before the process began to the null device.

    Otherwise the next file that is opened would get the number of stderr, for example, and what
    libraries print there would be written into it. That results cannot be printed stays an error.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        tell_nobody()


class _Stopped(SystemExit):
    """An exit because of a signal."""

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number


@contextmanager
def _unwrapped() -> Iterator[None]:
    """Context manager that raises the exception of a signal as it is.

    Python 3.11 makes it the cause of a RuntimeError where it comes while a class names its fields.
    """
    try:
        yield
    except RuntimeError as error:
        if isinstance(error.__cause__, _Stopped | KeyboardInterrupt):
            raise error.__cause__ from None
        raise


def _raise_signal_again(dropped: Any) -> None:
    """Raise a signal again whose exception was dropped, because it came in a callback of Python's.

    There are such callbacks wherever objects are freed, above all while modules are loaded. A while
    later the thread is out of them.
    """
    is_interrupted = issubclass(dropped.exc_type, KeyboardInterrupt)
    number = signal.SIGINT if is_interrupted else getattr(dropped.exc_value, "number", None)
    if number is None:
        sys.__unraisablehook__(dropped)
        return
    again = threading.Timer(_A_WHILE, signal.raise_signal, [number])
    again.daemon = True
    again.start()


def _stop(number: int, frame: FrameType | None) -> Any:
    """Unwind on a signal as an exit does, so that temporary files are removed."""
    raise _Stopped(number)
