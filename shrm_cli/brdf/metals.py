"""Colors of metals, for the models that have a reflectance at normal incidence."""

from shrm_cli.brdf.base import Color, Parameter

METALS: dict[str, Color] = {
    "aluminum": (0.913, 0.922, 0.924),
    "chromium": (0.549, 0.556, 0.554),
    "copper": (0.955, 0.638, 0.538),
    "gold": (1.000, 0.782, 0.344),
    "iron": (0.562, 0.565, 0.578),
    "nickel": (0.660, 0.609, 0.526),
    "platinum": (0.673, 0.637, 0.585),
    "silver": (0.972, 0.960, 0.915),
    "titanium": (0.542, 0.497, 0.449),
}
"""Reflectance at normal incidence by the name of the metal, linear RGB with sRGB's primaries.

References
----------
Akenine-Moeller et al. 2018, Real-Time Rendering, 4th edition, table 9.2.
"""

# The default is 1 because a surface that reflects little along its normal has most of its energy at
# grazing angles, in orders that a tolerance below some per cent does not reach.
NORMAL_REFLECTANCE = Parameter(
    "f0", (1.0, 1.0, 1.0), 0.0, 1.0, "reflectance at normal incidence, 0.04 for plastics",
    names=METALS,
)  # fmt: skip
