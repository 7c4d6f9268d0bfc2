"""Irradiance of vertices against Mitsuba's path tracer, direct and after one bounce.

The environment is a function of harmonics to order 4, which is negative in places. Mitsuba renders
it with a constant added, and the constant alone along the same paths, and the difference counts.
"""

import numpy as np
import pytest

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.geometry.load import load_mesh
from shrm_cli.maps.product.prefilter import product_texture
from shrm_cli.transfer.bake import Plan, bake
from tests.oracles import real_harmonics as harmonics
from tests.transfer import meshes

ALBEDO = 0.8
CONSTANT = 6.0
SAMPLES = 4096


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    module.set_variant("scalar_rgb")
    return module


@pytest.fixture(scope="module")
def light():
    """Three lights, one a channel."""
    coefficients = np.random.default_rng(12).standard_normal((25, 3))
    coefficients[0] = 0
    return coefficients


def environment(mitsuba, radiance, height=128):
    """A lat-long image of radiance by direction, as Mitsuba lays it out.

    The middles of its first and last rows lie on the poles.
    """
    v, u = np.meshgrid(
        np.arange(height) / (height - 1) * np.pi,
        (np.arange(2 * height) + 0.5) / (2 * height) * 2 * np.pi,
        indexing="ij",
    )
    directions = np.stack([np.sin(u) * np.sin(v), np.cos(v), -np.cos(u) * np.sin(v)], axis=-1)
    pixels = np.ascontiguousarray(radiance(directions), dtype=np.float32)
    return mitsuba.load_dict({"type": "envmap", "bitmap": mitsuba.Bitmap(pixels)})


GREY = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [ALBEDO] * 3}}
METAL = {"type": "roughconductor", "distribution": "ggx", "material": "none", "alpha": 0.7**2}


def shape_of(mitsuba, mesh, material):
    """The mesh, which reflects on the side of its normals."""
    properties = mitsuba.Properties()
    properties["bsdf"] = mitsuba.load_dict(material)
    shape = mitsuba.Mesh("mesh", len(mesh.vertices), len(mesh.faces), properties, True)
    held = mitsuba.traverse(shape)
    held["vertex_positions"] = mesh.vertices.ravel().astype(np.float32)
    held["vertex_normals"] = mesh.normals.ravel().astype(np.float32)
    held["faces"] = mesh.faces.ravel().astype(np.uint32)
    held.update()
    return shape


def meters(mitsuba, mesh, chosen):
    """Tiny discs just above vertices, which measure the irradiance."""
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    found = {}
    for k in chosen:
        at = mesh.vertices[k] + 2e-5 * size * mesh.normals[k]
        place = mitsuba.ScalarTransform4f().look_at(
            origin=at.tolist(),
            target=(at + size * mesh.normals[k]).tolist(),
            up=Plan(mesh).frames()[k, 0].tolist(),
        ) @ mitsuba.ScalarTransform4f().scale(5e-6 * size)
        sensor = {
            "type": "irradiancemeter",
            "film": film,
            "sampler": {"type": "multijitter", "sample_count": SAMPLES},
        }
        found[f"meter{k:06d}"] = {"type": "disk", "to_world": place, "sensor": sensor}
    return found


def path_traced(mitsuba, mesh, chosen, light, bounces, material):
    """Irradiance of vertices, shape (chosen, 3).

    Without a choice by the environment's brightness, both renderings follow the same paths.
    """
    integrator = mitsuba.load_dict(
        {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}
        if bounces
        else {"type": "path", "max_depth": 1}
    )
    sums = []
    for radiance in (
        lambda directions: CONSTANT + harmonics(4, directions) @ light,
        lambda directions: np.full(directions.shape, CONSTANT),
    ):
        scene = mitsuba.load_dict(
            {
                "type": "scene",
                "shape": shape_of(mitsuba, mesh, material),
                "emitter": environment(mitsuba, radiance),
                **meters(mitsuba, mesh, chosen),
            },
            optimize=False,  # it would make one of sensors that are alike
        )
        pictures = [
            np.array(mitsuba.render(scene, sensor=sensor, integrator=integrator, seed=k))
            for k, sensor in enumerate(scene.sensors())
        ]
        sums.append(np.array(pictures)[:, 0, 0, :3])
    return sums[0] - sums[1]


def test_the_environment_is_where_it_should_be(mitsuba, light):
    """It is seen in every direction as the harmonics say."""
    rng = np.random.default_rng(4)
    directions = rng.standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    emitter = environment(mitsuba, lambda d: CONSTANT + harmonics(4, d) @ light)
    expected = CONSTANT + harmonics(4, directions) @ light
    for direction, color in zip(directions, expected, strict=True):
        place = mitsuba.SurfaceInteraction3f()
        place.wi = mitsuba.Vector3f(*(-direction))
        np.testing.assert_allclose(np.array(emitter.eval(place)), color, atol=0.005)


def relative_error(mitsuba, mesh, chosen, light, bounces, material=GREY, **of_plan):
    expected = path_traced(mitsuba, mesh, chosen, light, bounces, material)
    plan = Plan(mesh, bounces=bounces, albedo=ALBEDO, **of_plan)
    vectors = bake(plan).vectors[chosen, :, 0]
    difference = vectors @ light - expected
    return np.sqrt(np.mean(difference**2) / np.mean(expected**2))


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [0, 1])
def test_a_made_mesh(mitsuba, light, bounces):
    mesh = meshes.bumps(24)
    chosen = np.arange(0, len(mesh.vertices), 31)
    error = relative_error(mitsuba, mesh, chosen, light, bounces)
    assert error < 0.03, error


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize("bounces", [0, 1])
def test_the_bunny(mitsuba, light, shared, bounces):
    path = shared / "meshes" / "bunny.obj"
    if not path.exists():
        pytest.skip("the bunny is not among the real meshes beside the project")
    mesh = load_mesh(path)
    chosen = np.random.default_rng(5).choice(len(mesh.vertices), 150, replace=False)
    error = relative_error(mitsuba, mesh, chosen, light, bounces)
    assert error < 0.03, error


@pytest.mark.proof
def test_glossy_walls_light_each_other(mitsuba, light):
    """What a bounce of a metal adds, and that a diffuse bounce in its place is far off."""
    mesh = meshes.bumps(24)
    chosen = np.arange(0, len(mesh.vertices), 13)
    product = product_texture(Ggx(roughness=0.7, f0=1.0), 4).map
    glossy = relative_error(mitsuba, mesh, chosen, light, 1, METAL, glossy=True, product=product)
    diffuse = relative_error(mitsuba, mesh, chosen, light, 1, METAL)
    print(glossy, diffuse)
    assert glossy < 0.03, glossy
    assert diffuse > 2 * glossy, diffuse
