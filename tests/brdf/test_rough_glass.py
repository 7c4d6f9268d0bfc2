"""The example of light through rough glass, with what its maps are looked up with."""

import importlib.util

import numpy as np

from shrm_cli.brdf.spec import parse_spec
from tests.brdf.models.test_analytic import mitsuba, mitsuba_values  # noqa: F401
from tests.brdf.test_python_file import EXAMPLE
from tests.brute_force import unit

PATH = EXAMPLE.with_name("rough_glass.py")
GLASS = {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.36, "int_ior": 1.4,
         "ext_ior": 1.0}  # fmt: skip


def looked_up(normals, views):
    spec = importlib.util.spec_from_file_location("rough_glass", PATH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.through(normals, views, 1.4)


def frames_of(third, towards):
    """Frames (n, 3, 3), in columns, whose z axis is given, and whose x axis points to the views."""
    first = towards - np.sum(towards * third, axis=1, keepdims=True) * third
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=2)


def test_the_lobe_is_that_of_walter_about_the_refracted_direction(mitsuba, rng):  # noqa: F811
    normals, views, lights = (unit(rng, 200) for _ in range(3))
    views *= np.sign(np.sum(normals * views, axis=1, keepdims=True))
    lights *= -np.sign(np.sum(normals * lights, axis=1, keepdims=True))
    found_normals, found_views = looked_up(normals, views)
    true, asked = frames_of(normals, views), frames_of(found_normals, found_views)
    turned = [np.einsum("nij,ni->nj", true, each) for each in (lights, views)]
    # Light that came into the glass from air has n^2 times the radiance there.
    expected = mitsuba_values(mitsuba, GLASS, *turned) * 1.4**2
    light, view = (np.einsum("nij,ni->nj", asked, each) for each in (lights, found_views))
    brdf = parse_spec(f"{PATH}:RoughGlass:roughness=0.6,ior=1.4")
    np.testing.assert_allclose(brdf.transfer(light, view), expected, rtol=2e-3, atol=1e-4)
    assert expected.max() > 0.5


def test_a_view_along_the_normal_sees_what_views_beside_it_see(rng):
    brdf = parse_spec(f"{PATH}:RoughGlass:roughness=0.4")
    lights = unit(rng, 500)
    beside = np.array([1e-5, 0.0, np.sqrt(1 - 1e-10)])
    found, expected = (brdf.transfer(lights, view) for view in (np.array([0.0, 0, 1]), beside))
    assert expected.max() > 1
    np.testing.assert_allclose(found, expected, rtol=1e-2, atol=1e-3)
