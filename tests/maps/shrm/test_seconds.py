"""How long maps take: the law of growth, by counting what the work is made of; never a clock."""

import pytest

from shrm_cli.maps.shrm.make import making_seconds
from tests.cli.helpers import run


def test_times_of_three_maps_that_were_measured():
    # Seconds of one processor for coupling and synthesis, measured once, and 1.5e-7 a value.
    measured = {(40, 28, 32): 2.3, (80, 12, 64): 0.57, (320, 2, 256): 0.92}
    for (f, p, size), seconds in measured.items():
        stored = 1.5e-7 * 3 * (p + 1) ** 2 * 6 * size**2
        ratio = making_seconds(f, p, size) / (seconds + stored)
        assert 1 / 2 < ratio < 2


def test_large_cubes_take_the_time_of_their_texels():
    # Twice the size is four times the values, and all else stays.
    small, middle, large = (making_seconds(8, 1, size) for size in (64, 128, 256))
    assert large - middle == pytest.approx(4 * (middle - small))


@pytest.mark.parametrize(("seconds", "is_said"), [(2.4, False), (12.4, True)])
def test_what_takes_long_is_said_once_on_a_terminal(probe, monkeypatch, seconds, is_said):
    monkeypatch.setattr("shrm_cli.maps.shrm.make.making_seconds", lambda *orders: seconds)
    arguments = "prefilter", probe, "--brdf", "phong", "--size", 8, "--force"
    line = "prefiltering takes about 12 s more"
    assert run(*arguments, terminal=True).err.count(line) == is_said
    assert line not in run(*arguments).err
    assert line not in run(*arguments, "--quiet", terminal=True).err


@pytest.fixture
def probe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("probe", "furnace", "--size", 16, "-o", "probe.exr").code == 0
    return "probe.exr"
