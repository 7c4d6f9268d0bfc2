"""docs/formats.md: its decoders, without shrm, read what shrm writes, as `Map.radiance` does."""

import ast
import re

import numpy as np
import pytest

from research.bilinear import centers
from shrm_cli.maps.file import open_map
from shrm_cli.vocabulary import NO_TAPS
from tests import oracles
from tests.cli.helpers import ROOT, done, polynomial_light, write_exr
from tests.ggx import lobe

CODE = "\n".join(
    re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "formats.md").read_text(), re.S)
)
SIZE, COUNT = 12, 60


@pytest.fixture(scope="module")
def page():
    """The names that the page defines; what it imports is known to be others' alone."""
    names = {}
    exec(compile(CODE, "formats.md", "exec"), names)
    return names


@pytest.fixture
def made(tmp_path):
    """Makes a map of a smooth probe with a command; returns its path and the map."""
    theta, phi = np.meshgrid(
        (np.arange(32) + 0.5) * np.pi / 32, np.pi - (np.arange(64) + 0.5) * np.pi / 32,
        indexing="ij",
    )  # fmt: skip
    light = [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)]
    pixels = polynomial_light(np.stack(light, axis=-1)).astype(np.float32)
    write_exr(tmp_path / "probe.exr", pixels)

    def make(*options):
        path = tmp_path / "map.exr"
        done("prefilter", tmp_path / "probe.exr", *options, "--precision", "float", "-o", path)
        return path, open_map(path)

    return make


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.fixture
def scene():
    """Directions of texels' centres, and views of surfaces with these as central directions."""
    rng = np.random.default_rng(7)
    around = centers(SIZE).reshape(-1, 3)[rng.choice(6 * SIZE * SIZE, COUNT, replace=False)]
    views = unit(rng.normal(size=(COUNT, 3)))
    return around, unit(views + around * (0.1 - np.minimum(0, np.sum(views * around, 1)))[:, None])


def normals_of(center, around, views):
    return around if center == "normal" else unit(around + views)


def close(found, expected, tolerance=1e-4):
    np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(expected).max())


def test_the_page_imports_nothing_of_shrm():
    imports = [each for each in ast.walk(ast.parse(CODE)) if isinstance(each, ast.Import)]
    assert {name.name for each in imports for name in each.names} == {"json", "numpy", "OpenEXR"}
    assert not [each for each in ast.walk(ast.parse(CODE)) if isinstance(each, ast.ImportFrom)]


def test_decoders_are_short():
    functions = [each for each in ast.parse(CODE).body if isinstance(each, ast.FunctionDef)]
    assert max(each.end_lineno - each.lineno for each in functions) < 40


@pytest.mark.parametrize(
    ("form", "name", "options"),
    [
        ("shrm", "shrm", ("--brdf", "ggx:roughness=0.5", "--frame", "global")),
        ("shrm", "shrm", ("--brdf", "ggx:roughness=0.5", "--frame", "local")),
        ("shrm", "shrm", ("--brdf", "lambertian")),
        ("shrm", "shrm", ("--brdf", "ggx:roughness=0.5", "--compress", "pca:4")),
        ("principal", "principal", ("--brdf", "ggx:roughness=0.5", "--maps", 16)),
        ("principal", "principal", ("--brdf", "ggx:roughness=0.5", "--maps", 9, "--divide")),
        ("principal", "principal", ("--brdf", "charlie:roughness=0.4", "--maps", 9)),
        ("kautz-mccool", "kautz_mccool", ("--brdf", "ggx:roughness=0.5")),
        ("cabral", "cabral", ("--brdf", "ggx:roughness=0.5")),
        ("lightfield", "light_field", ("--brdf", "ggx:roughness=0.5", "--views", 9)),
        ("lightfield", "light_field", ("--brdf", "lambertian", "--views", 5)),
    ],
)
def test_forms_of_a_material(page, made, scene, form, name, options):
    path, shown = made("--to", form, "--size", SIZE, *options)
    around, views = scene
    normals = normals_of(shown.center, around, views)
    close(page[name](path, normals, views), shown.radiance(normals, views))


@pytest.mark.parametrize(
    ("form", "name", "options"),
    [
        ("shrm", "shrm", ("--brdf", "ggx:roughness=0.5")),
        ("shrm", "shrm", ("--brdf", "lambertian", "--compress", "pca:1")),
        ("principal", "principal", ("--brdf", "ggx:roughness=0.5", "--maps", 9)),
        ("kautz-mccool", "kautz_mccool", ("--brdf", "ggx:roughness=0.5")),
        ("cabral", "cabral", ("--brdf", "ggx:roughness=0.5")),
        ("lightfield", "light_field", ("--brdf", "lambertian", "--views", 5)),
    ],
)
def test_cubes_whose_texels_lie_on_the_edges(page, made, form, name, options):
    """At texels that are on no edge, where nothing is interpolated."""
    path, shown = made("--to", form, "--size", SIZE, "--map-sampling", "border", *options)
    rng = np.random.default_rng(9)
    texels = oracles.cube_texels(SIZE, "border")[:, 1:-1, 1:-1].reshape(-1, 3)
    around = texels[rng.choice(len(texels), COUNT, replace=False)]
    views = unit(unit(rng.normal(size=(COUNT, 3))) + 1.1 * around)
    normals = normals_of(shown.center, around, views)
    close(page[name](path, normals, views), shown.radiance(normals, views))


@pytest.mark.parametrize(
    ("spec", "form"), [("lambertian", "shrm"), ("ggx:roughness=0.5", "principal")]
)
def test_lamps_beside_a_map(page, made, scene, tmp_path, spec, form):
    """The map and the lamps together are what the file reflects; neither is by itself."""
    path, _ = made("--to", "irradiance")  # which writes the probe, too
    light = '[[probe]]\nfile = "probe.exr"\n[[disc]]\ndirection = [0.6, 0.64, 0.48]\n'
    (tmp_path / "sun.toml").write_text(f"{light}radius = 3\nradiance = [900, 700, 500]\n")
    done("prefilter", tmp_path / "sun.toml", "--brdf", spec, "--to", form, "--sun", "split",
         "--size", SIZE, "--precision", "float", "--force", "-o", path)  # fmt: skip
    shown = open_map(path)
    around, views = scene
    normals = normals_of(shown.center, around, views)

    def brdf(n, light, v):
        if spec == "lambertian":
            return 1 / np.pi
        cosines = np.sum(n * light, axis=1)
        above = cosines > 0
        found = np.zeros((len(n), 3))
        for k in np.flatnonzero(above):
            value, _ = lobe(0.5, n[k], v[k], light[k])
            found[k] = value / cosines[k]
        return found

    rest, beside = page[form](path, normals, views), page["lamps"](path, brdf, normals, views)
    expected = shown.radiance(normals, views)
    assert np.linalg.norm(beside) > 0.1 * np.linalg.norm(expected)
    close(rest + beside, expected, 5e-3)


@pytest.mark.parametrize("order", [2, 4])
def test_irradiance(page, made, scene, order):
    path, shown = made("--to", "irradiance", "--order-f", order, "--size", SIZE)
    close(page["irradiance"](path, scene[0]), shown.irradiance(scene[0]), 2e-3)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    done("dfg", "--size", 64, "-o", folder / "dfg.exr")
    done("dfg", "--moments", "--size", 64, "-o", folder / "moments.exr")
    return folder


@pytest.mark.parametrize(
    ("form", "name", "table", "options"),
    [
        ("splitsum", "split_sum", "dfg.exr", ("--mapping", "linear", "--levels", 4)),
        ("splitsum", "split_sum", "dfg.exr", ("--mapping", "filament", "--levels", 4)),
        ("she", "exponential", "moments.exr", ("--quiet",)),
    ],
)
def test_forms_of_all_roughnesses(page, made, tables, scene, form, name, table, options):
    path, shown = made("--to", form, *options)
    around, views = scene
    normals, f0 = unit(around + views), (1.0, 0.8, 0.3)
    found = page[name](path, tables / table, normals, views, 0.6, f0)
    taps = NO_TAPS if form == "splitsum" else None
    expected = shown.shaded(0.6, f0, taps=taps).radiance(normals, views)
    assert np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2)) < 0.01


@pytest.mark.parametrize("spec", ["ward:ax=0.5,ay=0.4", "ggx:roughness=0.6,f0=gold"])
def test_product(page, made, spec):
    path, shown = made("--brdf", spec, "--to", "product", "--order", 3, "--texels", 8)
    rng = np.random.default_rng(3)
    ((_, channels),) = page["parts"](path)
    size = len(next(iter(channels.values())))
    x, y = ((2 * rng.integers(size // 4, 3 * size // 4, COUNT) + 1) / size - 1 for _ in range(2))
    seen = np.stack([2 * x, 2 * y, 1 - x * x - y * y], axis=1) / (1 + x * x + y * y)[:, None]
    normals = unit(rng.normal(size=(COUNT, 3)))
    tangents = unit(np.cross(normals, rng.normal(size=(COUNT, 3))))
    frames = np.stack([tangents, np.cross(normals, tangents), normals], axis=1)
    views = np.einsum("nj,njk->nk", seen, frames)
    found = page["product"](path, normals, tangents, views)
    close(found, shown.brushed_radiance(normals, tangents, views))
