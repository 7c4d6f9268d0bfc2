"""Surfaces of other programs with OpenPBR's parameters.

What a surface has is a mapping of names, as the node of MaterialX calls its inputs, to numbers and
colors. What is left out has its default.
"""

import math
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from shrm_cli.errors import BrdfError, ShrmWarning
from shrm_cli.messages import first_of
from shrm_cli.records import record

Values = Mapping[str, Any]

_LARGEST_IOR = 3.0
"""The largest of OpenPBR's `specular_ior`."""

LEFT_OUT = (
    "anisotropy_rotation", "specular_rotation", "coat_rotation", "coat_affect_color",
    "coat_affect_roughness",
)  # fmt: skip
"""What is left out where it is not 0: how far what is brushed is turned, since tangents say where
it runs, and what a coat of Standard Surface does to what lies under it."""


def of_gltf(given: Values) -> dict[str, Any]:
    """The parameters of a glTF material, or of ``gltf_pbr``.

    The factor and the color of KHR_materials_specular are those of the dielectric alone, where
    OpenPBR has the metal's too: they fade out as the surface becomes metal.
    """
    metal, sheen = given.get("metallic", 1.0), given.get("sheen_color", (0.0, 0.0, 0.0))
    ior, tint = _border(given.get("ior", 1.5), given.get("specular_color", (1.0, 1.0, 1.0)))
    found = {
        "base_color": given.get("base_color", (1.0, 1.0, 1.0)),
        "base_metalness": metal,
        "specular_weight": _fading(given.get("specular", 1.0), metal),
        "specular_color": [_fading(each, metal) for each in tint],
        "specular_ior": ior,
        "coat_weight": given.get("clearcoat", 0.0),
        "coat_roughness": given.get("clearcoat_roughness", 0.0),
        "coat_ior": 1.5,
        "fuzz_weight": float(max(sheen) > 0),
        "fuzz_color": sheen,
        "fuzz_roughness": given.get("sheen_roughness", 0.0),
        "transmission_weight": max(
            given.get("transmission", 0.0), given.get("diffuse_transmission", 0.0)
        ),
        "emission_luminance": max(given.get("emissive", (0.0,))),
        "geometry_opacity": given.get("alpha", 1.0),
    }
    alpha, strength = given.get("roughness", 1.0) ** 2, given.get("anisotropy_strength", 0.0)
    thickness, ior = given.get("iridescence_thickness", 100.0), given.get("iridescence_ior", 1.3)
    film = _film(given.get("iridescence", 0.0), thickness, ior)
    return {**found, **film, **_brushed(alpha + (1 - alpha) * strength**2, alpha)}


def of_standard_surface(given: Values) -> dict[str, Any]:
    """The parameters of Autodesk's ``standard_surface``, as MaterialX translates it.

    Its `specular` is that of the dielectric alone, as glTF's is, and its coat does not darken what
    lies under it.
    """
    metal = given.get("metalness", 0.0)
    aspect = math.sqrt(1 - min(given.get("specular_anisotropy", 0.0), 0.98))
    alpha = given.get("specular_roughness", 0.2) ** 2
    coat, thickness = given.get("coat", 0.0), given.get("thin_film_thickness", 0.0)
    return {
        "base_weight": given.get("base", 1.0),
        "base_color": given.get("base_color", (0.8, 0.8, 0.8)),
        "base_diffuse_roughness": given.get("diffuse_roughness", 0.0),
        "base_metalness": metal,
        "specular_weight": _fading(given.get("specular", 1.0), metal),
        "specular_color": given.get("specular_color", (1.0, 1.0, 1.0)),
        "specular_ior": given.get("specular_IOR", 1.5),
        "coat_weight": coat,
        "coat_color": given.get("coat_color", (1.0, 1.0, 1.0)),
        "coat_roughness": given.get("coat_roughness", 0.1),
        "coat_roughness_anisotropy": given.get("coat_anisotropy", 0.0) * (coat > 0),
        "coat_ior": given.get("coat_IOR", 1.5),
        "coat_darkening": 1.0 if coat == 0 else 0.0,
        "fuzz_weight": given.get("sheen", 0.0),
        "fuzz_color": given.get("sheen_color", (1.0, 1.0, 1.0)),
        "fuzz_roughness": given.get("sheen_roughness", 0.3),
        "transmission_weight": given.get("transmission", 0.0),
        "subsurface_weight": given.get("subsurface", 0.0),
        "emission_luminance": given.get("emission", 0.0),
        "geometry_opacity": min(given.get("opacity", (1.0,))),
        **_film(float(thickness > 0), thickness, given.get("thin_film_IOR", 1.5)),
        **_brushed(min(alpha / aspect, 1.0), alpha * aspect),
    }


SURFACES: dict[str, Callable[[Values], dict[str, Any]]] = {
    "open_pbr_surface": dict,  # its parameters are OpenPBR's own
    "gltf_pbr": of_gltf,
    "standard_surface": of_standard_surface,
}
"""The surfaces that are read, by the names of their nodes in MaterialX."""


def _border(ior: float, color: Sequence[float]) -> tuple[float, Sequence[float]]:
    """The index and the color of a dielectric's border that OpenPBR's ranges hold.

    In glTF the color may exceed 1, and an index of 0 stands for infinity, so that the color is what
    is reflected along the normal. An index of 3 reflects a quarter there.

    Raises BrdfError if more is reflected, as metals do.
    """
    if 1 <= ior <= _LARGEST_IOR and max(color) <= 1:
        return ior, color
    root = (ior - 1) / (ior + 1) if ior else 1.0
    along = [min(root**2 * each, 1.0) for each in color]
    most = max(along)
    if 0 < ior < 1 or min(color) < 0:
        raise BrdfError(f"its ior is {ior:g} and its specularColorFactor {list(color)}")
    if most > ((_LARGEST_IOR - 1) / (_LARGEST_IOR + 1)) ** 2:
        raise BrdfError(
            f"by ior and specularColorFactor its dielectric reflects {most:.0%} along the normal, "
            "where maps hold 25%; make it a metal"
        )
    if most == 0:
        return 1.5, [0.0, 0.0, 0.0]
    root = math.sqrt(most)
    return (1 + root) / (1 - root), [each / most for each in along]


def _fading(value: float, metal: float) -> float:
    return float(1 - (1 - value) * (1 - metal))


def _film(weight: float, thickness: float, ior: float) -> dict[str, float]:
    """A thin film, whose thickness is in nm, where there is one."""
    if weight == 0:
        return {}
    return {
        "thin_film_weight": weight, "thin_film_thickness": thickness / 1000, "thin_film_ior": ior,
    }  # fmt: skip


def _brushed(across: float, along: float) -> dict[str, float]:
    """The roughness and anisotropy that give alphas by OpenPBR's mapping."""
    ratio = along / across if across > 0 else 1.0
    root = math.sqrt(across * math.sqrt((1 + ratio**2) / 2))
    return {"specular_roughness": root, "specular_roughness_anisotropy": 1 - ratio}


# ---- materials -----------------------------------------------------------------------------------

_LISTED = 12


@record
class Material:
    """A material as a file has it."""

    surface: str
    """One of `SURFACES`."""
    values: dict[str, Any]
    """Numbers, and colors in linear Rec.709."""
    averaged: list[str]
    """The textures whose mean is in the values."""
    left_out: list[str]
    """What is not read."""


def chosen(name: str, names: Sequence[str], wanted: str) -> int:
    """The place of a material among those of a file, by its name or else by its number.

    Warns where a name is the number of another material.
    """
    same = [k for k, each in enumerate(names) if each == wanted] if wanted else []
    if len(same) > 1:
        numbers = [_number(k, names) for k in same]
        raise BrdfError(
            f"{name}: {len(same)} materials are called {wanted[:40]!r}; name one of them after "
            f"a '#' by its number: {first_of(numbers, _LISTED)}"
        )
    is_number = wanted.isascii() and wanted.isdigit() and int(wanted[:9]) < len(names)
    if same:
        if is_number and int(wanted) != same[0]:
            line = (
                f"{name}: {wanted!r} is the name of material {same[0]}, which is taken; name "
                f"material {wanted} as '#{_number(int(wanted), names)}'"
            )
            warnings.warn(line, ShrmWarning, stacklevel=2)
        return same[0]
    if is_number:
        return int(wanted)
    if not names:
        raise BrdfError(f"{name}: it has no material that can be read; name another file")
    if not wanted and len(names) == 1:
        return 0
    what = f"no material is called {wanted[:40]!r}" if wanted else "it has several materials"
    # Those without a name of their own have a number.
    count = Counter(names)
    ways = [
        each if each and count[each] == 1 else _number(k, names) for k, each in enumerate(names)
    ]
    raise BrdfError(f"{name}: {what}; name one after a '#': {first_of(ways, _LISTED)}")


def _number(place: int, names: Sequence[str]) -> str:
    """The number of a material, with zeros before it where it is the name of one."""
    found = str(place)
    while found in names:
        found = f"0{found}"
    return found
