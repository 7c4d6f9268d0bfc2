"""The levels of a split sum as an engine looks them up: its own sizes, its own roughnesses.

The levels of a file are taken where they fit the engine's law, and refused where they do not, with
the command that makes the right ones.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.export.engine import Engine
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.sphere.cube import CubeSampler, cube_directions

_SAME = 5e-4
"""Roughnesses that differ by this much are the same: files name them with few digits."""


def levels_of_map(
    split: SplitSum, path: str, engine: Engine, size: int | None
) -> tuple[tuple[Array, ...], tuple[float, ...], list[str]]:
    """Take the levels of a split sum for an engine.

    `path` is its file, for messages. `size` is the number of texels along an edge of level 0, by
    default those of the file.

    Returns OpenEXR cubes of shape (6 N_k, N_k, 3) in world axes, their roughnesses, and a sentence
    about each level that was interpolated to the engine's sizes.

    Raises MapError if the roughnesses are not the engine's, or level 0 has another size. Raises
    ArgumentError if the engine reads no such size.
    """
    wanted = split.size if size is None else size
    sizes = engine.sizes(wanted)
    roughness = engine.roughness(sizes)
    command = _command(engine, wanted, split.lobe)
    if len(roughness) != len(split.roughness) or not np.allclose(
        roughness, split.roughness, rtol=0, atol=_SAME
    ):
        raise MapError(
            f"{path}: its levels have roughness {_listed(split.roughness)}; {engine.title} looks "
            f"up {_listed(roughness)} at size {wanted}; make it by {command}, or "
            "export the probe itself"
        )
    if split.size != wanted:
        raise MapError(
            f"{path}: its level 0 has {split.size} texels along an edge, not {wanted}; make it by "
            f"{command}, or export the probe itself"
        )
    levels, changed = [], []
    for k, (cube, texels) in enumerate(zip(split.levels, sizes, strict=True)):
        same = cube.shape[1] == texels and split.sampling == "center"
        levels.append(cube if same else _interpolated(cube, split, texels))
        changed += [] if same else [f"{k} (from {cube.shape[1]} to {texels})"]
    told = [f"levels {', '.join(changed)} were interpolated"] if changed else []
    return tuple(levels), roughness, told


def _interpolated(cube: Array, split: SplitSum, size: int) -> Array:
    """Return a level with other texels; levels are smooth, so that this hardly changes them."""
    values = CubeSampler(cube, split.sampling)(cube_directions(size))
    return np.maximum(values, min(float(cube.min()), 0.0))  # a cubic filter overshoots


def _command(engine: Engine, size: int, lobe: str) -> str:
    """Return the command that makes the levels of an engine."""
    sizes = engine.sizes(size)
    to = "--to splitsum" if lobe == "ggx" else f"--to splitsum --brdf {lobe}"
    if engine.mapping is None:
        levels = ",".join(f"{value:.6g}" for value in engine.roughness(sizes))
        return f"shrm prefilter PROBE {to} --levels {levels} --size {size}"
    return (
        f"shrm prefilter PROBE {to} --mapping {engine.mapping} --levels {len(sizes)} --size {size}"
    )


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
