"""From the arguments that the library's messages speak of to the flags of the command line."""

import re

_ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)`")


def with_flags(message: str) -> str:
    """A message with each argument in backticks, such as `fix_nonfinite`, as --fix-nonfinite."""
    return _ARGUMENT.sub(lambda found: "--" + found[1].replace("_", "-"), message)
