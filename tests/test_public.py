"""The public names: each command has its function, each example holds, and no change is unseen."""

import ast
import doctest
import inspect
import re
import shutil
from pathlib import Path

import click
import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.cli.main import cli

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "library.md").read_text()
COMMANDS = ROOT / "shrm_cli" / "cli"
MOST_LINES = 60
ROW = re.compile(r"^\| `shrm ([a-z ]+)` \| (.+?) \| `(tests/[a-z_/]+\.py)` \|$", re.MULTILINE)
SIGNATURES = Path(__file__).with_name("public.txt")


def commands(group, names=()):
    """The full names of all commands of a group, those of groups within it, too."""
    for name in group.list_commands(click.Context(group)):
        command = group.get_command(click.Context(group), name)
        if isinstance(command, click.Group):
            yield from commands(command, (*names, name))
        else:
            yield " ".join((*names, name))


def test_each_command_has_its_function_and_a_test():
    rows = {command: (functions, test) for command, functions, test in ROW.findall(PAGE)}
    assert list(rows) == sorted(commands(cli))
    for functions, test in rows.values():
        text = (ROOT / test).read_text()
        for name in re.findall(r"`([A-Za-z_]+)", functions):
            assert callable(getattr(shrm, name))
            assert re.search(rf"\b{name}\b", text), f"{test} does not name {name}"


def code_lines(path):
    """The lines of code of each function of a module, without its docstring and comments."""
    text = path.read_text()
    lines = text.split("\n")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            told = range(0)
            if ast.get_docstring(node) is not None:
                told = range(node.body[0].lineno, node.body[0].end_lineno + 1)
            kept = [
                lines[number - 1].strip()
                for number in range(node.lineno, node.end_lineno + 1)
                if number not in told
            ]
            yield node.name, sum(bool(line) and not line.startswith("#") for line in kept)


def test_commands_are_short():
    long = [
        (path.name, name, count)
        for path in sorted(COMMANDS.glob("*.py"))
        for name, count in code_lines(path)
        if count > MOST_LINES
    ]
    assert long == []


def test_lines_are_counted(tmp_path):
    text = 'def f(\n    a,\n):\n    """One.\n\n    Two.\n    """\n    # a\n\n    return a\n'
    (tmp_path / "some.py").write_text(text)
    assert dict(code_lines(tmp_path / "some.py")) == {"f": 4}


UNTRIED = {"hdr_flip"}
"""Names without an example, because they need an extra that may be missing."""
EXAMPLES = {
    each.name: each
    for name in shrm.__all__
    if callable(getattr(shrm, name))
    for each in doctest.DocTestFinder(recurse=False).find(
        getattr(shrm, name), name, globs={"shrm": shrm, "np": np}
    )
    if each.examples
}
LONG = {"report", "Look"}
"""Names whose examples take seconds, with tests of their own that do not."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.proof) if name in LONG else name for name in EXAMPLES],
)
def test_examples_hold(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "probes", tmp_path / "probes")  # tables follow no link out of a folder
    told = []
    flags = doctest.NORMALIZE_WHITESPACE
    doctest.DocTestRunner(optionflags=flags).run(EXAMPLES[name], out=told.append)
    assert "".join(told) == ""


def test_public_names_have_examples():
    """All but constants and errors."""
    without = [
        name
        for name in shrm.__all__
        if callable(value := getattr(shrm, name)) and name not in {*EXAMPLES, *UNTRIED}
        if not (isinstance(value, type) and issubclass(value, Exception))
    ]
    assert without == []


def signature(name):
    """A public name as its callers see it."""
    value = getattr(shrm, name)
    if not callable(value):
        return f"{name}: {type(value).__name__}"
    if isinstance(value, type) and issubclass(value, Exception):
        return f"{name}({value.__bases__[0].__name__})"
    parameters = [
        each.replace(annotation=each.empty, default=Default(each.default))
        if each.default is not each.empty
        else each.replace(annotation=each.empty)
        for each in inspect.signature(value).parameters.values()
    ]
    return f"{name}{inspect.Signature(parameters)}"


class Default:
    """A default value, without where it lies in memory."""

    def __init__(self, value):
        self.text = re.sub(r" at 0x[0-9a-f]+|<class '|<.*_MISSING_TYPE.*|'>", "", repr(value))

    def __repr__(self):
        return self.text or "..."


def test_no_public_name_changes_unseen():
    """After a change that docs/library.md allows: write what this prints to public.txt."""
    now = "".join(f"{signature(name)}\n" for name in sorted(shrm.__all__))
    assert now == SIGNATURES.read_text(), now
