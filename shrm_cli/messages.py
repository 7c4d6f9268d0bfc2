"""How messages call the arguments of the library, and how they tell of errors of foreign code.

Errors and warnings have arguments in backticks. On the command line they are flags; in light files,
manifests and scenes they are keys, which no flag stands for.
"""

import re

from shrm_cli.errors import ArgumentError

ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)(=False)?`")
"""An argument in a message: its name, and whether it is false."""


def as_keys(message: object) -> str:
    """Return a message about arguments as one about the keys of a file that gave them.

    Parameters
    ----------
    message : object
        An error of the library, or its text. It names `size` and `split=False` in backticks.

    Returns
    -------
    str
        The text with 'size' and 'split = false', as TOML has them.
    """
    return ARGUMENT.sub(
        lambda found: f"'{found[1]} = false'" if found[2] else f"'{found[1]}'", str(message)
    )


def explained(error: BaseException, path: str | None = None) -> str:
    """An error of foreign code in one line, with the last line of the file that took part in it."""
    import traceback  # slow to load, and rarely needed

    words = f"{type(error).__name__}: {error}".rstrip(": ")
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path is not None and frame.filename == path]
    place = f"line {lines[-1]}: " if lines else ""
    return place + " ".join(words.split())


def refuse_arguments(what: str, **values: object) -> None:
    """Raise an `ArgumentError`, if an argument is given, not None, that would change nothing.

    The message says that it does not apply to `what`, such as ``"a map of representation she"``.
    """
    for name, value in values.items():
        if value is not None:
            raise ArgumentError(name, f"does not apply to {what}")
