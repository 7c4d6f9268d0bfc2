"""The shader code of maps in WGSL, from the same lines that the other languages are made from.

WGSL names types behind variables, has no ``a ? b : c``, and declares a variable a statement. All
else of what the lines of GLSL hold is written alike.
"""

import re
from collections.abc import Sequence
from itertools import count

_TYPES = {"float": "f32", "int": "i32", "vec3": "vec3f"}
_KIND = "|".join(_TYPES)
_HEADER = re.compile(rf"^({_KIND}) (shrm_\w+)\(([^)]*)\)(?=\n\{{| \{{)", re.MULTILINE)
_DECLARED = re.compile(rf"^( +)({_KIND}) ([^;]+);", re.MULTILINE)
_ARRAY = re.compile(r"(\w+)\[(\w+)\]")
_WORDS = [
    (re.compile(r"\+\+(\w+)\)"), r"\1++)"),
    (re.compile(r"\batan\("), "atan2("),
    *((re.compile(rf"\b{name}\("), f"{kind}(") for name, kind in _TYPES.items()),
]
_BINDING = re.compile(r"^var(?:<uniform>)? shrm_\w+: (?:texture|sampler|array)", re.MULTILINE)
_OPENING, _CLOSING = "([{", ")]}"


def in_wgsl(text: str) -> str:
    """Write lines of GLSL, as forms write them, in WGSL.

    A function that changes a parameter, or a word that WGSL reserves, is not mended.
    """
    while "?" in _without_comments(text):
        text = _select(text, _without_comments(text).rindex("?"))
    text = _HEADER.sub(_header, text)
    text = _DECLARED.sub(_declared, text)
    for pattern, word in _WORDS:
        text = pattern.sub(word, text)
    numbers = count()
    return _BINDING.sub(lambda found: f"@group(0) @binding({next(numbers)}) {found[0]}", text)


def _without_comments(text: str) -> str:
    """Blank comments out, at the same places."""
    return re.sub(r"/\*.*?\*/", lambda found: " " * len(found[0]), text, flags=re.DOTALL)


def _header(found: re.Match[str]) -> str:
    kind, name, parameters = found.groups()
    pairs = (each.split() for each in parameters.split(",") if each.strip())
    typed = ", ".join(f"{own}: {_TYPES[word]}" for word, own in pairs)
    return f"fn {name}({typed}) -> {_TYPES[kind]}"


def _declared(found: re.Match[str]) -> str:
    """Write a variable of each declarator; names that are given a value lie in front of it."""
    indent, kind, rest = found.groups()
    lines = []
    for each in _split(rest):
        name, equals, value = each.strip().partition(" = ")
        array = _ARRAY.fullmatch(name)
        typed = f"{name}: {_TYPES[kind]}"
        if array:
            typed = f"{array[1]}: array<{_TYPES[kind]}, {array[2]}>"
        lines.append(f"{indent}var {typed}{equals}{value};")
    return "\n".join(lines)


def _split(text: str) -> Sequence[str]:
    """Split a text at the commas that are in no brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in _OPENING) - (letter in _CLOSING)
        if letter == "," and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _select(text: str, at: int) -> str:
    """Write the conditional expression whose question mark is the last one, as a ``select``.

    WGSL computes both values; no value of the code is costly or goes wrong where it is not taken.
    """
    first = at - 1
    while not _is_bound(text, first, _CLOSING, _OPENING):
        first = _over(text, first, -1)
    colon = at + 1
    while text[colon] != ":":
        colon = _over(text, colon, 1)
    last = colon + 1
    while not _is_bound(text, last, _OPENING, _CLOSING):
        last = _over(text, last, 1)
    condition, yes, no = (
        " ".join(part.split())
        for part in (text[first + 1 : at], text[at + 1 : colon], text[colon + 1 : last])
    )
    word = "return " if condition.startswith("return ") else ""
    before = text[first + 1 : at]
    space = before[: len(before) - len(before.lstrip())]
    chosen = f"select({no}, {yes}, {condition.removeprefix('return ')})"
    return f"{text[: first + 1]}{space}{word}{chosen}{text[last:]}"


def _is_bound(text: str, at: int, over: str, until: str) -> bool:
    """Tell whether an expression ends before a letter, which lies in no brackets of its own."""
    if not 0 <= at < len(text):
        return True
    letter = text[at]
    if letter == "=":
        return text[at - 1] not in "=!<>" and text[at + 1] != "="
    return letter in ",;?:" or letter in until or letter in "{}"


def _over(text: str, at: int, step: int) -> int:
    """Step over a letter, or over brackets with all that is in them."""
    opening, closing = (_OPENING, _CLOSING) if step > 0 else (_CLOSING, _OPENING)
    depth = 0
    while True:
        depth += (text[at] in opening) - (text[at] in closing)
        at += step
        if not depth:
            return at
