"""Colours of vertices against integrals over light, and the three modes against each other."""

import numpy as np
import pytest

from shrm_cli.errors import TransferError
from shrm_cli.render.vertex_colors import VertexColors
from shrm_cli.sphere.parabolic import unproject
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.modes import (
    FineViewMaps,
    FixedLight,
    FixedView,
    General,
    ViewFunctions,
    ViewMaps,
)
from shrm_cli.transfer.shading import diffuse_colors, glossy_colors
from tests.oracles import real_harmonics as harmonics
from tests.oracles import sphere_rule
from tests.transfer import meshes


class Cushion:
    """The product function of a BRDF that is a polynomial, anisotropic and coloured.

    It is ``(V.L)^2 + x_L x_V / 2`` times a colour that depends on the view, of degree 2 in L.
    """

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
    # Each vertex as a corner of one of its triangles.
    faces = (mesh.faces == np.arange(len(mesh.vertices))[:, None, None]).any(axis=2).argmax(axis=1)
    corners = (mesh.faces[faces] == np.arange(len(faces))[:, None]).astype(float)
    place = (faces, corners), mesh.normals, mesh.normals
    shown = VertexColors(mesh, glossy, light).radiance(np.array([0.0, 0.0, 9.0]), *place)
    np.testing.assert_array_equal(shown, np.where(plain < 0, 0, plain))
    view = np.array([0.0, 9.0, 9.0])
    reflected = VertexColors(mesh, glossy, light, Cushion()).radiance(view, *place)
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
    red = diffuse_colors(glossy, light, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(red[:, 0], irradiance[:, 0] / np.pi, atol=1e-6)
    assert (red[:, 1:] == 0).all()


def test_glossy_surfaces_need_matrices():
    baked = bake(Plan(meshes.sphere(0), samples=4))
    with pytest.raises(TransferError, match="--matrices"):
        glossy_colors(baked, Cushion(), random_light(), unit(0, 0, 1))


class Grey(Cushion):
    """The same in each channel."""

    def values(self, local_views):
        return np.repeat(super().values(local_views)[..., :1], 3, axis=-1)


class Metal(Cushion):
    """Reflectance that goes from a colour to white: two functions, mixed in each channel."""

    def values(self, local_views):
        whole = super().values(local_views)
        rim = (1 - local_views[..., 2]) ** 5
        return (np.array([1.0, 0.8, 0.3]) + rim[..., None, None]) * whole[..., :1]


@pytest.mark.parametrize(("product", "kept"), [(Grey(), 1), (Metal(), 2), (Cushion(), 3)])
def test_a_fixed_view_keeps_as_few_vectors_as_channels_need(glossy, product, kept):
    general = General(ViewFunctions(product), glossy.frames, glossy.matrices)
    light, view = random_light(), unit(0.2, -0.3, 0.9)
    fixed = FixedView(general, view)
    assert fixed.mixing.shape == (3, kept)
    found = general.colors(light, view)
    np.testing.assert_allclose(fixed.colors(light), found, atol=1e-4 * np.abs(found).max())


class OneChannel(Grey):
    """The one channel that textures of grey BRDFs have."""

    def values(self, local_views):
        return super().values(local_views)[..., :1]


def test_the_modes_take_textures_of_one_channel(glossy):
    light, view = random_light(), unit(0.2, -0.3, 0.9)
    one, three = (
        General(ViewFunctions(product), glossy.frames, glossy.matrices)
        for product in (OneChannel(), Grey())
    )
    for mode in (lambda g: g.colors(light, view), lambda g: FixedView(g, view).colors(light),
                 lambda g: FixedLight(g, light).colors(view)):  # fmt: skip
        found = mode(three)
        np.testing.assert_allclose(mode(one), found, atol=1e-5 * np.abs(found).max())


@pytest.mark.parametrize("shadows", [True, False])
@pytest.mark.parametrize("distant", [True, False])
def test_the_three_modes_agree(glossy, shadows, distant):
    """To what leaving out functions of the view may cost, which they state."""
    functions = ViewFunctions(Cushion(), 1e-4)
    assert len(functions.maps) < 25
    matrices = glossy.matrices if shadows else None
    general = General(functions, glossy.frames, matrices)
    light, view = random_light(), unit(0.2, -0.3, 0.9)
    if not distant:
        offsets = np.random.default_rng(1).standard_normal((len(glossy.frames), 3))
        view = view + 0.1 * offsets
        view /= np.linalg.norm(view, axis=1, keepdims=True)
    found = general.colors(light, view)
    scale = np.sqrt(np.mean(found**2))
    fixed_light = FixedLight(general, light, 1e-4)
    np.testing.assert_allclose(fixed_light.colors(view), found, atol=2e-3 * scale)
    np.testing.assert_allclose(FixedView(general, view).colors(light), found, atol=1e-4 * scale)
    if shadows:
        expected = glossy_colors(glossy, Cushion(), light, view)
        np.testing.assert_allclose(found, expected, atol=0.01 * scale)


@pytest.mark.parametrize(("tolerance", "maps"), [(0.1, FineViewMaps), (2e-3, ViewMaps)])
def test_a_fixed_light_states_its_error(glossy, tolerance, maps):
    """Against the general mode, over views of the sphere; strict ones filter four texels."""
    functions = ViewFunctions(Cushion(), 1e-4)
    general = General(functions, glossy.frames, glossy.matrices)
    fixed = FixedLight(general, random_light(), tolerance)
    assert type(fixed.maps) is maps
    assert 0.1 * tolerance < fixed.error <= tolerance
    assert len(fixed.maps) < len(general.functions.maps)
    directions = np.random.default_rng(4).standard_normal((40, 3))
    views = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    pairs = [(fixed.colors(view), general.colors(random_light(), view)) for view in views]
    error = sum(np.sum((one - other) ** 2) for one, other in pairs)
    whole = sum(np.sum(other**2) for _, other in pairs)
    assert np.sqrt(error / whole) == pytest.approx(fixed.error, rel=0.5)


def test_one_texel_of_finer_maps_misses_what_it_says():
    """Beside the filtered coarse maps, over directions that are even in the map's circle."""
    planes = ViewFunctions(Cushion(), 1e-2).planes
    rng = np.random.default_rng(5)
    radius, angle = np.sqrt(rng.uniform(0, 0.98, 20_000)), rng.uniform(0, 2 * np.pi, 20_000)
    views = unproject(radius * np.cos(angle), radius * np.sin(angle)).T.astype(np.float32)
    fine = FineViewMaps(planes)
    difference = fine.at(views) - ViewMaps(planes).at(views)
    measured = (difference**2).mean(axis=0) * planes.shape[1]
    np.testing.assert_allclose(measured, fine.errors, rtol=0.4)


def test_vertices_that_face_away_are_black_in_every_mode(glossy):
    general = General(ViewFunctions(Cushion()), glossy.frames, glossy.matrices)
    light, view = random_light(), unit(1, 0.3, -0.1)
    away = glossy.frames[:, 2] @ view <= 0
    assert 0.3 < away.mean() < 0.7
    modes = general.colors(light, view), FixedView(general, view).colors(light)
    for found in (*modes, FixedLight(general, light).colors(view)):
        assert (found[away] == 0).all()
        assert (found[~away] != 0).any(axis=1).all()
