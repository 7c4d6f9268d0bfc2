"""Panoramas whose lamps are spread, and what engines make of a lamp by their own filters."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.export import engine as engines
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.export.tamed import tamed
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import ENGINES
from tests.brute_force import latlong_samples
from tests.export import samplers
from tests.export.test_engines import latlong

ROWS = 512
NAMES = [name for name in ENGINES if engines.engine(name).sampler is not None]


def lit(rows=ROWS):
    """A smooth sky with a sun of four pixels, a bulb of one, and a wide window."""
    directions, areas = (np.asarray(each) for each in latlong_samples(rows))
    image = (1 + 0.3 * directions).reshape(rows, 2 * rows, 3)
    image[rows // 4 : rows // 4 + 2, rows // 3 : rows // 3 + 2] = [9000, 7000, 5000]
    image[rows // 2, rows] = [400, 900, 2000]
    image[rows // 2 - 40 : rows // 2, 60:120] = 20
    return image, areas.reshape(rows, 2 * rows, 1)


@pytest.mark.parametrize("name", NAMES)
def test_a_lamp_is_a_disc_of_the_same_light(name):
    sampler = engines.engine(name).sampler
    image, areas = lit()
    found, told = tamed(image, sampler)
    before, after = ((each * areas).sum(axis=(0, 1)) for each in (image, found))
    assert after == pytest.approx(before, rel=1e-12)
    assert told[0].startswith("2 lamps are spread")
    assert np.array_equal(found[: ROWS // 8], image[: ROWS // 8])
    assert np.array_equal(found[ROWS // 2 - 15, 60:120], image[ROWS // 2 - 15, 60:120])
    directions = np.asarray(latlong_samples(ROWS)[0]).reshape(*image.shape)
    for rows, columns in (((128, 130), (170, 172)), ((256, 257), (512, 513))):
        own = np.s_[rows[0] : rows[1], columns[0] : columns[1]]
        axis = (directions[own] * areas[own]).sum(axis=(0, 1))
        axis /= np.linalg.norm(axis)
        angles = np.degrees(np.arccos(np.clip(directions @ axis, -1, 1)))
        inside = angles <= sampler.radius
        near = (angles < 5)[..., None] & True
        assert (found * areas * near).sum() == pytest.approx((image * areas * near).sum())
        assert found[inside].max() < image[own].max()
        ring = (angles > 1.05 * sampler.radius + 1) & (angles < 5)
        assert np.array_equal(found[ring], image[ring])
        assert np.ptp(found[inside][:, 0]) < 0.2 * found[inside].mean()


def test_a_lamp_with_a_glow_is_spread_and_a_tube_stays():
    """The pixels of its glow made a street lamp of .4 degrees as large as one of 1.2, which stays:
    of a night with seven such lamps one was spread."""
    directions, areas = (np.asarray(each) for each in latlong_samples(ROWS))
    angles = np.degrees(np.arccos(np.clip(directions @ directions[ROWS // 2 * 2 * ROWS], -1, 1)))
    image = np.full((2 * ROWS**2, 3), 0.01)
    image += np.where(angles < 0.4, 4000, np.where(angles < 2, 4, 0))[:, None]
    image = image.reshape(ROWS, 2 * ROWS, 3)
    image[300, 500:520] = 500  # 7 degrees of a tube, whose pixels are fewer than those of a disc
    found, told = tamed(image, engines.engine("godot").sampler)
    assert told[0].startswith("1 lamp is spread")
    assert found[: ROWS // 2 + 10].max() < 1000
    weights = areas.reshape(ROWS, 2 * ROWS, 1)
    assert (found * weights).sum() == pytest.approx((image * weights).sum(), rel=1e-12)
    glow = ((angles > 1.2) & (angles < 2)).reshape(ROWS, 2 * ROWS)
    assert np.array_equal(found[glow], image[glow])
    assert np.array_equal(found[300, 500:520], image[300, 500:520])


def test_light_without_lamps_stays(rng):
    image = rng.uniform(0.5, 1.5, (64, 128, 3))
    found, told = tamed(image, engines.engine("godot").sampler)
    assert np.array_equal(found, image)
    assert told == ["no lamp is spread, as none is smaller than a radius of 2.8 degrees"]


@pytest.mark.proof
@pytest.mark.parametrize("name", NAMES)
def test_what_is_told_of_a_lamp_is_what_the_filter_makes(name):
    sampler = engines.engine(name).sampler
    for radius, told in ((0, sampler.bare), (sampler.radius, sampler.spread)):
        found = samplers.lamp_errors(name, sampler, radius)
        assert found == pytest.approx(told, abs=0.01)


def test_filters_with_many_samples_make_what_the_lobe_makes():
    levels = samplers.mips((1 + 0.5 * samplers.centers(64)[..., 1]).reshape(-1, 64))
    normals = np.array([[0, 1, 0], [0.6, 0, 0.8], [0, -1, 0.0]])
    lobes = samplers.total(0.3, 1) / samplers.total(0.3)
    # Godot weighs its samples with N.L in place of the shadowing.
    for name, bound in (("unity", 0.001), ("godot", 0.01)):
        found = samplers.filtered(name, levels, 0.3, 2584, normals)
        assert found == pytest.approx(1 + 0.5 * lobes * normals[:, 1], abs=bound)


def test_an_export_is_told_and_smaller(tmp_path):
    image, areas = lit(1024)
    source = Source("sky", "sky.exr", Probe.from_array(image, "latlong"))
    made = packaged(source, engines.engine("godot"), Asked(safe=True))
    write(made, tmp_path)
    found = latlong(tmp_path, "sky_panorama.exr")
    assert found.shape == (512, 1024, 3)  # its cube of 256 skips nothing
    light = (found * np.asarray(latlong_samples(512)[1]).reshape(512, 1024, 1)).sum(axis=(0, 1))
    assert light == pytest.approx((image * areas).sum(axis=(0, 1)), rel=2e-3)
    assert found.max() < 900
    said = "; ".join(made.told)
    assert "spread over a radius of 1 degrees" in said
    assert "8, 28, 34, 43, 46, 48, 49 % RMS" in said


@pytest.mark.parametrize("name", sorted(set(ENGINES) - set(NAMES)))
def test_other_engines_are_refused(name):
    source = Source("sky", "sky.exr", Probe.from_array(np.ones((16, 32, 3)), "latlong"))
    with pytest.raises(ArgumentError, match="does not apply"):
        packaged(source, engines.engine(name), Asked(safe=True))
