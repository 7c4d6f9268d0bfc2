"""Warnings speak of flags where the library's speak of arguments."""

import click

from shrm_cli.cli.options import output_options
from shrm_cli.cli.terminal import warn


@click.command()
@output_options
def shake():
    warn(["a.exr: see `clamp`"])


def test_in_warnings(capsys):
    shake.main([], standalone_mode=False)
    shake.main(["--quiet"], standalone_mode=False)
    assert capsys.readouterr().err == "Warning: a.exr: see --clamp\n"
