"""The lobe that a split sum knows of a material: that of the view along the normal.

A split sum looks along the normal, where N = V = R, and takes what it sees for the lobe about the
mirror direction of every view. So the lobe depends on the angle from its axis alone.
"""

from abc import abstractmethod
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, Value, check_finite, grey
from shrm_cli.brdf.core import Core
from shrm_cli.errors import BrdfError
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.vocabulary import MIN_ROUGHNESS

_NODES = 256
_HALF = 2 * np.sqrt(np.sqrt(2) - 1)
"""Where GGX's lobe is half of its peak, in radians, as a part of a small ggx_alpha."""
_AXIS = np.array([0.0, 0.0, 1.0])


def square_half_sine(light: Array, view: Array) -> Array:
    """Return ``sin(angle / 2)^2`` of the angle between light and mirror direction, shape (...).

    ``|L - R|^2 / 4`` is exact for small angles, where ``1 - R.L`` would cancel. Both directions,
    shape (..., 3), are in the frame of the normal.
    """
    x, y = light[..., 0] + view[..., 0], light[..., 1] + view[..., 1]
    z = light[..., 2] - view[..., 2]
    return (x * x + y * y + z * z) / 4


class NormalLobe(Brdf):
    """A lobe that depends on the angle from the mirror direction alone, and ends at 90 degrees.

    It is no model of a material, so it is not among the models that have a name.
    """

    includes_cosine = True
    has_horizon = False
    zonal = True
    width: float
    """The ggx_alpha of the lobe of GGX that is as sharp, which says how fine the pixels are to be
    that it is summed over."""
    is_peaked: bool = True
    """Whether the lobe gathers about its axis. That of cloth is a ring about it."""

    def evaluate(self, light: Array, view: Array) -> Array:
        return grey(self.radial(square_half_sine(light, view)))

    @abstractmethod
    def radial(self, square_sine: Array) -> Array:
        """Evaluate the lobe, from the square of the sine of half the angle to its axis."""


def check_varies(brdf: Brdf) -> None:
    """Check that a BRDF has a lobe for every roughness, and that none is asked for."""
    if not brdf.isotropic:
        MaterialLobe(brdf)
    rough = brdf.at_roughness(1.0)
    MaterialLobe(rough if rough.has_horizon else brdf)
    usual = type(brdf)().values
    for name in brdf.roughness_names:
        if brdf.values[name] != usual[name]:
            level = perceptual_roughness(brdf)
            raise BrdfError(
                f"{brdf!r}: all roughnesses are made; leave {name} out, and look them up at "
                f"roughness {level:.4g}, as engines have it"
            )


def perceptual_roughness(brdf: Brdf) -> float:
    """Return the roughness of an isotropic BRDF that has one, as engines have it, in 0 .. 1."""
    return float(brdf.number(brdf.roughness_names[0]) ** (1 / brdf.roughness_power))


class MaterialLobe(NormalLobe):
    """The lobe ``f_r N.L`` of any isotropic BRDF for ``N = V``, normalized to be a mean of light.

    It is the mean of the lobes of the three channels: one lobe for all of them.
    """

    def __init__(self, material: Brdf) -> None:
        if not material.isotropic or material.center == "tangent":
            raise BrdfError(
                f"{material!r}: a split sum is of a lobe that is the same all around; a principal "
                "map holds this one"
            )
        if not material.has_horizon:
            raise BrdfError(
                f"{material!r}: a split sum is of one lobe above the surface; a principal map "
                "holds this one"
            )
        self.material = material
        self.name = f"{material.name}-lobe"
        self.values: dict[str, Value] = dict(material.values)
        self._factor = 1.0
        whole = self._whole()
        check_finite(whole, material)
        if whole <= 0:
            less = "less than " if whole < 0 else ""
            raise BrdfError(f"{material!r}: along the normal it reflects {less}nothing")
        core = Core.of(self)
        self.width = min(float(core.widths[0] / _HALF), 1.0)
        peak = self.radial(np.linspace(0, 0.5, _NODES)).max()
        self.is_peaked = bool(2 * self.radial(np.zeros(1))[0] > peak)
        self._factor = 1 / self._whole()

    def radial(self, square_sine: Array) -> Array:
        sine = 2 * np.sqrt(square_sine * np.maximum(1 - square_sine, 0))
        light = np.stack([sine, np.zeros_like(sine), 1 - 2 * square_sine], axis=-1)
        return self.material.transfer(light, _AXIS).mean(axis=-1) * self._factor

    def _whole(self) -> float:
        """The integral over the hemisphere.

        It substitutes ``tan(angle / 2) = width sinh(x)``, since lobes of all widths are smooth in
        x. Before the width is known it is as fine as the sharpest lobe wants.
        """
        scale = getattr(self, "width", 1e-3)
        nodes, weights = gauss_legendre(_NODES)
        end = np.arcsinh(1 / scale)
        x = (nodes + 1) / 2 * end
        tangent = scale * np.sinh(x)
        square_sine = tangent**2 / (1 + tangent**2)
        # The solid angle is 4 pi d(square_sine).
        rings = 8 * np.pi * scale * np.cosh(x) * tangent / (1 + tangent**2) ** 2
        return float(end / 2 * np.sum(weights * rings * self.radial(square_sine)))


_GGX_NODES = 128


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
        nodes, weights = gauss_legendre(_GGX_NODES)
        end = np.arcsinh(1 / self.width)
        x = (nodes + 1) / 2 * end
        square_tangent = a2 * np.sinh(x) ** 2
        cosine = (1 - square_tangent) / (1 + square_tangent)
        visible = cosine / (cosine + np.sqrt(a2 + (1 - a2) * cosine**2))
        # Here D N.H dH = 2 tanh(x) / cosh(x)^2 dx dphi / (2 pi), and dL = 4 N.H dH.
        whole = 2 * end * np.sum(weights * visible * 2 * np.tanh(x) / np.cosh(x) ** 2)
        return float(1 / (np.pi * a2 * whole))
