"""A BRDF of one's own: Minnaert's, which darkens the rim of the moon, or brightens it.

shrm brdf examples/my_brdf.py:Minnaert
shrm prefilter probe.exr --brdf examples/my_brdf.py:Minnaert:k=2,albedo=0.8/0.7/0.6
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli import Brdf, Parameter

Array = NDArray[np.floating]


class Minnaert(Brdf):
    """``f_r = albedo (k + 1) / (2 pi) (N.L N.V)^(k - 1)`` above the horizon.

    So normalized it reflects exactly `albedo` of a uniform light when seen along the normal.

    References
    ----------
    Minnaert 1941, The reciprocity principle in lunar photometry, Astrophysical Journal 93.
    """

    name = "minnaert"
    summary = "diffuse reflection whose rim is darker than Lambert's"
    source = "Minnaert 1941, The reciprocity principle in lunar photometry"
    parameters = (
        Parameter("k", 1.5, 1.0, 10.0, "1 is Lambert's law, larger darkens the rim"),
        Parameter("albedo", (1.0, 1.0, 1.0), 0.0, 1.0, "reflectance seen along the normal"),
    )
    center = "normal"

    def evaluate(self, light: Array, view: Array) -> Array:
        """Return the BRDF (1/sr), shape (..., 3), for unit directions in the normal's frame."""
        k = self.number("k")
        # N is the z axis, so the cosines are the z components. A view from below is never seen:
        # it takes the value from above, which spares the map a jump at its horizon.
        cosines = np.maximum(light[..., 2], 0) * np.abs(view[..., 2])
        value = (k + 1) / (2 * np.pi) * cosines ** (k - 1)
        value = np.where(light[..., 2] > 0, value, 0)
        # One value for each of R, G and B, of the directions' precision.
        return value[..., None] * np.array(self.color("albedo"), dtype=light.dtype)
