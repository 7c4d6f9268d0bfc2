"""Lines of code that make lamps in engines: `shrm sun --for ENGINE`.

Radiance of a probe has no unit, and irradiance is in that of the radiance times sr. Where an
engine calls it lux, both have to be scaled alike: the environment and the lamps.
"""

import json
from collections.abc import Callable, Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.lights.light_files import intensity_and_color, light_axes
from shrm_cli.probe.disc import Disc

_BABYLON_LIGHTS = 4
"""The lights that a material of Babylon.js is shaded by, unless it says more."""


def snippet(engine: str, discs: Sequence[Disc]) -> str:
    """The lines for an engine, by its name in `shrm_cli.vocabulary.LIGHT_ENGINES`."""
    return _WRITERS[engine](discs)


def beside_cubes(engine: str, discs: Sequence[Disc]) -> str:
    """The lines for the files of `shrm export --for ENGINE`, which may lie in other axes.

    They are none where the files have the lamps in them.
    """
    write = _BESIDE_CUBES.get(engine) or _WRITERS.get(engine)
    return write(discs) if write else ""


def _numbers(values: Array) -> str:
    return ", ".join(f"{value + 0.0:.6g}" for value in values)


def _three(discs: Sequence[Disc]) -> str:
    """three.js has +X in the centre of a lat-long and +Z to its right; we have +Z and -X."""
    axes = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    about = "In the axes that three.js gives the residual (EquirectangularReflectionMapping)."
    return "\n".join(_three_lights(discs, axes, about))


def _three_beside_cubes(discs: Sequence[Disc]) -> str:
    """Cubes of `shrm export` are looked up in our axes."""
    lines = _three_lights(discs, np.eye(3), "The lamps that the cube is without.")
    return "\n".join(['import * as THREE from "three";', *lines])


def _babylon_beside_cubes(discs: Sequence[Disc]) -> str:
    """Babylon.js takes the irradiance of a directional light, and four lights for a material."""
    lines = ["// The lamps that the environment is without, in a right-handed scene.", "let lamp;"]
    for number, disc in enumerate(discs, 1):
        intensity, color = intensity_and_color(disc)
        travel = f"new BABYLON.Vector3({_numbers(-disc.direction)})"
        lines += [
            f'lamp = new BABYLON.DirectionalLight("Lamp{number}", {travel}, scene);',
            f"lamp.diffuse = lamp.specular = new BABYLON.Color3({_numbers(color)});",
            f"lamp.intensity = {intensity:.6g};",
        ]
    if len(discs) > _BABYLON_LIGHTS:
        lines.append(f"// of each PBR material: material.maxSimultaneousLights = {len(discs)};")
    return "\n".join(lines)


def _three_lights(discs: Sequence[Disc], axes: Array, about: str) -> list[str]:
    lines = [
        f"// {about}",
        "// Intensity is the irradiance in units of the probe; environmentIntensity scales both.",
    ]
    for disc in discs:
        intensity, color = intensity_and_color(disc)
        lines += [
            "{",
            f"  const lamp = new THREE.DirectionalLight(0xffffff, {intensity:.6g});",
            f"  lamp.color.setRGB({_numbers(color)}, THREE.LinearSRGBColorSpace);",
            f"  lamp.position.set({_numbers(axes @ disc.direction)}).multiplyScalar(100);",
            "  scene.add(lamp);  // shines at lamp.target, the origin",
            "}",
        ]
    return lines


def _filament(discs: Sequence[Disc]) -> str:
    """Filament shades with one directional light, the strongest; the others are far away points."""
    lines = [
        "// World axes, as cubes of `shrm export --for filament` have them.",
        "// The intensity of the IndirectLight that is made of the residual: Filament's own.",
        "const float scale = 30000.0f;",
    ]
    if len(discs) > 1:
        lines.append("const float far = 1000.0f;  // from the origin, much farther than the scene")
    strongest = max(discs, key=lambda disc: intensity_and_color(disc)[0], default=None)
    for disc in discs:
        intensity, color = intensity_and_color(disc)
        is_sun = disc is strongest
        placed = [
            f"    .intensityCandela({intensity:.6g}f * far * far * scale)  // lux there",
            f"    .position(math::float3{{{_numbers(disc.direction)}}} * far)",
            "    .falloff(100.0f * far)",
        ]
        travelling = [
            f"    .intensity({intensity:.6g}f * scale)  // lux",
            f"    .direction({{{_numbers(-disc.direction)}}})  // that of its travel",
            f"    .sunAngularRadius({np.degrees(disc.radius):.6g}f)",
        ]
        lines += [
            f"LightManager::Builder(LightManager::Type::{'SUN' if is_sun else 'POINT'})",
            f"    .color({{{_numbers(color)}}})  // linear",
            *(travelling if is_sun else placed),
            "    .build(*engine, EntityManager::get().create());",
        ]
    return "\n".join(lines)


def _bevy(discs: Sequence[Disc]) -> str:
    """A directional light of Bevy shines along the -Z of its transform."""
    lines = [
        "// World axes, as cubes of `shrm export --for bevy` have them.",
        "// The intensity of the EnvironmentMapLight that is made of the residual.",
        "let scale = 1000.0;",
    ]
    for disc in discs:
        intensity, color = intensity_and_color(disc)
        up = "X" if _is_steep(disc) else "Y"
        lines += [
            "commands.spawn((",
            "    DirectionalLight {",
            f"        illuminance: {_float(intensity)} * scale,",
            f"        color: Color::linear_rgb({', '.join(map(_float, color))}),",
            "        ..default()",
            "    },",
            f"    Transform::from_xyz({', '.join(map(_float, disc.direction))})"
            f".looking_at(Vec3::ZERO, Vec3::{up}),",
            "));",
        ]
    return "\n".join(lines)


def _godot(discs: Sequence[Disc]) -> str:
    """Godot multiplies the energy of a light by pi, and its lights shine along -Z."""
    lines = [
        "# World axes, as panoramas of `shrm export --for godot` have them, at a sky energy of 1.",
        "# Energy is the irradiance in units of the probe, over pi.",
    ]
    for number, disc in enumerate(discs, 1):
        intensity, color = intensity_and_color(disc)
        up = "RIGHT" if _is_steep(disc) else "UP"
        lines += [
            f"var lamp{number} := DirectionalLight3D.new()",
            f"lamp{number}.light_energy = {intensity / np.pi:.6g}",
            f"lamp{number}.light_color = Color({_numbers(color)}).linear_to_srgb()",
            f"lamp{number}.light_angular_distance = {2 * np.degrees(disc.radius):.6g}",
            f"lamp{number}.sky_mode = DirectionalLight3D.SKY_MODE_LIGHT_ONLY",
            f"lamp{number}.basis = Basis.looking_at(Vector3({_numbers(-disc.direction)}), "
            f"Vector3.{up})",
            f"add_child(lamp{number})",
        ]
    return "\n".join(lines)


def _float(value: float) -> str:
    """A number that Rust takes for one of floating point."""
    text = f"{value + 0.0:.6g}"
    return text if "." in text or "e" in text else f"{text}.0"


def _blender(discs: Sequence[Disc]) -> str:
    """Blender is Z-up, and has +X in the centre of an environment texture and -Y to its right."""
    lines = [
        "# In the axes that Blender gives the residual as an environment texture of strength 1.",
        "# Energy is the irradiance, W/m^2 there, in units of the probe.",
        "import bpy",
        "from mathutils import Vector",
    ]
    for number, disc in enumerate(discs, 1):
        x, y, z = disc.direction
        intensity, color = intensity_and_color(disc)
        lines += [
            f'lamp = bpy.data.lights.new("Lamp{number}", "SUN")',
            f"lamp.energy, lamp.angle = {intensity:.6g}, {2 * disc.radius:.6g}  # whole angle, rad",
            f"lamp.color = ({_numbers(color)})",
            f'item = bpy.data.objects.new("Lamp{number}", lamp)',
            'item.rotation_mode = "QUATERNION"',
            f"item.rotation_quaternion = Vector(({_numbers(np.array([z, x, y]))}))"
            '.to_track_quat("Z", "Y")',
            "bpy.context.collection.objects.link(item)",
        ]
    return "\n".join(lines)


def _gltf(discs: Sequence[Disc]) -> str:
    """KHR_lights_punctual: directional lights shine along -Z of their node, in lux."""
    lights, nodes = [], []
    for number, disc in enumerate(discs, 1):
        intensity, color = intensity_and_color(disc)
        name = f"Lamp{number}"
        lights.append(
            {
                "name": name, "type": "directional", "intensity": _short(intensity),
                "color": [_short(each) for each in color],
            }
        )  # fmt: skip
        rotation = [_short(each) for each in _quaternion(light_axes(disc.direction).T)]
        extension = {"KHR_lights_punctual": {"light": number - 1}}
        nodes.append({"name": name, "rotation": rotation, "extensions": extension})
    return json.dumps(
        {
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": lights}},
            "nodes": nodes,
            "scenes": [{"nodes": list(range(len(nodes)))}],
        },
        indent=2,
    )


def _short(value: float) -> float:
    return float(f"{value:.7g}")


def _quaternion(matrix: Array) -> Array:
    """x, y, z, w of a rotation, shape (3, 3): the eigenvector of Bar-Itzhack's symmetric matrix."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    symmetric = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    found = np.linalg.eigh(symmetric)[1][:, -1]
    return np.asarray(found * (-1 if found[3] < 0 else 1))


_WRITERS: dict[str, Callable[[Sequence[Disc]], str]] = {
    "three": _three,
    "filament": _filament,
    "bevy": _bevy,
    "godot": _godot,
    "blender": _blender,
    "gltf": _gltf,
}
_BESIDE_CUBES = {"three": _three_beside_cubes, "babylon": _babylon_beside_cubes}


def _is_steep(disc: Disc) -> bool:
    """Whether a light is nearer to the vertical than to +-X, and is to be turned about this."""
    return bool(abs(disc.direction[1]) > abs(disc.direction[0]))
