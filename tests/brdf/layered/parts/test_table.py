"""Tables of albedos beside sums over grids that share no code with them."""

import numpy as np
import pytest

from shrm_cli.brdf.layered.parts.table import COSINES, Table, albedos, transport
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.sphere.directions import from_angles

SPECS = [
    "ggx:roughness=0.3,f0=0.9/0.5/0.1",
    "ggx:ax=0.5,ay=0.2",
    "charlie:roughness=0.4",
    "oren-nayar",
]
VIEWS = (0.62, 0.11, 0.03)


def gridded(spec, cosine, function):
    """The integral of a function of the light's cosine times the BRDF, on slopes of half vectors.

    Their grid is even in the inverse hyperbolic sine of slopes, beyond which there is next to
    nothing.
    """
    brdf, view = parse_spec(spec), np.array([np.sqrt(1 - cosine**2), 0, cosine])
    steps = np.linspace(-12, 12, 900)
    step, width = steps[1] - steps[0], 0.05
    x, y = np.meshgrid(width * np.sinh(steps), width * np.sinh(steps), indexing="ij")
    areas = np.outer(width * np.cosh(steps), width * np.cosh(steps)) * step**2
    size = np.sqrt(1 + x**2 + y**2)
    half = np.stack([x, y, np.ones_like(x)], axis=-1) / size[..., None]
    seen = half @ view
    light = 2 * seen[..., None] * half - view
    lit = (seen > 0) & (light[..., 2] > 1e-9)
    weights = (areas / size**3 * 4 * seen)[lit]  # of half vectors, and of the light they mirror
    values = brdf.evaluate(light[lit], view) * light[lit][:, 2:]
    return (weights * function(light[lit][:, 2])) @ values


@pytest.mark.parametrize("spec", SPECS)
def test_albedos_and_rows_are_sums_over_half_vectors(spec):
    brdf = parse_spec(spec)
    whole = albedos(brdf, np.array(VIEWS))
    rows = transport(brdf, np.array(VIEWS), COSINES)
    for cosine, albedo, row in zip(VIEWS, whole, rows, strict=True):
        np.testing.assert_allclose(albedo, gridded(spec, cosine, np.ones_like), rtol=1e-4)
        dimmed = gridded(spec, cosine, lambda z: np.interp(z, COSINES, np.exp(-3 * COSINES)))
        np.testing.assert_allclose(np.exp(-3 * COSINES) @ row, dimmed, rtol=1e-4)


@pytest.mark.parametrize(("dtype", "error"), [(np.float32, 2e-6), (np.float64, 1e-13)])
@pytest.mark.parametrize("channels", [1, 3])
def test_tables_are_linear_between_their_cosines(rng, dtype, error, channels):
    """As numpy's own interpolation is, at the ends and below the horizon, too."""
    values = np.broadcast_to(rng.random((64, channels)), (64, 3))
    cosines = np.concatenate([COSINES, rng.random(500) ** 2, [-0.3]]).astype(dtype)
    found = Table(values)(cosines)
    expected = [np.interp(cosines.astype(float), COSINES, each) for each in values.T]
    np.testing.assert_allclose(found, np.transpose(expected), rtol=0, atol=error)
    assert found.dtype == dtype
    assert (found.strides[-1] == 0) == (channels == 1)


def test_channels_of_layers_lie_apart():
    """In triples all that followed took twice the time."""
    light = from_angles(np.linspace(0.1, 1.4, 1000), 0.3).astype(np.float32)
    view = from_angles(0.4, 0.0).astype(np.float32)
    for spec in ("coated:base=(lambertian:albedo=0.6/0.05/0.03)", "ggx:f0=0.04,film=350"):
        value = parse_spec(spec).evaluate(light, view)
        assert value[..., 0].strides == (value.itemsize,)
