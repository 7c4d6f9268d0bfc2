"""Parts of a batch and their two forms, read by a shell and by Open Job Description's own tool."""

import json
import math
import os
import shlex
import subprocess
import sys
from collections import Counter

import pytest

from shrm_cli.batch.farm import command_lines, openjd_template, parse_part, part_of
from shrm_cli.errors import ArgumentError

STUB = """#!{python}
import json, sys
with open({calls!r}, "a") as calls:
    print(json.dumps(sys.argv[1:]), file=calls)
"""
"""A command `shrm` that notes what it is called with."""

HARD = [
    "probes/my probe *.exr", "it's", 'a "quoted" word', "$HOME `id` $(id)", "100%", "%s %{x}",
    "a\\nb", "-o", "bake/{probe}.{brdf}.{to}.exr", "{{probe}}", "{}}{{{", "}}",
    "a{{ Param.X }}b", "", "#x", "~", "é😀", "!history", ";", "&& false",
]  # fmt: skip
"""Arguments that a shell, a template or a farm could take for something else."""


@pytest.fixture
def called(tmp_path):
    """Return a function that runs a command with our stub on its path, and tells its calls."""
    calls = tmp_path / "calls"
    stub = tmp_path / "bin" / "shrm"
    stub.parent.mkdir()
    stub.write_text(STUB.format(python=sys.executable, calls=str(calls)))
    stub.chmod(0o755)
    environment = {**os.environ, "PATH": f"{stub.parent}{os.pathsep}{os.environ['PATH']}"}

    def run(*command):
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stdout + done.stderr
        return [json.loads(line) for line in calls.read_text().splitlines()]

    return run


def test_every_name_belongs_to_one_part_and_parts_are_even():
    names = [f"probes/{index:05}.exr" for index in range(20_000)]
    sizes = Counter(part_of(name, 100) for name in names)
    assert sorted(sizes) == list(range(1, 101))
    # The sizes are binomial: their mean square deviation is 200 (1 - 1/100), and its own spread
    # over 100 parts is a seventh of that.
    spread = sum((size - 200) ** 2 for size in sizes.values()) / 100
    assert spread == pytest.approx(198, rel=3 * math.sqrt(2 / 99))
    assert {part_of(name, 1) for name in names} == {1}


def test_the_part_of_a_name_never_changes():
    """Machines of one farm may have different versions of Python, with hashes of their own."""
    digest = 0xD09C8A99674AAF3DCF2763C57E6FFB28  # printf studio.exr | sha256sum | cut -c-32
    assert part_of("studio.exr", 1000) == digest % 1000 + 1
    assert 1 <= part_of("\udcff.exr", 7) <= 7  # a name that is no text


@pytest.mark.parametrize(
    ("text", "expected"), [("1/1", (1, 1, 1)), ("3/10", (3, 3, 10)), ("3-5/10", (3, 5, 10))]
)
def test_parts_are_read(text, expected):
    assert parse_part(text) == expected


@pytest.mark.parametrize(
    "text", ["", "3", "0/3", "4/3", "2-4/3", "3-2/4", "1/0", "a/b", "1 /2", "-1/2", "1-/2", "٣/٤"]
)
def test_what_names_no_part_is_refused(text):
    with pytest.raises(ArgumentError, match="not a part of a batch"):
        parse_part(text)


def test_a_shell_hands_over_the_arguments_as_they_are(called):
    lines = command_lines(HARD, 3)
    expected = [["batch", "--share", f"{part}/3", *HARD] for part in (1, 2, 3)]
    assert [shlex.split(line)[1:] for line in lines] == expected
    assert called("sh", "-c", "\n".join(lines)) == expected


def test_control_characters_are_refused():
    for make, flag in ((command_lines, "commands"), (openjd_template, "openjd")):
        with pytest.raises(ArgumentError, match=rf"`{flag}` cannot hold .*'a\\nb'"):
            make(["a\nb"], 2)


def openjd():
    """Return the start of a command line of Open Job Description's tool, or skip the test."""
    pytest.importorskip("openjd.cli")
    return [sys.executable, "-W", "ignore", "-m", "openjd"]


@pytest.mark.parametrize("parts", [pytest.param(1, marks=pytest.mark.slow), 12_345])
def test_the_template_is_one_of_open_job_description(tmp_path, parts):
    template = tmp_path / "batch.template.json"
    template.write_text(openjd_template(HARD, parts), encoding="utf-8")
    command = [*openjd(), "check", str(template), "--extensions", "TASK_CHUNKING"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passes validation checks" in done.stdout


@pytest.mark.slow
def test_open_job_description_runs_every_part_with_the_arguments(tmp_path, called):
    template = tmp_path / "batch.template.json"
    template.write_text(openjd_template(HARD, 5), encoding="utf-8")
    ran = called(*openjd(), "run", str(template), "-p", "PartsPerCommand=2")
    parts = [call.pop(2) for call in ran]
    assert ran == 3 * [["batch", "--share", *HARD]]
    chunks = [parse_part(part) for part in parts]
    made = [part for first, last, _ in chunks for part in range(first, last + 1)]
    assert sorted(made) == [1, 2, 3, 4, 5]
    assert {count for *_, count in chunks} == {5}


def test_the_template_is_plain_json():
    template = json.loads(openjd_template(["é"], 7))
    (step,) = template["steps"]
    assert step["script"]["actions"]["onRun"]["args"] == [
        "batch", "--share", "{{Task.Param.Part}}/7", "é",
    ]  # fmt: skip
