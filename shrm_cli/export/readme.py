"""The README beside the files: what they are, how they lie, and the code that loads them."""

from shrm_cli import __release__
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.quoting import code_span, markdown

_SUFFIX = "_README.md"


def readme_name(name: str) -> str:
    """Return the name of the README of files whose names begin with a name."""
    return f"{name}{_SUFFIX}"


def readme(engine: Engine, light: Light, package: Package) -> str:
    """Return the README: a line each of title, files, what was done, and loading, and the code.

    File names stand in it without folders, so that the same light makes the same text anywhere.
    """
    files = ", ".join(code_span(file.name) for file in package.files)
    told = "; ".join(package.told) or "nothing was turned or scaled"
    lines = [
        f"Light of {markdown(light.source)} for {engine.title}, by shrm {__release__}. Linear RGB.",
        f"Files: {files}.",
        f"What was done: {told}.",
        f"Load it in {engine.title}:",
        *[f"    {line}" for line in package.loading],
    ]
    return "\n".join([*lines[:4], "", *lines[4:]]) + "\n"
