"""The share of a map that is negative: against what the map shows, and when it is said."""

import numpy as np
import pytest

from shrm_cli.maps.request import negative_share
from shrm_cli.maps.wrong_pixels import LampsBeside, LampsLit, beside_lamps, visible_pairs
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.cube import nearest_texels
from tests import oracles
from tests.cli.helpers import polynomial_light

LUMINANCE = [0.2126, 0.7152, 0.0722]


@pytest.fixture(scope="module")
def lamp():
    """A dim probe with one very bright pixel, beside which truncated series are negative."""
    light = 0.01 * polynomial_light(oracles.latlong_pixels(64, 32))
    light[8, 20] = 500
    return Probe.from_array(light.astype(np.float32))


def make(probe, to="shrm", **given):
    return prefilter_with_facts(probe, to, {"brdf": "microfacet:sigma=0.3", **given})


@pytest.mark.parametrize(("to", "given"), [
    ("shrm", {}), ("shrm", {"frame": "local"}), ("shrm", {"compress": 4}),
    ("shrm", {"brdf": "0.5*lambertian+0.5*microfacet:sigma=0.3", "split": True}),
    ("cabral", {}), ("kautz-mccool", {"slices": 12}), ("lightfield", {"views": 8}),
])  # fmt: skip
def test_it_is_what_random_pixels_of_spheres_show(lamp, to, given):
    orders = {} if "split" in given else {"order_f": 5, "order_p": 2}
    made = make(lamp, to, **{**orders, **given}).map
    rng = np.random.default_rng(3)
    mirrored, views = rng.normal(size=(2, 10_000, 3))
    mirrored /= np.linalg.norm(mirrored, axis=1, keepdims=True)
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    share = np.mean(made.radiance(normals, views) @ LUMINANCE < 0)
    assert negative_share(made) == pytest.approx(share, abs=0.02)


def test_it_is_said_once_and_recorded(lamp):
    made = make(lamp, order_f=5, order_p=2)
    share = made.summary()["negative_share"]
    assert share > 0.05
    (line,) = [each for each in made.warnings if "negative" in each]
    assert f"{share:.1%} of what is visible" in line
    assert "`eps`" in line


def test_positive_maps_are_not_spoken_of():
    light = polynomial_light(oracles.latlong_pixels(32, 16)).astype(np.float32)
    for to in ("shrm", "cabral"):
        made = make(Probe.from_array(light), to)
        assert made.summary()["negative_share"] == 0
        assert not made.warnings


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("size", [1, 2, 5])
def test_the_nearest_texel_is_the_one_of_the_least_angle(size, sampling):
    """On a face the nearest texel of the plane need not be that of the least angle, but almost."""
    from shrm_cli.sphere.cube import cube_directions

    texels = cube_directions(size, sampling)
    rows, columns = nearest_texels(texels, size, sampling)
    found = texels[rows, columns]
    np.testing.assert_allclose(np.sum(found * texels, axis=-1), 1, atol=1e-12)
    rng = np.random.default_rng(1)
    some = rng.normal(size=(500, 3))
    some /= np.linalg.norm(some, axis=1, keepdims=True)
    cosine = np.sum(texels[nearest_texels(some, size, sampling)] * some, axis=1)
    assert np.all(cosine > np.max(some @ texels.reshape(-1, 3).T, axis=1) - 0.06)


@pytest.mark.parametrize("to", ["auto", "shrm", "principal"])
def test_what_is_black_in_truth_may_be_black(to):
    """Half of a matt sphere faces away from a bare sun; what is cut off swings about 0 there."""
    light = np.zeros((64, 128, 3), np.float32)
    light[17, 50] = 2e4
    made = make(Probe.from_array(light), to, brdf="lambertian")
    assert negative_share(made.map) > 0.1
    assert made.summary()["negative_share"] <= 0.001
    assert not made.warnings
    if to == "auto":
        assert made.map.representation == "shrm"


def test_lamps_are_looked_up_where_the_map_alone_is_negative(lamp):
    """All pairs are evaluated only if the lamps leave so much dark that the truth has to tell."""
    made = make(lamp).map
    asked = []

    def bright(normals, tangents, views):
        asked.append(len(normals))
        return np.ones(normals.shape)

    alone = negative_share(made)
    with beside_lamps(LampsBeside(LampsLit(np.ones(3), bright), np.zeros((1, 3)), None)):
        assert negative_share(made) == 0
        assert negative_share(made) == 0
    assert asked == [round(alone * len(visible_pairs()[0]))]
    assert asked[0] > 0


def test_lamps_whose_discs_are_partly_negative_may_darken_a_map(lamp):
    """The discs of a lamp may have negative radiances, as of a ring."""
    made = make(lamp, order_f=5, order_p=2).map

    def dim(normals, tangents, views):
        return np.full(normals.shape, -1e9)

    lit = LampsLit(np.ones(3), dim, may_darken=True)
    with beside_lamps(LampsBeside(lit, np.zeros((1, 3)), None)):
        assert negative_share(made) > 0.99
        assert negative_share(made, lambda normals, views: np.zeros(normals.shape)) == 0
