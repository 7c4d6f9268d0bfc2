"""Pictures of meshes against Mitsuba's: the same camera, light and material, by Monte Carlo.

Mitsuba traces shadows, and maps know of none. Of a convex body the two must agree. Of others
Mitsuba's picture is darker where the body hides the light from itself.
"""

import numpy as np
import pytest

from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Lens, Viewer, aimed
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.stage import Actor, Look, Stage
from tests.geometry.shapes import icosphere

SIZE, VIEW = 48, Viewer(30, 15)
ALBEDO = (0.8, 0.5, 0.3)
LAMBERTIAN = (
    "lambertian:albedo=0.8/0.5/0.3",
    {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(ALBEDO)}},
)
# The same microfacets in both: GGX with Smith's shadowing. Where all light is reflected at all
# angles there is no Fresnel term.
GGX = (
    "ggx:roughness=0.7,f0=1",
    {"type": "roughconductor", "distribution": "ggx", "alpha": 0.49, "material": "none"},
)


@pytest.fixture(scope="module")
def mitsuba():
    module = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    module.set_variant("scalar_rgb")
    return module


def convex(splits=4):
    """A smooth convex body: an ellipsoid, stretched along one of its sides."""
    vertices, faces = icosphere(splits)
    stretched = np.where(vertices > 0, vertices * [1.0, 1.4, 0.8], vertices * [0.7, 0.8, 1.1])
    return make_mesh("body", stretched, faces)


def soft_sky(rows=64):
    """A lat-long of broad, coloured light, of which few samples tell much."""
    y, x = np.mgrid[:rows, : 2 * rows] + 0.5
    theta, phi = np.pi * y / rows, np.pi * (x / rows - 1)  # phi from +Z, to the right is -X
    directions = np.stack(
        [-np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    )
    sun = np.exp(3 * (directions @ [0.6, 0.64, 0.48] - 1))[..., None] * [3.0, 2.0, 1.0]
    return (0.4 + sun + 0.3 * directions[..., 1:2] * [0.0, 0.5, 1.0]).astype(np.float32)


def our_picture(mesh, light, spec):
    shown = prefilter(light, spec, eps=0.01, size=32)
    stage = Stage.of([Actor(mesh, [Look()])])
    lens = Lens(SIZE, SIZE, 30.0)
    subject = MeshSubject(stage, lens, aimed(mesh.vertices, [VIEW], lens))
    return subject.draw(stage.reflectors(shown), VIEW).astype(float), subject.aim


def their_picture(mitsuba, mesh, pixels, bsdf, aim, folder, samples=256):
    """Mitsuba's picture of direct light, and the coverage of the pixels."""
    shape = mitsuba.Mesh("body", len(mesh.vertices), len(mesh.faces), has_vertex_normals=True)
    path = folder / "body.ply"
    parameters = mitsuba.traverse(shape)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["vertex_normals"] = mesh.normals.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    shape.write_ply(str(path))
    look = mitsuba.ScalarTransform4f().look_at(
        origin=aim.eye(VIEW).tolist(), target=aim.target.tolist(), up=[0, 1, 0]
    )
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgba",
            "component_format": "float32", "rfilter": {"type": "box"}}  # fmt: skip
    scene = mitsuba.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
        "sensor": {"type": "perspective", "fov": 30.0, "to_world": look, "film": film,
                   "sampler": {"type": "independent", "sample_count": samples}},
        "light": {"type": "envmap", "bitmap": mitsuba.Bitmap(pixels.astype(np.float32))},
        "body": {"type": "ply", "filename": str(path), "bsdf": bsdf},
    })  # fmt: skip
    found = np.array(mitsuba.render(scene), dtype=float)
    return found[..., :3], found[..., 3]


def relative_rms(found, expected, coverage):
    inside = coverage > 0.999
    error = found[inside] - expected[inside]
    return np.sqrt(np.mean(error**2) / np.mean(expected[inside] ** 2))


def pixels_of(probe):
    """The pixels of a lat-long probe, which Mitsuba and we orient alike."""
    return np.concatenate([block for _, block, _ in probe.blocks()])


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize(("spec", "bsdf"), [LAMBERTIAN, GGX], ids=["lambertian", "ggx"])
def test_a_convex_body_looks_as_in_mitsuba(mitsuba, tmp_path, spec, bsdf):
    image = soft_sky()
    mesh = convex()
    ours, aim = our_picture(mesh, Probe.from_array(image, layout="latlong"), spec)
    theirs, coverage = their_picture(mitsuba, mesh, image, bsdf, aim, tmp_path)
    assert 0.2 < coverage.mean() < 0.7
    assert relative_rms(ours, theirs, coverage) < 0.05  # most of it is noise
    # Over many pixels the noise is gone: a sixteenth of the picture each.
    assert relative_rms(coarse(ours), coarse(theirs), coarse(coverage[..., None])[..., 0]) < 0.01
    # At the silhouette, too, it has the shape.
    np.testing.assert_allclose(ours.sum(axis=(0, 1)), theirs.sum(axis=(0, 1)), rtol=0.01)


def coarse(picture, step=6):
    height, width = picture.shape[0] // step, picture.shape[1] // step
    return picture.reshape(height, step, width, step, -1).mean(axis=(1, 3))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")  # city.exr has negative pixels
@pytest.mark.parametrize(("spec", "bsdf"), [LAMBERTIAN, GGX], ids=["lambertian", "ggx"])
def test_the_bunny_is_darker_where_it_hides_the_light(mitsuba, shared, tmp_path, spec, bsdf):
    """Real light and a body that is not convex: what is not hidden looks the same."""
    probe = open_probe(shared / "probes" / "city.exr")
    mesh = load_mesh(shared / "meshes" / "bunny.obj")
    ours, aim = our_picture(mesh, probe, spec)
    theirs, coverage = their_picture(mitsuba, mesh, pixels_of(probe), bsdf, aim, tmp_path, 512)
    ratio = (coarse(theirs, 3) / np.maximum(coarse(ours, 3), 1e-9)).mean(axis=-1)
    ratio = ratio[coarse(coverage[..., None], 3)[..., 0] > 0.999]
    print(f"of the bunny: {np.quantile(ratio, [0.02, 0.1, 0.5, 0.9, 0.98])}")
    assert np.quantile(ratio, 0.9) < 1.05  # nowhere brighter, but for noise
    assert 0.9 < np.median(ratio) < 1.01
    assert np.quantile(ratio, 0.02) < 0.9  # under the chin and between the feet
