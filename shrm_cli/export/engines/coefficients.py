"""Nine lighting coefficients as JSON, for programs of one's own: each convention by its name."""

import json

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.export import harmonics
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import TexelFormat

_BASIS = (
    "real orthonormal spherical harmonics without Condon-Shortley phase, index l(l+1)+m: 1, y, z, "
    "x, xy, yz, 3zz-1, xz, xx-yy; right-handed axes, +Y up"
)
_MEANINGS = {
    "radiance": "L_lm of the light itself; sum L_lm Y_lm(d) is its radiance to degree 2",
    "irradiance": "A_l L_lm, A = pi, 2 pi/3, pi/4; sum A_l L_lm Y_lm(n) is E(n), without 1/pi",
    "polynomial": "multiply 1, y, z, x, xy, yz, 3zz-1, xz, xx-yy of n and add up: E(n)/pi. "
    "Filament's sh.txt",
    "three": "27 numbers for SphericalHarmonics3.fromArray of a three.js LightProbe: L_lm",
    "babylon": "polynomials of SphericalPolynomial, (A_l/pi)^2 L_lm, for a right-handed scene that "
    "looks up (x, y, z)",
    "ext_lights_image_based": "irradianceCoefficients of glTF: A_l L_lm, Condon-Shortley phase",
}


def coefficients_json(coefficients: ArrayLike) -> str:
    """Return JSON of nine lighting coefficients L_lm, shape (9, 3), in all conventions.

    Raises ValueError if one is not finite.
    """
    known = np.asarray(coefficients, dtype=float)
    record = {
        "basis": _BASIS,
        "meanings": _MEANINGS,
        "radiance": known.tolist(),
        "irradiance": (np.pi * harmonics.irradiance_over_pi(known)).tolist(),
        "polynomial": harmonics.filament(known).tolist(),
        "three": harmonics.three(known).ravel().tolist(),
        "babylon": harmonics.babylon(known),
        "ext_lights_image_based": harmonics.ext_lights_image_based(known).tolist(),
    }
    return json.dumps(record, indent=1, allow_nan=False) + "\n"


def add_coefficients(made: Package, name: str, values: Array, meaning: str, axes: str) -> None:
    """Add coefficients, shape (9, 3), to a package: a list for each channel.

    `meaning` and `axes` are what the numbers are, and the axes that they are in, for people.
    """
    red, green, blue = (values[:, channel].tolist() for channel in range(3))
    found = {"meaning": meaning, "axes": axes, "red": red, "green": green, "blue": blue}
    made.add_text(name, json.dumps(found, indent=1) + "\n")


class Coefficients(Engine):
    """Programs of one's own."""

    name = "json"
    title = "JSON of nine coefficients"
    wants_levels = False

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        coefficients = light.nine()
        if coefficients is not None:
            made.add_text(f"{light.name}_sh.json", coefficients_json(coefficients))
            made.told.append("sh: in each convention by its name; nothing is turned")
        return made
