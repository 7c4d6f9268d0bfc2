"""How the degrees that maps carry end."""

from dataclasses import replace

import numpy as np
import pytest

from research import seen
from research.glossy_truth import light_of, sphere
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps import size as band_module
from shrm_cli.maps.expansion import Chosen, carried_band, carry
from shrm_cli.maps.size import Band
from shrm_cli.orders import choose_orders
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.reflected import last_visible, visible_beyond
from shrm_cli.render.seen import seen_errors
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests import brute_force
from tests.test_reflected import lamp, lit


def beyond(visible, known, level=1.0):
    """The RMS after each degree of light that is bright up to one of them."""
    return np.where(np.arange(known + 1) < min(visible, known), level, 0.0)


@pytest.mark.parametrize(("limit", "known", "last"), [(40, 100, 48), (100, 40, 40), (40, 40, 40)])
def test_visible_light_fades_out_where_a_map_has_to_end(limit, known, last):
    band = Band.of(beyond(70, known), limit, 48, known)
    assert (band.whole, band.last) == (int(0.8 * last), last)
    assert band.fades
    factors = band.factors
    assert (factors[: band.whole + 1] == 1).all()
    assert (np.diff(factors[band.whole :]) < 0).all()
    # The fall is even about its middle, where it is a half, and would be 0 one degree on.
    fall = np.append(factors[band.whole :], 0)
    assert fall + fall[::-1] == pytest.approx(1)


@pytest.mark.parametrize(("visible", "limit", "known"), [(30, 40, 31), (30, 30, 40), (0, 40, 40)])
def test_light_that_ends_by_itself_is_kept_whole(visible, limit, known):
    band = Band.of(beyond(visible, known), limit, limit + 5, known)
    assert band == Band.exact(visible)
    assert not band.fades
    assert (band.factors == 1).all()


def test_faint_light_makes_no_rings():
    """The RMS of what is lost is a hundredth of the mean, and a tenth."""
    assert Band.of(beyond(70, 100, 0.01), 40, 50, 100) == Band.exact(40)
    assert Band.of(beyond(70, 100, 0.1), 40, 50, 100).fades


def test_degrees_that_the_tolerance_asks_for_are_kept_where_nothing_is_weakened():
    assert Band.of(beyond(30, 100), 100, 120, 100, least=70) == Band.exact(70)
    assert Band.of(beyond(90, 100), 50, 60, 100, least=55).last == 60


def test_degrees_of_the_view_fade_out_where_enough_of_them_end_too_soon():
    assert Band.of_views(0.1, 25) == Band(20, 25)
    assert Band.of_views(0.01, 25) == Band.exact(25)
    assert Band.of_views(0.1, 13) == Band.exact(13)


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_views_that_fade_out_do_not_ring(monkeypatch):
    """Cloth, which shines at grazing views only, in a room with a lamp, beside the truth."""
    directions = latlong_directions(64, 32)
    lamp_light = np.where(directions @ np.array([0.6, 0.48, 0.64]) > 0.97, 60.0, 0.2)
    probe = Probe.from_array(np.repeat(lamp_light[..., None], 3, axis=2), layout="latlong")
    brdf, options = (
        parse_spec("charlie:roughness=0.1"),
        {"to": "shrm", "size": 12, "max_size": "4MB"},
    )
    ball, light = sphere((0.6, 0.0, 0.8), 16), light_of([probe], 32)
    truth = seen.lit(brdf, ball.normals, ball.views, light)
    fading = prefilter(probe, brdf, **options)
    monkeypatch.setattr(band_module, "_FEW_VIEWS", 99)
    cut = prefilter(probe, brdf, **options)
    by_hand = prefilter(probe, brdf, order_p=cut.info.order_p, **options)
    assert cut.info.order_p == fading.info.order_p >= 20
    errors = [seen_errors(each.radiance(ball.normals, ball.views), truth) for each in (fading, cut)]
    assert errors[0].median_relative_error < 0.5 * errors[1].median_relative_error
    assert errors[0].negative_share <= errors[1].negative_share
    assert cut.info.predicted_error < fading.info.predicted_error < 1.1 * cut.info.predicted_error
    # Orders that are given are kept whole.
    assert by_hand.info.predicted_error < fading.info.predicted_error


def test_maps_of_one_light_end_in_every_way():
    coefficients = compute_coefficients(parse_spec("phong:exponent=64"), 80, 0)
    light = lamp(80)
    enough = carried_band(light, coefficients, 10, 0, 40)
    assert enough == Band.exact(last_visible(visible_beyond(light, coefficients, 0)))
    assert carried_band(light, coefficients, 70, 0, 40) == Band.exact(70)
    # A single cube goes as far as its texels can tell degrees apart, and fades before.
    few_texels = carried_band(light, coefficients, 10, 0, 15)
    assert 20 < few_texels.whole < few_texels.last == 30
    # The pixels of a small probe resolve fewer degrees than the cube and the BRDF have.
    power = np.repeat(2.0 * np.arange(81)[:, None] + 1, 3, axis=1) * (np.arange(81) <= 25)[:, None]
    coarse = carried_band(lit(power, np.full(3, 1e12)), coefficients, 10, 0, 40)
    assert 15 < coarse.whole < coarse.last == 25
    # Light that has no more degrees does not fade out before its last one.
    assert carried_band(lit(power), coefficients, 10, 0, 40).whole >= 25


def test_maps_carry_what_is_visible_beyond_the_first_coefficients():
    """The orders that a tolerance asks for are found among 32, of which a map is to carry more."""
    pixels = np.full((128, 256, 3), 0.2, np.float32)
    pixels[40:42, 60:62] = 500
    brdf, light = parse_spec("microfacet:sigma=0.2"), Projection(Probe.from_array(pixels))
    chosen = Chosen.of(brdf, choose_orders(brdf, 0.1), 32)
    assert chosen.coefficients.order_f == 32
    found = carry(light, chosen)
    more = compute_coefficients(brdf, 128, chosen.coefficients.order_p)
    expected = carry(light, replace(chosen, coefficients=more))
    assert found.band == expected.band
    assert found.band.last > 32
    assert found.error == pytest.approx(expected.error, rel=0.01)


@pytest.mark.filterwarnings("ignore:.*is negative:shrm_cli.errors.ShrmWarning")
@pytest.mark.parametrize("to", ["shrm", "principal"])
def test_maps_that_fade_out_do_not_ring(monkeypatch, to):
    """A small lamp over a dim sky, against brute force: what is seen, and the RMS error."""
    height = 64
    light, weights = brute_force.latlong_samples(height)
    pixels = np.full((height, 2 * height, 3), 0.1, dtype=np.float32)
    pixels[20:22, 50:52] = 500
    probe = Probe.from_array(pixels)
    radiance = pixels.reshape(-1, 3).astype(float)
    rng = np.random.default_rng(3)
    reflections, views = brute_force.unit(rng, 600), brute_force.unit(rng, 600)
    normals = reflections + views
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    kept = np.sum(normals * views, axis=1) > 0.3  # others are hardly lit by this lobe
    lobe = brute_force.microfacet(0.1)
    truth = np.array(
        [
            brute_force.reflected(lobe, r, v, light, weights, radiance)
            for r, v in zip(reflections[kept], views[kept], strict=True)
        ]
    )[:, 1]
    options = {"maps": 25} if to == "principal" else {"order_p": 4}

    def seen() -> tuple[float, float, float]:
        made = prefilter(probe, "microfacet:sigma=0.1", to=to, size=24, **options)
        found = made.radiance(normals[kept], views[kept])[:, 1]
        error = np.abs(found - truth) / np.maximum(truth, 0.02 * truth.mean())
        return float(np.median(error)), float(np.mean(found < 0)), made.info.predicted_error

    median, negative, predicted = seen()
    monkeypatch.setattr(band_module, "_RINGS", np.inf)
    cut_median, cut_negative, cut_predicted = seen()
    print(
        f"{to}: {cut_median:.4f} {cut_negative:.4f} {cut_predicted:.4f} cut off, "
        f"{median:.4f} {negative:.4f} {predicted:.4f} fading"
    )
    assert median < 0.2 * cut_median
    assert negative < 0.5 * cut_negative
    assert predicted < 1.1 * cut_predicted
