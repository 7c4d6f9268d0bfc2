"""A thin film, such as of soap or oxide, which reflects some wavelengths more: iridescence.

What both of its sides reflect adds up as waves do. For each wavelength and both polarizations that
is Airy's sum with Fresnel's equations, exact. A spectrum is seen as Rec.709 under D65.
"""

from functools import lru_cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color, Parameter
from shrm_cli.brdf.vectors import GRAZING, interpolated, refracted_cosine
from shrm_cli.errors import BrdfError

Film = tuple[float, float]
"""The thickness of a film, nm, and its index of refraction, both as in air: within a medium, the
thickness is times the medium's index, and the index over that."""
FILM = (
    Parameter("film", 400.0, 0.0, 5000.0, "thickness of a thin film on it, nm", is_optional=True),
    Parameter("film_ior", 1.3, 1.0, 3.0, "the film's index of refraction", is_optional=True),
)
"""The parameters of a film, as KHR_materials_iridescence has them."""
COSINES = np.linspace(GRAZING, 1, 257)
"""Where reflectances are tabulated. Linear between them, they are exact to 2e-3."""
_WAVELENGTHS = np.arange(380.0, 781.0)
_WHITE = 1 - 1e-12
"""The most that a surface reflects: of one that reflects all, no index of refraction is known."""


def covered(brdf: Brdf, film: Film | None) -> Film | None:
    """Record a film among the values of a lobe that has one, and return it."""
    if film:
        brdf.values |= {"film": film[0], "film_ior": film[1]}
    return film


def film_of(brdf: Brdf) -> Film | None:
    """The thickness and index of refraction of a BRDF's film, whose default joins its values."""
    if "film" in brdf.values:
        # It stands where it would if it had been given, so that records are parsed to the same.
        values = {"film_ior": FILM[1].default, **brdf.values}
        own = [each.name for each in brdf.parameters if each.name in values]
        brdf.values = {name: values[name] for name in dict.fromkeys([*own, *values])}
        return brdf.number("film"), brdf.number("film_ior")
    if "film_ior" in brdf.values:
        raise BrdfError(f"{brdf.name}: film_ior applies with film")
    return None


def film_reflectance(cosine: Array, f0: Color, thickness: float, ior: float) -> Array:
    """Reflectance of a surface with a film, in air.

    `cosine`, of shape (...), is that of the angle to the normal, 0 .. 1. `f0` is what the surface
    reflects at normal incidence without the film. Each channel has the real index of refraction
    that follows from its f0, as in KHR_materials_iridescence. `thickness` is that of the film, nm.
    `ior` is the film's index of refraction.

    Returns an array of shape (..., 3): linear Rec.709, within 0 .. 1: colors outside of it become
    the nearest within.
    """
    table = film_table(f0, thickness, ior)
    place = (cosine - GRAZING) * ((len(COSINES) - 1) / (1 - GRAZING))
    row = np.clip(np.floor(place), 0, len(COSINES) - 2)
    return interpolated(table, row, place - row)


@lru_cache(maxsize=16)
def film_table(f0: Color, thickness: float, ior: float) -> Array:
    """What `film_reflectance` returns at `COSINES`, shape (257, 3)."""
    from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb  # only films need it

    # In a coat a film may have the smaller index. Where light turns back at it, waves fade within.
    within = np.sqrt(1 - (1 - COSINES**2) / ior**2 + 0j)
    wave = np.exp(4j * np.pi * ior * thickness * within[:, None] / _WAVELENGTHS)
    air, film = (1.0, COSINES), (ior, within)
    table = np.empty((len(COSINES), 3))
    for each in set(f0):
        root = np.sqrt(min(each, _WHITE))
        index = (1 + root) / (1 - root)
        base = index, refracted_cosine(COSINES, index)
        spectra = [
            _interference(_amplitude(air, film, power), _amplitude(film, base, power), wave)
            for power in (1, -1)
        ]
        has_it = np.equal(f0, each)
        table[:, has_it] = to_linear_srgb(_WAVELENGTHS, sum(spectra) / 2)[:, has_it]
    return np.clip(table, 0, 1)


def _amplitude(above: tuple[float, Array], below: tuple[float, Array], power: int) -> Array:
    """Fresnel's amplitude at a border of media, each an index and cosines, but for its sign.

    The power of the index is 1 for light polarized across the plane of incidence, -1 along it.
    """
    here, there = (index**power * cosine for index, cosine in (above, below))
    return np.asarray((here - there) / (here + there))


def _interference(outer: Array, inner: Array, wave: Array) -> Array:
    """Airy's sum of all reflections: amplitudes of both sides, and the wave that comes back."""
    first, second = outer[:, None], inner[:, None] * wave
    return np.asarray(np.abs((first + second) / (1 + first * second)) ** 2)
