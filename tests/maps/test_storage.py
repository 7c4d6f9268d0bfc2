"""Half has few digits for dim light: `auto` takes float there, and what half costs is told."""

import json
import tracemalloc

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.files.image import write_images
from shrm_cli.files.parts import Part, choose_storage, prepared
from shrm_cli.maps.file import open_map
from shrm_cli.maps.size import total_error
from shrm_cli.maps.stored import store
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from tests.cli.helpers import done, run
from tests.probe import scenes

FORMS = {
    "shrm": ("microfacet:sigma=0.3", {"size": 16}),
    "cabral": ("microfacet:sigma=0.3", {"size": 16}),
    "principal": ("ggx:roughness=0.6", {"size": 16}),
    "irradiance": (None, {}),
    "splitsum": (None, {"size": 16}),
}


def values(path):
    """Everything that a file stores, read by the image library."""
    import OpenImageIO as oiio

    source, found, index = oiio.ImageInput.open(str(path)), [], 0
    while source.seek_subimage(index, 0):
        found.append(source.read_image(index, 0, 0, -1, oiio.FLOAT).astype(float).ravel())
        index += 1
    return np.concatenate(found)


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
@pytest.mark.parametrize("form", FORMS)
def test_dim_light_keeps_its_digits(tmp_path, form):
    """The same map at two brightnesses, up to the factor."""
    brdf, options = FORMS[form]
    for dim in (1.0, 2.0**-23):
        probe = Probe.from_array(scenes.latlong(32) * np.float32(dim), "latlong")
        made = prefilter(probe, brdf, to=form, **options)
        kind = made.save(tmp_path / f"{dim == 1}.exr")
        assert kind == ("half" if dim == 1 else "float")
    bright, dim = values(tmp_path / "True.exr"), values(tmp_path / "False.exr") * 2.0**23
    assert np.linalg.norm(dim - bright) < 5e-4 * np.linalg.norm(bright)


def test_what_is_allowed():
    """Values with an error of 5 % in half, which a map of 12 % may not have."""
    plane = np.linspace(0, 1, 5000).reshape(50, 100) * 1e-6
    error = np.linalg.norm(plane.astype(np.float16) - plane) / np.linalg.norm(plane)
    assert 0.02 < error < 0.05
    for share, kind in ((0.8, "float"), (1.2, "half")):
        stored, _ = prepared("a.exr", [Part({"R": plane})], "auto", share * error)
        assert stored.pixel_type == kind
    stored = choose_storage("a.exr", [plane], "half")
    assert stored.error == pytest.approx(error)
    assert choose_storage("a.exr", [plane], "float").error == 0
    assert choose_storage("a.exr", [0 * plane], "auto").pixel_type == "half"
    # Ordinary rounding is no reason for float, however exact a map is.
    assert choose_storage("a.exr", [1 + plane * 1e6], "auto").pixel_type == "half"
    with pytest.raises(OutputError, match="overflows half"):
        choose_storage("a.exr", [plane * 1e12], "half")


def test_half_adds_no_more_than_a_tenth_of_the_error_of_a_map(tmp_path):
    """By light that is ever dimmer, of which half keeps fewer digits."""
    parts = {"half": [], "float": []}
    for dim in 2.0 ** -np.arange(15, 21, 0.5):
        probe = Probe.from_array(scenes.latlong(32) * np.float32(dim), "latlong")
        made = prefilter(probe, "microfacet:sigma=0.3", to="shrm", size=16)
        planes = np.concatenate([plane.ravel() for plane in made.planes()])
        lost = np.linalg.norm(planes.astype(np.float16) - planes) / np.linalg.norm(planes)
        kind = store(tmp_path / "a.exr", made).pixel_type
        parts[kind].append(lost / made.info.predicted_error)
    assert 0.06 < max(parts["half"]) < 0.1 < min(parts["float"]) < 0.17


def test_half_that_was_asked_for_states_its_cost(tmp_path):
    probe = Probe.from_array(scenes.latlong(32) * np.float32(1e-7), "latlong")
    made = prefilter(probe, "microfacet:sigma=0.3", size=16)
    stored = store(tmp_path / "m.exr", made, "half")
    back = open_map(tmp_path / "m.exr")
    planes = [np.concatenate([p.ravel() for p in each.planes()]) for each in (made, back)]
    lost = np.linalg.norm(planes[1] - planes[0]) / np.linalg.norm(planes[0])
    assert stored.error == pytest.approx(lost, rel=1e-3)
    assert back.info.storage_error == pytest.approx(lost, rel=1e-3)


def test_errors_of_storing_twice_add_up(tmp_path, monkeypatch):
    """In the file and in what `shrm convert` says of it."""
    monkeypatch.chdir(tmp_path)
    probe = Probe.from_array(scenes.latlong(32) * np.float32(1e-7), "latlong")
    first = store("a.exr", prefilter(probe, "microfacet:sigma=0.3", to="shrm", size=16), "half")
    second = store("b.exr", open_map("a.exr").resampled(12), "half")
    assert first.error > second.error > 0.2 * first.error
    expected = pytest.approx(np.hypot(first.error, second.error), rel=1e-6)
    assert open_map("b.exr").info.storage_error == expected
    asked = ("--to", "shrm", "--size", "12", "--precision", "half", "--json", "-o", "c.exr")
    assert json.loads(done("convert", "a.exr", *asked))["storage_error"] == expected


def test_half_of_any_size_has_the_error_that_is_counted_on(rng):
    """It is combined with the others as what is independent of them."""
    exact = np.exp(rng.uniform(-4, 4, 10**6))
    rounded = exact.astype(np.float16) / exact
    measured = np.sqrt(np.mean((rounded - 1) ** 2))
    assert total_error(0, 0) == pytest.approx(measured, rel=0.05)
    errors = 3e-4, 4e-4
    sums = sum(rng.normal(0, each, len(exact)) for each in errors)
    assert total_error(*errors) == pytest.approx(np.sqrt(np.mean((rounded - 1 + sums) ** 2)), 0.01)


def test_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done("probe", "furnace", "--size", "16", "--radiance", "1e-9", "-o", "dim.exr")
    np.testing.assert_allclose(open_probe("dim.exr").image(), 1e-9, rtol=1e-6)
    done("convert", "dim.exr", "--to", "openexr", "-o", "cube.exr")
    np.testing.assert_allclose(open_probe("cube.exr").image(), 1e-9, rtol=1e-5)
    result = run("prefilter", "dim.exr", "--brdf", "lambertian", "--json", "-o", "m.exr")
    (line,) = json.loads(result.out)["warnings"]
    assert "m.exr: written as 32-bit float, for light so dim that half would add" in line
    command = ("prefilter", "dim.exr", "--brdf", "lambertian", "--precision", "half", "-o", "m.exr")
    assert "100.00% from half precision" in done(*command)
    assert json.loads(done("info", "m.exr", "--json"))["storage_error"] == pytest.approx(1)


def test_images_are_written_without_a_copy_of_them(tmp_path, rng):
    """Beside the halves themselves there is only what is looked at, a part at a time."""
    image = rng.random((4096, 1024, 3), dtype=np.float32)
    tracemalloc.start()
    try:
        assert write_images([str(tmp_path / "a.exr")], [image]) == "half"
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 0.8 * image.nbytes
