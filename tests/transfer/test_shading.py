"""Colours of vertices against integrals over light, with and without shadows."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import TransferError
from shrm_cli.render.vertex_colors import VertexColors
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.transfer import diffuse_colors, glossy_colors
from tests.oracles import real_harmonics as harmonics
from tests.oracles import sphere_rule
from tests.transfer import meshes


class Cushion:
    """The product function of a BRDF that is a polynomial, anisotropic and coloured.

    It is ``(V.L)^2 + x_L x_V / 2`` times a colour that depends on the view, of degree 2 in L.
    """

    def shares(self, values):
        return []

    def at(self, shares):
        return self

    def values(self, local_views):
        directions, weights = sphere_rule(4)
        columns = self.of(directions, local_views[..., None, :])
        found = np.einsum("q,...qc,qi->...ic", weights, columns, harmonics(2, directions))
        return np.concatenate([found, np.zeros((*found.shape[:-2], 16, 3))], axis=-2)

    @staticmethod
    def of(light, view):
        grey = np.sum(light * view, axis=-1) ** 2 + light[..., 0] * view[..., 0] / 2
        colors = [np.ones_like(view[..., 2]), view[..., 2], view[..., 0] ** 2]
        return grey[..., None] * np.stack(colors, axis=-1)


@pytest.fixture(scope="module")
def glossy():
    return bake(Plan(meshes.bumps(16), samples=256, glossy=True))


def test_no_picture_of_a_mesh_is_negative(glossy):
    """Beside a lamp a series is negative in shadows, of windowed light too; it shows as black."""
    mesh, light = meshes.bumps(16), harmonics(4, np.array([[0.6, 0.8, 0.0]]))[0][:, None] * 9
    light = np.repeat(light, 3, axis=1)
    light[0] += 0.3
    plain = diffuse_colors(glossy, light)
    assert plain.min() < 0
    (shown,) = VertexColors(mesh, glossy, light).seen_from(np.array([0.0, 0.0, 9.0]))
    np.testing.assert_array_equal(shown, np.where(plain < 0, 0, plain))
    (reflected,) = VertexColors(mesh, glossy, light, Cushion()).seen_from(np.array([0.0, 9.0, 9.0]))
    assert reflected.min() == 0
    assert reflected.max() > 0


def random_light(order=4):
    return np.random.default_rng(8).standard_normal(((order + 1) ** 2, 3))


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def test_glossy_colors_without_shadows_are_integrals():
    """A convex mesh: light of order 4 times the product function, in each vertex's own frame."""
    mesh = meshes.sphere(1)
    rng = np.random.default_rng(2)
    turned = np.cross(mesh.normals, rng.standard_normal(mesh.normals.shape))
    tangents = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    baked = bake(Plan(mesh, samples=32, glossy=True, tangents=tangents))
    light, view = random_light(), unit(0.3, 0.5, 0.8)
    found = glossy_colors(baked, Cushion(), light, view)
    directions, weights = sphere_rule(8)
    frames = np.stack([tangents, np.cross(mesh.normals, tangents), mesh.normals], axis=1)
    arriving = harmonics(4, directions) @ light
    for frame, color in zip(frames, found, strict=True):
        if frame[2] @ view <= 0:
            assert (color == 0).all()
            continue
        product = Cushion.of(directions @ frame.T, frame @ view)
        expected = np.einsum("q,qc,qc->c", weights, product, arriving)
        np.testing.assert_allclose(color, expected, atol=2e-5)


def test_light_of_other_orders_is_cut_or_filled(glossy):
    long, short = random_light(6), random_light(1)
    np.testing.assert_array_equal(diffuse_colors(glossy, long), diffuse_colors(glossy, long[:25]))
    filled = np.concatenate([short, np.zeros((21, 3))])
    np.testing.assert_array_equal(diffuse_colors(glossy, short), diffuse_colors(glossy, filled))


def test_diffuse_colors_take_the_albedo(glossy):
    light = random_light()
    irradiance = np.einsum("vj,jc->vc", glossy.vectors[..., 0], light)
    np.testing.assert_allclose(diffuse_colors(glossy, light), 0.5 / np.pi * irradiance, atol=1e-6)
    red = diffuse_colors(replace(glossy, albedo=np.array([[1.0, 0.0, 0.0]])), light)
    np.testing.assert_allclose(red[:, 0], irradiance[:, 0] / np.pi, atol=1e-6)
    assert (red[:, 1:] == 0).all()


def test_glossy_surfaces_need_matrices():
    baked = bake(Plan(meshes.sphere(0), samples=4))
    with pytest.raises(TransferError, match="--matrices"):
        glossy_colors(baked, Cushion(), random_light(), unit(0, 0, 1))


def test_each_vertex_may_have_its_own_light(glossy):
    """It is shaded as the whole mesh is under that light."""
    lights = [random_light(), 3 * random_light(2)]
    count = len(glossy.vectors)
    both = np.zeros((count, 25, 3))
    both[::2], both[1::2, :9] = lights
    view = unit(0.2, 0.3, 0.9)
    for shade in (
        diffuse_colors,
        lambda *given: glossy_colors(given[0], Cushion(), given[1], view),
    ):
        found = shade(glossy, both)
        for first, light in enumerate(lights):
            np.testing.assert_allclose(found[first::2], shade(glossy, light)[first::2], atol=1e-6)


def test_bent_normals_are_those_of_free_points():
    mesh = meshes.bumps(16)
    flat = bake(Plan(mesh, samples=64))
    cosines = np.sum(flat.bent_normals() * mesh.normals, axis=1)
    assert np.median(cosines) > 0.98
    assert cosines.min() > 0.5
    even = bake(Plan(mesh, order=0, samples=16)).bent_normals()
    np.testing.assert_allclose(np.linalg.norm(even, axis=1), 1)
