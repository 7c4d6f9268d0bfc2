"""What the languages of the code differ in, so that each form writes its functions once.

The functions are written in GLSL that is C89 as well, apart from a few words: declarations come
first in each block, and arithmetic of vectors is written by the methods of `Language`. `translated`
changes the words.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import count

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.records import record

FLOAT_MAX = float(np.finfo(np.float32).max)
_MOST_NAME = 100
"""The most characters of a probe's name or digest in the code's comment."""

# What C lacks of GLSL; each function may use those before it.
_C_HEAD = ["#include <math.h>", "typedef struct { double x, y, z; } shrm_vec3;"]
_C_FUNCTIONS = """\
static shrm_vec3 shrm_vec(double x, double y, double z)
{
    shrm_vec3 r;
    r.x = x;
    r.y = y;
    r.z = z;
    return r;
}

static shrm_vec3 shrm_add(shrm_vec3 a, shrm_vec3 b)
{
    return shrm_vec(a.x + b.x, a.y + b.y, a.z + b.z);
}

static shrm_vec3 shrm_scale(double s, shrm_vec3 a) { return shrm_vec(s * a.x, s * a.y, s * a.z); }

static shrm_vec3 shrm_times(shrm_vec3 a, shrm_vec3 b)
{
    return shrm_vec(a.x * b.x, a.y * b.y, a.z * b.z);
}

static shrm_vec3 shrm_mix(shrm_vec3 a, shrm_vec3 b, double t)
{
    return shrm_add(shrm_scale(1 - t, a), shrm_scale(t, b));
}

static double shrm_dot(shrm_vec3 a, shrm_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static double shrm_length(shrm_vec3 a) { return sqrt(shrm_dot(a, a)); }

static double shrm_min(double a, double b) { return a < b ? a : b; }

static double shrm_max(double a, double b) { return a < b ? b : a; }"""

C_MAY_BE_UNUSED = ["#ifdef __GNUC__", "__attribute__((unused))", "#endif"]
"""What stands before the function that programs call: a file that includes the code and leaves it
unused gets no warning. C89 has no ``inline``, which would tell that in other languages."""
_CALLED = re.compile(
    r"^(?=static \w+ shrm_(?:(?:ir)?radiance(?:_at)?|brushed|even)\()", re.MULTILINE
)

# Patterns of words in GLSL, and what stands for them.
_WORDS: dict[str, list[tuple[str, str]]] = {
    "glsl": [],
    "hlsl": [(r"\bvec3\b", "float3"), (r"\bmix\(", "lerp("), (r"\batan\(", "atan2(")],
    "wgsl": [],  # its statements are others, too
    "c": [
        (r"\bvec3\(", "shrm_vec("),
        (r"\bvec3\b", "shrm_vec3"),
        (r"\bint\(", "(int)("),
        (r"\bfloat\(", "(double)("),
        (r"\bout float\b", "double"),
        (r"\bfloat\b(?! \*)", "double"),
        (r"\batan\(", "atan2("),
        (r"\babs\(", "fabs("),
        (r"\b(dot|length|min|max|mix)\(", r"shrm_\1("),
        (r"^(double|shrm_vec3|void) shrm_", r"static \1 shrm_"),
    ],
}
LANGUAGES = tuple(_WORDS)


@record
class Language:
    """A language that code is written in."""

    name: str
    """One of "glsl", "hlsl", "wgsl" and "c"."""

    def __post_init__(self) -> None:
        if self.name not in LANGUAGES:
            raise MapError(f"shader language {self.name!r}: take one of {', '.join(LANGUAGES)}")

    @property
    def is_c(self) -> bool:
        return self.name == "c"

    def add(self, a: str, b: str) -> str:
        """Write the sum of two vectors."""
        return f"shrm_add({a}, {b})" if self.is_c else f"({a} + {b})"

    def scale(self, factor: str, vector: str) -> str:
        """Write a vector times a number; both must be words, calls or in brackets."""
        return f"shrm_scale({factor}, {vector})" if self.is_c else f"{factor} * {vector}"

    def minus(self, a: str, b: str) -> str:
        """Write the difference of two vectors."""
        return f"shrm_add({a}, shrm_scale(-1.0, {b}))" if self.is_c else f"({a} - {b})"

    def times(self, a: str, b: str) -> str:
        """Write the product of two colours, channel by channel."""
        return f"shrm_times({a}, {b})" if self.is_c else f"{a} * {b}"

    def grow(self, name: str, by: str) -> str:
        """Write the statement that adds a vector to a variable."""
        return f"{name} = shrm_add({name}, {by});" if self.is_c else f"{name} += {by};"

    def combined(self, factors: Sequence[str], vectors: Sequence[str]) -> str:
        """Write the sum of vectors times numbers."""
        parts = [self.scale(*pair) for pair in zip(factors, vectors, strict=True)]
        text = parts[0]
        for part in parts[1:]:
            text = self.add(text, part)
        return text

    def colors(self, name: str, rows: Array) -> list[str]:
        """Write a constant array of colours. `rows` are of shape (n, 3)."""
        self.check(rows)
        texts = [", ".join(map(self.literal, row)) for row in rows.tolist()]
        head, last, values = {
            "glsl": (f"const vec3 {name}[{len(rows)}] = vec3[{len(rows)}](", ");", "vec3({})"),
            "hlsl": (f"static const vec3 {name}[{len(rows)}] = {{", "};", "vec3({})"),
            "wgsl": (f"const {name} = array<vec3f, {len(rows)}>(", ");", "vec3({})"),
            "c": (f"static const vec3 {name}[{len(rows)}] = {{", "};", "{{{}}}"),
        }[self.name]
        inside = [f"    {values.format(text)}," for text in texts]
        return [head, *inside[:-1], inside[-1].rstrip(","), last]

    def colors_given(self, name: str, rows: Array) -> list[str]:
        """Write an array of colours that the program sets; in C it begins with these rows."""
        count = len(rows)
        if self.is_c:
            head, *others = self.colors(name, rows)
            return [head.replace("const ", ""), *others]
        if self.name == "wgsl":
            return [f"var<uniform> {name}: array<vec3f, {count}>;"]
        return [f"{'uniform ' if self.name == 'glsl' else ''}vec3 {name}[{count}];"]

    def check(self, values: Array) -> None:
        """Refuse numbers that are not finite in the type of the language."""
        most = np.inf if self.is_c else FLOAT_MAX
        if not np.all(np.isfinite(values)) or np.abs(values).max(initial=0.0) > most:
            raise MapError(f"a number is beyond the 32-bit floats of {self.name}; dim the light")

    def literal(self, value: float) -> str:
        """Write a number with a decimal point, for a list of arguments."""
        text = f"{value:.{17 if self.is_c else 9}g}"
        return text if set(text) & set(".e") else f"{text}.0"

    def number(self, value: float) -> str:
        """Write a number with a decimal point, in brackets where it is negative."""
        text = self.literal(value)
        return f"({text})" if text.startswith("-") else text

    def translated(self, lines: Sequence[str]) -> list[str]:
        """Return lines of GLSL, whose vectors' arithmetic this class wrote, in the language.

        In C they begin with those functions of GLSL that they use.
        """
        text = "\n".join(lines)
        for pattern, word in _WORDS[self.name]:
            text = re.sub(pattern, word, text, flags=re.MULTILINE)
        if self.name == "wgsl":
            text = in_wgsl(text)
        if not self.is_c:
            return text.split("\n")
        text = _CALLED.sub("\n".join([*C_MAY_BE_UNUSED, ""]), text)
        for function in reversed(_C_FUNCTIONS.split("\n\n")):
            if re.findall(r"shrm_\w+\(", function)[0] in text:
                text = f"{function}\n{text}"
        return [*_C_HEAD, *text.split("\n")]


def filled(text: str, words: Mapping[str, str]) -> list[str]:
    """Return the lines of a text whose words in capitals are replaced, one word after the other."""
    for word, meaning in words.items():
        text = text.replace(word, meaning)
    return text.split("\n")


def harmless(text: str) -> str:
    """Replace characters that could end a comment, start one, or continue a line."""
    return re.sub(r"[^A-Za-z0-9 ._+,()-]", "_", text)[:_MOST_NAME]


# ---- WGSL ----------------------------------------------------------------------------------------
# WGSL names types behind variables, has no ``a ? b : c``, and declares a variable a statement. All
# else of what the lines of GLSL hold is written alike.

_TYPES = {"float": "f32", "int": "i32", "vec3": "vec3f"}
_KIND = "|".join(_TYPES)
_HEADER = re.compile(rf"^({_KIND}) (shrm_\w+)\(([^)]*)\)(?=\n\{{| \{{)", re.MULTILINE)
_DECLARED = re.compile(rf"^( +)({_KIND}) ([^;]+);", re.MULTILINE)
_ARRAY = re.compile(r"(\w+)\[(\w+)\]")
_WGSL_WORDS = [
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
    for pattern, word in _WGSL_WORDS:
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
    while not _is_bound(text, first, _OPENING):
        first = _over(text, first, -1)
    colon = at + 1
    while text[colon] != ":":
        colon = _over(text, colon, 1)
    last = colon + 1
    while not _is_bound(text, last, _CLOSING):
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


def _is_bound(text: str, at: int, until: str) -> bool:
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
