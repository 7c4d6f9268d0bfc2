"""Lafortune's generalized cosine lobes: one of one's own, or fits to measured materials."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color, Parameter, Value
from shrm_cli.brdf.vectors import above_horizon, colored, is_grey, power, tangential
from shrm_cli.errors import BrdfError

Lobe = tuple[Color, Color, Color]
"""C_xy, C_z and the exponent of a lobe, each for R, G and B."""

# fmt: off
FITS: dict[str, tuple[Color, tuple[Lobe, ...]]] = {
    "bluepaint": (
        (0.3094, 0.39667, 0.70837),
        (
            ((0.870567, 0.857255, 0.670982), (0.803624, 0.77429, 0.586674),
             (21.820103, 18.597755, 7.472717)),
            ((-0.451218, -0.406681, -0.477976), (0.023123, 0.017625, 0.227295),
             (2.774499, 2.581499, 3.677653)),
            ((-1.031545, -1.029426, -1.026588), (0.706734, 0.69653, 0.687715),
             (66.89906, 63.767912, 57.489181)),
        ),
    ),
    "brushedmetal": (
        (0.0, 0.0, 0.0),
        (
            ((-1.11854, -1.11845, -1.11999), (1.01272, 1.01469, 1.01942),
             (15.8708, 15.6489, 15.4571)),
            ((-1.05334, -1.06409, -1.08378), (0.69541, 0.662178, 0.626672),
             (111.267, 88.9222, 65.2179)),
            ((-1.01684, -1.01635, -1.01529), (1.00132, 1.00112, 1.00108),
             (180.181, 184.152, 195.773)),
        ),
    ),
    "clay": (
        (0.383626, 0.260749, 0.274207),
        (
            ((-1.089701, -1.102701, -1.107603), (-1.354682, -2.714801, -1.569866),
             (17.968505, 11.024489, 21.270282)),
            ((-0.733381, -0.79332, -0.848206), (0.676108, 0.679314, 0.726031),
             (8.219745, 9.055139, 11.261951)),
            ((-1.010548, -1.012378, -1.011263), (0.910783, 0.885239, 0.892451),
             (152.912795, 141.937171, 201.046802)),
        ),
    ),
    "felt": (
        (0.025865, 0.025865, 0.025865),
        (
            ((-0.304075, -0.304075, -0.304075), (-0.065992, -0.065992, -0.065992),
             (3.047892, 3.047892, 3.047892)),
            ((-0.749561, -0.749561, -0.749561), (-1.167929, -1.167929, -1.167929),
             (6.931827, 6.931827, 6.931827)),
            ((1.004921, 1.004921, 1.004921), (-0.205529, -0.205529, -0.205529),
             (94.117332, 94.117332, 94.117332)),
        ),
    ),
    "primer": (
        (0.11823, 0.121218, 0.133209),
        (
            ((-0.399286, -1.033473, -1.058104), (0.167504, 0.009545, -0.068002),
             (2.466633, 7.637253, 8.117645)),
            ((-1.041861, -1.100108, -1.087779), (0.014375, -0.198147, -0.053605),
             (7.993722, 29.446268, 41.98899)),
            ((-1.098605, -0.379883, -0.449038), (-0.14511, 0.159127, 0.173224),
             (31.899719, 2.372852, 2.636161)),
        ),
    ),
    "skin": (
        (0.428425, 0.301341, 0.331054),
        (
            ((-1.131747, -1.016939, -0.966018), (-1.209182, -1.462488, -1.222419),
             (6.421658, 3.699932, 3.524889)),
            ((-0.54657, -0.643533, -0.638934), (0.380123, 0.410559, 0.437367),
             (3.685044, 4.266495, 4.539742)),
            ((-0.998888, -1.020153, -1.027479), (0.857998, 0.703913, 0.573625),
             (64.208486, 63.919687, 43.809866)),
        ),
    ),
}
# fmt: on
"""Fits to measurements of Cornell University: the diffuse reflectance and three lobes of each.

References
----------
Lafortune et al. 1997, Non-linear approximation of reflectance functions (the paint);
Marschner et al. 1999, Image-based BRDF measurement including human skin (skin); Westin 2000,
Lafortune BRDF for RenderMan (all of these numbers).
"""


class Lafortune(Brdf):
    """``f_r = diffuse / pi + sum (C_xy (L_x V_x + L_y V_y) + C_z L_z V_z)^n`` above the horizon.

    A lobe counts where the base of its power is positive. With C_xy = -1 and C_z = 1 it lies about
    the mirror direction, with C_xy = C_z = 1 about the way back to the light. The lobes are not
    normalized. The fits follow the data where there were any, and may reflect more than they
    receive towards grazing angles.
    """

    name = "lafortune"
    summary = "generalised cosine lobes: one of your own, or fits to measured materials"
    source = "Lafortune et al. 1997; fits: Marschner et al. 1999, Westin 2000"
    parameters = (
        Parameter("fit", "none", meaning="a measured material, in place of all others",
                  choices=("none", *FITS)),
        Parameter("diffuse", (0.2, 0.2, 0.2), 0.0, 1.0, "diffuse reflectance"),
        Parameter("cxy", (-0.98, -0.98, -0.98), -1.2, 1.2, "C_xy: below 0 mirrors"),
        Parameter("cz", (0.98, 0.98, 0.98), -1.2, 1.2, "C_z"),
        Parameter("exponent", (20.0, 20.0, 20.0), 0.0, 300.0, "n: larger is sharper"),
    )  # fmt: skip

    def __init__(self, **values: Value) -> None:
        super().__init__(**values)
        fit = str(self.values["fit"])
        if fit == "none":
            self._diffuse = self.color("diffuse")
            self._lobes: tuple[Lobe, ...] = (
                (self.color("cxy"), self.color("cz"), self.color("exponent")),
            )
            return
        if len(values) > 1:
            raise BrdfError(f"{self.name}: fit={fit} has numbers of its own; give it alone")
        self.values = {"fit": fit}
        self._diffuse, self._lobes = FITS[fit]

    def evaluate(self, light: Array, view: Array) -> Array:
        across, up = tangential(light, view), light[..., 2] * view[..., 2]
        everything = (self._diffuse, *(triple for lobe in self._lobes for triple in lobe))
        channels = []
        for channel in range(1 if all(map(is_grey, everything)) else 3):
            value = np.full_like(up, self._diffuse[channel] / np.pi)
            for c_xy, c_z, exponent in self._lobes:
                value += power(c_xy[channel] * across + c_z[channel] * up, exponent[channel])
            channels.append(above_horizon(value, light, view))
        if len(channels) == 1:
            return colored(channels[0], (1.0, 1.0, 1.0))
        return np.stack(channels, axis=-1)
