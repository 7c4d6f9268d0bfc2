"""Materials of OBJ files, which other files hold, in the terms of glTF's metallic-roughness model.

Read are `Kd`, the metallic `Pm`, the roughness `Pr`, `Ke` and the opacity `d`, or 1 - `Tr`, and
textures of the first four, of which those of Kd and of a Ke above 0 multiply it, and others replace
the number. `norm` and `map_Bump` are normal maps. Without `Pr` the exponent `Ns` of Phong's
highlight gives the roughness: GGX's alpha^2 = 2 / (Ns + 2), by which the lobes are equally wide
(Walter et al. 2007, section 5.2).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from shrm_cli.errors import MeshError
from shrm_cli.files.texture import referenced_file
from shrm_cli.files.whole import note
from shrm_cli.geometry.mesh import MASKED, SurfaceMaterial, Texture, Wrap

PAINTED = SurfaceMaterial(metallic=0.0, roughness=0.5, colored="srgb")
"""What files without materials have whose vertices have colours."""
_MOST_BYTES = 2**24
_LARGEST = 1e6
_OPTIONS = {
    "-o": 3, "-s": 3, "-t": 3, "-mm": 2, "-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1,
    "-texres": 1, "-bm": 1, "-imfchan": 1, "-boost": 1, "-type": 1,
}  # fmt: skip
"""Options of textures, and the most arguments of each."""
_UNREAD_OPTIONS = {"-mm", "-t"}
_CHANNELS = {"r": 0, "g": 1, "b": 2, "m": 3}
"""The channels of textures that are numbers, by what `-imfchan` calls them."""
_SPARSE = {"-o", "-s", "-t"}
"""The options that need not have all of their arguments, which are numbers."""
_MAPS = {
    "map_Kd": "color_map", "map_Pm": "metallic_map", "map_Pr": "roughness_map",
    "norm": "normal_map", "map_Kn": "normal_map", "map_Ke": "emission_map",
    "map_Bump": "normal_map", "map_bump": "normal_map", "bump": "normal_map",
}  # fmt: skip
_SRGB = {"map_Kd", "map_Ke"}
_REPLACED = {"Ns", "Tr"}
"""What `Pr` and `d` replace."""
_UNREAD = {"map_Ks", "map_d", "disp", "Pc", "Ps", "map_Ns", "refl", "aniso"}


def read_materials(
    name: str, libraries: Sequence[str], wanted: Sequence[str]
) -> list[SurfaceMaterial]:
    """Return the materials that an OBJ file names.

    Materials and textures are looked for in its folder. `libraries` are the lines of it that name
    files of materials, one or several. `wanted` holds the names of the materials. Those that are
    not found are not known, and say so in their `unread`.
    """
    known: dict[str, SurfaceMaterial] = {}
    paths, missing = _named(name, libraries)
    for path in paths:
        for material, lines in _sections(path).items():
            if material in wanted and material not in known:
                known[material] = _Material(path, material).read(lines)
    if missing:
        why = f"whose file {missing[0][:80]!r} is missing"
    else:
        held = " and ".join(path.name for path in paths)
        why = f"which {held} does not have" if held else "of which no file of materials is named"
    plain = SurfaceMaterial(metallic=0.0, roughness=0.5, unread=(why,), is_known=False)
    return [known.get(each) or replace(plain, name=each[:80]) for each in wanted]


def _named(name: str, libraries: Sequence[str]) -> tuple[list[Path], list[str]]:
    """Return the files that lines name, whole or word by word, and the names of missing ones."""
    paths, missing = [], []
    for line in libraries:
        try:
            paths.append(_beside(name, line))
        except ValueError:
            for word in line.split():
                try:
                    paths.append(_beside(name, word))
                except ValueError:
                    missing.append(word)
    return paths, missing


def _beside(name: str, text: str) -> Path:
    """Return a file that another one names.

    Where its path leads elsewhere, as on the machine that it was made on, a file of its name in the
    folder of the other one will do. Raises ValueError if there is none.
    """
    path = text.strip('"').replace("\\", "/")
    try:
        return referenced_file(name, path)
    except ValueError as error:
        try:
            return referenced_file(name, path.rpartition("/")[2])
        except ValueError:
            raise error from None


def _sections(path: Path) -> dict[str, list[list[str]]]:
    """Return the words of the lines of each material."""
    note(path)
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise MeshError(
                f"{path}: more than {_MOST_BYTES:,} bytes of materials; export it again"
            )
        text = path.read_bytes().decode("utf-8", "replace")
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror}); copy it again") from error
    found: dict[str, list[list[str]]] = {}
    lines: list[list[str]] = []
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ["newmtl"]:
            lines = found.setdefault(" ".join(words[1:]), [])
        elif words and not words[0].startswith("#"):
            lines.append(words)
    return found


class _Material:
    """Reads the lines of a material."""

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name

    def read(self, lines: Sequence[Sequence[str]]) -> SurfaceMaterial:
        """Return the material; what is damaged, or is not known, is named as `unread`."""
        found: dict[str, Any] = {"metallic": 0.0, "roughness": 0.5}
        unread = [key for key, *_ in lines if key in _UNREAD]
        # What others replace comes first.
        for key, *words in sorted(lines, key=lambda words: words[0] not in _REPLACED):
            try:
                if key in _READ:
                    found.update(_READ[key](_numbers(words)))
                elif key in _MAPS:
                    found.update(self._texture(key, words))
                    unread += [f"{each} of {key}" for each in words if each in _UNREAD_OPTIONS]
            except ValueError:
                unread.append(f"{key} without numbers")
        for textured in ("metallic", "roughness"):
            if f"{textured}_map" in found:
                found[textured] = 1.0
        if "emission_map" in found and not any(found.get("emission", ())):
            found["emission"] = 1.0, 1.0, 1.0
        if found.get("opacity", 1.0) < 1:
            found["cutoff"] = MASKED
            unread.append(f"opacity {found['opacity']:g}")
        channels = {"metallic_channel": 0, "roughness_channel": 0}
        return SurfaceMaterial(
            name=self._name[:80], unread=tuple(dict.fromkeys(unread)), **{**channels, **found}
        )

    def _texture(self, key: str, words: Sequence[str]) -> dict[str, Any]:
        """Return a texture, and the factor of normals."""
        rest, options = list(words), {}
        while rest and rest[0] in _OPTIONS:
            option = rest.pop(0)
            taken: list[str] = []
            while rest and len(taken) < _OPTIONS[option]:
                if option in _SPARSE and taken and not _is_number(rest[0]):
                    break
                taken.append(rest.pop(0))
            options[option] = taken
        move, size = _pair(options.get("-o"), 0.0), _pair(options.get("-s"), 1.0)
        path: Path | str
        try:
            path = _beside(str(self._path), " ".join(rest))
        except ValueError as error:
            path = str(error)
        side: Wrap = "clamp" if options.get("-clamp") == ["on"] else "repeat"
        # Coordinates of the file have v upwards, those of the matrix downwards.
        matrix = (size[0], 0.0, move[0], 0.0, size[1], 1 - size[1] - move[1])
        texture = Texture(path, key in _SRGB, 0, matrix, (side, side))
        kind = _MAPS[key]
        if kind in ("metallic_map", "roughness_map"):
            channel = _CHANNELS.get(options.get("-imfchan", ["r"])[0], 0)
            return {kind: texture, kind.replace("_map", "_channel"): channel}
        if kind != "normal_map":
            return {kind: texture}
        scale = _numbers(options.get("-bm", ["1"]))[0]
        return {"normal_map": texture, "normal_scale": scale}


def _numbers(words: Sequence[str]) -> list[float]:
    """Return up to three numbers.

    Raises ValueError if there are none, or they are no numbers or out of range.
    """
    numbers = [float(each) for each in words[:3]]
    if not numbers or not all(abs(each) <= _LARGEST for each in numbers):
        raise ValueError
    return numbers


def _pair(words: Sequence[str] | None, default: float) -> tuple[float, float]:
    if not words:
        return default, default
    first, *others = _numbers(words)
    return first, others[0] if others else default


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _color(numbers: Sequence[float]) -> tuple[float, float, float]:
    red, green, blue = numbers if len(numbers) == 3 else [numbers[0]] * 3
    return red, green, blue


_READ: dict[str, Callable[[list[float]], dict[str, Any]]] = {
    "Kd": lambda x: {"base_color": _color([_unit(each) for each in x])},
    "Ke": lambda x: {"emission": _color([max(each, 0.0) for each in x])},
    "Ns": lambda x: {"roughness": (2 / (max(x[0], 0.0) + 2)) ** 0.25},
    "Pr": lambda x: {"roughness": _unit(x[0])},
    "Pm": lambda x: {"metallic": _unit(x[0])},
    "Tr": lambda x: {"opacity": 1 - _unit(x[0])},
    "d": lambda x: {"opacity": _unit(x[0])},
}
