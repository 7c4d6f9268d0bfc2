"""`export`: from a probe or maps to the files that an engine loads."""

import os
from collections.abc import Sequence
from pathlib import Path

from shrm_cli.export.engine import Package
from shrm_cli.export.engine import engine as engine_of
from shrm_cli.export.make import Asked, Source, write
from shrm_cli.export.make import export as packaged
from shrm_cli.probe.options import ReadOptions
from shrm_cli.progress import Progress


def export(
    sources: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    engine: str,
    folder: str | os.PathLike[str] | None = None,
    *,
    asked: Asked | None = None,
    reading: ReadOptions | None = None,
    progress: Progress | None = None,
) -> Package:
    """Make the files that an engine loads, and a README with the code that loads them.

    Parameters
    ----------
    sources : path-like or sequence of path-like
        A light probe, or a split sum, an irradiance map, or both.
    engine : str
        One of `vocabulary.ENGINES`, or that of an installed package.
    folder : path-like, optional
        Where the files are written, all or none of them; by default they are not.
    asked : Asked, optional
        Sizes, texels and more that the engine would choose itself.
    reading : ReadOptions, optional
        How a probe is read.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Package
        Its `files`, and what was `told` of them.

    Raises
    ------
    ArgumentError, ProbeError, MapError, OutputError, PluginError

    Examples
    --------
    >>> made = shrm.export("probes/studio.exr", "unity")
    >>> any(file.name.endswith("_README.md") for file in made.files)
    True
    """
    paths = [sources] if isinstance(sources, str | os.PathLike) else list(sources)
    source = Source.open([os.fspath(each) for each in paths], reading=reading)
    made = packaged(source, engine_of(engine), asked or Asked(), progress)
    if folder is not None:
        write(made, Path(folder))
    return made
