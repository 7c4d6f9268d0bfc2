"""The library as its page and its example use it, and what `import shrm_cli` loads."""

import copy
import inspect
import os
import pickle  # noqa: TID251 (of its own objects)
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli import errors
from tests import brute_force

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "library.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)


def python(code, **options):
    """Standard output of a process that runs some code with this checkout's package."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, **options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_block_of_the_page_runs(tmp_path):
    """One after the other, as a reader would type them."""
    assert len(BLOCKS) >= 6
    (tmp_path / "probes").mkdir()
    shutil.copy(ROOT / "probes" / "studio.exr", tmp_path / "probes")
    out = python("\n".join(BLOCKS), cwd=tmp_path)
    # The largest error of a map whose radiance is about 0.5, and then its relative ones.
    largest, median, p95, wrong, negative = map(float, out.split()[-5:])
    assert 0 < largest < 0.02
    assert 0 < median <= p95 < 0.04
    assert 0 <= wrong < 0.05
    assert negative == 0
    assert (tmp_path / "studio.exr").stat().st_size > 1000


def test_the_page_names_what_there_is():
    for name in (
        "prefilter",
        "open_probe",
        "open_map",
        "reference",
        "using",
        "parse_spec",
        "seen_errors",
    ):
        assert name in shrm.__all__
        assert f"`{name}" in PAGE or f"shrm.{name}" in PAGE
    for name in shrm.__all__:
        assert getattr(shrm, name) is not None


@pytest.mark.slow
def test_the_page_has_the_arguments_of_prefilter():
    """Two were missing, and its default form was another one."""
    section = PAGE.split("## Prefiltering")[1].split("\n| ")[0]
    parameters = inspect.signature(shrm.prefilter).parameters.values()
    for each in parameters:
        if each.kind is each.KEYWORD_ONLY and each.name != "to":
            assert f"`{each.name}`" in section, each.name
    default = next(each.default for each in parameters if each.name == "to")
    assert f'to="{default}"' in section


def test_the_example_runs(tmp_path):
    example = str(ROOT / "examples" / "library.py")
    code = f"import runpy, sys; sys.argv = ['library.py', '.']; runpy.run_path({example!r})"
    out = python(code, cwd=tmp_path)
    predicted, measured = (float(value) for value in re.findall(r"([0-9.]+)%", out)[:2])
    assert measured < 1.5 * predicted
    assert {path.name for path in tmp_path.iterdir()} == {
        "lamp.glossy.exr",
        "lamp.chain.exr",
        "lamp.diffuse.exr",
    }


def test_public_names_are_what_they_are_whatever_was_imported_before():
    """The import system binds each submodule to a name of the package, and may hide one of ours."""
    out = python(
        "import importlib, pkgutil, types, shrm_cli\n"
        "for module in pkgutil.iter_modules(shrm_cli.__path__, 'shrm_cli.'):\n"
        "    if module.name not in ('shrm_cli.__main__', 'shrm_cli.torch'):\n"
        "        importlib.import_module(module.name)\n"
        "names = {name: getattr(shrm_cli, name) for name in shrm_cli.__all__}\n"
        "print(*(n for n, v in names.items() if v is None or isinstance(v, types.ModuleType)))\n"
        "print(shrm_cli.__version__)"
    )
    hidden, version = out.split("\n")[:2]
    assert hidden == ""
    assert re.match(r"\d+\.\d+", version)


def test_the_import_loads_nothing_heavy():
    loaded = python("import sys, shrm_cli; print(*(m for m in sys.modules))").split()
    assert not {"numpy", "OpenEXR", "OpenImageIO", "click"} & set(loaded)


def test_functions_are_not_the_submodules_of_their_names():
    """Whatever is imported first."""
    ask = "print(callable(shrm_cli.prefilter), callable(shrm_cli.reference))"
    modules = "import shrm_cli.maps.explicit.prefilter, shrm_cli.prefilter, shrm_cli.reference"
    first = "shrm_cli.prefilter; shrm_cli.reference"
    assert python(f"import shrm_cli; {modules}; {ask}") == "True True\n"
    assert python(f"import shrm_cli; {first}; {modules}; {ask}") == "True True\n"


def test_dir_lists_what_is_public():
    """Types that the package itself needs were among them."""
    assert {name for name in dir(shrm) if not name.startswith("__")} == {
        name for name in shrm.__all__ if not name.startswith("__")
    }
    assert set(shrm.__all__) <= set(dir(shrm))


def test_unknown_names_are_attribute_errors():
    with pytest.raises(AttributeError, match="no attribute 'prefiltre'"):
        shrm.prefiltre  # noqa: B018


class Wrapped(shrm.Brdf):
    """A smooth lobe about the normal, of a color of its own."""

    center = "normal"

    def evaluate(self, light, view):
        value = (1 + light[..., 2]) * (1 + view[..., 2]) / 8
        return value[..., None] * np.array([1.0, 0.5, 0.25])


def test_reference_and_maps_agree_on_a_class_and_an_array(rng):
    """Both beside a sum over the pixels that shares no code with them."""
    pixels = rng.uniform(0, 1, (16, 32, 3)).astype(np.float32)
    pixels = (pixels + np.roll(pixels, 1, 1) + np.roll(pixels, 2, 1)) / 3
    probe = shrm.Probe.from_array(pixels, layout="latlong")
    normals, views = brute_force.unit(rng, 24), brute_force.unit(rng, 24)
    views = np.where(np.sum(normals * views, -1, keepdims=True) < 0, -views, views)
    exact = shrm.reference(probe, Wrapped(), normals, views, exact=True)
    expected = np.zeros_like(exact)
    theta = (np.arange(16) + 0.5) * np.pi / 16
    longitude = -((np.arange(32) + 0.5) / 16 - 1) * np.pi
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    light = np.stack(
        np.broadcast_arrays(sine * np.sin(longitude), cosine, sine * np.cos(longitude)), axis=-1
    )
    # The areas of the pixels' cells, where the package has a quadrature rule.
    areas = (
        (np.cos(np.arange(16) * np.pi / 16) - np.cos(np.arange(1, 17) * np.pi / 16)) * np.pi / 16
    )
    for k, (normal, view) in enumerate(zip(normals, views, strict=True)):
        height = light @ normal
        value = (1 + height) * (1 + view @ normal) / 8 * np.maximum(height, 0)
        color = np.einsum("ij,ijc,i->c", value, pixels, areas)
        expected[k] = color * [1.0, 0.5, 0.25]
    np.testing.assert_allclose(exact, expected, rtol=0.02)
    made = shrm.prefilter(pixels, Wrapped(), order_f=12, order_p=3)
    error = made.radiance(normals, views) - exact
    assert np.sqrt(np.mean(error**2) / np.mean(exact**2)) < 0.02


def test_what_the_user_should_know_is_a_warning():
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[2, 3] = -1
    with pytest.warns(shrm.ShrmWarning, match="negative"):
        shrm.prefilter(pixels, "lambertian")


def test_refusals_speak_of_arguments():
    with pytest.raises(shrm.ArgumentError, match="`levels` applies with `to` splitsum"):
        shrm.prefilter(np.ones((8, 16, 3)), "phong", levels=3)
    with pytest.raises(shrm.ArgumentError, match="`brdf` is missing"):
        shrm.prefilter(np.ones((8, 16, 3)))
    with pytest.raises(shrm.ArgumentError, match="`level` is no argument"):
        shrm.prefilter(np.ones((8, 16, 3)), to="splitsum", level=3)
    with pytest.raises(shrm.ArgumentError, match="'shmr' is none of auto, shrm"):
        shrm.prefilter(np.ones((8, 16, 3)), to="shmr")


def test_errors_come_out_of_worker_processes():
    """A pool breaks, and tells nothing, where an error cannot be made again of its pickle."""
    kinds = [each for each in vars(errors).values() if isinstance(each, type)]
    for kind in (each for each in kinds if issubclass(each, Exception)):
        error = kind("size", "is 3") if kind is shrm.ArgumentError else kind("a.exr: damaged")
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (kind, str(error), vars(error))


def test_what_functions_return_is_copied_and_pickled(tmp_path):
    """An offer is made in another process as in this one, or says why it is not."""
    light = shrm.Probe.from_array(np.ones((16, 32, 3), np.float32))
    (choice,) = shrm.choose(light, "0.5*lambertian+0.5*phong:exponent=8")
    again = pickle.loads(pickle.dumps(choice))
    assert again == choice == copy.deepcopy(choice)
    views = np.array([0.0, 0.6, 0.8])
    for one, other in zip(choice.offers, again.offers, strict=True):
        if one.arguments is None:
            with pytest.raises(shrm.MapError, match="no arguments make this map"):
                other.make()
        elif one.bytes < 30_000:
            found = [each.make().shaded().radiance(views, views) for each in (one, other)]
            np.testing.assert_allclose(*found, rtol=1e-3)
    assert {each.arguments is None for each in choice.offers} == {True, False}
    for engine in ("three", "unity", "godot"):
        package = pickle.loads(pickle.dumps(shrm.export(ROOT / "probes" / "studio.exr", engine)))
        assert all(file.write(tmp_path / file.name) or True for file in package.files)
