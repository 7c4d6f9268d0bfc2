"""What messages call the arguments of the library, for those who gave them by other means.

Errors and warnings have arguments in backticks. On the command line they are flags; in light files,
manifests and scenes they are keys, which no flag stands for.
"""

import re

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
