"""The surface that maps of light alone are shown as, and a check of its roughness."""

from collections.abc import Mapping

from shrm_cli.brdf.base import Color
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.vocabulary import DEFAULT_TAPS

_ROUNDING = 1e-6
"""How far a roughness may lie outside a map's range, which files hold as 32-bit floats."""


def ggx_surface(
    roughness: float | None = None, f0: Color | None = None, anisotropy: float | None = None
) -> Ggx:
    """Return the GGX surface that maps are shown as.

    Parameters
    ----------
    roughness : float, optional
        Perceptual roughness: GGX's alpha is its square. The default is that of `Ggx`.
    f0 : tuple of 3 float, optional
        Reflectance at normal incidence, linear RGB. The default is that of `Ggx`.
    anisotropy : float, optional
        That of glTF; without it the surface is not brushed.

    Raises
    ------
    BrdfError
        If a parameter is out of its range.
    """
    given = {"roughness": roughness, "f0": f0, "anisotropy": anisotropy or None}
    return Ggx(**{key: value for key, value in given.items() if value is not None})


def shown_as(made: Map, surface: Ggx, taps: int | None = None) -> ReflectedLight:
    """Return the light of a map as a GGX surface reflects it; see `Map.shaded`."""
    anisotropy = 0.0 if surface.isotropic else surface.number("anisotropy")
    numbers = surface.number("roughness"), surface.color("f0"), anisotropy
    return made.shaded(*numbers, taps or DEFAULT_TAPS)


def reflectance(value: str, primaries: tuple[float, ...] | None = None) -> Color:
    """Return the linear RGB, each channel within 0 .. 1, that a text such as ``gold`` means.

    Parameters
    ----------
    value : str
    primaries : tuple of 8 float, optional
        The chromaticities of the light, which the colors of metals are converted to.

    Raises
    ------
    BrdfError
        If it is no color.
    """
    return parse_spec(f"ggx:f0={value}", primaries=primaries).color("f0")


def outside_range(maps: Mapping[str, Map], roughness: float) -> list[str]:
    """Return a warning for each map that was not made for a roughness.

    Parameters
    ----------
    maps : mapping of str to Map
        Maps by the names of their files.
    roughness : float
        Perceptual roughness.

    Returns
    -------
    list of str
    """
    lines = []
    for path, each in maps.items():
        low, high = each.roughness_range
        if not low - _ROUNDING <= roughness <= high + _ROUNDING:
            made = f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"
            lines.append(f"{path}: it was made for roughness {made}, not {roughness:g}")
    return lines
