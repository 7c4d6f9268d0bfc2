"""RGL's materials against Mitsuba, the database's albedos, and integrals written out again."""

import time
import tracemalloc

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import RegularGridInterpolator

from shrm_cli.brdf.measured.rgl import Rgl, Slices, Warp
from shrm_cli.errors import BrdfError
from tests.brdf.measured.rgl_files import brushed, material, tensor_file
from tests.brute_force import unit

MATERIALS = ["cc_ibiza_sunset_rgb", "cg_sunflower_rgb", "paper_white_rgb", "satin_rosaline_rgb"]
CSV_SAMPLES = 60000


@pytest.fixture
def made(tmp_path):
    """A function that writes a small material with changes, and gives its path."""

    def write(**changes):
        path = tmp_path / "made.bsdf"
        path.write_bytes(tensor_file(material(**changes)))
        return path

    return write


@pytest.fixture
def made_brushed(tmp_path):
    """A function that writes a small anisotropic material with changes, and gives its path."""

    def write(symmetry=1, **changes):
        path = tmp_path / "brushed.bsdf"
        path.write_bytes(tensor_file(brushed(symmetry, **changes)))
        return path

    return write


def upper(rng, count):
    directions = unit(rng, count)
    directions[:, 2] = np.abs(directions[:, 2])
    return directions


def at_angles(theta, phi):
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def pairs(rng, count):
    """Lights and views: half of the lights near the mirror direction, every third view at 80."""
    theta = np.radians(rng.uniform(0, 88, count))
    theta[::3] = np.radians(80)
    view = at_angles(theta, rng.uniform(0, 2 * np.pi, count))
    light = upper(rng, count)
    near = view[::2] * [-1, -1, 1] + rng.normal(size=view[::2].shape) * 0.05
    near[:, 2] = np.abs(near[:, 2])
    light[::2] = near / np.linalg.norm(near, axis=1, keepdims=True)
    return light, view


def mitsuba_values(path, light, view):
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "measured", "filename": str(path)})
    interaction, context = mi.SurfaceInteraction3f(), mi.BSDFContext()
    values = np.empty(light.shape)
    for k in range(len(light)):
        interaction.wi = mi.Vector3f(*view[k])
        values[k] = np.array(bsdf.eval(context, interaction, mi.Vector3f(*light[k])))
    return np.maximum(values, 0)  # Mitsuba keeps the noise below zero


@pytest.mark.parametrize("name", MATERIALS)
def test_mitsuba_finds_the_same(shared, rng, name):
    path = shared / "brdf" / "rgl" / f"{name}.bsdf"
    light, view = pairs(rng, 300)
    expected = mitsuba_values(path, light, view)
    brdf = Rgl.open(path)
    assert np.median(expected) > 0.01
    for dtype in (np.float64, np.float32):
        found = brdf.evaluate(light.astype(dtype), view.astype(dtype))
        assert found.dtype == dtype
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


def test_mitsuba_finds_the_same_in_a_made_file(made, rng):
    path = made()
    light, view = pairs(rng, 300)
    expected = mitsuba_values(path, light, view)
    np.testing.assert_allclose(Rgl.open(path).evaluate(light, view), expected, rtol=1e-4)


@pytest.mark.parametrize("symmetry", [1, 2, 4])
def test_mitsuba_finds_the_same_in_an_anisotropic_file(made_brushed, rng, symmetry):
    path = made_brushed(symmetry)
    light, view = pairs(rng, 400)
    quadrants = {tuple(signs) for signs in np.signbit(view[:, :2]).tolist()}
    assert len(quadrants) == 4
    expected = mitsuba_values(path, light, view)
    assert np.ptp(expected) > np.median(expected) > 0.01
    brdf = Rgl.open(path)
    assert not brdf.isotropic
    # The noise of Mitsuba's single precision is largest where the half vector is on the normal.
    np.testing.assert_allclose(brdf.evaluate(light, view), expected, rtol=5e-4)
    turned = np.array([-1, -1, 1])
    mirrors = {1: [], 2: [turned], 4: [turned, [1, -1, 1], [-1, 1, 1]]}[symmetry]
    for signs in ([-1, -1, 1], [1, -1, 1], [-1, 1, 1]):
        same = np.allclose(brdf.evaluate(light * signs, view * signs), expected, rtol=1e-3)
        assert same == any(np.array_equal(signs, each) for each in mirrors)


def test_equal_azimuths_are_an_isotropic_material(made, made_brushed, rng):
    """An anisotropic file, that holds the isotropic one at each of its azimuths, turned."""
    fields = material(vndf=np.ones((1, 4, 7, 6), "f4"))
    grey = np.broadcast_to(fields["rgb"][:, :, :, :1], fields["rgb"].shape)  # at every azimuth
    isotropic = Rgl.open(made(vndf=fields["vndf"], rgb=grey.copy()))
    same = {
        name: np.repeat(each, 6, axis=0) for name, each in (("rgb", grey), ("vndf", fields["vndf"]))
    }
    found = Rgl.open(made_brushed(ndf=fields["ndf"], sigma=fields["sigma"], **same))
    light, view = pairs(rng, 100)
    np.testing.assert_allclose(
        found.evaluate(light, view), isotropic.evaluate(light, view), rtol=1e-5
    )


def half_vector_rule(count, view):
    """Lights and solid angles, from half vectors that crowd about the normal."""
    x, weights = np.polynomial.legendre.leggauss(count)
    u = (x + 1) / 2
    theta = u**3 * np.pi / 2
    ring = weights / 2 * 3 * u**2 * np.pi / 2 * np.sin(theta) * 2 * np.pi / count
    half = at_angles(theta[:, None], 2 * np.pi * (np.arange(count) + 0.5) / count)
    cosine = half @ view
    light = 2 * cosine[..., None] * half - view
    return light, ring[:, None] * 4 * np.maximum(cosine, 0)


@pytest.mark.parametrize("name", MATERIALS)
def test_albedos_of_the_database(shared, name):
    """Within 2 % where the database's value is that good, else within its own noise.

    It is the mean of 60000 cosine-weighted samples; their variance is integrated here.
    """
    folder = shared / "brdf" / "rgl"
    brdf = Rgl.open(folder / f"{name}.bsdf")
    rows = [row.split(",") for row in (folder / "albedo.csv").read_text().splitlines()]
    checked = 0
    for _, angle, *expected in (row for row in rows if row[0] == name):
        view = at_angles(np.radians(float(angle)), 0.3)
        (coarse, _), (albedo, square) = (
            moments(brdf, *half_vector_rule(count, view), view) for count in (150, 300)
        )
        np.testing.assert_allclose(coarse, albedo, rtol=3e-3, atol=1e-4)
        noise = np.sqrt((square - albedo**2) / CSV_SAMPLES)
        error = np.abs(albedo - np.array(expected, dtype=float))
        sure = noise < 0.005 * albedo
        assert (error[sure] < 0.02 * albedo[sure]).all()
        assert (error < 3 * noise + 0.0005).all()
        checked += 1
    assert checked == 4


def moments(brdf, light, weights, view):
    """Mean of the estimator rho_hat pi / cos with cosine-weighted lights, and of its square."""
    value = brdf.transfer(light, view)
    cosine = np.where(light[..., 2] > 0, light[..., 2], 1.0)
    return (
        np.einsum("ij,ijc->c", weights, value),
        np.einsum("ij,ijc->c", weights * np.pi / cosine, value**2),
    )


@pytest.mark.proof
@pytest.mark.slow
def test_the_warp_is_the_integral_of_the_density(rng):
    density = rng.uniform(0, 1, (2, 5, 6))
    nodes = np.array([0.2, 1.2])
    parameter = 0.5
    part = (parameter - 0.2) / 1.0
    one, other = (d / bilinear_integral(d) for d in density)
    at = RegularGridInterpolator(
        (np.linspace(0, 1, 5), np.linspace(0, 1, 6)), (1 - part) * one + part * other
    )

    def row(y, end):
        points = np.linspace(0, 1, 6)
        return quad(lambda x: at((y, x)), 0, end, points=points[points < end])[0]

    warp = Warp(density)
    for x, y in rng.uniform(0, 1, (6, 2)):
        found_x, found_y = warp.invert(
            np.array([x]), np.array([y]), Slices((nodes, np.array([parameter])))
        )
        assert found_x[0] == pytest.approx(row(y, x) / row(y, 1), abs=2e-6)
        below = np.linspace(0, 1, 5)
        expected = quad(lambda t: row(t, 1), 0, y, points=below[below < y])[0]
        assert found_y[0] == pytest.approx(expected, abs=2e-6)


def bilinear_integral(values):
    return np.mean((values[1:] + values[:-1])[:, 1:] + (values[1:] + values[:-1])[:, :-1]) / 4


def test_a_uniform_density_leaves_the_measurement_where_it_is(made, rng):
    """D / (4 sigma) times bilinear colours, by scipy, at views on the measured angles."""
    fields = material()
    brdf = Rgl.open(made(vndf=np.ones((1, 4, 7, 6), "f4")))
    grid = (np.linspace(0, 1, 5),) * 2
    for index, theta in enumerate(fields["theta_i"][:-1]):
        view = at_angles(np.full(50, theta), 0.0)
        light = upper(rng, 50)
        half = light + view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        u = np.sqrt(np.arccos(half[:, 2]) * 2 / np.pi)
        v = np.arctan2(half[:, 1], half[:, 0]) / (2 * np.pi) + 0.5
        colour = RegularGridInterpolator(grid, np.moveaxis(fields["rgb"][0, index], 0, -1))
        normals = 2 + (0.1 - 2) * u
        area = 1 + (0.3 - 1) * np.sqrt(theta * 2 / np.pi)
        expected = colour(np.stack([v, u], -1)) * (normals / (4 * area))[:, None]
        np.testing.assert_allclose(brdf.evaluate(light, view), expected, rtol=1e-4)


def test_without_the_jacobian_the_measurement_is_the_transfer_function(made, rng):
    light, view = pairs(rng, 40)
    grey = np.full((1, 4, 3, 5, 5), 0.7, "f4")
    brdf = Rgl.open(made(jacobian=np.zeros(1, "u1"), rgb=grey))
    np.testing.assert_allclose(brdf.evaluate(light, view), 0.7, rtol=1e-6)
    assert brdf.includes_cosine


def test_only_the_azimuth_between_light_and_view_counts(made, rng):
    brdf = Rgl.open(made())
    light, view = pairs(rng, 50)
    turn = np.array([[np.cos(2), -np.sin(2), 0], [np.sin(2), np.cos(2), 0], [0, 0, 1]])
    found = brdf.evaluate(light @ turn.T, view @ turn.T)
    np.testing.assert_allclose(found, brdf.evaluate(light, view), rtol=1e-9)


@pytest.mark.parametrize("symmetry", [0, 1, 2, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_it_is_finite_and_black_below_the_horizon(made, made_brushed, rng, dtype, symmetry):
    if symmetry:
        path = made_brushed(symmetry, rgb=brushed()["rgb"] - 1)
    else:
        path = made(rgb=material()["rgb"] - 1)
    brdf = Rgl.open(path)
    special = np.array([[0, 0, 1], [1, 0, 0], [0, -1, 0], [0, 0, -1], [1e-9, 0, 1]], dtype)
    light = np.concatenate([special, unit(rng, 300).astype(dtype)])
    found = brdf.evaluate(light[:, None], light[None, :])
    assert found.shape == (305, 305, 3)
    assert found.dtype == dtype
    assert np.isfinite(found).all()
    assert (found >= 0).all()
    above = (light[:, None, 2] > 0) & (light[None, :, 2] > 0)
    assert (found[~above] == 0).all()
    assert (found[above] > 0).any()
    assert (found[above] == 0).any()  # the negative measurements


def test_spectra_are_seen_as_linear_srgb(made):
    """A narrow band at 620 nm and a flat spectrum, by colour-science from end to end."""
    colour = pytest.importorskip("colour")
    wavelengths = np.arange(380, 781, 20).astype("f4")
    band = np.exp(-(((wavelengths - 620) / 40) ** 2)) + 0.1
    spectra = np.empty((1, 4, len(wavelengths), 5, 5), "f4")
    spectra[:] = band[:, None, None]
    spectra[0, :, :, :, 2:] = 0.4  # columns: half vectors far from the normal
    path = made(
        rgb=None, spectra=spectra, wavelengths=wavelengths, jacobian=np.zeros(1, "u1"),
        vndf=np.ones((1, 4, 7, 6), "f4"),
    )  # fmt: skip
    brdf = Rgl.open(path)
    view = np.array([0.0, 0.0, 1.0])
    near, far = at_angles(np.array([0.1, np.pi * 0.45]), 0.0)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(observer.shape)
    fine = np.arange(360, 831)
    distribution = colour.SpectralDistribution(np.interp(fine, wavelengths, band), fine)
    seen = colour.sd_to_XYZ(distribution, observer, daylight, method="Integration") / 100
    expected = colour.XYZ_to_RGB(seen, "sRGB", apply_cctf_encoding=False)
    assert expected[0] > 2 * expected[2]
    np.testing.assert_allclose(brdf.evaluate(near, view), expected, rtol=5e-3, atol=2e-3)
    np.testing.assert_allclose(brdf.evaluate(far, view), 0.4, rtol=1e-5)


def test_a_file_is_identified_by_its_content(made):
    import hashlib

    path = made()
    brdf = Rgl.open(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert brdf.values == {"file": "made.bsdf", "sha256": digest}
    assert repr(brdf) == "made.bsdf"
    assert Rgl.recognizes(path.read_bytes()[:4096])
    assert not Rgl.recognizes(b"tensor")
    assert not Rgl.recognizes(b"#")


ONE = np.ones(1, "f4")
AZIMUTHS = {name: brushed()[name] for name in ("phi_i", "vndf", "rgb", "luminance")}
WRONG = {
    "azimuths equal": ({"phi_i": np.zeros(13, "f4")}, "do not increase"),
    "azimuths NaN": ({"phi_i": np.array([-3, np.nan, 0], "f4")}, "not finite"),
    "azimuths in degrees": ({"phi_i": np.array([-180, 0, 180], "f4")}, "not from -180"),
    "a third of the circle": ({"phi_i": np.array([-3.14, -2, -1.05], "f4")}, "not from -180"),
    "azimuths of another half": ({"phi_i": np.linspace(0, np.pi, 5, dtype="f4")}, "0 to 180 deg"),
    "fewer than azimuths": ({"phi_i": np.linspace(-np.pi, 0, 5, dtype="f4")}, "1 x 4 x 7 x 6"),
    "colours at fewer": ({**AZIMUTHS, "rgb": material()["rgb"]}, "1 x 4 x 3 x 5 x 5"),
    "normals of one azimuth": ({**AZIMUTHS, "ndf": np.ones((1, 9), "f4")}, "too short"),
    "no azimuths": ({"phi_i": None}, "phi_i"),
    "one angle": ({"theta_i": ONE}, "theta_i"),
    "angles fall": ({"theta_i": np.array([0, 0.6, 0.5, 1.5], "f4")}, "do not increase"),
    "angles in degrees": ({"theta_i": np.array([0, 30, 60, 90], "f4")}, "do not increase"),
    "angle NaN": ({"theta_i": np.array([0, np.nan, 1, 1.5], "f4")}, "not finite"),
    "other count": ({"theta_i": np.array([0, 1, 1.5], "f4")}, "vndf"),
    "no density": ({"vndf": None}, "vndf"),
    "density negative": ({"vndf": np.full((1, 4, 3, 3), -1, "f4")}, "no density"),
    "density zero": ({"vndf": np.zeros((1, 4, 3, 3), "f4")}, "vanishes"),
    "density infinite": ({"vndf": np.full((1, 4, 3, 3), np.inf, "f4")}, "not finite"),
    "density of a row": ({"vndf": np.ones((1, 4, 1, 3), "f4")}, "no density"),
    "density integer": ({"vndf": np.ones((1, 4, 3, 3), "u1")}, "uint8"),
    "no colours": ({"rgb": None}, "rgb"),
    "two channels": ({"rgb": np.ones((1, 4, 2, 5, 5), "f4")}, "1 x 4 x 2 x 5 x 5"),
    "colours NaN": ({"rgb": np.full((1, 4, 3, 5, 5), np.nan, "f4")}, "not finite"),
    "one colour": ({"rgb": np.ones((1, 4, 3, 1, 1), "f4")}, "no area"),
    "colours huge": ({"rgb": np.full((1, 4, 3, 5, 5), 9e29, "f4")}, "reach"),
    "area zero": ({"sigma": np.zeros((2, 9), "f4")}, "not positive"),
    "area short": ({"sigma": np.ones((2, 1), "f4")}, "too short"),
    "normals negative": ({"ndf": np.full((2, 9), -1, "f4")}, "negative"),
    "no flag": ({"jacobian": None}, "jacobian"),
    "flag float": ({"jacobian": ONE}, "no flag"),
    "no wavelengths": ({"rgb": None, "spectra": np.ones((1, 4, 5, 5, 5), "f4")}, "wavelengths"),
    "wavelength zero": (
        {"rgb": None, "spectra": np.ones((1, 4, 2, 5, 5), "f4"), "wavelengths": np.zeros(2, "f4")},
        "wavelengths",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_contradictions_are_refused(made, case):
    changes, word = WRONG[case]
    path = made(**changes)
    with pytest.raises(BrdfError, match=word) as caught:
        Rgl.open(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["isotropic", "brushed"])
def test_truncated_files_are_refused(made, made_brushed, kind):
    path = made() if kind == "isotropic" else made_brushed(4)
    content = path.read_bytes()
    for length in [*range(0, 400, 7), *range(400, len(content), 501), len(content) - 1]:
        path.write_bytes(content[:length])
        with pytest.raises(BrdfError, match=rf"{path.name}: "):
            Rgl.open(path)


@pytest.mark.proof
@pytest.mark.parametrize("kind", ["isotropic", "brushed"])
@pytest.mark.slow
def test_flipped_bytes_are_refused_or_harmless(made, made_brushed, rng, kind):
    path = made() if kind == "isotropic" else made_brushed(2)
    content = path.read_bytes()
    light, view = pairs(rng, 20)
    refused = 0
    tracemalloc.start()
    for place in [*rng.integers(0, 400, 120), *rng.integers(400, len(content), 120)]:
        broken = bytearray(content)
        broken[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        try:
            assert np.isfinite(Rgl.open(path).evaluate(light, view)).all()
        except BrdfError:
            refused += 1
    assert refused > 50
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_a_sparse_giant_is_refused_at_once(made):
    path = made()
    with open(path, "r+b") as stream:
        stream.truncate(2**40)
    start = time.process_time()
    with pytest.raises(BrdfError, match="larger than"):
        Rgl.open(path)
    assert time.process_time() - start < 1


def test_other_files_of_the_suffix_are_refused(tmp_path):
    path = tmp_path / "x.bsdf"
    zemax = (
        "#Data Generated by a goniometer\nSource Measured\nSymmetry PlaneSymmetrical\n"
        "SpectralContent Monochrome\nScatterType BRDF\nSampleRotation 1\n0\n"
        "AngleOfIncidence 2\n0 30\n"
    )
    path.write_text(zemax)
    with pytest.raises(BrdfError, match=r"a Zemax \.bsdf text file; only RGL's"):
        Rgl.open(path)
    path.write_text("hello")
    with pytest.raises(BrdfError, match=r"not an RGL \.bsdf file"):
        Rgl.open(path)
