"""What a library refuses in one line: values that arguments cannot have, and what it takes."""

from pathlib import Path

import numpy as np
import pytest

import shrm_cli as shrm

UP = np.array([0.0, 1.0, 0.0])
STUDIO = Path(__file__).resolve().parents[1] / "probes" / "studio.exr"


@pytest.fixture(scope="module")
def light():
    return shrm.Probe.from_array(np.ones((16, 32, 3), np.float32), layout="latlong")


@pytest.fixture(scope="module")
def matte(light):
    return shrm.prefilter(light, "lambertian", to="shrm", order_f=2, order_p=0, size=8)


@pytest.fixture(scope="module")
def chain(light):
    return shrm.prefilter(light, to="splitsum", levels=[0.3, 1.0], size=8)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda light, made: shrm.project(light, -1), "order"),
        (lambda light, made: shrm.project(light, 1.5), "order"),
        (lambda light, made: shrm.project(light, True), "order"),
        (lambda light, made: shrm.project(light, 10**9), "order"),
        (lambda light, made: shrm.basis_maps(-1), "order"),
        (lambda light, made: shrm.dfg(size=0), "size"),
        (lambda light, made: shrm.split_lamps(light, count=1.5), "count"),
        (lambda light, made: shrm.probe_statistics(light, -1), "lamps"),
        (lambda light, made: shrm.reference(light, "lambertian", UP, UP, 0), "source_height"),
        (lambda light, made: shrm.reference(light, "lambertian", UP, UP, 10**9), "source_height"),
        (lambda light, made: shrm.reference(light, "lambertian", 5.0, UP), "normals"),
        (lambda light, made: shrm.reference(light, "lambertian", UP, [UP[:2]]), "views"),
        (lambda light, made: shrm.reference(light, 3, UP, UP), "brdf"),
        (lambda light, made: light.radiance("up"), "directions"),
        (lambda light, made: made.radiance(UP, UP[:2]), "views"),
        (lambda light, made: made.radiance(None, UP), "normals"),
        (lambda light, made: made.save("x.exr", "flaot"), "precision"),
        (lambda light, made: made.save("x.exr", orientation="left"), "orientation"),
        (lambda light, made: shrm.render(made, size=0), "size"),
        (lambda light, made: shrm.render(made, size=(32, 16)), "size"),
        (lambda light, made: shrm.render(made, size=(16, 16, 16)), "size"),
        (lambda light, made: shrm.render(made, view=30, size=16), "view"),
        (lambda light, made: shrm.render(made, size=16, exposure=float("nan")), "exposure"),
        (lambda light, made: shrm.render(made, size=16, fov=30.0), "fov"),
        (lambda light, made: shrm.render(made, size=16, roughness=0.3), "roughness"),
        (lambda light, made: shrm.compare(made, light, size=16, f0="gold"), "f0"),
        (lambda light, made: shrm.render(made, size=16, mesh="x.obj", place=(0, 0, 0)), "place"),
        (lambda light, made: shrm.product("ward", 1, 8, vary=0.5), "vary"),
        (lambda light, made: shrm.product("ward", 1, 8, vary={"ax": (0.1, 0.5)}), "vary"),
        (lambda light, made: shrm.product("ward", 1, 8, vary=()), "vary"),
        (lambda light, made: shrm.using(threads=0), "threads"),
        (lambda light, made: shrm.to_layout("sky.exr", "latlong"), "probe"),
    ],
)
def test_what_cannot_be_is_refused_by_its_name(call, named, light, matte, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(shrm.ArgumentError) as refused:
        call(light, matte)
    assert refused.value.argument == named
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [1, 10**9, 64.0])
def test_probes_have_rows_within_limits(size):
    with pytest.raises(shrm.ProbeError, match="at least 2 pixels, 8192 at most"):
        shrm.furnace(size)


def test_names_of_layouts_are_told(light):
    with pytest.raises(shrm.ProbeError, match="'sphere' is not known; give one of latlong"):
        shrm.to_layout(light, "sphere")


def test_probes_are_taken_by_path_and_as_arrays():
    """Whatever takes a probe does."""
    expected = shrm.project(shrm.open_probe(STUDIO), 2).coefficients
    assert np.array_equal(shrm.project(STUDIO, np.int64(2)).coefficients, expected)
    assert shrm.probe_statistics(str(STUDIO), 0).maximum[0] == 20
    white = shrm.project(np.ones((16, 32, 3)), 0).coefficients
    np.testing.assert_allclose(white, np.sqrt(4 * np.pi), rtol=1e-6)


def test_files_of_brdfs_are_taken_as_paths(light, tmp_path):
    file = tmp_path / "paint + 0.5*x.npz"
    from shrm_cli.brdf.measured.table import sample_table, write_table

    write_table(file, sample_table(shrm.parse_spec("ggx:roughness=0.6")))
    expected = shrm.reference(light, str(file), UP, UP)
    assert np.array_equal(shrm.reference(light, file, UP, UP), expected)
    assert shrm.parse_spec(file).name == shrm.parse_spec(str(file)).name
    made = shrm.prefilter(light, file, to="shrm", eps=0.3)
    np.testing.assert_allclose(made.radiance(UP, UP), expected, rtol=0.05)
    with pytest.raises(shrm.BrdfError, match="is no specification"):
        shrm.parse_spec(None)


def test_reflectance_is_text_a_number_or_three(chain):
    gold = shrm.render(chain, size=16, f0=(1.0, 0.78, 0.34))
    assert np.array_equal(gold, shrm.render(chain, size=16, f0="1/0.78/0.34"))
    assert np.array_equal(gold, shrm.render(chain, size=np.int64(16), f0=np.array([1, 0.78, 0.34])))
    grey = shrm.render(chain, size=(16, 16), f0=0.04)
    assert np.array_equal(grey, shrm.render(chain, size=16, f0="0.04"))


@pytest.mark.parametrize("to", ["shrm", "cabral", "principal", "lightfield"])
def test_no_points_have_no_light(to, light):
    made = shrm.prefilter(light, "ggx:roughness=0.6", to=to)
    assert made.radiance(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0, 3)


def test_a_folder_that_is_not_there_is_named(matte, tmp_path):
    with pytest.raises(shrm.OutputError, match="there is no folder"):
        matte.save(tmp_path / "there" / "x.exr")
