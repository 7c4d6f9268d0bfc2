"""Materials of glTF and GLB files: their factors, and the means of their textures."""

from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.imported.surfaces import Material, chosen
from shrm_cli.errors import BrdfError, MeshError
from shrm_cli.files.gltf import Json, buffers_of, index_in, list_of, picture_of, read_tree, table
from shrm_cli.files.texture import mean_color

_BASE = "pbrMetallicRoughness"
_FIELDS: dict[str, tuple[str, str, Any, str, Any]] = {
    "base_color": (_BASE, "baseColorFactor", (1.0, 1.0, 1.0), "baseColorTexture", "rgb"),
    "metallic": (_BASE, "metallicFactor", 1.0, "metallicRoughnessTexture", 2),
    "roughness": (_BASE, "roughnessFactor", 1.0, "metallicRoughnessTexture", 1),
    "ior": ("ior", "ior", 1.5, "", 0),
    "specular": ("specular", "specularFactor", 1.0, "specularTexture", 3),
    "specular_color": (
        "specular", "specularColorFactor", (1.0, 1.0, 1.0), "specularColorTexture", "rgb",
    ),
    "clearcoat": ("clearcoat", "clearcoatFactor", 0.0, "clearcoatTexture", 0),
    "clearcoat_roughness": (
        "clearcoat", "clearcoatRoughnessFactor", 0.0, "clearcoatRoughnessTexture", 1,
    ),
    "sheen_color": ("sheen", "sheenColorFactor", (0.0, 0.0, 0.0), "sheenColorTexture", "rgb"),
    "sheen_roughness": ("sheen", "sheenRoughnessFactor", 0.0, "sheenRoughnessTexture", 3),
    "anisotropy_strength": ("anisotropy", "anisotropyStrength", 0.0, "anisotropyTexture", 2),
    "anisotropy_rotation": ("anisotropy", "anisotropyRotation", 0.0, "", 0),
    "transmission": ("transmission", "transmissionFactor", 0.0, "", 0),
    "diffuse_transmission": ("diffuse_transmission", "diffuseTransmissionFactor", 0.0, "", 0),
    "iridescence": ("iridescence", "iridescenceFactor", 0.0, "iridescenceTexture", 0),
    "iridescence_ior": ("iridescence", "iridescenceIor", 1.3, "", 0),
    "iridescence_thickness": (
        "iridescence", "iridescenceThicknessMaximum", 400.0, "iridescenceThicknessTexture", 1,
    ),
    "emissive": ("", "emissiveFactor", (0.0, 0.0, 0.0), "", 0),
}  # fmt: skip
"""Where each value is: its extension (empty: the material itself), the factor and its default, the
texture, and the channel of that, or ``rgb`` for a color in sRGB."""
_REPLACING = "pbrSpecularGlossiness", "unlit"
"""Extensions in the place of metallic and roughness."""
_KNOWN = {field[0] for field in _FIELDS.values()} | {"volume", "dispersion", "emissive_strength"}
_NORMALS = (
    ("", "normalTexture"), ("", "occlusionTexture"), ("clearcoat", "clearcoatNormalTexture"),
)  # fmt: skip


def read_gltf_material(name: str, data: bytes, wanted: str) -> Material:
    """A material of a glTF or GLB file, by its name or its number.

    Buffers and textures are looked for in its folder. `wanted` is empty for the only material.
    """
    try:
        tree, chunk = read_tree(name, data)
        materials = list_of(tree, "materials")
        names = [str(table(each).get("name", ""))[:80] for each in materials]
        given = table(materials[chosen(name, names, wanted)])
        return _Reader(name, tree, chunk, given).material()
    except MeshError as error:
        raise BrdfError(str(error)) from error
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError) as error:
        why = " ".join(str(error).split())[:160]
        raise BrdfError(f"{name}: its material cannot be used ({why})") from error


class _Reader:
    """One material, and what its file holds besides."""

    def __init__(self, name: str, tree: Json, chunk: bytes | None, given: Json) -> None:
        self.name, self.tree, self.chunk, self.given = name, tree, chunk, given
        self.averaged: list[str] = []

    def material(self) -> Material:
        extensions = table(self.given.get("extensions", {}))
        ours = {str(each).removeprefix("KHR_materials_") for each in extensions}
        for each in _REPLACING:
            if each in ours:
                raise ValueError(f"{each} takes the place of metal and roughness; convert it")
        values = {each: self._value(*field) for each, field in _FIELDS.items()}
        values["iridescence_thickness"] += self._least_thickness()
        if self.given.get("alphaMode", "OPAQUE") != "OPAQUE":
            values["alpha"] = self._alpha()
        unread = [key for place, key in _NORMALS if key in self._table(place)]
        unread += [f"extension {each[:40]!r}" for each in sorted(ours - _KNOWN)]
        return Material("gltf_pbr", values, self.averaged, unread)

    def _table(self, place: str) -> Json:
        if place in ("", _BASE):
            return table(self.given.get(place, {})) if place else self.given
        extensions = table(self.given.get("extensions", {}))
        return table(extensions.get(f"KHR_materials_{place}", {}))

    def _value(self, place: str, key: str, default: Any, texture: str, channel: Any) -> Any:
        held = self._table(place)
        is_color = isinstance(default, tuple)
        factor = held.get(key, default)
        values = [float(each) for each in (factor[:3] if is_color else [factor])]
        if len(values) < (3 if is_color else 1) or not np.isfinite(values).all():
            raise ValueError(f"its {key} is {str(factor)[:40]}")
        if texture in held:
            self.averaged.append(texture)
            mean = self._mean(table(held[texture]), channel == "rgb")
            values = list(values * (mean[:3] if channel == "rgb" else mean[channel : channel + 1]))
        return tuple(map(float, values)) if is_color else float(values[0])

    def _least_thickness(self) -> float:
        """What a texture of a film's thickness adds where it is dark, nm."""
        place, key = "iridescence", "iridescenceThicknessMinimum"
        dark, bright = (
            self._value(place, key, 100.0, each, 1) for each in ("", "iridescenceThicknessTexture")
        )
        return float(dark - bright)

    def _alpha(self) -> float:
        held = self._table(_BASE)
        alpha = float([*held.get("baseColorFactor", ()), 1, 1, 1, 1][:4][3])
        if "baseColorTexture" in held:
            alpha *= self._mean(table(held["baseColorTexture"]), True)[3]
        return float(alpha)

    def _mean(self, texture: Json, is_srgb: bool) -> Array:
        textures = list_of(self.tree, "textures")
        named = table(textures[index_in(texture["index"], textures)])
        return mean_color(picture_of(self.name, self.tree, self._buffers, named), is_srgb)

    def _buffers(self) -> list[bytes]:
        return buffers_of(self.name, self.tree, self.chunk)
