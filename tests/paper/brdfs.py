"""BRDFs of the paper's figures that `shrm` does not have."""

import numpy as np

from shrm_cli.brdf.base import Array, Brdf, Parameter, grey


class KajiyaKay(Brdf):
    """``rho_hat = cos^s(theta_i - theta_o)`` about the central direction (section 5.7.1).

    Kajiya and Kay's hair has the tangent for a centre. Here it is the normal, which is the same
    mathematics: no dependence on the azimuth, and a cone of highlights that moves with the view.
    """

    name = "kajiya-kay"
    summary = "a cone of highlights about the central direction, a transfer function"
    source = "Kajiya and Kay 1989; Ramamoorthi 2002, section 5.7.1"
    parameters = (Parameter("exponent", 32.0, 1.0, 1e3, "s: larger is sharper"),)
    center = "normal"
    includes_cosine = True
    has_horizon = False

    def evaluate(self, light: Array, view: Array) -> Array:
        incident, outgoing = (
            np.arctan2(np.hypot(each[..., 0], each[..., 1]), each[..., 2]) for each in (light, view)
        )
        cosine = np.maximum(np.cos(incident - outgoing), 0)
        exponent = self.values["exponent"]
        return grey((exponent + 1) / (2 * np.pi) * cosine**exponent)
