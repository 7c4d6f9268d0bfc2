"""The share of a map that is negative: against what the map shows, and when it is said."""

import numpy as np
import pytest

from shrm_cli.maps.wrong_pixels import LampsBeside, LampsLit, beside_lamps, negative_of
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
    assert negative_of(made).share == pytest.approx(share, abs=0.02)


@pytest.fixture(scope="module")
def rim():
    """A map of a sun in the sky that rings at grazing angles alone, on the side away from it."""
    light = np.ones((32, 64, 3), np.float32)
    light[8, 20] = 1000
    return make(Probe.from_array(light), "principal", brdf="microfacet", error=0.02)


def test_the_worst_side_is_what_pictures_show(rim):
    """Spheres in parallel projection, drawn from 400 sides with pixels in squares."""
    rng = np.random.default_rng(5)
    x, y = np.reshape(np.meshgrid(*[(np.arange(45) + 0.5) / 22.5 - 1] * 2), (2, -1))
    inside = x**2 + y**2 < 1
    x, y = x[inside], y[inside]
    shares = []
    for _ in range(400):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        normals = np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=1) @ axes
        views = np.broadcast_to(axes[2], normals.shape)
        shares.append(np.mean(rim.map.radiance(normals, views) @ LUMINANCE < 0))
    found = negative_of(rim.map)
    assert np.mean(shares) == pytest.approx(found.share, abs=0.001)
    assert np.quantile(shares, 0.98) <= found.worst <= 1.2 * max(shares)
    assert found.worst > 10 * found.share


def test_what_one_side_shows_is_said(rim):
    facts = rim.summary()
    assert facts["negative_share"] < 0.001
    assert facts["worst_negative_share"] > 0.005
    (line,) = [each for each in rim.warnings if "negative" in each]
    assert f"{facts['worst_negative_share']:.1%} of what is visible from the worst side" in line


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
        assert made.summary()["worst_negative_share"] == 0
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
    assert negative_of(made.map).share > 0.1
    assert made.summary()["negative_share"] <= 0.001
    assert made.summary()["worst_negative_share"] <= 0.005
    assert not made.warnings
    if to == "auto":
        assert made.map.representation == "shrm"


def test_lamps_are_looked_up_where_the_map_alone_is_negative(lamp):
    """They are at all pixels only if they leave so much dark that the truth has to tell."""
    made = make(lamp).map
    asked = []

    def bright(normals, tangents, views):
        asked.append(len(normals))
        return np.ones(normals.shape)

    alone = negative_of(made).share
    with beside_lamps(LampsBeside(LampsLit(np.ones(3), bright), np.zeros((1, 3)), None)):
        assert negative_of(made).badness == 0
        assert negative_of(made).badness == 0
    assert asked == [round(alone * 64 * 128)]
    assert asked[0] > 0


def test_lamps_whose_discs_are_partly_negative_may_darken_a_map(lamp):
    """The discs of a lamp may have negative radiances, as of a ring."""
    made = make(lamp, order_f=5, order_p=2).map

    def dim(normals, tangents, views):
        return np.full(normals.shape, -1e9)

    lit = LampsLit(np.ones(3), dim, may_darken=True)
    with beside_lamps(LampsBeside(lit, np.zeros((1, 3)), None)):
        assert negative_of(made).share > 0.99
        assert negative_of(made).worst > 0.99
        assert not negative_of(made, lambda normals, views: np.zeros(normals.shape)).is_seen
