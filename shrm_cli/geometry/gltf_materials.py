"""Materials of glTF files: factors, and textures that multiply them."""

from collections.abc import Callable
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any

from shrm_cli.files import gltf
from shrm_cli.geometry.mesh import MASKED, Matrix, SurfaceMaterial, Texture, Wrap

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST = 9728
_TRANSFORM = "KHR_texture_transform"
_STRONG = "KHR_materials_emissive_strength"
_BRIGHTEST = 1e12
"""The most radiance that a material may send."""
_UV_SETS = 2
_DRAWN = {_STRONG}
"""Extensions of materials that are drawn."""


class SurfaceReader:
    """Reads the materials of a file.

    `name` is the path of the file, whose textures are looked for in its folder. `tree` is its JSON.
    `buffers` returns the bytes of its buffers.
    """

    def __init__(self, name: str, tree: gltf.Json, buffers: Callable[[], list[bytes]]) -> None:
        self._name, self._tree, self._buffers = name, tree, buffers
        self._textures = gltf.list_of(tree, "textures")
        self._pictures: dict[int, Path | bytes | str] = {}

    def material(self, given: gltf.Json, number: int) -> SurfaceMaterial:
        """Return a material; `number` is its place in the file, and the name of one without a name.

        Raises ValueError, KeyError or TypeError if it is damaged, or a texture is not beside the
        file.
        """
        pbr = gltf.table(given.get("pbrMetallicRoughness", {}))
        color = [_unit(each) for each in pbr.get("baseColorFactor", (1, 1, 1, 1))]
        if len(color) < 3:
            raise ValueError("a base colour of less than three numbers")
        extensions = gltf.table(given.get("extensions", {}))
        mode = given.get("alphaMode", "OPAQUE")
        rough = self._texture(pbr, "metallicRoughnessTexture")
        return SurfaceMaterial(
            name=str(given.get("name") or f"material {number}")[:80],
            base_color=(color[0], color[1], color[2]),
            metallic=_unit(pbr.get("metallicFactor", 1)),
            roughness=_unit(pbr.get("roughnessFactor", 1)),
            color_map=self._texture(pbr, "baseColorTexture", True),
            metallic_map=rough,
            roughness_map=rough,
            normal_map=self._texture(given, "normalTexture"),
            normal_scale=_number(gltf.table(given.get("normalTexture", {})).get("scale", 1)),
            occlusion_map=self._texture(given, "occlusionTexture"),
            occlusion_strength=_unit(
                gltf.table(given.get("occlusionTexture", {})).get("strength", 1)
            ),
            emission=_emission(given, extensions),
            emission_map=self._texture(given, "emissiveTexture", True),
            opacity=color[3] if len(color) > 3 else 1.0,
            cutoff={"MASK": _unit(given.get("alphaCutoff", MASKED)), "BLEND": MASKED}.get(mode),
            unread=(
                *(f"alphaMode {mode}" for _ in range(mode == "BLEND")),
                *(str(each)[:40] for each in sorted(set(extensions) - _DRAWN)),
            ),
        )

    def _texture(self, held: gltf.Json, key: str, is_srgb: bool = False) -> Texture | None:
        if key not in held:
            return None
        try:
            return self._laid(held[key], is_srgb)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            return Texture(f"its {key} is damaged ({str(error)[:60]})")

    def _laid(self, given: Any, is_srgb: bool) -> Texture:
        """Return a texture as it lies over the mesh."""
        info = gltf.table(given)
        index = gltf.index_in(info["index"], self._textures)
        named = gltf.table(self._textures[index])
        samplers = gltf.list_of(self._tree, "samplers")
        sampler = gltf.table(
            samplers[gltf.index_in(named["sampler"], samplers)] if "sampler" in named else {}
        )
        moved = gltf.table(gltf.table(info.get("extensions", {})).get(_TRANSFORM, {}))
        uv_set = gltf.natural(moved.get("texCoord", info.get("texCoord", 0)))
        if uv_set >= _UV_SETS:
            raise ValueError(f"a texture over the coordinates TEXCOORD_{uv_set}")
        return Texture(
            self._picture(index, named), is_srgb, uv_set, _matrix(moved),
            (_wrap(sampler, "wrapS"), _wrap(sampler, "wrapT")),
            sampler.get("magFilter") == _NEAREST,
        )  # fmt: skip

    def _picture(self, index: int, named: gltf.Json) -> Path | bytes | str:
        """Return the picture of a texture; the same object for the same one."""
        if index not in self._pictures:
            try:
                found = gltf.picture_of(self._name, self._tree, self._buffers, named)
            except ValueError as error:
                self._pictures[index] = str(error)
            else:
                self._pictures[index] = found
        return self._pictures[index]


def _emission(given: gltf.Json, extensions: gltf.Json) -> tuple[float, float, float]:
    """Return the radiance that a material sends, its factor times its strength."""
    strength = float(gltf.table(extensions.get(_STRONG, {})).get("emissiveStrength", 1))
    if not 0 <= strength <= _BRIGHTEST:
        raise ValueError(f"an emissive strength of {strength}")
    red, green, blue = (strength * _unit(each) for each in given.get("emissiveFactor", (0, 0, 0)))
    return red, green, blue


def _wrap(sampler: gltf.Json, key: str) -> Wrap:
    value = sampler.get(key, 10497)
    if value not in _WRAPS:
        raise ValueError(f"a sampler whose {key} is {str(value)[:20]}")
    return _WRAPS[value]


def _matrix(given: gltf.Json) -> Matrix:
    """Return the matrix of KHR_texture_transform, which scales, rotates, and then moves.

    v points down, and coordinates are rotated counter-clockwise as they are seen.
    """
    (x, y), (across, down) = _pair(given, "offset", 0.0), _pair(given, "scale", 1.0)
    turn = _number(given.get("rotation", 0))
    c, s = cos(turn), sin(turn)
    return c * across, s * down, x, -s * across, c * down, y


def _pair(given: gltf.Json, key: str, default: float) -> tuple[float, float]:
    values = [_number(each) for each in given.get(key, (default, default))]
    if len(values) != 2:
        raise ValueError(f"the {key} of a texture is no pair")
    return values[0], values[1]


def _number(value: Any) -> float:
    number = float(value)
    if not isfinite(number) or abs(number) > 1e6:
        raise ValueError("a number of a material is out of range")
    return number


def _unit(value: Any) -> float:
    return min(max(_number(value), 0.0), 1.0)
