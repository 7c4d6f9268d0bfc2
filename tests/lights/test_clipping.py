"""Clipped light is told from the soft boxes of computer graphics, by shapes that are known."""

import numpy as np
import pytest

from shrm_cli.analysis.probe_statistics import probe_statistics
from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.lights.clipping import Plateau, clipping
from shrm_cli.lights.split import split_lamps
from shrm_cli.probe.make import studio
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from tests.lights import rooms
from tests.lights.rooms import unit

AXIS, ALONG = unit(0.3, 0.5, 0.7), unit(0.7, 0, -0.3)
WARM = np.array([1.0, 0.95, 0.9])
SIZE = 96


def seen(light):
    """An image of a room behind `light`, which tells radiance and how much of the room it hides."""

    def radiance(directions):
        values, hides = light(directions)
        return values[..., None] * WARM + (1 - hides)[..., None] * rooms.background(directions)

    return rooms.latlong(SIZE, radiance)


def box(level, length, width, edge=0.0, axis=AXIS):
    """An even box, whose smooth edge is as wide as a part of half its size."""
    across = np.cross(axis, ALONG)

    def light(directions):
        shape = (directions @ axis > 0).astype(float)
        for direction, extent in ((ALONG, length), (across, width)):
            angle = np.abs(np.arctan2(directions @ direction, directions @ axis))
            outside = 2 * angle / np.radians(extent) - 1
            t = np.clip(0.5 - outside / max(edge, 1e-9), 0, 1)
            shape = shape * t**2 * (3 - 2 * t)
        return level * shape, shape

    return light


def glare(power, at, level):
    """A sun's glare that falls by a power of the angle, and is `level` at an angle in degrees."""

    def light(directions):
        angle = np.arccos(np.clip(directions @ AXIS, -1, 1))
        return level * (np.maximum(angle, 1e-3) / np.radians(at)) ** -power, np.zeros(angle.shape)

    return light


def blur(degrees, level):
    """A sun that a blur of some degrees has spread."""

    def light(directions):
        height = directions @ AXIS
        return level * np.exp((height - 1) / np.radians(degrees) ** 2), np.zeros(height.shape)

    return light


def view(directions):
    """A window of 30 x 20 degrees with a view, whose brightness rises toward a side."""
    _, inside = box(1, 30, 20)(directions)
    angle = np.arctan2(directions @ ALONG, directions @ AXIS)
    return inside * 20 * 4 ** (angle / np.radians(15)), inside


def both(first, second):
    def light(directions):
        (one, hides), (other, too) = first(directions), second(directions)
        return one + other, np.maximum(hides, too)

    return light


def told(image):
    return probe_statistics(Probe.from_array(image), 0).clipped


BOXES = {
    "an even box": seen(box(20, 40, 30)),
    "a small even box": seen(box(20, 18, 18)),
    "a soft box": seen(box(20, 40, 30, edge=0.6)),
    "a box with a darker one": seen(both(box(20, 40, 30), box(16, 30, 40, axis=-AXIS))),
    "a studio": studio(SIZE),
    "a studio of strong contrast": studio(SIZE, 1000),
    "a window blown out to its rim, which looks the same": np.minimum(seen(box(90, 40, 30)), 20),
}
LAMPS = {
    "a bare sun": seen(glare(2, 2, 20)),
    "a sun in haze": seen(glare(2, 10, 20)),
    "a sun in thin haze": seen(glare(3, 8, 20)),
    "a blurred sun": seen(blur(1.5, 2000)),
    "a bulb of few pixels": seen(box(20, 8, 8)),
    "a window with a view": seen(view),
}


@pytest.mark.parametrize("name", BOXES)
def test_boxes_are_not_clipped(name):
    assert told(BOXES[name]) == ""


@pytest.mark.parametrize("name", LAMPS)
def test_lamps_and_windows_are(name):
    assert "pixels share the maximum 20 of R" in told(np.minimum(LAMPS[name], 20))


@pytest.mark.parametrize("name", ["an even box", "a soft box"])
def test_boxes_at_the_end_of_half_precision_are(name):
    assert "R reaches 65504, the end of half" in told(BOXES[name] * (65504 / BOXES[name].max()))


@pytest.mark.parametrize("axis", [unit(0, 1, 0), unit(1, 0, 0)])
def test_the_pixels_that_are_told_are_counted(axis):
    """Of a lat-long those at the zenith are many and small, those at the horizon few and large."""

    def light(directions):
        angle = np.arccos(np.clip(directions @ axis, -1, 1))
        return 20 * (np.maximum(angle, 1e-3) / np.radians(5)) ** -2.0, np.zeros(angle.shape)

    image = np.minimum(seen(light), 20)
    count = np.count_nonzero(image[..., 0] == image.max())
    assert told(image) == f"{count} pixels share the maximum 20 of R"
    for rows in (image, image[::-1]):  # where the maximum rises the count begins anew
        plateau = Plateau()
        for row in rows[..., 0]:
            plateau.add(row, np.full(len(row), 1e-3))
        assert plateau.pixels == count


def test_lamps_tell_the_same():
    """Of lamps that `split_lamps` finds only their own pixels are looked at."""
    small = Probe.from_array(BOXES["a small even box"])
    assert [lamp.clipped for lamp in split_lamps(small, largest=0.2).lamps] == [""]
    sun = Probe.from_array(np.minimum(LAMPS["a blurred sun"], 20))
    assert "share the maximum 20 of R" in split_lamps(sun, largest=0.2).lamps[0].clipped


def test_boxes_at_the_end_of_integers_are(tmp_path):
    """Of an 8-bit picture, by its statistics and by its lamps."""
    image = BOXES["a small even box"]
    write_png(tmp_path / "a.png", encode_srgb(image * np.where(image > 10, 0.06, 0.006)))
    probe = open_probe(tmp_path / "a.png", linearize=True)
    converted = open_probe(tmp_path / "a.png", linearize=True, working="acescg")
    for each in (probe, shared(probe), converted):  # as maps share it, and in other primaries
        assert "R reaches 1, the end of its integers" in probe_statistics(each, 0).clipped
        assert "R reaches 1, the end of" in split_lamps(each, largest=0.2).lamps[0].clipped


def test_blocks_of_rows_tell_what_the_whole_does():
    """The rim of a lamp may be in an earlier block than its brightest pixels."""
    image = np.minimum(LAMPS["a sun in haze"], 20)[..., 0]
    areas = np.broadcast_to(Probe.from_array(image).grid.weights(), image.shape)
    whole, rows = Plateau(), Plateau()
    whole.add(image, areas)
    for values, some in zip(image, areas, strict=True):
        rows.add(values, some)
    pixel = 4 * np.pi / image.size
    assert rows.suspicion("R", pixel) == whole.suspicion("R", pixel) != ""
    rims = [each.between(3 / 4, 1) for each in (rows, whole)]
    np.testing.assert_allclose(*rims, rtol=1e-9, atol=1e-15)


def peak(rows=128):
    """A peak that falls as a blur does, and is cut off by no more than the number of its pixels."""
    x = np.linspace(-1.5, 1.5, rows)
    return np.exp(-(x[:, None] ** 2) - x**2).ravel()


def told_of(values, color=(1.0, 1.0, 1.0), area=1e-6):
    return clipping(values.reshape(len(values), -1) * np.array(color), np.full(len(values), area))


def test_peaks_are_flat_only_where_they_are_cut_off():
    """A fortieth of a blurred sun is missing; or it has a hundred levels, as few as files have."""
    assert "share the maximum 0.975" in told_of(np.minimum(peak(), 0.975))
    assert told_of(np.round(peak(), 2)) == ""


@pytest.mark.parametrize(("red", "is_clipped"), [(0.3, False), (0.7, True)])
def test_channels_of_colored_light_are_cut_off_at_unlike_numbers(red, is_clipped):
    """White balance moves them apart; much darker ones may be flat by themselves."""
    light = np.stack([np.minimum(red / 0.7 * peak(), red), peak(), peak()], axis=1)
    assert ("of R" in told_of(light)) == is_clipped


def test_an_edge_that_resampling_left_is_hard():
    """A box of 13 x 13 pixels, with values of every size in the pixels around it."""
    values = np.concatenate([np.ones(169), (np.arange(56) + 0.5) / 56])
    assert told_of(values, area=1e-4) == ""
    assert "169 pixels share" in told_of(values, area=1e-5)  # a bulb is as small


@pytest.mark.parametrize(("level", "is_clipped"), [(1.75, False), (3.0, True)])
def test_what_is_hardly_brighter_than_the_mean_is_no_lamp(level, is_clipped):
    image = np.minimum(LAMPS["a bare sun"], level)
    assert 3 < level / image[..., 0].mean() < 6
    assert (told(image) != "") == is_clipped
