"""Nine coefficients in the conventions of engines, by their own polynomials of a normal.

The light is a polynomial of degree 2, so that nine coefficients hold all of it, and its irradiance
is summed over the pixels of a lat-long.
"""

import numpy as np
import pytest

from shrm_cli.export.harmonics import filament, in_axes, three, unity, unreal
from shrm_cli.probe.probe import Probe
from tests.brute_force import latlong_samples, unit
from tests.makers import prefilter_irradiance as prefilter

HEIGHT = 64


@pytest.fixture(scope="module")
def scene():
    """Return our coefficients, a function for the light, and one for its irradiance."""
    rng = np.random.default_rng(5)
    linear, square = rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 3))

    def light(directions):
        quadratic = np.einsum("ni,cij,nj->nc", directions, square, directions)
        return 12 + directions @ linear.T + quadratic

    directions, weights = (np.asarray(each) for each in latlong_samples(HEIGHT))
    radiance = light(directions)
    assert radiance.min() > 0

    def irradiance(normals):
        cosines = np.maximum(normals @ directions.T, 0)
        return (cosines * weights) @ radiance

    probe = Probe.from_array(radiance.reshape(HEIGHT, 2 * HEIGHT, 3), "latlong")
    return prefilter(probe).map.nine(), light, irradiance


def shader_polynomial(sh, n):
    """Return the sum of Filament's `Irradiance_SphericalHarmonics`, term by term."""
    x, y, z = n.T
    terms = [1 + 0 * x, y, z, x, y * x, y * z, 3 * z * z - 1, z * x, x * x - y * y]
    return np.einsum("kc,kn->nc", sh, np.array(terms))


def test_filament(scene, rng):
    nine, _, irradiance = scene
    normals = unit(rng, 50)
    found = shader_polynomial(filament(nine), normals)
    assert found == pytest.approx(irradiance(normals) / np.pi, rel=2e-3)


def test_the_constants_of_filament():
    """Those that its documentation gives, to six digits."""
    found = filament(np.ones((9, 3)))[:, 0]
    wanted = [
        0.282095, 0.325735, 0.325735, 0.325735, 0.273137, 0.273137, 0.078848, 0.273137, 0.136569
    ]  # fmt: skip
    assert found == pytest.approx(wanted, abs=1e-6)


def test_three(scene, rng):
    """`shGetIrradianceAt` of three.js, whose constants hold A_l and the harmonics'."""
    nine, _, irradiance = scene
    normals = unit(rng, 50)
    x, y, z = normals.T
    terms = [
        0.886227 + 0 * x, 2 * 0.511664 * y, 2 * 0.511664 * z, 2 * 0.511664 * x,
        2 * 0.429043 * x * y, 2 * 0.429043 * y * z, 0.743125 * z * z - 0.247708,
        2 * 0.429043 * x * z, 0.429043 * (x * x - y * y),
    ]  # fmt: skip
    found = np.einsum("kc,kn->nc", three(nine), np.array(terms))
    assert found == pytest.approx(irradiance(normals), rel=2e-3)


def test_unity(scene, rng):
    """`ShadeSH9` with what `SHCoefficients` packs, at normals of Unity's left-handed axes."""
    nine, _, irradiance = scene
    normals = unit(rng, 50)
    s = unity(in_axes(nine, np.diag([-1.0, 1, 1])))
    x, y, z = -normals[:, 0], normals[:, 1], normals[:, 2]
    a = np.array([s[3], s[1], s[2], s[0] - s[6]])
    b = np.array([s[4], s[5], s[6] * 3, s[7]])
    found = (
        np.einsum("kc,kn->nc", a, np.array([x, y, z, np.ones_like(x)]))
        + np.einsum("kc,kn->nc", b, np.array([x * y, y * z, z * z, z * x]))
        + (x * x - y * y)[:, None] * s[8]
    )
    assert found == pytest.approx(irradiance(normals) / np.pi, rel=2e-3)


def test_unreal(scene, rng):
    """`TSHVector<3>::SHBasisFunction` at directions of Unreal's axes gives the radiance."""
    nine, light, _ = scene
    directions = unit(rng, 50)
    found = unreal(in_axes(nine, np.eye(3)[[0, 2, 1]]))
    x, y, z = directions[:, 0], directions[:, 2], directions[:, 1]
    basis = [
        0.282095 + 0 * x, -0.488603 * y, 0.488603 * z, -0.488603 * x, 1.092548 * x * y,
        -1.092548 * y * z, 0.315392 * (3 * z * z - 1), -1.092548 * x * z,
        0.546274 * (x * x - y * y),
    ]  # fmt: skip
    values = np.einsum("kc,kn->nc", found, np.array(basis))
    assert values == pytest.approx(light(directions), rel=2e-3)
