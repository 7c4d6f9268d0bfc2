"""What packages that are installed add to `shrm`, by their entry points.

Nothing is looked for but where a name is none of `shrm` itself, or where all names are listed, and
nothing is loaded but what is named: metadata of many packages take longer to read than short runs.
"""

from __future__ import annotations

import os
import sys
import warnings
from contextlib import suppress
from importlib.machinery import PathFinder
from typing import TYPE_CHECKING

from shrm_cli.errors import PluginError, ShrmWarning
from shrm_cli.messages import explained

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

BRDFS = "shrm.brdf"
"""The group of BRDFs, each a subclass of `shrm_cli.brdf.base.Brdf`."""
COMMANDS = "shrm_cli.commands"
"""The group of commands, each a `click.Command`."""
ENGINES = "shrm_cli.engines"
"""The group of engines, each a subclass of `shrm_cli.export.engine.Engine`."""

FORMS = "shrm_cli.forms"
"""The group of forms of maps, each a `maps.options.Representation`; see `maps.installed`."""

READERS = "shrm_cli.readers"
"""The group of functions that read probes, by the suffixes of their files; see `probe.open`."""

_POINTS = "entry_points.txt"

_loaded: dict[str, EntryPoint] = {}
"""An entry point of each package that was loaded, by the name of its outermost module."""


def installed(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; of several with the same name the first that is found.

    Where a package's list cannot be read, which Python says without naming it, there are none.
    """
    if not _may_be_named(group):
        return {}
    import importlib.metadata  # slow to load, and rarely needed

    found: dict[str, EntryPoint] = {}
    try:
        for each in importlib.metadata.entry_points(group=group):
            found.setdefault(each.name, each)
    except Exception as error:
        what = f"entry points of installed packages cannot be read: {explained(error)}"
        warnings.warn(what, ShrmWarning, stacklevel=2)
    return found


def _may_be_named(group: str) -> bool:
    """Tell whether a package on Python's path may have entry points of a group.

    Their files are only searched for its name. To parse those of all packages takes five times as
    long, with what has to be imported for it.
    """
    heading = f"[{group}]".encode()
    for folder in sys.path:
        try:
            entries = [each.path for each in os.scandir(folder or ".")]
        except OSError:
            if os.path.isfile(folder):  # an archive
                return True
            continue
        for entry in entries:
            if entry.endswith(".egg"):  # an archive or a folder
                return True
            if entry.endswith((".dist-info", ".egg-info")):
                with suppress(OSError), open(os.path.join(entry, _POINTS), "rb") as stream:
                    if heading in stream.read():
                        return True
    # What finds packages elsewhere is asked.
    return any(hasattr(each, "find_distributions") for each in sys.meta_path if each != PathFinder)


def where(point: EntryPoint) -> str:
    """What messages call an entry point: its name, its value and its package."""
    package = "" if point.dist is None else f" of the package {point.dist.name}"
    return f"{point.name}: the entry point {point.value!r}{package}"


def load(point: EntryPoint) -> object:
    """Import what an entry point names.

    Raises PluginError: whatever goes wrong as its modules are imported.
    """
    _loaded.setdefault(point.module.partition(".")[0], point)
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        raise PluginError(f"{where(point)} cannot be loaded: {explained(error)}") from error


def culprit(error: BaseException) -> str:
    """Return the name of the installed package whose code took part in an error; empty if none."""
    import traceback  # slow to load, and rarely needed

    for frame, _ in traceback.walk_tb(error.__traceback__):
        name = str(frame.f_globals.get("__name__")).partition(".")[0]
        if name in _loaded and name != "shrm_cli":
            package = _loaded[name].dist
            return name if package is None else package.name
    return ""
