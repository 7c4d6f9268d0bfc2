"""What explicit maps have in common: exact at their samples, a fit away from SHRMs."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps import registry
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.prefilter import explicit_kind
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm, compressed
from tests import oracles
from tests.brute_force import unit
from tests.maps.scenes import (
    EXPLICIT,
    azimuthal_mean_image,
    cube_weights,
    harmonics_image,
    make_info,
    make_shrm,
    relative_rms,
    rms,
    uniform_points,
)

WORLD = [(Cabral, 12), (LightField, 1), (LightField, 3), (LightField, 4)]
EVERY = [*WORLD, (KautzMcCool, 1), (KautzMcCool, 6)]
PRECISIONS = [(np.float64, 1e-12), (np.float32, 1e-6)]


def black(cls=Shrm, order_p=2):
    shrm = make_shrm(order_p=order_p, size=4)
    return replace(shrm, coefficients=0 * shrm.coefficients)


@pytest.mark.parametrize(("dtype", "tolerance"), PRECISIONS)
@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize(("kind", "count"), WORLD)
def test_images_are_the_harmonics_at_the_samples(kind, count, frame, dtype, tolerance):
    shrm = make_shrm(order_p=3, size=5, dtype=dtype)
    made = kind.from_shrm(shrm.to_frame(frame), count)
    assert made.frame == "global"
    assert (made.center, made.sampling, made.size) == ("reflection", "center", 5)
    assert made.images.dtype == dtype
    for image, view in zip(made.images, kind.sample_views(made.count), strict=True):
        expected = harmonics_image(shrm, view)
        assert np.abs(image - expected).max() < tolerance * rms(shrm.coefficients)


@pytest.mark.parametrize(("dtype", "tolerance"), PRECISIONS)
@pytest.mark.parametrize("center", ["reflection", "normal"])
@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(("kind", "count"), WORLD)
def test_radiance_at_the_samples_is_that_of_the_shrm(
    kind, count, sampling, center, dtype, tolerance
):
    """At any R: what filters between texels filters both."""
    rng = np.random.default_rng(3)
    shrm = make_shrm(size=6, center=center, sampling=sampling, dtype=dtype)
    made = kind.from_shrm(shrm, count)
    samples = kind.sample_views(made.count)
    samples = samples[rng.permutation(len(samples))[:4]]
    for view in samples:
        normals = unit(rng, 60)
        views = np.broadcast_to(view, normals.shape)
        truth = shrm.radiance(normals, views)
        found = made.radiance(normals, views)
        assert np.abs(found - truth).max() < 5 * tolerance * rms(truth)


@pytest.mark.parametrize(("kind", "count"), EVERY)
def test_shapes_of_normals_and_views(kind, count):
    rng = np.random.default_rng(4)
    made = kind.from_shrm(make_shrm(size=4), count)
    normals, views = unit(rng, 6).reshape(2, 3, 3), unit(rng, 3)
    whole = made.radiance(normals, views)
    assert whole.shape == (2, 3, 3)
    for i in range(2):
        for j in range(3):
            one = made.radiance(normals[i, j], views[j])
            assert one.shape == (3,)
            np.testing.assert_allclose(one, whole[i, j], atol=1e-12)
    distant = made.radiance(normals, views[0])
    np.testing.assert_allclose(distant[:, 0], whole[:, 0], atol=1e-12)
    assert made.radiance(normals[:0], views).shape == (0, 3, 3)


@pytest.mark.parametrize("order_p", [0, 1, 3])
def test_views_are_about_ten_times_the_order(order_p):
    shrm = make_shrm(order_f=3, order_p=order_p, size=2)
    t = max(10 * order_p, 1)
    assert KautzMcCool.from_shrm(shrm).count == t
    assert LightField.from_shrm(shrm).count == t**2
    assert Cabral.from_shrm(shrm).count == 12


# ---- integrals over the view -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "count", "degree"),
    [
        (Cabral, 12, 5),
        (LightField, 1, 0),
        (LightField, 16, 3),
        (LightField, 25, 4),
        (LightField, 144, 11),
    ],
)
def test_weights_integrate_harmonics(kind, count, degree):
    """The icosahedron is a 5-design; T x T views integrate up to the degree T - 1."""
    harmonics = oracles.real_harmonics(degree + 1, kind.sample_views(count))
    integrals = kind.view_weights(count) @ harmonics
    expected = np.zeros(len(integrals))
    expected[0] = np.sqrt(4 * np.pi)
    known = (degree + 1) ** 2
    np.testing.assert_allclose(integrals[:known], expected[:known], atol=1e-12)
    assert kind.view_weights(count).min() > 0
    if kind is Cabral:  # and no 6-design
        beyond = oracles.real_harmonics(6, kind.sample_views(count)).sum(axis=0)[36:]
        assert np.abs(beyond).max() > 0.1


@pytest.mark.parametrize("count", [1, 2, 3, 6, 7])
def test_slices_integrate_legendre_polynomials(count):
    angles = np.linspace(0, np.pi, count) if count > 1 else np.zeros(1)
    for degree in range(count):
        polynomial = np.polynomial.Legendre.basis(degree)(np.cos(angles))
        integral = KautzMcCool.view_weights(count) @ polynomial
        assert integral == pytest.approx(4 * np.pi * (degree == 0), abs=1e-12)


# ---- and back ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-13), (np.float32, 2e-6)])
@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize(("order_p", "t"), [(0, 1), (1, 3), (2, 5), (2, 20), (3, 7), (4, 11)])
def test_light_fields_hold_the_whole_shrm(order_p, t, frame, dtype, tolerance):
    """T > 2P."""
    shrm = make_shrm(order_p=order_p, size=4, dtype=dtype)
    back = LightField.from_shrm(shrm.to_frame(frame), t).to_shrm()
    assert (back.frame, back.order_p) == ("global", order_p)
    assert relative_rms(back.coefficients, shrm.coefficients) < tolerance
    assert back.info.fit_residual < tolerance
    assert back.info == replace(
        shrm.info, order_p=order_p, fit_residual=back.info.fit_residual, added_error=0.0
    )


@pytest.mark.parametrize("order_p", [0, 1, 2])
def test_cabral_holds_a_shrm_to_the_second_order(order_p):
    shrm = make_shrm(order_p=order_p, size=4)
    back = Cabral.from_shrm(shrm).to_shrm()
    assert relative_rms(back.coefficients, shrm.coefficients) < 1e-13
    assert back.info.fit_residual < 1e-13


def test_cabral_knows_nothing_of_the_third_order():
    made = Cabral.from_shrm(make_shrm(order_p=3, size=4))
    with pytest.raises(MapError, match=r"12 cabral images determine .* P = 2, not 3.*`order_p`"):
        made.to_shrm(3)
    back = made.to_shrm()
    assert back.order_p == back.info.order_p == 2
    assert back.info.fit_residual > 0.1  # it tells that much was left


def test_third_order_does_not_spoil_the_first_two():
    """As the vertices are a 5-design, p = 3 is orthogonal to p <= 2 on them."""
    shrm = make_shrm(order_p=3, size=4)
    back = Cabral.from_shrm(shrm).to_shrm(2)
    np.testing.assert_allclose(back.coefficients, shrm.coefficients[:, :, :9], atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "t", "most"), [(LightField, 4, 1), (LightField, 6, 2), (KautzMcCool, 4, 3)]
)
def test_orders_that_the_samples_do_not_determine(kind, t, most):
    """T views around a circle tell azimuths |q| < T / 2 apart, T angles orders p < T."""
    made = kind.from_shrm(make_shrm(order_p=5, size=2), t)
    assert made.to_shrm().order_p == made.to_shrm(most).order_p == most
    with pytest.raises(MapError, match=f"P = {most}, not 4; lower `order_p`"):
        made.to_shrm(4)


@pytest.mark.parametrize("t", [3, 4, 9])
def test_kautz_mccool_gives_the_azimuth_free_part(t):
    shrm = make_shrm(order_p=2, size=5)
    back = KautzMcCool.from_shrm(shrm, t).to_shrm()
    assert (back.frame, back.azimuth_free, back.order_p) == ("local", True, 2)
    expected = shrm.to_frame("local").coefficients.copy()
    expected[:, :, [1, 3, 4, 5, 7, 8]] = 0
    assert relative_rms(back.coefficients, expected) < 1e-13
    # And without the package's rotation: it is the mean over azimuth at angles between slices.
    for theta in (0.4, 1.7, 2.9):
        mean = azimuthal_mean_image(shrm, theta)
        zonal = np.sqrt((2 * np.arange(3) + 1) / (4 * np.pi)) * [
            np.polynomial.Legendre.basis(p)(np.cos(theta)) for p in range(3)
        ]
        found = np.einsum("ijkc,k->ijc", back.coefficients[:, :, [0, 2, 6]], zonal)
        np.testing.assert_allclose(found, mean, atol=1e-12)


@pytest.mark.parametrize(("kind", "t"), [(Cabral, 12), (LightField, 6), (KautzMcCool, 5)])
@pytest.mark.parametrize("order_p", [0, 1, 2])
def test_a_fit_is_that_of_least_squares(kind, t, order_p):
    """Images of no SHRM at all: coefficients and residual of numpy's solver."""
    rng = np.random.default_rng(5)
    count = kind.image_count(t)
    images = rng.normal(size=(count, 18, 3, 3)) + rng.normal(size=(18, 3, 3))
    made = kind(images, "reflection", make_info(4, 2))
    fitted = made.to_shrm(order_p)
    basis = oracles.real_harmonics(order_p, kind.sample_views(count))
    if kind is KautzMcCool:
        basis = basis[:, [p * (p + 1) for p in range(order_p + 1)]]
    root = np.sqrt(kind.view_weights(count))[:, None]
    flat = images.reshape(count, -1)
    solution = np.linalg.lstsq(root * basis, root * flat, rcond=None)[0]
    found = fitted.coefficients.transpose(2, 0, 1, 3).reshape((order_p + 1) ** 2, -1)
    if kind is KautzMcCool:
        found = found[[p * (p + 1) for p in range(order_p + 1)]]
    np.testing.assert_allclose(found, solution, atol=1e-12)
    texels = np.repeat(cube_weights(3).ravel(), 3)
    rest = np.sum((root * (flat - basis @ solution)) ** 2 * texels)
    expected = np.sqrt(rest / np.sum((root * flat) ** 2 * texels))
    assert expected > 0.1
    assert fitted.info.fit_residual == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("kind", "t"), [(Cabral, 12), (LightField, 8), (KautzMcCool, 12)])
def test_the_residual_is_that_of_the_noise(kind, t):
    """All of the noise but what the orders of the fit can take up."""
    shrm = make_shrm(order_p=1, size=16)
    made = kind.from_shrm(shrm, t)
    sigma = 0.01 * rms(made.images)
    noise = sigma * np.random.default_rng(6).normal(size=made.images.shape)
    back = replace(made, images=made.images + noise).to_shrm()
    weights = kind.view_weights(made.count)
    basis = oracles.real_harmonics(1, kind.sample_views(made.count))
    if kind is KautzMcCool:
        basis = basis[:, [0, 2]]
    root = np.sqrt(weights)[:, None]
    left = np.eye(made.count) - basis @ np.linalg.pinv(root * basis) * root.T
    squares = np.einsum("kcij,k->", np.moveaxis(made.images, 3, 1) ** 2 * cube_weights(16), weights)
    expected = sigma * np.sqrt(weights @ np.sum(left**2, axis=1) * 3 * 4 * np.pi / squares)
    assert back.info.fit_residual == pytest.approx(expected, rel=0.02)
    assert back.info.fit_residual < 0.012


@pytest.mark.parametrize(("kind", "t"), [(Cabral, 12), (LightField, 4), (KautzMcCool, 4)])
def test_black_maps(kind, t):
    made = kind.from_shrm(black(), t)
    assert made.info.added_error == 0
    back = made.to_shrm()
    assert back.info.fit_residual == 0
    assert not back.coefficients.any()
    assert not made.radiance(*uniform_points(5)).any()


# ---- the error that is told ----------------------------------------------------------------------


@pytest.mark.parametrize("order_p", [1, 2, 4])
@pytest.mark.parametrize(
    ("kind", "t"),
    [(Cabral, 12), (KautzMcCool, 6), (KautzMcCool, 20), (LightField, 4), (LightField, 8)],
)
@pytest.mark.slow
def test_added_error_is_the_measured_one(kind, t, order_p):
    shrm = make_shrm(order_f=5, order_p=order_p, size=32, seed=7, dtype=np.float32)
    made = kind.from_shrm(shrm, t)
    points = uniform_points(8000)
    measured = relative_rms(made.radiance(*points), shrm.radiance(*points))
    assert made.info.added_error == pytest.approx(measured, rel=0.03)


@pytest.mark.parametrize("t", [5, 24, 31, 48, 49, 61, 96, 149])
def test_added_error_does_not_depend_on_where_the_samples_are(t):
    """Many views: at random ones, by the coefficients' own moments."""
    shrm = make_shrm(order_p=2, size=3)
    views = unit(np.random.default_rng(8), 40_000)
    indices, weights = LightField.blend(views, views, t**2)
    at_samples = oracles.real_harmonics(2, LightField.sample_views(t**2))
    exact = oracles.real_harmonics(2, views)
    difference = np.einsum("vk,vkn->vn", weights, at_samples[indices]) - exact
    flat = (shrm.coefficients * np.sqrt(cube_weights(3))[..., None, None]).transpose(2, 0, 1, 3)
    flat = flat.reshape(9, -1)
    expected = np.linalg.norm(difference @ flat) / np.linalg.norm(exact @ flat)
    found = LightField.from_shrm(shrm, t).info.added_error
    assert found == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_added_error_knows_the_size_of_texels(sampling):
    """All the light in a corner or in the middle of a face: no mean over texels would do."""
    shrm = make_shrm(order_p=2, size=5, sampling=sampling)
    values = 1e-6 * shrm.coefficients
    values[0, 0] = values[7, 2] = 0
    values[0, 0, 0] = 1.0  # does not vary with the view
    values[7, 2, 6] = 1.0
    found = LightField.from_shrm(replace(shrm, coefficients=values), 6).info.added_error
    alone = np.zeros_like(values)
    alone[7, 2, 6] = 1.0
    pure = LightField.from_shrm(replace(shrm, coefficients=alone), 6).info.added_error
    weights = cube_weights(5, sampling)
    share = weights[7, 2] / (weights[0, 0] + weights[7, 2])
    assert found == pytest.approx(pure * np.sqrt(share), rel=1e-4)


def test_a_fit_of_a_light_field_has_no_added_error():
    made = LightField.from_shrm(make_shrm(size=4), 6)
    assert made.info.added_error > 0
    assert made.to_shrm().info.added_error == 0


def test_a_fit_of_slices_has_lost_the_azimuth():
    """With many slices the error of the map is that of the azimuth alone."""
    shrm = make_shrm(order_p=2, size=32, dtype=np.float32)
    back = KautzMcCool.from_shrm(shrm, 20).to_shrm()
    points = uniform_points(8000)
    measured = relative_rms(back.radiance(*points), shrm.radiance(*points))
    assert measured > 0.1
    assert back.info.added_error == pytest.approx(measured, rel=0.03)


# ---- limits and shapes ---------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "t"), [(LightField, 10_000), (KautzMcCool, 10**8)])
def test_size_is_bounded_before_anything_is_allocated(kind, t):
    shrm = make_shrm(size=4)
    with pytest.raises(MapError, match=f"a {kind.representation} map of .* lower `size` or the"):
        kind.from_shrm(shrm, t)


@pytest.mark.parametrize(("kind", "count"), [(Cabral, 11), (LightField, 8), (KautzMcCool, 0)])
def test_counts_are_checked(kind, count):
    with pytest.raises(ValueError, match=r"images|slices"):
        kind(np.zeros((count, 6, 1, 3)), "reflection", make_info(1, 1))


@pytest.mark.parametrize("shape", [(12, 5, 1, 3), (12, 6, 1, 4), (12, 6, 1), (12, 1, 6, 3)])
def test_shapes_are_checked(shape):
    with pytest.raises(ValueError, match="images of shape"):
        Cabral(np.zeros(shape), "reflection", make_info(1, 1))


# ---- the table -----------------------------------------------------------------------------------


def test_table_of_representations():
    of_a_brdf = [name for name, each in registry.descriptions().items() if each.needs_brdf]
    assert of_a_brdf == ["shrm", "cabral", "kautz-mccool", "lightfield", "principal", "product"]
    assert all(issubclass(kind, ExplicitMap) for kind in EXPLICIT.values())
    shrm = make_shrm(size=3)
    for name, kind in EXPLICIT.items():
        argument = {"kautz-mccool": {"slices": 5}, "lightfield": {"views": 5}}.get(name, {})
        made = shrm.converted(name, **argument)
        assert registry.map_class(name) is explicit_kind(name) is type(made) is kind
        np.testing.assert_array_equal(made.images, kind.from_shrm(shrm, 5).images)
        assert made.cube_count == {"cabral": 12, "kautz-mccool": 5, "lightfield": 25}[name]
    assert shrm.converted("shrm") is compressed(shrm, None) is shrm
    assert shrm.cube_count == 9
    assert KautzMcCool.from_shrm(shrm, 5).to_shrm().cube_count == 3
    few = shrm.converted("shrm", compress=4)
    assert isinstance(few, CompressedShrm)
    assert few.cube_count == compressed(shrm, 4).cube_count == 4
    assert CompressedShrm.from_shrm(shrm, tolerance=2.0).cube_count == 1
    near = compressed(shrm, 0.5)
    assert 1 <= near.cube_count < 9
    assert near.info.added_error <= 0.5
    with pytest.raises(MapError, match="`compress` 2 is neither"):
        compressed(shrm, 2.0)


@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("order_p", [None, 0, 1, 2])
@pytest.mark.parametrize("made_by", [None, Cabral, LightField, CompressedShrm])
def test_every_map_is_an_shrm_again(made_by, order_p, frame):
    shrm = make_shrm(size=4)
    made = shrm if made_by is None else made_by.from_shrm(shrm, *([5] * (made_by is LightField)))
    back = made.to_shrm(order_p, frame)
    p = 2 if order_p is None else order_p
    assert (back.frame, back.order_p, back.info.order_p) == (frame, p, p)
    truth = shrm.coefficients[:, :, : (p + 1) ** 2]
    np.testing.assert_allclose(back.to_frame("global").coefficients, truth, atol=1e-12)


def test_an_shrm_has_no_more_orders_than_it_has():
    for made in (make_shrm(size=2), CompressedShrm.from_shrm(make_shrm(size=2), 3)):
        with pytest.raises(MapError, match="P = 2 has nothing of order 3; lower `order_p`"):
            made.to_shrm(3, "global")


@pytest.mark.parametrize("frame", ["global", "local"])
def test_slices_in_either_frame(frame):
    """The fit of a Kautz-McCool map is local; turned into world axes it reflects the same."""
    made = KautzMcCool.from_shrm(make_shrm(size=8), 8)
    found = made.to_shrm(frame=frame)
    assert found.frame == frame
    points = uniform_points(200)
    np.testing.assert_allclose(
        found.radiance(*points), made.to_shrm().radiance(*points), atol=1e-12
    )


@pytest.mark.parametrize("kind", [LightField, Cabral, KautzMcCool])
def test_errors_add_up_along_a_chain(kind):
    """What a map lost before stays told; what a fit takes back does not."""
    whole = make_shrm(order_p=2, size=4)
    low = whole.truncated(1)
    assert low.info.added_error > 0.1
    made = kind.from_shrm(low)
    own = kind.from_shrm(replace(low, info=replace(low.info, added_error=0.0))).info.added_error
    assert made.info.added_error == pytest.approx(np.hypot(low.info.added_error, own))
    lost = lost_azimuth if kind is KautzMcCool else lambda shrm: 0.0
    expected = np.hypot(low.info.added_error, lost(low))
    assert made.to_shrm(1).info.added_error == pytest.approx(expected, rel=0.02)
    back = kind.from_shrm(whole).to_shrm(2)
    assert back.info.added_error == pytest.approx(lost(whole), rel=0.02)


def lost_azimuth(shrm):
    """Relative RMS of the coefficients with q != 0, by solid angle, in the local frame."""
    values = shrm.to_frame("local").coefficients ** 2 * cube_weights(shrm.size)[..., None, None]
    energies = values.sum(axis=(0, 1, 3))
    zonal = [p * (p + 1) for p in range(shrm.order_p + 1)]
    return np.sqrt(1 - energies[zonal].sum() / energies.sum())
