"""GGX as split sums have it: its lobe seen along the normal, moved to the mirror direction."""

from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Parameter, Value
from shrm_cli.brdf.environment.lobe import NormalLobe
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.vocabulary import MIN_ROUGHNESS

_NODES = 128


class GgxLobe(NormalLobe):
    """The lobe ``f_DV N.L`` of `Ggx` for ``N = V = R``, normalized to be a mean of light about R.

    f_DV is the BRDF without Fresnel's term. With ``c = R.L`` and H half way between R and L,
    ``rho_hat = k D(R.H) c / (c + sqrt(a^2 + (1 - a^2) c^2))``, where k makes the integral over the
    hemisphere 1.
    """

    name = "ggx-lobe"
    summary = "GGX seen along the normal, normalised: the kernel of the split sum"
    source = "Karis 2013; Silvennoinen et al. 2025, section 3.2"
    parameters = (
        Parameter(
            "roughness", 0.4, MIN_ROUGHNESS, 1.0, "perceptual roughness, the root of GGX's alpha"
        ),
    )

    def __init__(self, **values: Value) -> None:
        super().__init__(**values)
        self.width = self.number("roughness") ** 2

    def radial(self, square_sine: Array) -> Array:
        cosine = np.maximum(1 - 2 * square_sine, 0)
        a2 = self.width**2
        distribution = (self._peak * a2 * a2) / (a2 + (1 - a2) * square_sine) ** 2
        return distribution * cosine / (cosine + np.sqrt(a2 + (1 - a2) * cosine**2))

    @cached_property
    def _peak(self) -> float:
        """The factor k D(1).

        The integral over the lobe substitutes ``tan(angle / 2) = a sinh(x)``, since lobes of all
        widths are smooth in x.
        """
        a2 = self.width**2
        nodes, weights = gauss_legendre(_NODES)
        end = np.arcsinh(1 / self.width)
        x = (nodes + 1) / 2 * end
        square_tangent = a2 * np.sinh(x) ** 2
        cosine = (1 - square_tangent) / (1 + square_tangent)
        visible = cosine / (cosine + np.sqrt(a2 + (1 - a2) * cosine**2))
        # Here D N.H dH = 2 tanh(x) / cosh(x)^2 dx dphi / (2 pi), and dL = 4 N.H dH.
        whole = 2 * end * np.sum(weights * visible * 2 * np.tanh(x) / np.cosh(x) ** 2)
        return float(1 / (np.pi * a2 * whole))
