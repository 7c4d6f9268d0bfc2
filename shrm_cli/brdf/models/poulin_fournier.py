"""Poulin and Fournier's brushed surface: a row of parallel cylinders."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, added
from shrm_cli.brdf.models.blinn_phong import normalization
from shrm_cli.brdf.vectors import METALS, above_horizon, colored, cosines, half_vector, power
from shrm_cli.sphere.quadrature import gauss_legendre

_NODES = 32


class PoulinFournier(Brdf):
    """Light reflected once by half cylinders of radius 1 along x, their axes `distance` apart.

    The BRDF is ``f_r = int f (n.L) (n.V) ds / (distance N.L N.V)``, an integral over the part of
    one period of the profile that is lit and visible. There n is the local normal, and ``f =
    diffuse / pi + specular (e+2) (e+4) / (8 pi (2^(-e/2) + e)) (n.H)^e``. The cylinders hide parts
    of each other and of the floor between them, which is level with their axes. Choose diffuse +
    specular <= 1.

    Poulin and Fournier also have cylinders that protrude from the floor by any part or are cut
    into it, and several directions of cylinders at one place. They approximate by a polynomial
    what is a quadrature here.
    """

    name = "poulin-fournier"
    summary = "brushed surface of parallel cylinders, anisotropic"
    source = "Poulin and Fournier 1990, A model for anisotropic reflection; simplified"
    parameters = (
        Parameter("distance", 2.0, 2.0, 20.0, "of the cylinders' axes, in radii"),
        Parameter("exponent", 20.0, 0.0, 100.0, "e: larger is sharper"),
        Parameter("diffuse", (0.1, 0.1, 0.1), 0.0, 1.0, "diffuse reflectance of the cylinders"),
        Parameter(
            "specular", (0.6, 0.6, 0.6), 0.0, 1.0, "specular reflectance of them", names=METALS
        ),
    )
    isotropic = False

    def evaluate(self, light: Array, view: Array) -> Array:
        distance = self.number("distance")
        lit, seen = _open_parts(light, distance), _open_parts(view, distance)
        low, high = np.maximum(lit[0], seen[0]), np.minimum(lit[1], seen[1])
        width = np.maximum(high - low, 0.0)
        floor = np.minimum(lit[3], seen[3]) - np.maximum(lit[2], seen[2])
        half = half_vector(light, view)
        exponent = self.number("exponent")
        # On the floor the local normal n is N.
        product = np.maximum(light[..., 2] * view[..., 2], 0.0) * np.maximum(floor, 0.0)
        diffuse, specular = product, product * power(np.minimum(half.z, 1.0), exponent)
        for node, weight in zip(*gauss_legendre(_NODES), strict=True):
            turn = low + width * float((node + 1) / 2)
            sine, cosine = np.sin(turn), np.cos(turn)
            facing = np.maximum(light[..., 1] * sine + light[..., 2] * cosine, 0.0)
            facing = facing * np.maximum(view[..., 1] * sine + view[..., 2] * cosine, 0.0)
            facing = facing * width * float(weight / 2)
            towards_half = np.minimum(half.y * sine + half.z * cosine, 1.0)
            diffuse, specular = (
                diffuse + facing,
                specular + facing * power(towards_half, exponent),
            )
        light_cosine, view_cosine = cosines(light, view)
        projected = distance * light_cosine * view_cosine
        diffuse = above_horizon(diffuse / (np.pi * projected), light, view)
        specular = above_horizon(specular * normalization(exponent) / projected, light, view)
        colors = self.color("diffuse"), self.color("specular")
        return added([colored(diffuse, colors[0]), colored(specular, colors[1])])


def _open_parts(direction: Array, distance: float) -> tuple[Array, Array, Array, Array]:
    """The parts of one period that rays of a direction reach: of a cylinder, and of the floor.

    Angles on the cylinder are from z towards y. The inclination is the angle of the ray from z in
    the plane of y and z. A ray that touches the next cylinder meets this one at an angle with
    ``sin(angle - inclination) = distance cos(inclination) - 1``, or the floor at ``distance - 1 /
    cos(inclination)`` from this cylinder's axis.

    Returns `low` and `high`, each of shape (...), the range of angles on the cylinder, radians; and
    `start` and `end`, each of shape (...), the range of places on the floor, measured from the axis
    in radii; it is empty where start >= end.
    """
    y, z = direction[..., 1], np.maximum(direction[..., 2], 0.0)
    inclination = np.arctan2(np.abs(y), z)
    # The length of the shadow is 1 / cos(inclination), and the cosine is z / hypot(y, z).
    shadow = np.hypot(y, z) / np.maximum(z, np.finfo(z.dtype).tiny)
    shadow = np.where(np.isfinite(shadow), shadow, distance)
    reach = inclination + np.arcsin(np.clip(distance * np.cos(inclination) - 1, -1.0, 1.0))
    low, high = inclination - np.pi / 2, np.minimum(reach, np.pi / 2)
    from_right = y > 0
    return (
        np.where(from_right, low, -high),
        np.where(from_right, high, -low),
        np.where(from_right, 1.0, shadow).astype(z.dtype),
        np.where(from_right, distance - shadow, distance - 1).astype(z.dtype),
    )
