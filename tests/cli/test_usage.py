"""The words of messages on the command line, and the rule that refuses options."""

import click
import pytest
from click.testing import CliRunner

from shrm_cli.cli.usage import exclude, flags, given_options, refuse_inapplicable
from tests.cli.helpers import run


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("lower `size` or the orders", "lower --size or the orders"),
        ("lower `order_p`", "lower --order-p"),
        ("take `split=False`, or `split=True`", "take --no-split, or `split=True`"),
        ("`to` shrm", "--to shrm"),
        ("a file named `A b`", "a file named `A b`"),
        ("no argument", "no argument"),
    ],
)
def test_arguments_are_flags_on_the_command_line(message, expected):
    assert flags(message) == expected


def test_names_of_files_keep_their_backticks():
    typed = ["a`size`.exr", "`to`", "b"]
    assert (
        flags("a`size`.exr: lower `size`, or `to` b", typed)
        == "a`size`.exr: lower --size, or `to` b"
    )
    for name in ("a`size`.exr", "p`to`/x.exr"):
        for arguments in (("info", name), ("prefilter", name, "--to", "irradiance")):
            assert run(*arguments).err.startswith(f"Error: {name}: no such file")


@pytest.mark.parametrize("size", ["1000000000", "1234567890123", "9" * 30, "0000000000"])
@pytest.mark.parametrize(
    ("command", "words"),
    [
        (("render", "m.exr", "--size"), "{} is not in the range"),
        (("prefilter", "p.exr", "--to", "splitsum", "--levels"), "{} levels are not 1 .. 64"),
    ],
)
def test_numbers_are_told_as_they_were_given(command, words, size):
    found = run(*command, size)
    assert found.code == 2
    assert words.format(size) in found.err


def command(body):
    """A command with two options that does something, whose result is what it prints."""

    @click.command("shake")
    @click.option("--salt", "grains", type=int, default=3)
    @click.option("--wet", is_flag=True)
    def shake(grains, wet):
        click.echo(body())

    return lambda *arguments: CliRunner().invoke(shake, arguments)


def test_what_stands_on_the_command_line_is_given_and_defaults_are_not():
    run = command(given_options)
    assert run().stdout == "{}\n"
    assert run("--salt", "3").stdout == "{'grains': '--salt'}\n"
    assert run("--salt", "3", "--wet").stdout == "{'grains': '--salt', 'wet': '--wet'}\n"


@pytest.mark.parametrize("holds", [True, False])
def test_options_that_nothing_obeys_are_refused(holds):
    run = command(lambda: refuse_inapplicable({"grains": (holds, "to water")}))
    assert run().exit_code == run("--wet").exit_code == 0
    result = run("--salt", "3")
    assert result.exit_code == (0 if holds else 2)
    assert ("--salt applies to water; leave it out" in result.stderr) == (not holds)


def test_options_that_exclude_each_other():
    run = command(lambda: exclude("grains", "wet"))
    assert run("--salt", "1").exit_code == run("--wet").exit_code == 0
    result = run("--salt", "1", "--wet")
    assert result.exit_code == 2
    assert "--salt and --wet exclude each other; leave one out" in result.stderr
