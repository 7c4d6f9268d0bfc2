"""How Godot and Unity's high definition pipeline filter cubes, written out again, for one channel.

Half vectors are drawn by GGX, N = V; each light is looked up in a mip whose texels have the solid
angle that a sample stands for (GPU Gems 3, chapter 20).
"""

from functools import cache

import numpy as np

from research.bilinear import centers, look_up
from tests.ggx import lobe


def hammersley(count):
    """Godot's points: azimuth and depth."""
    return np.array([(k / count, int(f"{k:032b}"[::-1], 2) / 2**32) for k in range(count)]).T


def fibonacci(count):
    """Unity's points, which it takes for depth and azimuth; returned the other way around."""
    before, last = 1, 1
    while last < count:
        before, last = last, before + last
    k = np.arange(count)
    return np.array([k * before / count % 1, (k + 0.5) / count])


def areas(size):
    """Solid angles of the texels of a cube, shape (6, size, size), but for a factor."""
    s = (np.arange(size) + 0.5) * 2 / size - 1
    face = (1 + s[:, None] ** 2 + s**2) ** -1.5 * (2 / size) ** 2
    return np.broadcast_to(face, (6, size, size))


def mips(cube):
    """Means of 2 x 2 texels, down to one, each of shape (6 N, N, 1)."""
    size = cube.shape[1]
    found, cube = [], cube.reshape(6, size, size)
    while True:
        found.append(cube.reshape(6 * size, size, 1))
        if size == 1:
            return found
        size //= 2
        cube = cube.reshape(6, size, 2, size, 2).mean(axis=(2, 4))


def filtered(name, levels, roughness, count, normals):
    """What an engine makes of a cube around some normals."""
    is_unity = name == "unity"
    azimuth, depth = fibonacci(count) if is_unity else hammersley(count)
    alpha = roughness**2
    cosine = np.sqrt((1 - depth) / (1 + (alpha**2 - 1) * depth))
    sine = np.sqrt(1 - cosine**2)
    density = alpha**2 / np.pi / (1 + (alpha**2 - 1) * cosine**2) ** 2 / 4
    least = 0 if is_unity else 1e-4
    solid_angle = 1 / (count * (density + least) + least)
    texel = 4 * np.pi / (6 * levels[0].shape[1] ** 2)
    lods = 0.5 * np.log2(solid_angle / texel) + (alpha if is_unity else 0)
    height = 2 * cosine**2 - 1
    weights = height
    if is_unity:  # V_SmithJointGGX N.L, but for a factor
        weights = height / (height + np.sqrt(height**2 * (1 - alpha**2) + alpha**2))
    ups = np.where(np.abs(normals[:, 2:]) < 0.999, [[0, 0, 1.0]], [[1.0, 0, 0]])
    tangents = np.cross(ups, normals)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    sides = np.cross(normals, tangents)
    used = np.flatnonzero(height > 0)
    turn, up = 2 * np.pi * azimuth[used, None, None], height[used, None, None]
    across = np.cos(turn) * tangents + np.sin(turn) * sides
    light = 2 * (cosine * sine)[used, None, None] * across + up * normals
    lods = np.clip(lods[used], 0, len(levels) - 1)
    values = np.zeros(light.shape[:2])
    for k, level in enumerate(levels):
        parts = np.maximum(1 - np.abs(lods - k), 0)
        near = parts > 0
        if near.any():
            found = look_up(level, light[near].reshape(-1, 3))[:, 0]
            values[near] += parts[near, None] * found.reshape(-1, len(normals))
    return weights[used] @ values / weights[used].sum()


def counts(name, levels):
    """Half vectors of each level."""
    return (21, 34, 55, 89, 89, 89) if name == "unity" else (32,) * levels


def lamp_errors(name, sampler, radius, lamps=30, places=60):
    """Errors under one lamp alone: a texel, or a disc of a radius in degrees; one for each level.

    The light is of irradiance 1; around each lamp some normals in reach of the lobe are tried.
    """
    directions, weights = centers(sampler.edge), areas(sampler.edge)
    found = [[] for _ in sampler.roughness]
    wanted = [[] for _ in sampler.roughness]
    for seed in range(lamps):
        rng = np.random.default_rng(seed)
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        cosines = directions @ axis
        cube = (cosines >= min(np.cos(np.radians(radius)), cosines.max())).astype(float)
        levels = mips((cube / (cube * weights).sum()).reshape(-1, sampler.edge))
        tangent = np.cross(axis, [0, 0, 1.0])
        tangent /= np.linalg.norm(tangent)
        side = np.cross(axis, tangent)
        for k, (rough, count) in enumerate(
            zip(sampler.roughness, counts(name, len(sampler.roughness)), strict=True)
        ):
            angle = min(2.5 * rough**2 + 0.03, 1.2) * np.sqrt(rng.random((places, 1)))
            turn = 2 * np.pi * rng.random((places, 1))
            off = np.cos(turn) * tangent + np.sin(turn) * side
            normals = np.cos(angle) * axis + np.sin(angle) * off
            found[k].append(filtered(name, levels, rough, count, normals))
            wanted[k].append([lobe(rough, n, n, axis[None])[0][0] / total(rough) for n in normals])
    return [
        np.sqrt(np.mean((np.array(a) - b) ** 2) / np.mean(np.square(b)))
        for a, b in zip(found, wanted, strict=True)
    ]


@cache
def total(roughness, power=0):
    """The integral of the lobe times a power of N.L over the hemisphere, N = V."""
    t = (np.arange(20000) + 0.5) / 20000
    angle, step = np.pi / 2 * t**2, np.pi * t / 20000
    light = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    value = lobe(roughness, np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), light)[0]
    return np.sum(value * np.cos(angle) ** power * 2 * np.pi * np.sin(angle) * step)
