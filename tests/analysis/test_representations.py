"""The errors of a table of representations against brute force that shares no code with it."""

import os
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.analysis import representations
from shrm_cli.analysis.representations import COMPARED, compare_representations, plan_comparison
from shrm_cli.errors import ShrmWarning
from shrm_cli.files.image import write_image
from shrm_cli.maps.explicit.prefilter import prefilter_explicit
from shrm_cli.maps.request import Request
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.open import open_probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import ggx_surface
from tests.brute_force import latlong_samples
from tests.makers import prefilter_split_sum
from tests.oracles import latlong_pixels

pytestmark = pytest.mark.slow

ROUGHNESS = (0.6, 1.0)
F0 = (1.0, 0.5, 0.1)
VIEW = (40.0, 20.0)
TOLERANCE = 0.1
SMALL = 8000
"""Bytes of a principal map with visible errors. At the defaults this smooth light is kept to a few
hundredths of a percent, which is as far as the pixels of the probe and brute force agree."""


def lamp(directions):
    """Smooth light from one side: a bright lobe and a dim sky."""
    axis = np.array([0.48, 0.6, 0.64])
    lobe = np.exp(8 * (np.asarray(directions, dtype=float) @ axis - 1))
    return 0.2 + lobe[..., None] * np.array([4.0, 2.0, 1.0])


@pytest.fixture(scope="module")
def probe(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "lamp.exr"
    write_image(path, lamp(latlong_pixels(64, 32)).astype(np.float32), "float")
    return open_probe(path)


@pytest.fixture(scope="module")
def told():
    """What the comparison has told of its progress."""
    return []


def planned(probe, size):
    surfaces = [ggx_surface(roughness, F0) for roughness in ROUGHNESS]
    return plan_comparison(probe, surfaces, TOLERANCE, [Viewer(*VIEW)], size)


@pytest.fixture(scope="module")
def table(probe):
    return compare_representations(planned(probe, 96))


@pytest.fixture(scope="module")
def coarse(probe, told):
    """The same of small pictures, which take a fifth of the time."""
    return compare_representations(planned(probe, 16), lambda *what: told.append(what))


@pytest.fixture(scope="module")
def small_table(probe):
    """The same of principal maps alone, with few bytes."""
    plan = planned(probe, 96)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(representations, "COMPARED", ("principal",))
        return compare_representations(replace(plan, memory=replace(plan.memory, max_size=SMALL)))


def ggx(roughness, normal, view, light):
    """f_r cos of GGX with Schlick and correlated Smith, after Walter 2007 and Heitz 2014."""
    alpha = roughness**2
    half = light + view
    half /= np.sqrt(np.sum(half**2, axis=1, keepdims=True))
    nl, nv, nh, vh = light @ normal, view @ normal, half @ normal, half @ view
    distribution = alpha**2 / (np.pi * (nh**2 * (alpha**2 - 1) + 1) ** 2)

    def lam(cosine):
        return (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2

    lit = nl > 1e-9
    shadowing = 1 / (1 + lam(np.where(lit, nl, 1)) + lam(nv))
    fresnel = np.array(F0) + (1 - np.array(F0)) * (1 - vh[:, None]) ** 5
    value = distribution * shadowing / (4 * nv)
    return np.where(lit, value, 0)[:, None] * fresnel


def disc():
    """Normals of the sphere's visible half, their shares of the picture's area, and the view."""
    azimuth, elevation = np.radians(VIEW)
    view = np.array([np.sin(azimuth), 0, np.cos(azimuth)]) * np.cos(elevation)
    view[1] = np.sin(elevation)
    right = np.array([np.cos(azimuth), 0, -np.sin(azimuth)])
    nodes, weights = np.polynomial.legendre.leggauss(48)
    depth, phi = (nodes + 1) / 2, 2 * np.pi * np.arange(96) / 96
    x, y = (np.sqrt(1 - depth**2)[:, None] * turn for turn in (np.cos(phi), np.sin(phi)))
    z = np.broadcast_to(depth[:, None], x.shape)
    normals = np.stack([x, y, z], axis=-1) @ np.array([right, np.cross(view, right), view])
    return normals.reshape(-1, 3), np.repeat(weights * depth, 96)[:, None], view


@pytest.fixture(scope="module")
def truth():
    """Radiance at the normals of the disc, for each roughness."""
    light, weights = latlong_samples(40)
    radiance = lamp(light) * weights[:, None]
    normals, _, view = disc()
    return [
        np.array([np.sum(ggx(each, normal, view, light) * radiance, axis=0) for normal in normals])
        for each in ROUGHNESS
    ]


def relative(found, expected):
    _, area, _ = disc()
    return np.sqrt(np.sum(area * (found - expected) ** 2) / np.sum(area * np.square(expected)))


def maps(name, probe):
    """What reflects, for each roughness, never written to a file."""
    surfaces = [ggx_surface(each, F0) for each in ROUGHNESS]
    if name == "splitsum":
        split = prefilter_split_sum(probe).map
        return [split.shaded(each.number("roughness"), each.color("f0")) for each in surfaces]
    if name == "shrm":
        return [prefilter(probe, each, eps=TOLERANCE) for each in surfaces]
    if name == "principal":
        with pytest.warns(ShrmWarning, match="before packing hold too little"):
            return [
                prefilter(probe, each, to=name, eps=TOLERANCE, max_size=SMALL) for each in surfaces
            ]
    return [prefilter_explicit(probe, Request(name, each, TOLERANCE)).map for each in surfaces]


@pytest.mark.proof
@pytest.mark.parametrize("name", ["shrm", "principal", "cabral", "splitsum"])
def test_errors_are_those_of_brute_force(probe, table, small_table, truth, name):
    results = (small_table if name == "principal" else table).results
    (result,) = (each for each in results if each.representation.name == name)
    normals, _, view = disc()
    found = [each.radiance(normals, view) for each in maps(name, probe)]
    expected = [relative(*pair) for pair in zip(found, truth, strict=True)]
    np.testing.assert_allclose(result.errors, expected, rtol=0.03)
    assert result.error == pytest.approx(relative(np.array(found), np.array(truth)), rel=0.03)
    assert min(expected) > 0.01


@pytest.mark.proof
def test_the_exponential_is_near_the_truth(table):
    (result,) = (each for each in table.results if each.representation.name == "she")
    assert 0 < result.error < 0.3
    assert result.files == 1


def test_storage_is_that_of_files(probe, coarse, tmp_path):
    sizes = []
    for roughness in ROUGHNESS:
        made = prefilter(probe, ggx_surface(roughness, F0), eps=TOLERANCE)
        made.save(tmp_path / "map.exr")
        sizes.append(os.path.getsize(tmp_path / "map.exr"))
    first = coarse.results[0]
    assert (first.representation.name, first.files, first.stored) == ("shrm", 2, sum(sizes))


def test_pictures_and_shapes(coarse):
    assert coarse.truth.shape == (2, 1, 16, 16, 3)
    assert [each.representation.name for each in coarse.results] == list(COMPARED)
    for each in coarse.results:
        assert [picture.shape for picture in each.pictures] == [(1, 16, 16, 3)] * 2
        assert each.seconds > 0


def test_progress_is_told_from_the_start_to_the_end(coarse, told):
    done, total = (np.array(each) for each in zip(*told, strict=True))
    assert len(set(total)) == 1
    assert done[0] == 0
    assert done[-1] == total[0]
    assert (np.diff(done) >= 0).all()
    # Two pictures of the truth, two maps of each of three representations, and two other maps.
    stage = total[0] / 10
    made = np.unique(done[done > 2 * stage])
    assert (np.abs(made / stage - np.round(made / stage)) > 0.01).sum() > 10
