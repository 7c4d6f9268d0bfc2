"""Grids in the forms that engines read; docs/grid.md says how each is loaded.

Engines filter between probes without knowing of walls. So those within walls, which are dark, get
the light of their neighbours first.
"""

import json
import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.export.ktx import can_compress, ktx2
from shrm_cli.export.pixels import FORMATS, encoded
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, peek, write_parts
from shrm_cli.files.whole import write_bytes
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.maps.irradiance.window import least_window
from shrm_cli.rooms.grid import ProbeGrid
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions

_SIDES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
"""Bevy's ambient cubes: +X and -X, +Y and -Y, +Z and -Z."""
_FACTS = "shrm:grid"
"""The attribute of a picture of coefficients that says which grid they are of."""
_THREE_ORDER = 2
_TRIED = 128
"""Normals for which irradiance is looked at before a window is sought."""


def prepared(grid: ProbeGrid, direct: bool, order: int | None = None) -> Array:
    """Return the coefficients of all probes, shape (nx, ny, nz, (order+1)^2, 3).

    `direct` tells whether light counts that comes straight from lamps. `order` is the largest
    degree; that of the grid by default.

    Returns an array, of probes within walls the mean of their neighbours'. A probe whose irradiance
    is negative somewhere has the window that changes it least and leaves it nowhere negative.
    """
    light = np.array(grid.coefficients if direct else grid.reflected, dtype=float)
    order = grid.order if order is None else min(order, grid.order)
    light = light[:, : (order + 1) ** 2].reshape(*grid.lattice.shape, -1, 3)
    light = _filled(light, grid.alive.reshape(grid.lattice.shape))
    factors = lambert_factors(order)[degrees(order)][:, None]
    values = real_harmonics(order, spiral_directions(_TRIED)) * factors.T
    flat = light.reshape(-1, *light.shape[-2:])
    lowest = np.einsum("dj,njc->ndc", values, flat).min(axis=(1, 2))
    for number in np.flatnonzero(lowest < 0):
        window = least_window(flat[number] * factors)
        flat[number] = window.apply(flat[number])
    return light


def _filled(light: Array, alive: NDArray[np.bool_]) -> Array:
    """Return coefficients in which dead probes have the mean of their living neighbours."""
    light, known = np.where(alive[..., None, None], light, 0), alive.astype(float)
    while 0 < known.sum() < known.size:
        total, count = np.zeros_like(light), np.zeros_like(known)
        for axis in range(3):
            for step in (-1, 1):
                # What is rolled in from the other end is no neighbour.
                inside = np.ones_like(known)
                np.moveaxis(inside, axis, 0)[0 if step == 1 else -1] = 0
                total += np.roll(light, step, axis) * inside[..., None, None]
                count += np.roll(known, step, axis) * inside
        new = (known == 0) & (count > 0)
        light[new] = total[new] / count[new][:, None, None]
        known[new] = 1
    return light


def as_json(grid: ProbeGrid, direct: bool) -> str:
    """Return a grid as text: the box, the probes along each axis, and their coefficients.

    ``coefficients`` has 27 numbers a probe, R G B of each of nine coefficients of radiance; x runs
    fastest, then y, then z. three.js's `LightProbeGridWebGL` has the same box and order.
    """
    light = prepared(grid, direct, _THREE_ORDER)
    count = (_THREE_ORDER + 1) ** 2
    padded = np.zeros((*grid.lattice.shape, count, 3))
    padded[..., : light.shape[-2], :] = light
    rows = np.transpose(padded, (2, 1, 0, 3, 4)).reshape(-1)
    return json.dumps(
        {
            "type": "probe grid",
            "version": 1,
            "min": grid.lattice.low.tolist(),
            "max": grid.lattice.high.tolist(),
            "resolution": list(grid.lattice.shape),
            "coefficients": [float(f"{each:.6g}") for each in rows],
        }
    )


def as_volume(grid: ProbeGrid, direct: bool) -> bytes:
    """Return Bevy's irradiance volume: a KTX 2 file of nx x 2 ny x 3 nz texels of rgb9e5.

    Texels are irradiance over pi, which Bevy multiplies with the albedo. The positive sides of the
    cubes come before the negative ones along y, and X, Y and Z are one after the other along z: so
    Bevy's shader looks them up (irradiance_volume.wgsl), whereas the page of its
    module `irradiance_volume` names the signs the other way round.
    """
    light = prepared(grid, direct)
    order = order_of(light.shape[-2])
    factors = lambert_factors(order)[degrees(order)]
    values = real_harmonics(order, _SIDES) * factors / np.pi
    sides = np.maximum(np.einsum("sj,xyzjc->szyxc", values, light), 0)
    stacked = np.concatenate([sides[0::2], sides[1::2]], axis=2)  # along y
    volume = stacked.reshape(-1, *stacked.shape[2:])  # the axes one after the other along z
    depth, height, width = volume.shape[:3]
    texels = FORMATS["rgb9e5"]
    data, _ = encoded(volume, texels, "irradiance")
    return ktx2([data], (width, height, depth), texels, can_compress())


def as_part(grid: ProbeGrid, direct: bool) -> Part:
    """Return a picture of nx x (ny nz n) pixels: RGB of a coefficient; y runs before z before n."""
    light = prepared(grid, direct)
    rows = np.transpose(light, (3, 2, 1, 0, 4)).reshape(-1, grid.lattice.shape[0], 3)
    facts = {
        "min": grid.lattice.low.tolist(),
        "max": grid.lattice.high.tolist(),
        "resolution": list(grid.lattice.shape),
        "order": order_of(light.shape[-2]),
    }
    channels = {name: rows[..., k] for k, name in enumerate("RGB")}
    return Part(channels, {_FACTS: json.dumps(facts)})


def read_grid_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what a picture of `as_part` says of its grid; None if the file is anything else."""
    found = peek(path)
    if found is None or not (text := found.first.text(_FACTS)):
        return None
    try:
        facts = parse_json(text)
        shape, low, high = (facts[name] for name in ("resolution", "min", "max"))
        return {"shape": [*shape], "low": [*low], "high": [*high], "order": int(facts["order"])}
    except (ValueError, TypeError, KeyError):
        raise MeshError(
            f"{found.first.path}: its attribute {_FACTS} is wrong; make the grid again"
        ) from None


WRITERS: dict[str, Callable[[str | os.PathLike[str], ProbeGrid, bool], object]] = {
    ".json": lambda path, *light: write_bytes(path, (as_json(*light) + "\n").encode()),
    ".ktx2": lambda path, *light: write_bytes(path, as_volume(*light)),
    ".exr": lambda path, *light: write_parts(path, [as_part(*light)], "float"),
}
"""What a grid is written as, by the suffix; each takes whether light of lamps counts."""
