"""The values of a parameter that textures are made for, beside textures made exactly between."""

import json
from itertools import pairwise, product

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from shrm_cli.maps.file import open_map
from shrm_cli.maps.product.prefilter import product_texture, varying_steps
from shrm_cli.maps.product.product import VaryingProduct
from shrm_cli.maps.product.steps import ENOUGH, MOST_STEPS, Steps, chosen_steps, chosen_values
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


ACROSS, ALONG = np.meshgrid(np.linspace(-1.9, 2, 14), np.linspace(-2, 1.8, 13))


def lobe(x, y):
    """A lobe of two widths, which is far from a product of functions of each."""
    return np.exp(-((ACROSS / x) ** 2) - ((ALONG - y * ACROSS / 2) / y) ** 2) / (x * y)


LOBE = {"x": (0.5, 2.0), "y": (0.6, 1.5)}


def mixed(steps, points, function, shares):
    """Sums of the textures of points, of weights between values, and the function itself there."""
    lows, highs = (np.array([own[k] for own in steps.values.values()]) for k in (0, -1))
    tables = np.array([function(*point) for point in points])
    found = np.einsum("nk,k...->n...", steps.at(shares), tables)
    return found, np.array([function(*(lows + each * (highs - lows))) for each in shares])


def test_few_textures_of_two_parameters_tell_all_others():
    steps, points = chosen_steps(lobe, LOBE)
    grid = [len(own) for own in steps.values.values()]
    assert steps.weights.shape == (*grid, len(points))
    assert len(points) < np.prod(grid) / 4
    found, true = mixed(steps, points, lobe, np.random.default_rng(1).uniform(size=(300, 2)))
    errors = np.linalg.norm(found - true, axis=(1, 2)) / np.linalg.norm(true, axis=(1, 2))
    assert errors.max() < 1.2 * steps.error <= 1.2 * ENOUGH
    # A texture less would miss more than that.
    tables = np.array([lobe(*point).ravel() for point in points[:-1]])
    worst = np.array([lobe(*point).ravel() for point in product(*steps.values.values())])
    rest = worst.T - tables.T @ np.linalg.lstsq(tables.T, worst.T)[0]
    assert (np.linalg.norm(rest, axis=0) / np.linalg.norm(worst, axis=1)).max() > ENOUGH / 2


def test_at_points_of_textures_there_is_one_texture():
    steps, points = chosen_steps(lobe, LOBE)
    for index, point in enumerate(points):
        place = tuple(own.index(v) for own, v in zip(steps.values.values(), point, strict=True))
        np.testing.assert_array_equal(steps.weights[place], np.eye(len(points))[index])


@pytest.mark.parametrize("is_linear", [True, False])
def test_two_textures_suffice_of_a_parameter_that_is_linear(is_linear):
    """For each texture that the other parameter needs, or in all where that is linear, too."""

    def glossy(weight, width):
        shape = width if is_linear else np.exp(-((ACROSS / width) ** 2))
        return weight * shape + (2 - weight) * (ALONG + 3)

    steps, points = chosen_steps(glossy, {"weight": (0.0, 1.0), "width": (0.5, 2.0)})
    found, true = mixed(steps, points, glossy, np.random.default_rng(2).uniform(size=(99, 2)))
    errors = np.linalg.norm(found - true, axis=(1, 2)) / np.linalg.norm(true, axis=(1, 2))
    assert errors.max() < (1e-6 if is_linear else ENOUGH)
    assert len(steps.values["weight"]) == 5
    assert len(points) == 2 if is_linear else 2 < len(points) < 9


def test_where_there_is_nothing_a_texture_is_kept():
    steps, points = chosen_steps(lambda x, y: np.zeros((3, 4, 1)), LOBE)
    assert (len(points), steps.error) == (1, 0)


LOBES = "ashikhmin-shirley:nu=40", "nv", 4.0, 400.0


@pytest.fixture(scope="module")
def chosen():
    return varying_steps(parse_spec(LOBES[0]), {LOBES[1]: LOBES[2:]}, 3)[0]


@pytest.mark.proof
def test_textures_between_miss_what_is_stated(chosen):
    """Of light of all directions alike, everywhere between two values, and not in the middle."""
    values, stated = chosen.values["nv"], chosen.error
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


@pytest.mark.parametrize("more", [{}, pytest.param({"nu": (4.0, 40.0)}, marks=pytest.mark.proof)])
def test_a_range_that_needs_too_many_is_refused(monkeypatch, more):
    for name in ("MOST_STEPS", "_MOST_OF_TWO"):
        monkeypatch.setattr(f"shrm_cli.maps.product.steps.{name}", 3)
    with pytest.raises(BrdfError, match="narrow the range, or give `steps`"):
        varying_steps(parse_spec(LOBES[0]), {LOBES[1]: LOBES[2:], **more}, 1)


def test_middles_are_recorded_as_people_write_them():
    """The middle of .2 and .4 is .30000000000000004, which warnings and pages named."""
    steps = Steps({"ax": (0.2, 0.4), "ay": (0.1, 0.5)}, np.ones((2, 2, 1)))
    record = {"name": "ward", "parameters": {"ax": 0.2, "ay": 0.1}}
    assert steps.recorded([record], 0.5)["parameters"] == {"ax": 0.3, "ay": 0.3}
    assert steps.recorded([record], (0.0, 1.0))["parameters"] == {"ax": 0.2, "ay": 0.5}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


WARD = ("product", "ward:ax=0.5", "--size", "8", "--order", "2")


@pytest.mark.proof
def test_the_file_and_the_report_tell_the_error(folder):
    out = done(*WARD, "--vary", "ay=0.1..0.5", "-o", "x.exr")
    made = open_map("x.exr")
    assert 0 < made.steps.error <= ENOUGH
    assert f"{made.steps.error:.2%} RMS error between two values at most" in out
    (told,) = {part.header["shrm:varying"] for part in OpenEXR.File("x.exr").parts}
    assert json.loads(told) == made.steps.summary()
    few = run(*WARD, "--vary", "ay=0.1..0.5", "--steps", "2", "-o", "x.exr")
    assert few.code == 0
    assert "is missed; leave --steps out, or give more" in few.err


def test_files_from_before_are_read(folder, monkeypatch):
    """They do not tell the error, and their values are evenly spaced."""
    old = VaryingProduct.of([texture(), texture()], Steps.of_one("a", [0, 1]))
    monkeypatch.setattr(Steps, "summary", lambda _: {"parameter": "a", "values": [0, 1]})
    old.save("old.exr")
    assert open_map("old.exr").steps.error == 0


def test_more_than_two_parameters_are_refused(folder):
    third = ("--vary", "color=0.2..0.3")
    found = run(*WARD, "--vary", "ay=0.1..0.5", "--vary", "ax=0.2..0.3", *third)
    assert found.code == 2
    assert "3 parameters, and 2 can vary" in found.err
    found = run(*WARD, "--vary", "ay=0.1..0.5", "--vary", "ay=0.2..0.3")
    assert found.code == 2
    assert "given twice for ay" in found.err
