"""Arguments in the library's messages come out as flags."""

import pytest

from shrm_cli.cli.flags import with_flags
from shrm_cli.cli.options import warn


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("give `fix_nonfinite` to fill them", "give --fix-nonfinite to fill them"),
        ("the `layout` that it has", "the --layout that it has"),
        ("`order_f`, `clamp`", "--order-f, --clamp"),
        ("`shrm brdf` lists the models", "`shrm brdf` lists the models"),
        ("`Probe` and `2x` and `", "`Probe` and `2x` and `"),
    ],
)
def test_arguments_become_flags(message, expected):
    assert with_flags(message) == expected


def test_in_warnings(capsys):
    warn(["a.exr: see `clamp`"], quiet=False)
    warn(["a.exr: see `size`"], quiet=True)
    assert capsys.readouterr().err == "Warning: a.exr: see --clamp\n"
