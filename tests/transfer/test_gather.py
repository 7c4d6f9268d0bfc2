"""Transfer vectors and matrices against closed forms, and against sums over directions."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.maps.product.prefilter import product_texture
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.gather import DiffuseLight, Gathering
from tests.oracles import real_harmonics as harmonics
from tests.transfer import meshes


def baked(mesh, **options):
    return bake(Plan(mesh, **options))


def test_a_vertex_that_sees_the_whole_sky_is_exact():
    """T is A_l Y_lm(N), with A_l by its integral; M only rotates."""
    mesh = meshes.sphere(2)
    found = baked(mesh, samples=64, glossy=True)
    z, weights = np.polynomial.legendre.leggauss(40)
    z, weights = (z + 1) / 2, weights / 2  # the upper half
    factors = [
        2 * np.pi * np.sum(weights * z * np.polynomial.legendre.legval(z, np.eye(5)[degree]))
        for degree in range(5)
    ]
    expected = harmonics(4, mesh.normals) * np.repeat(factors, [1, 3, 5, 7, 9])
    np.testing.assert_allclose(found.vectors[..., 0], expected, atol=1e-6)
    directions, areas = meshes.whole_sphere(8)  # exact for products of two of degree 4
    for vertex in (0, 7, 100):
        local = directions @ found.frames[vertex].T
        rotation = (harmonics(4, local) * areas[:, None]).T @ harmonics(4, directions)
        np.testing.assert_allclose(found.matrices[vertex, ..., 0], rotation, atol=1e-6)


@pytest.mark.parametrize("degrees", [20, 45, 70])
def test_a_wall_beside_a_vertex(degrees):
    """The free directions are a lune from `angle` to pi about the y axis."""
    angle = np.radians(degrees)
    found = baked(meshes.wall(angle), order=1, samples=4096).vectors[0, :, 0]
    constant, linear = np.sqrt(1 / (4 * np.pi)), np.sqrt(3 / (4 * np.pi))
    # int sin(t)^2 dt = pi / 2 and int sin(t)^3 dt = 4 / 3 over the polar angle t from the y axis.
    expected = [
        constant * np.pi / 2 * (1 + np.cos(angle)),
        0,
        linear * 4 / 3 * ((np.pi - angle) / 2 + np.sin(2 * angle) / 4),
        linear * 4 / 3 * (-(np.sin(angle) ** 2) / 2),
    ]
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.slow
def test_matrices_beside_a_wall():
    """Every entry is an integral over the free directions, and those below the horizon."""
    angle = np.radians(50)
    mesh = meshes.wall(angle)
    found = baked(mesh, order=2, samples=8192, glossy=True)
    directions, areas = meshes.whole_sphere()
    x, _, z = directions.T
    free = (z < 0) | (np.arctan2(z, x) > angle)
    frame = found.frames[0]
    np.testing.assert_allclose(frame[2], mesh.normals[0], atol=1e-12)
    local = harmonics(2, directions @ frame.T)
    expected = (local * (areas * free)[:, None]).T @ harmonics(2, directions)
    np.testing.assert_allclose(found.matrices[0, ..., 0], expected, atol=2e-3)


def test_matrices_and_vectors_agree_where_the_cosine_is_the_surface():
    """c = A_l at m = 0 of the frame is a diffuse surface, to the order's own truncation."""
    mesh = meshes.bumps()
    found = baked(mesh, order=6, samples=256, glossy=True)
    product = np.zeros(49)
    product[[0, 2, 6, 20]] = np.sqrt(np.array([1, 3, 5, 9]) / (4 * np.pi)) * [
        np.pi, 2 * np.pi / 3, np.pi / 4, -np.pi / 24,
    ]  # fmt: skip
    product[42] = np.sqrt(13 / (4 * np.pi)) * np.pi / 64
    light = np.random.default_rng(3).standard_normal(9)
    glossy = np.einsum("i,vij,j->v", product, found.matrices[..., :9, 0], light)
    diffuse = found.vectors[:, :9, 0] @ light
    assert np.sqrt(np.mean((glossy - diffuse) ** 2) / np.mean(diffuse**2)) < 0.03


def test_white_boxes_are_furnaces():
    """Light that is sent by all walls alike comes back times the albedo, exactly."""
    mesh = meshes.box()
    gathering = Gathering(Plan(mesh).sites, Plan(mesh).frames(), Rays(mesh), 0, 128)
    everything = slice(0, len(mesh.vertices))
    albedo, emitted = 0.5, 2.0
    total = np.full((len(mesh.vertices), 1, 1), emitted, np.float32)
    for bounces in range(1, 15):
        arrived, _ = gathering.transfer(everything, DiffuseLight(albedo / np.pi * total))
        total = (emitted + arrived).astype(np.float32)
        series = emitted * (1 - albedo ** (bounces + 1)) / (1 - albedo)
        np.testing.assert_allclose(total, series, rtol=1e-4)
    np.testing.assert_allclose(total, emitted / (1 - albedo), rtol=1e-4)


@pytest.mark.slow
def test_an_integrating_sphere():
    """Within a sphere all points see each other alike, so E = pi f / (1 - a (1 - f)).

    f is the part of the sphere that is open. The cavity has flat triangles, which close as many
    directions as they are seen at.
    """
    mesh = meshes.sphere(2, inwards=True, hole=0.5)
    lowest = mesh.vertices[:, 2].argmin()
    albedo = 0.5
    found = baked(mesh, order=0, samples=512, bounces=12, albedo=albedo).vectors[..., 0]
    direct = baked(mesh, order=0, samples=512).vectors[..., 0]
    constant = np.sqrt(4 * np.pi)  # radiance 1 has this coefficient
    open_part = constant * direct[lowest, 0] / np.pi
    assert 0.2 < open_part < 0.3  # (1 - 0.5) / 2, but for the jagged edge
    expected = np.pi * open_part / (1 - albedo * (1 - open_part))
    assert constant * found[lowest, 0] == pytest.approx(expected, rel=0.01)
    dark = baked(meshes.sphere(1, inwards=True), order=2, samples=256, bounces=3)
    np.testing.assert_allclose(dark.vectors, 0, atol=2e-3)


@pytest.mark.slow
def test_shadows_take_light_away_and_bounces_bring_some():
    """Under light that is nowhere negative, for each vertex and channel."""
    mesh = meshes.bumps()
    light = nowhere_negative(np.random.default_rng(5))
    shadowed = baked(mesh).vectors[..., 0] @ light
    bounced = np.einsum("vjc,j->vc", baked(mesh, bounces=2, albedo=(0.2, 0.5, 1.0)).vectors, light)
    factors = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4, 0, -np.pi / 24], [1, 3, 5, 7, 9])
    free = harmonics(4, mesh.normals) @ (factors * light)
    assert (shadowed <= free + 1e-5).all()
    assert shadowed.mean() < 0.9 * free.mean()
    assert (np.diff(np.column_stack([shadowed, bounced]), axis=1) >= -1e-5).all()
    assert (bounced[:, 2] > 1.02 * shadowed).mean() > 0.5


def nowhere_negative(rng):
    """Coefficients to order 4 of the square of a random function of order 2."""
    directions, areas = meshes.whole_sphere(12)
    values = (harmonics(2, directions) @ rng.standard_normal(9)) ** 2
    return harmonics(4, directions).T @ (areas * values)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["bumps", "bunny"])
def test_the_estimator_of_pifu(shape, request):
    """The mean over random directions, as `prt_util.py` of PIFu takes it, order 2."""
    if shape == "bunny":  # skips where there are no real meshes
        mesh = load_mesh(request.getfixturevalue("shared") / "meshes" / "bunny.obj")
    else:
        mesh = meshes.bumps(12)
    some = slice(44, 54) if shape == "bumps" else slice(100, 1700, 160)
    found = baked(mesh, order=2, samples=2048).vectors[some, :, 0]
    count, rng = 50_000, np.random.default_rng(1)
    z, phi = rng.uniform(-1, 1, count), rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - z**2)
    directions = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=1)
    rays, lift = Rays(mesh), 1e-4 * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    expected = []
    for vertex, normal in zip(mesh.vertices[some], mesh.normals[some], strict=True):
        cosines = directions @ normal
        free = ~rays.occluded(vertex + lift * normal, directions)
        lit = np.where((cosines > 0) & free, cosines, 0)
        expected.append(4 * np.pi / count * (lit @ harmonics(2, directions)))
    # The standard error of the mean of so many random directions is 0.007.
    assert np.abs(found - expected).max() < 0.025
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.009


def test_triangles_may_be_wound_either_way():
    """The side of a triangle that sends light is where its vertices' normals are."""
    mesh = meshes.box()
    turned = meshes.make_mesh("turned", mesh.vertices, mesh.faces[:, ::-1], mesh.normals)
    options = {"order": 1, "samples": 64, "bounces": 1}
    with_hole = [slice(None), slice(2, None)]
    for part in with_hole:
        one, other = (
            meshes.make_mesh("open", each.vertices, each.faces[part], each.normals)
            for each in (mesh, turned)
        )
        np.testing.assert_allclose(
            baked(one, **options).vectors, baked(other, **options).vectors, atol=1e-6
        )


def test_what_sees_nothing_of_itself_gains_nothing():
    """Glossy light that bounces on a convex box meets no vertex."""
    product = product_texture(parse_spec("ggx:roughness=0.6"), 4, 16).map
    mesh, kinds = meshes.box(inwards=False, divided=1), {"samples": 64, "glossy": True}
    found = baked(mesh, bounces=1, product=product, **kinds)
    np.testing.assert_array_equal(found.vectors, baked(mesh, **kinds).vectors)


@pytest.mark.proof
@pytest.mark.parametrize(
    "spec", ["lambertian:albedo=0.9/0.5/0.2", "ggx:roughness=0.6,f0=gold", "ward:ax=0.3,ay=0.7"]
)
def test_a_glossy_wall_lights_the_ground(spec):
    """What it sends in each direction is the integral of its BRDF over the hemisphere before it.

    The light is of the order of the product function, and nothing shadows the wall, so that
    nothing is lost by the order.
    """
    angle = np.radians(60)
    mesh, brdf = meshes.wall(angle), parse_spec(spec)
    light = np.random.default_rng(8).standard_normal((25, 3))
    product = product_texture(brdf, 4, 128).map
    kinds = {"samples": 8192, "glossy": True}
    found = baked(mesh, bounces=1, product=product, **kinds)
    direct = baked(mesh, **kinds)
    gained = found.vectors[0] - direct.vectors[0]
    frame = found.frames[-1]
    np.testing.assert_allclose(frame[2], [-1, 0, 0], atol=1e-12)

    directions, areas = meshes.whole_sphere(120)
    local = directions @ frame.T
    above = local[:, 2] > 0
    arriving = (harmonics(4, directions) @ light)[above]
    t, weights = np.polynomial.legendre.leggauss(24)
    polar, around = np.pi * (t + 1) / 2, angle * (t + 1) / 2
    expected_vector, expected_matrix = np.zeros(3), np.zeros((25, 3))
    for polar_angle, one in zip(polar, weights * np.pi / 2, strict=True):
        for azimuth, other in zip(around, weights * angle / 2, strict=True):
            ray = np.array([
                np.sin(polar_angle) * np.cos(azimuth),
                np.cos(polar_angle),
                np.sin(polar_angle) * np.sin(azimuth),
            ])  # fmt: skip
            values = brdf.transfer(local[above], -ray @ frame.T)
            sent = np.einsum("kc,kc,k->c", values, arriving, areas[above])
            share = one * other * np.sin(polar_angle) * sent
            expected_vector += ray[2] * share
            expected_matrix += harmonics(4, ray @ found.frames[0].T)[:, None] * share
    gained = np.einsum("jc,jc->c", np.broadcast_to(gained, (25, 3)), light)
    scale = np.abs(expected_vector).max()
    np.testing.assert_allclose(gained, expected_vector, atol=0.01 * scale)
    brought = found.matrices[0] - direct.matrices[0]
    brought = np.einsum("ijc,jc->ic", np.broadcast_to(brought, (25, 25, 3)), light)
    scale = np.abs(expected_matrix).max()
    np.testing.assert_allclose(brought, expected_matrix, atol=0.01 * scale)


def test_light_of_a_diffuse_bounce_is_the_sum_over_rays(rng):
    """Several rays of a place may meet the same vertices, and some places meet none."""
    sent = DiffuseLight(rng.random((50, 9, 3)).astype(np.float32))
    owners = np.sort(rng.choice([0, 1, 3, 4], 400))
    vertices, weights = rng.integers(20, 40, (400, 3)), rng.random((400, 3))
    expected = np.zeros((6, 27))
    for owner, corners, shares in zip(owners, vertices, weights, strict=True):
        for corner, share in zip(corners, shares, strict=True):
            expected[owner] += share * sent.radiance[corner].ravel()
    found = sent.summed(owners, vertices, weights, 6)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert not found[[2, 5]].any()


def test_a_bounce_is_gathered_without_its_light_along_each_ray(monkeypatch):
    """It took as many bytes for each block as rays times coefficients."""

    def fail(*given):
        raise AssertionError("light was looked up along rays")

    plan = Plan(meshes.bumps(8), 4, bounces=1, samples=256)
    before = bake(plan).vectors
    monkeypatch.setattr(DiffuseLight, "towards", fail)
    np.testing.assert_array_equal(bake(plan).vectors, before)
