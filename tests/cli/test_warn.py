"""Warnings speak of flags where the library's speak of arguments."""

from shrm_cli.cli.options import warn


def test_in_warnings(capsys):
    warn(["a.exr: see `clamp`"], quiet=False)
    warn(["a.exr: see `size`"], quiet=True)
    assert capsys.readouterr().err == "Warning: a.exr: see --clamp\n"
