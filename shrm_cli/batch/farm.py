"""Batches for render farms: parts of a batch, and the two forms in which farms take commands.

A farm has its own queue, which starts commands and repeats those that failed. A batch is divided
into parts for it, each of them a command of its own: ``shrm batch ... --share 3/100`` makes what
belongs to the third of a hundred, and ``--share 3-5/100`` what belongs to three of them.

Which part a probe belongs to is decided by its name alone, so that every machine finds the same
whatever order its folder is listed in, and files that come later move no others.
"""

import hashlib
import json
import os
import re
import shlex
from collections.abc import Sequence
from typing import Any

from shrm_cli.errors import ArgumentError

_PART = re.compile(r"([1-9][0-9]{0,8})(?:-([1-9][0-9]{0,8}))?/([1-9][0-9]{0,8})")
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
"""Characters that neither a line of a list nor a job template may have in an argument."""


def part_of(name: str, count: int) -> int:
    """Return the part, from 1 to a count, that a name belongs to.

    The part is the name's SHA-256 digest modulo the count, so that parts are about equally large:
    one that has n names on average has n plus or minus the square root of n.
    """
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:16], "big") % count + 1


def parse_part(text: str) -> tuple[int, int, int]:
    """Return the first part, the last and the number of parts that a text such as 3-5/9 names."""
    match = _PART.fullmatch(text)
    if match is not None:
        first, last, count = int(match[1]), int(match[2] or match[1]), int(match[3])
        if first <= last <= count:
            return first, last, count
    raise ArgumentError(
        "share", f"{text!r}: not a part of a batch; write 3/10, or 3-5/10 for three of ten parts"
    )


_COMMAND = "shrm batch --share "
"""What all lines of a list begin with."""


def is_list(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a list of commands that `command_lines` gave."""
    try:
        with open(path, "rb") as stream:
            return stream.read(len(_COMMAND)) == _COMMAND.encode()
    except OSError:
        return False


def command_lines(arguments: Sequence[str], parts: int) -> list[str]:
    """Return a line of a POSIX shell for every part of a batch.

    `arguments` is what follows ``shrm batch``, without the flags that ask for these lines. `parts`
    is the number of parts.
    """
    _check(arguments, "commands")
    words = shlex.join(arguments)
    return [f"{_COMMAND}{part}/{parts} {words}" for part in range(1, parts + 1)]


def openjd_template(arguments: Sequence[str], parts: int) -> str:
    """Return a job template of Open Job Description, whose tasks are the parts of a batch.

    Its extension TASK_CHUNKING lets the farm run several neighbouring parts as one command. How
    many is the job's parameter ``PartsPerCommand``, which whoever submits it can set.

    `arguments` is what follows ``shrm batch``, without the flags that ask for this template.

    Returns JSON, which is YAML too.

    References: Open Job Description, Template Schemas 2023-09, and RFC 0001, Task Chunking.
    """
    _check(arguments, "openjd")
    # Behind the arguments it would be one of the probes if these hold "--".
    words = ["batch", "--share", f"{{{{Task.Param.Part}}}}/{parts}", *map(_literal, arguments)]
    part = {
        "name": "Part",
        "type": "CHUNK[INT]",
        "range": f"1-{parts}",
        "chunks": {
            "defaultTaskCount": "{{Param.PartsPerCommand}}",
            "rangeConstraint": "CONTIGUOUS",
        },
    }
    step = {
        "name": "Bake",
        "parameterSpace": {"taskParameterDefinitions": [part]},
        "script": {"actions": {"onRun": {"command": "shrm", "args": words}}},
    }
    template: dict[str, Any] = {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": "shrm batch",
        "parameterDefinitions": _parameters(),
        "steps": [step],
    }
    return json.dumps(template, indent=2, ensure_ascii=False) + "\n"


_BRACES = {"{": "LeftBrace", "}": "RightBrace"}
"""The job's parameters that stand for braces."""


def _parameters() -> list[dict[str, Any]]:
    """Return the parameters of the job: how much a command does, and how braces are written."""
    several: dict[str, Any] = {
        "name": "PartsPerCommand",
        "type": "INT",
        "description": "How many parts one command makes.",
        "minValue": 1,
        "default": 1,
    }
    braces = [
        {
            "name": parameter,
            "type": "STRING",
            "description": "A brace in an argument, which a template cannot hold otherwise.",
            "userInterface": {"control": "HIDDEN"},
            "default": brace,
            "allowedValues": [brace],
        }
        for brace, parameter in _BRACES.items()
    ]
    return [several, *braces]


def _literal(text: str) -> str:
    """Write a text so that it stands for itself in a template.

    Two braces begin an expression, and there is no way to escape them. Their place is taken by
    expressions whose values are braces; single ones too, which could join those of expressions.
    """
    if "{{" not in text and "}}" not in text:
        return text
    return re.sub("[{}]", lambda brace: f"{{{{Param.{_BRACES[brace[0]]}}}}}", text)


def _check(arguments: Sequence[str], flag: str) -> None:
    for argument in arguments:
        if _CONTROL.search(argument):
            raise ArgumentError(
                flag, f"cannot hold the control character in {argument!r}; rename what it names"
            )
