"""Packed texels: every number that they hold, rounding, and what does not fit."""

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.export.pixels import FORMATS, RGBD, RGBP, clip_warning, encoded, loss, sentence
from shrm_cli.render.seen import seen_errors
from tests.export.readers import decoded, packed_floats, shared_exponent, small_float


def words(image, name):
    data, _ = encoded(np.asarray(image, dtype=float), FORMATS[name], "level 0")
    return np.frombuffer(data, "<u4")


@pytest.mark.parametrize(("mantissa", "channel"), [(6, 0), (6, 1), (5, 2)])
def test_every_packed_float_keeps_its_bits(mantissa, channel):
    """All finite numbers of 11 bits, and of 10, go around, and so do their midpoints to even."""
    bits = np.arange(31 << mantissa)
    values = np.array([small_float(each, mantissa) for each in bits])
    image = np.zeros((len(bits), 3))
    image[:, channel] = values
    shift = (0, 11, 22)[channel]
    assert (words(image, "r11g11b10") == bits << shift).all()
    middle = (values[1:] + values[:-1]) / 2
    even = np.where(bits[:-1] % 2 == 0, bits[:-1], bits[1:])
    image = np.zeros((len(middle), 3))
    image[:, channel] = middle
    assert (words(image, "r11g11b10") == even << shift).all()


def test_packed_floats_are_the_nearest(rng):
    image = np.exp(rng.uniform(-14, 11, size=(2000, 3)))
    found = np.array([packed_floats(word) for word in words(image, "r11g11b10").tolist()])
    for channel, mantissa in ((0, 6), (1, 6), (2, 5)):
        held = np.array([small_float(each, mantissa) for each in range(31 << mantissa)])
        nearest = np.abs(held[None] - image[:, channel, None]).min(axis=1)
        assert np.abs(found[:, channel] - image[:, channel]) == pytest.approx(nearest, abs=0)


def test_every_shared_exponent_keeps_its_value():
    """All mantissas with all exponents, in each channel."""
    held = np.array([[m * 2.0 ** (e - 24) for m in range(512)] for e in range(32)]).ravel()
    for channel in range(3):
        image = np.zeros((len(held), 3))
        image[:, channel] = held
        found = np.array([shared_exponent(word) for word in words(image, "rgb9e5").tolist()])
        assert (found == image).all()


def test_shared_exponents_follow_the_extension(rng):
    """The steps that EXT_texture_shared_exponent gives, one texel at a time."""
    image = np.exp(rng.uniform(-14, 11, size=(2000, 3)))
    image[::7, 1] = 0
    image[::11] *= 511.7 / 512 / image[::11].max(axis=1, keepdims=True) * 2.0**5  # carries over
    for (red, green, blue), word in zip(image, words(image, "rgb9e5").tolist(), strict=True):
        largest = max(red, green, blue)
        exponent = max(-16, int(np.floor(np.log2(largest)))) + 16
        if int(np.floor(largest / 2.0 ** (exponent - 24) + 0.5)) == 512:
            exponent += 1
        assert word >> 27 == exponent
        for value, found in zip((red, green, blue), shared_exponent(word), strict=True):
            assert abs(found - value) <= 2.0 ** (exponent - 24) / 2


def test_halves_are_the_nearest(rng):
    image = np.exp(rng.uniform(-18, 11, size=(500, 3)))
    data, _ = encoded(image, FORMATS["rgba16f"], "level 0")
    step = 2.0 ** (np.maximum(np.floor(np.log2(image)), -14) - 10)
    assert (np.abs(decoded(data, "rgba16f") - image) <= step / 2).all()


@pytest.mark.parametrize("name", FORMATS)
def test_what_does_not_fit_is_clipped_and_counted(name):
    largest = FORMATS[name].largest
    image = np.ones((4, 2, 3))
    image[0, 0] = 1e6
    image[1, 0, 2] = 70000
    image[2, 1] = -0.5
    data, found = encoded(image, FORMATS[name], "level 3")
    pixels = decoded(data, name).reshape(image.shape)
    assert pixels[0, 0] == pytest.approx(largest, abs=0)
    assert pixels[1, 0, 2] == largest[2]
    assert (pixels[2, 1] == 0).all()
    assert (found.above, found.below, found.most, found.least) == (2, 1, 1e6, -0.5)
    text = clip_warning("a.ktx", FORMATS[name], [found])
    assert text.startswith("a.ktx: texels brighter than")
    assert "2 of level 3" in text
    assert "1 of level 3, the least -0.5" in text
    assert clip_warning("a.ktx", FORMATS[name], [encoded(image[3], FORMATS[name], "")[1]]) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(value):
    image = np.ones((2, 3))
    image[1, 1] = value
    with pytest.raises(MapError, match=r"level 2: 1 texels are not finite; .*dim it"):
        encoded(image, FORMATS["rgb9e5"], "level 2")


@pytest.mark.parametrize("chosen", [*FORMATS.values(), RGBD, RGBP], ids=lambda each: each.name)
def test_light_that_is_too_dim_or_bright_is_to_be_scaled(chosen):
    """What was advised of light a thousand times too bright was to clamp it, and of dim light
    nothing: of a probe of 1e-5 Babylon.js showed black."""
    image = np.random.default_rng(1).uniform(0.5, 1.5, (64, 64, 3))

    def told(scale):
        return clip_warning("a", chosen, [encoded(image * scale, chosen, "level 0")[1]]) or ""

    assert told(1) == told(10 * chosen.dimmest) == ""
    assert "too dim" in told(0.5 * chosen.dimmest)
    assert "--scale 1e-7 " in told(1e7)
    assert "--scale 1e8 " in told(1e-8)
    assert "in the engine by 1e-8" in told(1e-8)


def test_a_level_of_which_nothing_is_left_has_no_power_of_ten():
    light = np.ones((6, 16, 16, 3))
    told = sentence("a.ktx2", [loss("level 0", light, 0 * light), loss("level 1", light, light)])
    assert "by 100/100, 0/0 %" in told


def test_negative_light_beside_a_sun_is_no_loss_of_packing():
    """Of a bare sun half of the texels are a little negative; each counted as 100 % wrong."""
    light = np.full((6, 16, 16, 3), -1e-3)
    light[0, 5, 5] = 1000
    faces = np.maximum(light, 0)
    assert loss("level 0", light, faces).worst == 0
    assert loss("level 0", light, 1.01 * faces).worst == pytest.approx(0.01)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_what_clipping_loses_is_known_of_light_of_any_brightness(kind):
    """Squares of 1e22 are beyond 32-bit floats: all of the light was lost, and 0 or nan % said."""
    light = np.full((6, 16, 16, 3), 1e22, np.float32)
    found = loss("level 0", light, np.full(light.shape, 65504, kind))
    assert (found.rms, found.p95) == pytest.approx((1, 1))
    assert "by 100/100 %" in sentence("a.ktx2", [found])


def test_the_night_side_of_a_bare_sun_is_measured_as_what_is_seen():
    """Of texels near black 1000 times too bright the 95th percentile was 99900 %."""
    light = np.full((6, 16, 16, 3), 1e-5)
    light[:3] = 1.0
    read = np.where(light < 1, 1000 * light, 1.01 * light)
    expected = seen_errors(read, light).p95_relative_error
    assert loss("level 0", light, read).p95 == pytest.approx(expected, rel=1e-6)
    assert 0.5 < expected < 1.5


def test_the_dimmest_light_has_steps_of_a_tenth():
    for chosen in (*FORMATS.values(), RGBD, RGBP):
        values = np.linspace(1, 1.12, 400)[:, None] * np.ones(3) * chosen.dimmest
        words = chosen.pack(values).reshape(400, -1)
        steps = (np.diff(words, axis=0) != 0).any(axis=1).sum()
        assert 1 <= steps <= 6, chosen.name
