"""The README of an export, which says what was done, how it is loaded, and what made it."""

import re
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from shrm_cli import __release__
from shrm_cli.export.asset import Asset
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.quoting import code_span, markdown
from shrm_cli.files.whole import exists_error

if TYPE_CHECKING:
    from shrm_cli.export.make import Asked, Source

README = "_README.md"
"""What the names of these files end in."""
_RECIPE = "Recipe "
_LAST = re.compile(rf"^{_RECIPE}([0-9a-f]{{16}}),", re.MULTILINE)


def readme(engine: Engine, light: Light, package: Package, recipe: str) -> str:
    """Return the README: a line each of title, files, what was done, and loading, with the code.

    File names stand in it without folders, so that the same light makes the same text anywhere.
    """
    files = ", ".join(code_span(file.name) for file in package.files)
    told = "; ".join(package.told) or "nothing was turned or scaled"
    lines = [
        f"Light of {markdown(light.source)} for {engine.title}, by shrm {__release__}. Linear RGB.",
        f"Files: {files}.",
        f"What was done: {told}.",
        f"{_RECIPE}{recipe}, which tells shrm what other light or options made.",
    ]
    if package.loading:
        code = (f"    {line}" for line in package.loading)
        lines += [f"Load it in {engine.title}:", "", *code]
    return "\n".join(lines) + "\n"


def recipe_of(source: "Source", engine: Engine, asked: "Asked", asset: Asset | None) -> str:
    """Return a digest of the light, of what is asked, and of the release."""
    probe, maps = source.probe, [each.info for each in (source.split, source.irradiance) if each]
    light = maps if probe is None else [probe.digest(), probe.reading()]
    into = None if asset is None else (asset.tree, sha256(asset.data).hexdigest())
    parts = engine.name, source.title, light, replace(asked, into=None), into, __release__
    return sha256(repr(parts).encode()).hexdigest()[:16]


def refuse_other(path: Path, recipe: str) -> None:
    """Refuse a folder whose README says that other light or options made it."""
    with suppress(OSError, ValueError):
        found = _LAST.findall(path.read_text(encoding="utf-8"))
        if found and found[-1] != recipe:
            raise exists_error(path, "other inputs or options made it")
