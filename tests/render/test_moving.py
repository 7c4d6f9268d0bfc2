"""Light that moves, against probes that are turned, blends of pictures and other coefficients."""

from dataclasses import replace

import numpy as np
import pytest

import shrm_cli
from shrm_cli.color import REC709
from shrm_cli.errors import MapError
from shrm_cli.render.camera import Viewer
from shrm_cli.render.moving import Moment, check_blend, moving_light
from shrm_cli.render.sphere import render_sphere
from shrm_cli.sphere.directions import turn_about, turn_matrix
from tests.render.materials import INFO, spot, under_random_light

VIEW = Viewer(30, 20)


def test_turns_about_the_axes_are_yaw_pitch_and_roll():
    for axis, turn in enumerate(("pitch", "yaw", "roll")):
        expected = turn_matrix(**{turn: 37.0})
        np.testing.assert_allclose(turn_about(np.eye(3)[axis] * 3, 37), expected, atol=1e-15)


def test_a_turn_about_a_diagonal_exchanges_the_axes():
    np.testing.assert_allclose(turn_about((1, 1, 1), 120), np.eye(3)[[2, 0, 1]], atol=1e-15)


def room(turn):
    """A smooth room with a lamp, 32 x 64, whose light is turned as `turn` says."""
    z = np.cos((np.arange(64) + 0.5) / 64 * 2 * np.pi - np.pi)
    rows = (np.arange(32) + 0.5) / 32
    image = 1 + 0.5 * z[None, :, None] * np.sin(np.pi * rows)[:, None, None] * [1.0, 0.6, 0.2]
    image[8:12, 12:18] += [8.0, 6.0, 4.0]
    return shrm_cli.Probe.from_array(np.asarray(image, np.float32), **turn)


CASES = [
    ({"to": "irradiance"}, 1e-9),
    ({"to": "irradiance", "form": "zh3"}, 1e-6),
    ({"brdf": "microfacet:sigma=.4", "to": "shrm", "order_f": 8, "order_p": 3}, 2e-3),
    ({"brdf": "microfacet:sigma=.4", "to": "principal", "error": 0.01}, 2e-3),
    ({"brdf": "ggx:roughness=.6", "to": "product", "order": 6}, 2e-3),
    ({"to": "splitsum", "size": 64}, 2e-3),
    ({"brdf": "kajiya-kay:exponent=4", "to": "shrm", "order_f": 6, "order_p": 4}, 2e-3),
]


@pytest.mark.proof
@pytest.mark.parametrize("turn", ["yaw", "pitch", "roll"])
@pytest.mark.parametrize(("asked", "most"), CASES)
def test_a_turned_light_is_the_turned_probe(asked, most, turn):
    axis = np.eye(3)[("pitch", "yaw", "roll").index(turn)]
    at_rest = shrm_cli.prefilter(room({}), **asked)
    expected = shrm_cli.prefilter(room({turn: 73.0}), **asked)
    (moment,) = moving_light(VIEW, None, (axis, 73.0))
    shown, wanted = (each.shaded(0.4, (1.0, 0.8, 0.3)) for each in (at_rest, expected))
    truth = render_sphere(wanted, VIEW, 48)
    assert wrong(render_sphere(moment.moved(shown), VIEW, 48), truth) < most
    assert wrong(render_sphere(shown, VIEW, 48), truth) > 0.02


def test_exponentials_turn_as_their_coefficients_do():
    """They are fitted anew to a turned probe, and not to the same."""
    at_rest = shrm_cli.prefilter(room({}), to="she")
    (moment,) = moving_light(VIEW, None, ((1, 2, -1), 50.0))
    surface = 0.4, (1.0, 0.8, 0.3)
    found = render_sphere(moment.moved(at_rest.shaded(*surface)), VIEW, 48)
    turned = at_rest.turned(turn_about((1, 2, -1), 50.0)).shaded(*surface)
    assert wrong(found, render_sphere(turned, VIEW, 48)) < 1e-6


@pytest.mark.proof
def test_brushed_maps_keep_their_tangents_while_the_light_turns():
    brdf = "ggx:roughness=.6,anisotropy=.8"
    at_rest = shrm_cli.prefilter(room({}), brdf=brdf, to="principal", error=0.03)
    expected = shrm_cli.prefilter(room({"pitch": 60.0}), brdf=brdf, to="principal", error=0.03)
    (moment,) = moving_light(VIEW, None, ((1, 0, 0), 60.0))
    truth = render_sphere(expected, VIEW, 48)
    assert wrong(render_sphere(moment.moved(at_rest), VIEW, 48), truth) < 0.01


def test_a_blend_is_the_blend_of_pictures():
    first, second = spot((0, 0, 1)), under_random_light()
    moment = Moment(VIEW, share=0.3)
    found = render_sphere(moment.moved(first, second), VIEW, 48)
    expected = 0.7 * render_sphere(first, VIEW, 48) + 0.3 * render_sphere(second, VIEW, 48)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert Moment(VIEW).moved(first, second) is first
    assert Moment(VIEW, share=1.0).moved(first, second) is second


def test_turns_start_anew_and_blends_arrive():
    frames = moving_light(VIEW, 4, ((0, 1, 0), 360.0), 0.5)
    for k, each in enumerate(frames):
        np.testing.assert_allclose(each.turn, turn_matrix(yaw=90 * k), atol=1e-15)
        assert each.share == pytest.approx(0.5 * k / 3)
    (end,) = moving_light(VIEW, None, ((0, 1, 0), 90.0), 0.5)
    np.testing.assert_allclose(end.turn, turn_matrix(yaw=90), atol=1e-15)
    assert end.share == 0.5
    assert [each.viewer for each in frames] == [VIEW] * 4


def test_the_background_turns_with_the_light():
    sky, other = room({}), room({"roll": 20.0})
    directions = np.random.default_rng(2).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    moment = Moment(VIEW, turn_matrix(yaw=90), 0.25)
    expected = 0.75 * room({"yaw": 90.0}).radiance(directions)
    expected = expected + 0.25 * sky_after(90.0, directions)
    np.testing.assert_allclose(moment.behind(sky, other).radiance(directions), expected, rtol=1e-5)


def sky_after(yaw, directions):
    """The probe that was rolled by 20 degrees, turned by a yaw: one comes after the other."""
    return room({"yaw": yaw, "roll": 20.0}).radiance(directions)


def test_maps_of_other_brdfs_do_not_become_each_other():
    first, second = spot((0, 0, 1)), spot((1, 0, 0))
    check_blend(first, second, "b.exr")
    other = replace(second, info=replace(INFO, brdf={"name": "phong"}))
    with pytest.raises(MapError, match=r"b\.exr: it is of another BRDF"):
        check_blend(first, other, "b.exr")
    stated = replace(second, info=replace(INFO, chromaticities=REC709))
    check_blend(first, stated, "b.exr")  # what is not stated is taken for Rec.709
    primaries = tuple(np.linspace(0.1, 0.8, 8))
    for brdf in (INFO.brdf, {"name": "phong"}):  # gold is another colour in other primaries
        info = replace(INFO, chromaticities=primaries, brdf=brdf)
        with pytest.raises(MapError, match=r"primaries .* prefilter one with `working`"):
            check_blend(first, replace(second, info=info), "b.exr")


def wrong(found, truth):
    """The relative RMS error of a picture."""
    return np.sqrt(((found - truth) ** 2).mean() / (truth**2).mean())
