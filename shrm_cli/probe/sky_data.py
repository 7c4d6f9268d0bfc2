"""Tables of the analytic daylight model, and the color spaces that it needs.

References: Preetham, Shirley & Smits 1999, A Practical Analytic Model for Daylight: appendix A.1
(the sun's attenuation), Table 2 (its spectra), appendix A.2 (the sky). Wyman, Sloan & Shirley 2013,
Simple Analytic Approximations to the CIE XYZ Color Matching Functions, JCGT 2(2), section 2.2.
"""

import numpy as np

from shrm_cli.arrays import Array

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
