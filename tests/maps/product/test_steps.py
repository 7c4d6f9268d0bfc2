"""The values of a parameter that textures are made for, beside textures made exactly between."""

import json
from itertools import pairwise

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.product.prefilter import product_texture, varying_values
from shrm_cli.maps.product.steps import ENOUGH, MOST_STEPS, chosen_values
from shrm_cli.maps.product.varying import VaryingProduct
from tests import brute_force
from tests.cli.helpers import done, run
from tests.maps.product.test_file import texture


def bump(value):
    """A smooth curve that turns at 1 and is nearly straight beyond 10."""
    return np.array([1 / (1 + value**2), 1.0])


def middles(values, function):
    """The relative errors in the middle between values."""
    return [
        np.linalg.norm(function((a + b) / 2) - (function(a) + function(b)) / 2)
        / np.linalg.norm(function((a + b) / 2))
        for a, b in pairwise(values)
    ]


@pytest.mark.parametrize("steps", [None, 2, 3, 9, 40])
def test_values_are_closest_where_the_function_turns(steps):
    values, error = chosen_values(bump, 0.0, 100.0, steps)
    assert (values[0], values[-1]) == (0.0, 100.0)
    assert values == sorted(set(values))
    assert error == pytest.approx(max(middles(values, bump)), rel=1e-12)
    if steps is not None:
        assert len(values) == steps
    else:
        assert error <= ENOUGH
        even = np.linspace(0, 100, len(values))
        assert max(middles(even, bump)) > 5 * error
        assert values[1] - values[0] < (values[-1] - values[-2]) / 8


def test_as_many_as_are_allowed(monkeypatch):
    values, error = chosen_values(lambda x: np.array([2 + np.sin(12345 * x)]), 0.0, 1.0)
    assert len(values) == MOST_STEPS
    assert error > ENOUGH


LOBES = "ashikhmin-shirley:nu=40", "nv", 4.0, 400.0


@pytest.fixture(scope="module")
def chosen():
    return varying_values(parse_spec(LOBES[0]), *LOBES[1:], 3)


@pytest.mark.proof
def test_textures_between_miss_what_is_stated(chosen):
    """Of light of all directions alike, everywhere between two values, and not in the middle."""
    values, stated = chosen
    assert stated <= ENOUGH
    rng = np.random.default_rng(3)
    views = brute_force.unit(rng, 60)
    views[:, 2] = np.abs(views[:, 2])
    tables = {}

    def at(value):
        if value not in tables:
            made = product_texture(parse_spec(f"{LOBES[0]},nv={value!r}"), 3, 24).map
            tables[value] = made.values(views)
        return tables[value]

    for a, b in pairwise(values[:3]):
        for share in (0.4,):
            truth = at(a + share * (b - a))
            found = (1 - share) * at(a) + share * at(b)
            assert np.linalg.norm(found - truth) < 1.5 * stated * np.linalg.norm(truth)
    first, last = at(4.0), at(400.0)
    even = (6 * first + last) / 7  # an eighth of the way, as even values had it
    truth = at(4 + 396 / 7)
    assert np.linalg.norm(even - truth) > 0.1 * np.linalg.norm(truth)


def test_a_range_that_needs_too_many_is_refused(monkeypatch):
    monkeypatch.setattr("shrm_cli.maps.product.steps.MOST_STEPS", 3)
    with pytest.raises(BrdfError, match="narrow the range, or give `steps`"):
        varying_values(parse_spec(LOBES[0]), *LOBES[1:], 2)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


WARD = ("product", "ward:ax=0.5", "--size", "8", "--order", "2")


@pytest.mark.proof
def test_the_file_and_the_report_tell_the_error(folder):
    out = done(*WARD, "--vary", "ay=0.1..0.5", "-o", "x.exr")
    made = open_map("x.exr")
    assert 0 < made.step_error <= ENOUGH
    assert f"{made.step_error:.2%} RMS error between two values at most" in out
    (told,) = {part.header["shrm:varying"] for part in OpenEXR.File("x.exr").parts}
    assert json.loads(told) == made.variation()
    few = run(*WARD, "--vary", "ay=0.1..0.5", "--steps", "2", "-o", "x.exr")
    assert few.code == 0
    assert "is missed; leave --steps out, or give more" in few.err


def test_files_from_before_are_read(folder, monkeypatch):
    """They do not tell the error, and their values are evenly spaced."""
    old = VaryingProduct.of([texture(), texture()], "a", [0, 1])
    monkeypatch.setattr(VaryingProduct, "variation", lambda _: {"parameter": "a", "values": [0, 1]})
    old.save("old.exr")
    assert open_map("old.exr").step_error == 0


def test_several_parameters_are_refused(folder):
    found = run(*WARD, "--vary", "ay=0.1..0.5", "--vary", "ax=0.2..0.3")
    assert found.code == 2
    assert "--vary is given more than once" in found.err
