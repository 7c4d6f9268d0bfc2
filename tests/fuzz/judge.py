"""What a user may not see: the findings in how a command ended and in the files that it left."""

import json
import signal
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path

from tests.fuzz.child import WORKS, Outcome

_RESIDENT = 2**30  # the most memory of a case, whose input is tiny
_MOST_LINE = 1500  # characters of a line on stderr
_HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")


def of_signal(code: int) -> str:
    """Return what is wrong if a process ended instead of reporting."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return "takes too long"
    return f"the process ended with {code}"


def of_outcome(outcome: Outcome, as_json: bool) -> list[str]:
    """Return what is wrong with how a command ended."""
    out, err = outcome.out, outcome.err
    # `shrm batch` tells of each output, and that one failed is no error in what was asked for.
    lines = [each for each in err.splitlines() if not each.startswith(("waiting ", "Failed: "))]
    is_refused = outcome.code in (1, 2) and (bool(lines) or "Failed: " not in err)
    wrong = {
        f"ended with {outcome.code}": outcome.code not in (0, 1, 2),
        "takes too long": outcome.works > WORKS,
        "uses too much memory": outcome.resident > _RESIDENT,
        "asks for too much memory": "out of memory" in err,
        "internal error": "internal error" in err or "Traceback" in err,
        f"{len(lines)} lines of error": is_refused and len(lines) != 1,
        "no error line": is_refused and len(lines) == 1 and not err.startswith("Error: "),
        "an error after half the output": is_refused and out != "",
        "noise on stderr": outcome.code == 0
        and not all(line.startswith("Warning: ") for line in lines),
        "an endless line of error": any(len(line) > _MOST_LINE for line in lines),
        "control characters printed": not (is_plain(out) and is_plain(err)),
        "invalid JSON": outcome.code == 0 and as_json and not is_json(out),
    }
    return [what for what, is_so in wrong.items() if is_so]


def of_files(
    before: Mapping[str, int], after: Mapping[str, int], outputs: Sequence[str], code: int
) -> str:
    """Return what is wrong with the files after a command; empty if nothing is.

    Parameters
    ----------
    before, after : mapping of str to int
        The digest of each file by its name.
    outputs : sequence of str
        The names of the command's outputs.
    code : int
        The command's exit code.
    """
    if any(after.get(name) != digest for name, digest in before.items()):
        return "an input was changed"
    new = sorted(after.keys() - before.keys())
    expected = sorted(outputs) if code == 0 else []
    return "" if new == expected else f"left {new} instead of {expected}"


def is_plain(text: str) -> bool:
    """Whether a text has no characters that a terminal obeys, and none that are hidden."""
    return all(
        char == "\n" or unicodedata.category(char) not in _HIDDEN
        for char in text
        if not " " <= char <= "~"
    )


def is_json(text: str) -> bool:
    """Whether a text is JSON, which has no NaN and no infinity."""

    def refuse(name: str) -> None:
        raise ValueError(name)

    try:
        json.loads(text, parse_constant=refuse)
    except ValueError:
        return False
    return True


def listing(folder: Path) -> dict[str, int]:
    """Return the names in a folder, with a digest of each file, or of what a folder holds."""
    return {path.name: _digest(path) for path in folder.iterdir()}


def _digest(path: Path) -> int:
    if path.is_dir():
        return hash(tuple(sorted(listing(path).items())))
    return hash(path.read_bytes()) if path.is_file() else 0
