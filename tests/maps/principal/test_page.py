"""Principal maps decoded by the words of docs/engines.md alone: no code of shrm reads the file."""

import json

import numpy as np
import OpenEXR
import pytest

from tests.cli.helpers import done, noise, write_exr
from tests.oracles import real_harmonics

SIZE = 8
FACES = {
    0: ("+z", "-y", "+x"), 1: ("-z", "-y", "-x"), 2: ("+x", "-z", "+y"),
    3: ("+x", "+z", "-y"), 4: ("-x", "-y", "+z"), 5: ("+x", "-y", "-z"),
}  # fmt: skip
"""What is right, down and forward on each face, as the table of docs/conventions.md has it."""


def axis(name):
    vector = np.zeros(3)
    vector["xyz".index(name[1])] = 1 if name[0] == "+" else -1
    return vector


def texel(face, row, column, size):
    """The direction of a texel's centre."""
    right, down, forward = map(axis, FACES[face])
    s, t = ((2 * index + 1) / size - 1 for index in (column, row))
    direction = forward + s * right + t * down
    return direction / np.linalg.norm(direction)


def brushed(path, face, row, column, view, tangent):
    """The light of a map of a single brushed lobe at a texel's direction, towards a view."""
    parts = {part.name(): part for part in OpenEXR.File(str(path), separate_channels=True).parts}
    part, table = parts["lobe00"], parts["functions00"]
    size = part.channels["map000.R"].pixels.shape[1]
    center = texel(face, row, column, size)
    normal = (center + view) / np.linalg.norm(center + view)
    across = normal - (normal @ center) * center
    across /= np.linalg.norm(across)
    beside = np.cross(center, across)
    psi = np.arctan2(view @ np.cross(normal, tangent), view @ tangent)
    waves = json.loads(part.header["shrm:waves"])
    amplitudes = np.stack([table.channels[c].pixels for c in "RGB"], axis=-1)
    place = np.arccos(np.clip(center @ view, -1, 1)) / np.pi * (amplitudes.shape[1] - 1)
    light, cube, first = np.zeros(3), 0, 0
    for p in json.loads(part.header["shrm:degrees"]):
        texels = np.array(
            [
                [part.channels[f"map{cube + k:03d}.{c}"].pixels[face * size + row, column]
                 for c in "RGB"]
                for k in range(2 * p + 1)
            ],
            dtype=float,
        )  # fmt: skip
        # Some directions at random, more than there are unknowns.
        local = np.random.default_rng(p).normal(size=(6 * p + 9, 3))
        local /= np.linalg.norm(local, axis=1, keepdims=True)
        sums = real_harmonics(p, local @ np.stack([across, beside, center]))[:, p**2 :] @ texels
        signed = real_harmonics(p, local)[:, p**2 :]
        signed[:, np.arange(2 * p + 1) != p] /= np.sqrt(2)
        own = np.linalg.lstsq(signed, sums, rcond=None)[0]
        for q in range(p + 1):
            function = np.zeros(3, dtype=complex)
            for wave, (f, k) in enumerate(waves):
                curve = amplitudes[(first + q) * len(waves) + wave]
                amplitude = [np.interp(place, np.arange(len(curve)), curve[:, c]) for c in range(3)]
                function += np.array(amplitude) * 1j**k * np.exp(1j * f * psi)
            light += own[p + q] * function.real + (own[p - q] * function.imag if q else 0)
        cube, first = cube + 2 * p + 1, first + p + 1
    return light


@pytest.mark.proof
def test_the_page_alone_decodes_a_brushed_map(tmp_path, monkeypatch):
    from shrm_cli.maps.file import open_map

    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "probe.exr", noise(16, 32))
    command = ("prefilter", "probe.exr", "--brdf", "ward:ax=0.2,ay=0.5", "--to", "principal")
    done(*command, "--size", str(SIZE), "--maps", "16", "--precision", "float", "-o", "map.exr")
    made, rng = open_map("map.exr"), np.random.default_rng(5)
    found, expected = [], []
    for _ in range(24):
        place = rng.integers(6), rng.integers(SIZE), rng.integers(SIZE)
        center, view, tangent = texel(*place, SIZE), rng.normal(size=3), rng.normal(size=3)
        view /= np.linalg.norm(view)
        normal = (center + view) / np.linalg.norm(center + view)
        tangent = np.cross(normal, tangent)
        tangent /= np.linalg.norm(tangent)
        found.append(brushed("map.exr", *place, view, tangent))
        expected.append(made.brushed_radiance(normal, tangent, view))
    np.testing.assert_allclose(found, expected, atol=2e-5 * np.abs(expected).max())
    lobe, table = OpenEXR.File("map.exr", header_only=True).parts
    told = {name: value for name, value in lobe.header.items() if name.startswith("shrm:")}
    del told["shrm:digest"]  # that of the whole file, which its first part has
    assert told == {name: table.header.get(name) for name in told}


def decoded(path, face, row, column, view):
    """The light of all parts at a texel's direction, towards a view."""
    light = np.zeros(3)
    for part in OpenEXR.File(str(path), separate_channels=True).parts:
        header = part.header
        size = part.channels["map000.R"].pixels.shape[1]
        center = texel(face, row, column, size)
        beside = center + view if header["shrm:center"] == "reflection" else view
        across = beside - (beside @ center) * center
        across /= np.linalg.norm(across)
        table = json.loads(header["shrm:functions"])
        functions = np.array(table["values"]).reshape(table["shape"])
        if "shrm:albedo" in header:
            albedo = json.loads(header["shrm:albedo"])
            functions = functions * np.array(albedo["values"]).reshape(albedo["shape"])
        span = np.pi if header["shrm:center"] == "reflection" else np.pi / 2
        place = np.arccos(np.clip(center @ view, -1, 1)) / span * (functions.shape[1] - 1)
        cube = first = 0
        for p in json.loads(header["shrm:degrees"]):
            names = [f"map{cube + k:03d}" for k in range(2 * p + 1)]
            texels = np.array(
                [
                    [part.channels[f"{name}.{c}"].pixels[face * size + row, column] for c in "RGB"]
                    for name in names
                ],
                dtype=float,
            )
            angles = (np.arange(p + 1) + 0.5) * np.pi / (p + 1)
            plane = np.cos(angles)[:, None] * center + np.sin(angles)[:, None] * across
            sums = real_harmonics(p, plane)[:, p**2 :] @ texels
            pole = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
            legendre = real_harmonics(p, pole)[:, p * (p + 1) : (p + 1) ** 2]
            legendre[:, 1:] /= np.sqrt(2)
            parts = np.linalg.solve(legendre, sums)
            for q in range(p + 1):
                curve = functions[first + q]
                own = [np.interp(place, np.arange(len(curve)), curve[:, c]) for c in range(3)]
                light += parts[q] * own
            cube += 2 * p + 1
            first += p + 1
    return light


@pytest.mark.parametrize(
    ("spec", "options"),
    [
        ("ggx:roughness=0.5,f0=0.9/0.6/0.3", ("--maps", "25")),
        ("ggx:roughness=0.5,f0=0.04", ("--maps", "16", "--divide")),
        ("charlie:roughness=0.3", ("--maps", "9")),
        ("0.5*lambertian+0.5*ggx:roughness=0.6", ("--maps", "10")),
    ],
)
def test_the_page_alone_decodes_a_map(tmp_path, monkeypatch, spec, options):
    from shrm_cli.maps.file import open_map

    monkeypatch.chdir(tmp_path)
    write_exr(tmp_path / "probe.exr", noise(16, 32))
    command = ("prefilter", "probe.exr", "--brdf", spec, "--to", "principal", "--size", str(SIZE))
    done(*command, *options, "--precision", "float", "-o", "map.exr")
    made = open_map("map.exr")
    degrees = {p for lobe in made.lobes for p in lobe.degrees}
    assert max(degrees) > 0
    rng = np.random.default_rng(4)
    found, expected = [], []
    while len(found) < 24:
        face, row, column = rng.integers(6), rng.integers(SIZE), rng.integers(SIZE)
        center, view = texel(face, row, column, SIZE), rng.normal(size=3)
        view /= np.linalg.norm(view)
        is_about_the_normal = made.center == "normal"
        if is_about_the_normal and center @ view < 0.05:
            continue
        if made.center == "normal+reflection":
            # Both terms are read at texels where N = V = R.
            view = center + 1e-7 * view
            view /= np.linalg.norm(view)
        normal = center if is_about_the_normal else (center + view) / np.linalg.norm(center + view)
        found.append(decoded("map.exr", face, row, column, view))
        expected.append(made.radiance(normal, view))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=2e-5 * scale)
