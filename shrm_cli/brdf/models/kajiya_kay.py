"""Kajiya and Kay's highlight of hair and fur, a function of the angles to the tangent."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, grey
from shrm_cli.brdf.vectors import power


class KajiyaKay(Brdf):
    """``rho_hat = cos(theta_i - theta_o)^s`` where the cosine is positive, and 0 elsewhere.

    Both angles are from the tangent: light and view are given in a frame whose z axis is the
    TANGENT. The peak is 1, as in the paper of Kajiya and Kay, so the lobe is not normalized.
    Under uniform light of radiance 1 a fiber seen from the side shines with ``2 pi^(3/2) Gamma(s/2
    + 1) / Gamma(s/2 + 3/2)``, which is 2.72 for s = 32. A fiber has no horizon, and light from all
    azimuths around it counts alike.
    """

    name = "kajiya-kay"
    summary = "highlight of fibres, about the tangent; a transfer function that is not normalised"
    source = "Kajiya and Kay 1989; as Ramamoorthi 2002, section 5.3.1"
    parameters = (Parameter("exponent", 32.0, 0.0, 1e4, "s: larger is sharper"),)
    center = "tangent"
    includes_cosine = True
    has_horizon = False

    def evaluate(self, light: Array, view: Array) -> Array:
        light_cosine, view_cosine = light[..., 2], view[..., 2]  # with the tangent
        light_sine = np.hypot(light[..., 0], light[..., 1])
        view_sine = np.hypot(view[..., 0], view[..., 1])
        cosine = light_cosine * view_cosine + light_sine * view_sine
        return grey(power(np.minimum(cosine, 1.0), self.number("exponent")))
