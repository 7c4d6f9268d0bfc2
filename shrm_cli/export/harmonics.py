"""Our nine lighting coefficients in the conventions of engines.

Ours, L, are of radiance, in real harmonics without Condon-Shortley phase, index l(l+1)+m, that is
y, z, x for l = 1 and xy, yz, 3zz-1, xz, xx-yy for l = 2, in world axes (see docs/conventions.md).
Every function takes L, shape (9, 3), in the axes of the engine; `in_axes` changes axes.
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.sphere.harmonics import degrees, polynomial_factors
from shrm_cli.sphere.rotation import transform_coefficients

_CONDON_SHORTLEY = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])


def in_axes(coefficients: ArrayLike, matrix: ArrayLike) -> Array:
    """Return the coefficients of the same light in an engine's axes.

    `coefficients` are of shape (9, 3). `matrix`, of shape (3, 3), leads from world axes to those of
    the engine; it may mirror.
    """
    return np.asarray(transform_coefficients(np.asarray(coefficients, dtype=float), matrix))


def irradiance_over_pi(coefficients: ArrayLike) -> Array:
    """Return ``A_l L_lm / pi``, shape (9, 3): harmonics with these make ``E / pi``."""
    return lambert_factors(2)[degrees(2)][:, None] / np.pi * np.asarray(coefficients)


def filament(coefficients: ArrayLike) -> Array:
    """Return what Filament's shaders multiply with 1, y, z, x, xy, yz, 3zz-1, xz, xx-yy.

    Their sum is ``E / pi``, the light that a white diffuse surface reflects.
    """
    return irradiance_over_pi(coefficients) * polynomial_factors()[:, None]


def three(coefficients: ArrayLike) -> Array:
    """Return what three.js' `LightProbe` holds: L itself; its shader multiplies with A_l."""
    return np.asarray(coefficients, dtype=float)


def unity(coefficients: ArrayLike) -> Array:
    """Return what Unity's `SphericalHarmonicsL2` holds, by its index.

    Its shaders multiply ``(s3, s1, s2, s0 - s6)`` with x, y, z, 1, ``(s4, s5, 3 s6, s7)`` with xy,
    yz, zz, zx, and s8 with xx-yy: Filament's polynomials, whose sum is E / pi.
    """
    return filament(coefficients)


def unreal(coefficients: ArrayLike) -> Array:
    """Return what Unreal's `FSHVectorRGB3` holds: radiance, with the Condon-Shortley phase."""
    return np.asarray(coefficients, dtype=float) * _CONDON_SHORTLEY[:, None]


def babylon(coefficients: ArrayLike) -> dict[str, list[float]]:
    """Return the polynomials of Babylon.js' ``.env`` files, RGB by name.

    Their sum ``x X + y Y + .. + xy XY`` is that of harmonics with ``(A_l / pi)^2 L_lm``. Babylon's
    `SphericalHarmonics.FromPolynomial` divides by ``A_l / pi`` again before it shades.
    """
    twice = filament(irradiance_over_pi(coefficients))
    constant, zonal, squares = twice[0], twice[6], twice[8]
    polynomials = {
        "x": twice[3],
        "y": twice[1],
        "z": twice[2],
        "xx": constant - zonal + squares,
        "yy": constant - zonal - squares,
        "zz": constant + 2 * zonal,
        "yz": twice[5],
        "zx": twice[7],
        "xy": twice[4],
    }
    return {name: values.tolist() for name, values in polynomials.items()}


def ext_lights_image_based(coefficients: ArrayLike) -> Array:
    """Return what glTF's EXT_lights_image_based holds as Babylon.js reads it, shape (9, 3).

    They are ``A_l L_lm``, of irradiance, for harmonics with Condon-Shortley phase.
    """
    return np.pi * irradiance_over_pi(coefficients) * _CONDON_SHORTLEY[:, None]
