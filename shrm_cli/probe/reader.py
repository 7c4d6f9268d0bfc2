"""Probes in files that an installed package reads, by the suffixes that it names.

An entry point of the group `plugins.READERS` is called what the suffix is, in small letters and
without its dot, and names a function. It gets the path of the file, and returns its pixels and what
they are.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shrm_cli import plugins
from shrm_cli.errors import PluginError, ProbeError
from shrm_cli.messages import explained
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.image_file import check_file
from shrm_cli.records import record

_KEYS = {"layout", "orientation", "sampling", "chromaticities"}


@record(eq=False)
class ReadImage(ArrayImage):
    """Pixels that a package has read from a file."""

    path: Path  # type: ignore[assignment]
    file_format: str


def read_by_package(name: str) -> tuple[ReadImage, Mapping[str, Any]] | None:
    """Read a file by the package that names its suffix; None where none does.

    Returns
    -------
    ReadImage
    mapping of str
        What the package says of it: `Probe.from_array` has these arguments.

    Raises
    ------
    PluginError
        If the package's function cannot be loaded, fails, or returns something else.
    ProbeError
        If there is no such file, or the pixels are no image.
    """
    suffix = Path(name).suffix.lower().removeprefix(".")
    point = plugins.installed(plugins.READERS).get(suffix)
    if point is None:
        return None
    function, where = plugins.load(point), plugins.where(point)
    if not callable(function):
        raise PluginError(f"{where} is no function; make it one")
    path = check_file(name)
    try:
        pixels, description = function(path)
        unknown = sorted(description.keys() - _KEYS)
    except ProbeError:
        raise
    except Exception as error:
        raise PluginError(f"{name}: {where} failed: {explained(error)}") from error
    if unknown:
        known = ", ".join(sorted(_KEYS))
        raise PluginError(f"{where} describes {unknown[0]!r:.60}; it may tell {known}")
    return ReadImage(ArrayImage.copy_of(pixels, name).pixels, name, path, suffix), description
