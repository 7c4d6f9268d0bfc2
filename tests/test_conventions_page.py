"""Maps decoded by the words of docs/conventions.md alone, against `radiance`; principal maps,
irradiance, split sums and exponentials have pages of their own (`test_engines_page`)."""

import json

import numpy as np
import OpenEXR
import pytest
from scipy.spatial import ConvexHull

from research.bilinear import centers, look_up
from shrm_cli.maps.file import open_map
from tests.cli.helpers import done, polynomial_light, write_exr
from tests.oracles import real_harmonics

SIZE, COUNT = 16, 60


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Makes a map of a smooth probe; returns its parts (headers and channels) and the map."""
    monkeypatch.chdir(tmp_path)
    theta, phi = np.meshgrid(
        (np.arange(32) + 0.5) * np.pi / 32,
        np.pi - (np.arange(64) + 0.5) * np.pi / 32,
        indexing="ij",
    )
    light = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    write_exr("probe.exr", polynomial_light(light).astype(np.float32))

    def make(*command):
        done(*command, "--precision", "float", "-o", "map.exr")
        file = OpenEXR.File("map.exr", separate_channels=True)
        parts = [
            (part.header, {k: np.array(c.pixels, float) for k, c in part.channels.items()})
            for part in file.parts
        ]
        return parts, open_map("map.exr")

    return make


@pytest.fixture
def scene():
    """Directions of texels and their places in the stack, and views of them."""
    rng = np.random.default_rng(5)
    texels = rng.choice(6 * SIZE * SIZE, COUNT, replace=False)
    around, views = centers(SIZE).reshape(-1, 3)[texels], unit(rng.normal(size=(COUNT, 3)))
    return around, texels, views


def normals_of(center, around, views):
    """Surfaces whose central direction, about R or N, is that of the texel."""
    return unit(around + views) if center == "reflection" else around


def stack(channels, prefix="", count=1):
    """The cubes of channels as (texels, count, 3), faces below each other."""
    names = [f"{prefix}{i:03d}." for i in range(count)] if prefix else [""]
    cubes = [[channels[name + c].reshape(-1) for c in "RGB"] for name in names]
    return np.moveaxis(np.array(cubes), 2, 0)


def shrm_light(header, channels, texels, around, views):
    """The sum of b_pq(C) Y_pq(V), in the axes that the file states, for a map of version 1 or 2."""
    view, order = views, header["shrm:P"]
    if header["shrm:frame"] == "local":
        theta = np.arccos(around[:, 2])
        phi = np.arctan2(around[:, 1], around[:, 0])
        columns = np.stack(
            [
                [np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)],
                [-np.sin(phi), np.cos(phi), 0 * phi],
                [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)],
            ]
        )
        view = np.einsum("ijn,nj->ni", columns, views)
    harmonics = real_harmonics(order, view)
    if "shrm:pca_matrix" in header:
        matrix = np.array(json.loads(header["shrm:pca_matrix"]))
        weights = harmonics @ matrix.T
        return np.einsum("nk,nkc->nc", weights, stack(channels, "pc", len(matrix))[texels])
    kept = [i for i in range((order + 1) ** 2) if f"sh{i:03d}.R" in channels]
    values = np.stack(
        [np.stack([channels[f"sh{i:03d}.{c}"].reshape(-1) for c in "RGB"], axis=-1) for i in kept],
        axis=1,
    )
    return np.einsum("nk,nkc->nc", harmonics[:, kept], values[texels])


@pytest.mark.parametrize(
    ("spec", "options"),
    [
        ("ggx:roughness=0.5,f0=0.9/0.6/0.3", ("--frame", "global")),
        ("ggx:roughness=0.5", ("--frame", "local")),
        ("phong:exponent=8", ("--frame", "local")),
        ("lambertian", ()),
        ("ggx:roughness=0.5", ("--compress", "pca:4")),
    ],
)
def test_shrm(made, scene, spec, options):
    ((header, channels),), map_ = made(
        "prefilter", "probe.exr", "--brdf", spec, "--to", "shrm", "--size", SIZE, *options
    )
    around, texels, views = scene
    normals = normals_of(header["shrm:center"], around, views)
    found = shrm_light(header, channels, texels, around, views)
    np.testing.assert_allclose(found, map_.radiance(normals, views), rtol=1e-4, atol=1e-4)


def test_sums(made, scene):
    """Every term about its own centre; seen along the normal all are at one texel."""
    parts, map_ = made(
        "prefilter", "probe.exr", "--brdf", "0.5*lambertian+0.5*ggx:roughness=0.5", "--to", "shrm",
        "--split", "--size", SIZE,
    )  # fmt: skip
    around, _, views = scene
    assert [header["name"] for header, _ in parts] == ["term00", "term01"]
    assert {header["shrm:center"] for header, _ in parts} == {"normal", "reflection"}
    light = 0
    for header, channels in parts:
        count = (header["shrm:P"] + 1) ** 2
        cosines = np.sum(around * views, axis=1)[:, None]
        at = around if header["shrm:center"] == "normal" else 2 * cosines * around - views
        size = channels["sh000.R"].shape[1]
        cubes = np.stack(
            [np.stack([channels[f"sh{i:03d}.{c}"] for c in "RGB"], axis=-1) for i in range(count)],
            axis=2,
        ).reshape(6 * size, size, -1)
        coefficients = look_up(cubes, at).reshape(-1, count, 3)
        light = light + np.einsum(
            "nk,nkc->nc", real_harmonics(header["shrm:P"], views), coefficients
        )
    expected = map_.radiance(around, views)
    assert np.sqrt(np.mean((light - expected) ** 2) / np.mean(expected**2)) < 0.01


def test_kautz_mccool(made, scene):
    parts, map_ = made(
        "prefilter", "probe.exr", "--brdf", "ggx:roughness=0.5", "--to", "kautz-mccool",
        "--size", SIZE,
    )  # fmt: skip
    around, texels, views = scene
    angles = np.array([header["shrm:theta_o"] for header, _ in parts])
    np.testing.assert_allclose(angles, np.linspace(0, np.pi, len(parts)), atol=1e-6)
    images = np.stack([stack(channels)[:, 0] for _, channels in parts])
    angle = np.arccos(np.sum(around * views, axis=1))
    upper = np.clip(np.searchsorted(angles, angle), 1, len(angles) - 1)
    share = ((angle - angles[upper - 1]) / (angles[upper] - angles[upper - 1]))[:, None]
    found = (1 - share) * images[upper - 1, texels] + share * images[upper, texels]
    expected = map_.radiance(normals_of(parts[0][0]["shrm:center"], around, views), views)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def solid_angle(a, b, c):
    return 2 * np.arctan2(abs(np.dot(a, np.cross(b, c))), 1 + a @ b + b @ c + c @ a)


def test_cabral(made, scene):
    parts, map_ = made(
        "prefilter", "probe.exr", "--brdf", "ggx:roughness=0.5", "--to", "cabral", "--size", SIZE
    )
    around, texels, views = scene
    viewers = np.array([header["shrm:view"] for header, _ in parts], dtype=float)
    faces = ConvexHull(viewers).simplices
    images = np.stack([stack(channels)[:, 0] for _, channels in parts])
    found = []
    for texel, view in zip(texels, views, strict=True):
        face = min(faces, key=lambda each: np.linalg.solve(viewers[each].T, view).min() * -1)
        a, b, c = viewers[face]
        shares = np.array(
            [solid_angle(view, b, c), solid_angle(a, view, c), solid_angle(a, b, view)]
        )
        found.append(shares / shares.sum() @ images[face, texel])
    expected = map_.radiance(normals_of(parts[0][0]["shrm:center"], around, views), views)
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-4)


def test_light_field(made, scene):
    parts, map_ = made(
        "prefilter", "probe.exr", "--brdf", "ggx:roughness=0.5", "--to", "lightfield",
        "--size", SIZE, "--views", 8,
    )  # fmt: skip
    around, texels, views = scene
    t = 8
    theta, phi = np.pi * (np.arange(t) + 0.5) / t, 2 * np.pi * (np.arange(t) + 0.5) / t - np.pi
    for header, _ in parts:
        j, k = int(header["name"][4:6]), int(header["name"][7:9])
        expected = [
            np.sin(theta[j]) * np.cos(phi[k]), np.sin(theta[j]) * np.sin(phi[k]), np.cos(theta[j])
        ]  # fmt: skip
        np.testing.assert_allclose(header["shrm:view"], expected, atol=1e-6)
    images = np.stack([stack(channels)[:, 0] for _, channels in parts]).reshape(t, t, -1, 3)
    row = np.arccos(views[:, 2]) * t / np.pi - 0.5
    column = (np.arctan2(views[:, 1], views[:, 0]) + np.pi) * t / (2 * np.pi) - 0.5
    between = (row >= 0) & (row <= t - 1)  # the page is silent beyond the rows next to the poles
    j, k = (np.floor(each[between]).astype(int) for each in (row, column))
    j = np.minimum(j, t - 2)
    x, y = (column[between] - k)[:, None], (row[between] - j)[:, None]
    at = texels[between]
    found = sum(
        wy * wx * images[jj, kk % t, at]
        for jj, wy in ((j, 1 - y), (j + 1, y))
        for kk, wx in ((k, 1 - x), (k + 1, x))
    )
    center = parts[0][0]["shrm:center"]
    expected = map_.radiance(normals_of(center, around, views), views)[between]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


def product_table(channels, order):
    """The coefficients c_i of all texels, (N, N, (order+1)^2, 1 or 3)."""
    colours = [""] if "sh000" in channels else [".R", ".G", ".B"]
    names = [f"sh{i:03d}" for i in range((order + 1) ** 2)]
    return np.stack(
        [np.stack([channels[name + c] for c in colours], axis=-1) for name in names], axis=2
    )


def turned(series, frame):
    """The coefficients in the axes of the rows of `frame`, fitted to the light itself."""
    order = int(np.sqrt(len(series))) - 1
    own = unit(np.random.default_rng(1).normal(size=(400, 3)))
    light = real_harmonics(order, own @ frame) @ series
    return np.linalg.lstsq(real_harmonics(order, own), light, rcond=None)[0]


def product_light(channels, series, seen_by):
    """The light of surfaces whose views are texels' own, and what `seen_by` of them says of it."""
    order, rng = int(np.sqrt(len(series))) - 1, np.random.default_rng(8)
    table = product_table(channels, order)
    size, found, scene = len(table), [], []
    while len(found) < COUNT:
        i, j = rng.integers(size, size=2)
        x, y = ((2 * each + 1) / size - 1 for each in (j, i))
        if np.hypot(x, y) > 0.95:
            continue
        view = np.array([2 * x, 2 * y, 1 - x * x - y * y]) / (1 + x * x + y * y)
        normal = unit(rng.normal(size=3))
        tangent = unit(np.cross(normal, rng.normal(size=3)))
        frame = np.array([tangent, np.cross(normal, tangent), normal])
        found.append(np.sum(table[i, j] * turned(series, frame), axis=0))
        scene.append((normal, tangent, view @ frame))
    return np.array(found), seen_by(*(np.array(each) for each in zip(*scene, strict=True)))


@pytest.mark.parametrize("spec", ["ward:ax=0.5,ay=0.4", "ggx:roughness=0.6,f0=gold"])
def test_product(made, spec):
    ((header, channels),), map_ = made(
        "prefilter", "probe.exr", "--brdf", spec, "--to", "product", "--order", 3, "--texels", 12
    )
    series = np.array(json.loads(header["shrm:lighting_coefficients"]))
    assert header["shrm:F"] == 3
    found, expected = product_light(channels, series, map_.brushed_radiance)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_products_of_two_parameters_that_vary(made):
    two = ("--vary", "ax=0.3..0.5", "--vary", "ay=0.2..0.5", "--steps", 3)
    parts, map_ = made("product", "ward", *two, "--order", 2, "--size", 8)
    told = json.loads(parts[0][0]["shrm:varying"])
    assert told["parameters"] == ["ax", "ay"]
    (first, second), shares = told["values"], []
    for own, (a, b) in ((first, (0.3, 0.7)), (second, (0.6, 0.4))):
        shares.append((a * own[0] + b * own[1] - own[0]) / (own[-1] - own[0]))
    joined = 0
    for header, channels in parts:
        w = np.array(json.loads(header["shrm:weights"]))
        weight = np.array([0.3, 0.7]) @ w[:2, :2] @ np.array([0.6, 0.4])
        joined = joined + weight * np.stack([channels[f"sh{i:03d}"] for i in range(9)])
    joined = {f"sh{i:03d}": plane for i, plane in enumerate(joined)}
    lit = map_.at(shares).lit(np.random.default_rng(2).normal(size=(9, 3)))
    found, expected = product_light(joined, lit.lighting, lit.brushed_radiance)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_products_of_a_parameter_that_varies(made):
    parts, map_ = made(
        "product", "ward:ax=0.5", "--vary", "ay=0.45..0.5", "--order", 2, "--size", 8
    )
    told = json.loads(parts[0][0]["shrm:varying"])
    assert [header["name"] for header, _ in parts] == [f"value{k:02d}" for k in range(len(parts))]
    assert told["parameter"] == "ay"
    assert told["values"] == sorted(told["values"])
    series = np.random.default_rng(2).normal(size=(9, 3))
    share = (0.3 * told["values"][0] + 0.7 * told["values"][1] - 0.45) / 0.05
    joined = {name: 0.3 * first + 0.7 * parts[1][1][name] for name, first in parts[0][1].items()}
    lit = map_.at(share).lit(series)
    found, expected = product_light(joined, series, lit.brushed_radiance)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())
