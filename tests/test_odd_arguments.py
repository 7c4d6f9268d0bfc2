"""Arguments of the library that are odd: of another length, not finite, too large, or unknown."""

import numpy as np
import pytest

import shrm_cli as shrm

SKY = np.ones((16, 32, 3), np.float32)
SKY[:8] = [3, 2, 1]


@pytest.fixture(scope="module")
def pairs():
    rng = np.random.default_rng(7)
    normals = rng.normal(size=(6, 3))
    views = normals + rng.normal(size=(6, 3)) / 4
    return [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (normals, views)]


@pytest.mark.parametrize("brdf", ["lambertian", "phong:exponent=8", "ggx:roughness=0.5"])
def test_the_truth_does_not_depend_on_the_length_of_directions(pairs, brdf):
    """It rose with the length of normals, and not of views alone."""
    normals, views = pairs
    expected = shrm.reference(SKY, brdf, normals, views)
    for one, other in ((3, 1), (1, 5), (0.1, 1e-160)):
        found = shrm.reference(SKY, brdf, normals * one, views * other)
        assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
@pytest.mark.parametrize(
    ("to", "brdf"),
    [("shrm", "microfacet:sigma=0.3"), ("cabral", "microfacet:sigma=0.3"), ("irradiance", None),
     ("product", "phong"), ("splitsum", None), ("she", None)],
)  # fmt: skip
def test_maps_do_not_depend_on_the_length_of_directions(pairs, to, brdf):
    normals, views = pairs
    given = {} if brdf is None else {"brdf": brdf}
    map_ = shrm.prefilter(SKY, to=to, **given)
    expected = map_.radiance(normals, views)
    assert map_.radiance(normals * 3, views / 7) == pytest.approx(expected, rel=1e-5, abs=1e-6)


def refused(error, words, function, *values, **named):
    with pytest.raises(error, match=words) as caught:
        function(*values, **named)
    assert "\n" not in str(caught.value)


def test_arguments_that_arrays_do_not_have_are_named():
    for name in ("linearize", "speed"):
        words = f"`{name}` is no argument of from_array, which takes `array`, `layout`"
        refused(shrm.ArgumentError, words, shrm.Probe.from_array, SKY, **{name: True})
    refused(shrm.ArgumentError, "from_array", shrm.Probe.from_array)


def test_numbers_beyond_floats_are_too_large_and_not_infinite():
    large = SKY.astype(float)
    large[2, 3, 1] = 1e39
    words = "1 of its values are too large for 32-bit floats, the first at column 3, row 2"
    refused(shrm.ProbeError, words, shrm.Probe.from_array, large)
    large[2, 3, 1] = np.inf
    refused(shrm.ProbeError, "1 pixel is NaN or infinite", shrm.prefilter, large, to="irradiance")


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_light_that_is_no_number_is_refused(value):
    texture = shrm.prefilter(SKY, "phong", to="product", order=1).product
    light = np.full((4, 3), value)
    refused(shrm.MapError, "NaN or infinite", texture.lit, light)
    one, turn = np.ones(3), np.eye(3)
    refused(shrm.ArgumentError, "scale.*NaN or infinite", shrm.Edit, [], value * one, [], turn)
    refused(shrm.ArgumentError, "turn.*NaN or infinite", shrm.Edit, [], one, [], turn + value)
    numbers = [(0, value * one)]
    refused(shrm.ArgumentError, "numbers.*NaN or infinite", shrm.Edit, numbers, one, [], turn)
    refused(shrm.ArgumentError, "irradiance.*finite number", shrm.unclip, SKY, value * one)


def test_arrays_are_exported_as_probes_are():
    one, other = (
        shrm.export(each, "unity") for each in (SKY, shrm.Probe.from_array(SKY, name="array"))
    )
    assert [each.name for each in one.files] == [each.name for each in other.files]


def test_an_empty_name_is_no_folder():
    refused(shrm.ProbeError, "the name of a probe is empty", shrm.prefilter, "", to="irradiance")
