"""An analytic clear sky with a sun of its real radiance.

References: Preetham, Shirley & Smits 1999, A Practical Analytic Model for Daylight, SIGGRAPH 99.
"A.1" and "A.2" below are its appendices.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import REC709, xyz_matrix
from shrm_cli.errors import ProbeError
from shrm_cli.probe import make
from shrm_cli.sphere.directions import from_azimuth_elevation, local_frame, to_angles
from shrm_cli.sphere.grid.latlong import latlong_directions

TURBIDITY_RANGE = (1.7, 10.0)
"""Below it the fitted zenith is dark (F(0, theta) is 0 at 1.65); above it the air is not clear."""

SUN_RADIUS = np.arcsin(0.695 / 150)
"""Angular radius of the sun's disc, radians (0.2655 degrees).

Its sine is the sun's radius over its distance, both in millions of km. Table 2 divided measured
irradiance by the solid angle of this disc.
"""

SUN_SOLID_ANGLE = 2 * np.pi * (1 - np.cos(SUN_RADIUS))
"""Solid angle of the sun's disc, sr."""

OZONE_CM, WATER_CM = 0.35, 2.0
"""Ozone (at normal temperature and pressure) and precipitable water above the ground, cm (A.1)."""

SUN_SAMPLES = 2**17
"""Equal parts of the sun's disc: near 290 a texel for a low sun at height 8192."""


def sky(
    size: int,
    sun_azimuth: float,
    sun_elevation: float,
    turbidity: float = 3.0,
    ground_albedo: float = 0.2,
    has_disc: bool = True,
) -> make.Image:
    """Clear sky, sun, and ground that they light.

    Parameters
    ----------
    size : int
        Height of the image in pixels, at least 2.
    sun_azimuth, sun_elevation : float
        Direction of the sun's center, degrees: azimuth 0 is +Z and turns towards +X about +Y;
        elevation 0 (half of the disc has set) to 90.
    turbidity : float
        Haziness, 1.7 (pure air) to 10 (haze); 3 is a clear day.
    ground_albedo : float
        Diffuse reflectance of the ground, grey, 0 to 1.
    has_disc : bool
        Whether the sun's disc is in the image. The sun lights the sky and the ground in any case.

    Returns
    -------
    ndarray of float32, shape (size, 2 * size, 3)
        Linear Rec.709 whose luminance (0.2126 R + 0.7152 G + 0.0722 B) is in kcd/m^2: 1 unit is
        1000 cd/m^2. Colours outside the gamut are clamped at 0. The sun, smaller than most
        texels, is averaged over those it falls into: the sum over them of radiance times exact
        solid angle is the same at every size.

    Raises
    ------
    ProbeError
        If a parameter is out of its range.

    Notes
    -----
    The sky is as bright as the paper's fit says, which is brighter than most measured ones: at
    turbidity 3 and elevation 60 degrees it gives 32 klx on the ground and the sun 75 klx. Below
    turbidity 2 and above 6 the fit is extrapolated and can exceed the light that enters the
    atmosphere (127 klx perpendicular to the sun).

    Examples
    --------
    >>> shrm.sky(16, 45, 35, has_disc=False).shape
    (16, 32, 3)
    """
    make.check_size(size)
    if not np.isfinite(sun_azimuth):
        raise ProbeError("the sun's azimuth must be a finite number of degrees")
    _check_range("sun elevation", sun_elevation, 0, 90, " degrees, the sun above the horizon")
    _check_range("turbidity", turbidity, *TURBIDITY_RANGE)
    _check_range("ground albedo", ground_albedo, 0, 1)

    sun = from_azimuth_elevation(sun_azimuth, sun_elevation)
    upper = latlong_directions(2 * size, size)[: (size + 1) // 2]
    image = np.zeros((size, 2 * size, 3), dtype=np.float32)
    image[: len(upper)] = make.shade_in_bands(upper, lambda d: sky_radiance(d, sun, turbidity))

    # What each row adds to the irradiance of the ground: the integral of cos(zenith angle).
    edges = np.minimum(np.arange(size + 1) * (np.pi / size), np.pi / 2)
    cosines = np.diff(np.sin(edges) ** 2) * (np.pi / (2 * size))
    irradiance = cosines @ image.sum(axis=1, dtype=np.float64)
    disc = sun_disc_samples(sun)
    disc = disc[disc[:, 1] > 0]
    # Irradiance perpendicular to the sun that each sample of its disc brings.
    beam = sun_radiance(sun_elevation, turbidity) * (SUN_SOLID_ANGLE / SUN_SAMPLES)
    irradiance += beam * disc[:, 1].sum()

    ground = ground_albedo / np.pi * irradiance
    image[len(upper) :] = ground
    if size % 2:  # the horizon cuts the middle row into halves
        image[size // 2] = (image[size // 2] + ground) / 2
    if has_disc:
        _add_beams(image, disc, beam)
    return image


def sky_radiance(directions: Array, sun: Array, turbidity: float) -> Array:
    """Radiance of the sky without the sun's disc.

    `directions`, of shape (..., 3), are unit directions on or above the horizon. `sun`, of shape
    (3,), is the unit direction of the sun, on or above the horizon.

    Returns an array of shape (..., 3): linear Rec.709, luminance in kcd/m^2, at least 0.

    References: A.2: quantities F(theta, gamma) / F(0, theta_s) times those at the zenith.
    """
    sun_theta = np.arccos(np.clip(sun[1], 0.0, 1.0))
    # A.2 divides by the cosine; the radiance is flat long before it vanishes.
    cosine = np.maximum(directions[..., 1], 1e-4)
    gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
    zenith = {
        "Y": zenith_luminance(turbidity, sun_theta),
        "x": _zenith_chromaticity("x", turbidity, sun_theta),
        "y": _zenith_chromaticity("y", turbidity, sun_theta),
    }
    values = {
        name: value
        * _perez(name, turbidity, cosine, gamma)
        / _perez(name, turbidity, np.array(1.0), sun_theta)
        for name, value in zenith.items()
    }
    scale = values["Y"] / values["y"]
    xyz = np.stack(
        [scale * values["x"], values["Y"], scale * (1 - values["x"] - values["y"])], axis=-1
    )
    return np.maximum(xyz @ np.linalg.inv(xyz_matrix(REC709)).T, 0.0)


def zenith_luminance(turbidity: float, sun_theta: float) -> float:
    """Luminance of the zenith, kcd/m^2, for a sun at `sun_theta` radians from it (A.2)."""
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * sun_theta)
    return float((4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192)


def sun_radiance(elevation: float, turbidity: float) -> Array:
    """Mean radiance of the sun's disc as seen through the atmosphere.

    `elevation` is the elevation of the disc's center, degrees, 0 to 90.

    Returns an array of shape (3,): linear Rec.709, luminance in kcd/m^2, at least 0.

    References: A.1, Table 2.
    """
    wavelengths = np.arange(380.0, 750.5, 1.0)
    depth = atmosphere_depth(wavelengths, elevation, turbidity)
    spectrum = np.interp(wavelengths, SUN_WAVELENGTHS, SUN_RADIANCE) * np.exp(-depth)
    xyz = np.trapezoid(spectrum[:, None] * color_matching(wavelengths), wavelengths, axis=0)
    kilocandelas = xyz * (LUMINOUS_EFFICACY / 1000)
    return np.maximum(np.linalg.solve(xyz_matrix(REC709), kilocandelas), 0.0)


def atmosphere_depth(wavelengths: Array, elevation: float, turbidity: float) -> Array:
    """Optical depth of the whole atmosphere towards the sun.

    `wavelengths`, of shape (n,), are in nm. `elevation` is the elevation of the sun, degrees, 0 to
    90.

    Returns an array of shape (n,): minus the logarithm of the transmittance.

    References: A.1; the angle in its relative optical mass (Kasten's) is in degrees.
    """
    zenith_angle = 90 - elevation
    mass = 1 / (np.cos(np.radians(zenith_angle)) + 0.15 * (93.885 - zenith_angle) ** -1.253)
    microns = wavelengths / 1000
    beta = 0.04608 * turbidity - 0.04586

    ozone = np.interp(wavelengths, OZONE_WAVELENGTHS, OZONE_ABSORPTION) * OZONE_CM
    gas = np.interp(wavelengths, GAS_WAVELENGTHS, GAS_ABSORPTION) * mass
    water = np.interp(wavelengths, WATER_WAVELENGTHS, WATER_ABSORPTION) * WATER_CM * mass
    rayleigh = 0.008735 * microns**-4.08
    aerosols = beta * microns**-1.3
    return (
        (rayleigh + aerosols + ozone) * mass
        + 1.41 * gas / (1 + 118.93 * gas) ** 0.45
        + 0.2385 * water / (1 + 20.07 * water) ** 0.45
    )


def sun_disc_samples(sun: Array) -> Array:
    """Unit directions, shape (SUN_SAMPLES, 3), one for each of as many equal parts of the disc."""
    i = np.arange(SUN_SAMPLES)
    cosine = 1 - (i + 0.5) / SUN_SAMPLES * (1 - np.cos(SUN_RADIUS))
    sine = np.sqrt(1 - cosine**2)
    # A sunflower's spiral: no spokes that would beat with the columns of the image at a pole.
    angle = i * (np.pi * (3 - np.sqrt(5)))
    local = np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=-1)
    return local @ local_frame(*to_angles(sun)).T


def _add_beams(image: make.Image, directions: Array, beam: Array) -> None:
    """Add to `image` light of irradiance `beam`, shape (3,), from each direction (n, 3)."""
    size = len(image)
    rows, columns = make.latlong_texels(directions, size)
    texels, counts = np.unique(rows * (2 * size) + columns, return_counts=True)
    rows, columns = np.divmod(texels, 2 * size)
    share = counts / make.latlong_solid_angles(size)[rows]
    image[rows, columns] += (share[:, None] * beam).astype(np.float32)


def _perez(name: str, turbidity: float, cosine: Array, gamma: Array | float) -> Array:
    """Distribution F of Perez et al. 1993: `cosine` of the zenith angle, `gamma` to the sun."""
    a, b, c, d, e = (slope * turbidity + offset for slope, offset in PEREZ[name])
    zenith_to_horizon = 1 + a * np.exp(b / cosine)
    around_sun = 1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2
    return zenith_to_horizon * around_sun


def _zenith_chromaticity(name: str, turbidity: float, sun_theta: float) -> float:
    """Chromaticity x or y of the zenith (A.2), for a sun at `sun_theta` radians from it."""
    polynomials = np.array(ZENITH_CHROMATICITY[name])
    powers = sun_theta ** np.arange(3, -1, -1)
    return float(np.array([turbidity**2, turbidity, 1.0]) @ polynomials @ powers)


def _check_range(name: str, value: float, low: float, high: float, meaning: str = "") -> None:
    if not low <= value <= high:  # a NaN is in no range
        raise ProbeError(f"{name} {value:g} is out of range: give {low:g} to {high:g}{meaning}")


# ---- the model -----------------------------------------------------------------------------------


PEREZ = {
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771),
          (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989),
          (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537),
          (-0.0109, 0.0529)),
}  # fmt: skip
"""Coefficients A to E of luminance and chromaticity: (slope, offset) in the turbidity (A.2)."""

ZENITH_CHROMATICITY = {
    "x": ((0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394),
          (0.11693, -0.21196, 0.06052, 0.25886)),
    "y": ((0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516),
          (0.15346, -0.26756, 0.06670, 0.26688)),
}  # fmt: skip
"""Rows for T^2, T, 1; columns for the cube to the 0th power of the sun's zenith angle (A.2)."""

SUN_WAVELENGTHS = np.arange(380.0, 751.0, 10.0)
"""Wavelengths of `SUN_RADIANCE`, nm."""

SUN_RADIANCE = np.array([
    16559.0, 16233.7, 21127.5, 25888.2, 25829.1, 24232.3, 26760.5, 29658.3, 30545.4, 30057.5,
    30663.7, 28830.4, 28712.1, 27825.0, 27100.6, 27233.6, 26361.3, 25503.8, 25060.2, 25311.6,
    25355.9, 25134.2, 24631.5, 24173.2, 23685.3, 23212.1, 22827.7, 22339.8, 21970.2, 21526.7,
    21097.9, 20728.3, 20240.4, 19870.8, 19427.2, 19072.4, 18628.9, 18259.2,
])  # fmt: skip
"""Radiance of the sun above the atmosphere, W / (m^2 nm sr) (Table 2)."""

OZONE_WAVELENGTHS = np.array([
    *range(300, 356, 5), *range(445, 611, 5), *range(620, 791, 10)
], dtype=float)  # fmt: skip
"""Wavelengths of `OZONE_ABSORPTION`, nm; between 355 and 445 there is next to none."""

OZONE_ABSORPTION = np.array([
    10.0, 4.8, 2.7, 1.35, 0.8, 0.380, 0.160, 0.075, 0.04, 0.019, 0.007, 0.0,
    0.003, 0.003, 0.004, 0.006, 0.008, 0.009, 0.012, 0.014, 0.017, 0.021, 0.025, 0.03, 0.035,
    0.04, 0.045, 0.048, 0.057, 0.063, 0.07, 0.075, 0.08, 0.085, 0.095, 0.103, 0.110, 0.12,
    0.122, 0.12, 0.118, 0.115, 0.12, 0.125, 0.130, 0.12,
    0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.010,
    0.009, 0.007, 0.004, 0.0, 0.0,
])  # fmt: skip
"""Attenuation k_o of ozone at `OZONE_WAVELENGTHS`, 1/cm (Table 2)."""

GAS_WAVELENGTHS = np.array([759.0, 760.0, 770.0, 771.0])
"""Wavelengths of `GAS_ABSORPTION`, nm; outside them it is 0."""

GAS_ABSORPTION = np.array([0.0, 3.0, 0.210, 0.0])
"""Attenuation k_g of the mixed gases (oxygen's A band), 1/km (Table 2)."""

WATER_WAVELENGTHS = np.array([689.0, *range(690, 801, 10)])
"""Wavelengths of `WATER_ABSORPTION`, nm; below them it is 0."""

WATER_ABSORPTION = np.array([
    0.0, 0.016, 0.024, 0.0125, 1.0, 0.87, 0.061, 0.001, 1e-5, 1e-5, 0.0006, 0.0175, 0.036,
])  # fmt: skip
"""Attenuation k_wa of water vapour, 1/cm (Table 2)."""

COLOR_MATCHING = (
    ((0.362, 442.0, 0.0624, 0.0374), (1.056, 599.8, 0.0264, 0.0323),
     (-0.065, 501.1, 0.0490, 0.0382)),
    ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322)),
    ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725)),
)  # fmt: skip
"""Lobes of x, y and z: height, center (nm), 1/width below and above it (1/nm)."""

LUMINOUS_EFFICACY = 683.0
"""Lumens a watt at the peak of the eye's sensitivity."""


def color_matching(wavelengths: Array) -> Array:
    """CIE 1931 color matching functions, multi-lobe fit.

    `wavelengths`, of shape (n,), are in nm.

    Returns an array of shape (n, 3): x, y, z.

    References: Wyman, Sloan & Shirley 2013, eq. 4.
    """
    functions = []
    for lobes in COLOR_MATCHING:
        total = np.zeros_like(wavelengths)
        for height, center, below, above in lobes:
            t = (wavelengths - center) * np.where(wavelengths < center, below, above)
            total += height * np.exp(-0.5 * t * t)
        functions.append(total)
    return np.stack(functions, axis=-1)
