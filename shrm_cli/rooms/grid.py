"""A grid of probes: where they are, the irradiance between them, and their files.

Each of the eight probes about a point counts by its distance, by how far it is on the side that the
surface faces, and by how likely it sees the point. It knows the plane of what is met in each of a
few directions, and how much farther than that plane things are around there; Chebyshev's inequality
bounds from them the chance that the point is nearer. Planes, where Majercik et al. have distances,
tell a thin wall that is seen at a slant from what lies just behind it.

A file is an archive of numpy (.npz) of the arrays ``reflected``, ``direct``, ``alive`` (1 or 0)
and, where walls are known, ``walls`` of a `ProbeGrid`, the corners of the box as ``box`` (2 x 3),
and ``settings``: one text, a JSON object with ``version`` (2), ``shape`` and ``facts``. Where lamps
are known, there are ``lamps``, the corners and the radiance of their triangles (k x 4 x 3),
``seen`` and ``others`` of `SeenLamps`, and in the settings ``lamps``, how many triangles each has.
It may come from anywhere. docs/grid.md has it all.

References: Majercik, Guertin, Nowrouzezahrai and McGuire 2019, Dynamic Diffuse Global Illumination
with Ray-Traced Irradiance Fields, Journal of Computer Graphics Techniques 8(2), section 5; the
moments are those of Donnelly and Lauritzen 2006, Variance Shadow Maps.
"""

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import sound_primaries
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.records import record
from shrm_cli.rooms.lamps import MOST_TRIANGLES, Lamps, SeenLamps
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.transfer.transfer import cut_or_padded
from shrm_cli.vocabulary import MAX_GRID_ORDER

MOST = 2**20
"""The most probes of a grid."""


@record(eq=False)
class Lattice:
    """A box that is cut into cells, with a probe in the middle of each."""

    low: Array
    high: Array
    """`low` and `high`: the corners of the box, world axes, shape (3,)."""
    shape: tuple[int, int, int]
    """Cells along x, y and z."""

    @property
    def spacing(self) -> Array:
        """Distances between neighbours along each axis, shape (3,)."""
        return (self.high - self.low) / self.shape

    @property
    def count(self) -> int:
        """The number of probes."""
        return int(np.prod(self.shape))

    def points(self) -> Array:
        """Return where the probes are, shape (n, 3); z runs fastest, then y, then x."""
        axes = [np.arange(count) for count in self.shape]
        index = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return self.low + (index + 0.5) * self.spacing

    def corners(self, points: Array) -> tuple[Array, Array]:
        """Return the eight probes about points, and their shares by distance.

        Of `points`, of shape (n, 3), those outside of the middles of the outermost cells are moved
        to them.

        Returns `probes` of shape (n, 8); and `shares` of shape (n, 8), their sums are 1.
        """
        most = np.array(self.shape) - 1
        place = np.clip((points - self.low) / self.spacing - 0.5, 0, most)
        first = np.minimum(np.floor(place), np.maximum(most - 1, 0)).astype(np.int64)
        part = place - first
        probes, shares = [], []
        for corner in np.ndindex(2, 2, 2):
            index = np.minimum(first + corner, most)
            probes.append(np.ravel_multi_index(tuple(index.T), self.shape))
            shares.append(np.where(corner, part, 1 - part).prod(axis=1))
        return np.stack(probes, axis=1), np.stack(shares, axis=1)


EDGE = 8
"""Texels along an edge of the octahedral maps of distances."""
_BACK = 0.2
"""The share of a probe that lies behind the surface (Majercik et al. 2019, listing 1)."""
_SHARPER = 3
"""The power of the chance that a probe sees a point, which makes leaks darker."""
_UNEVEN = 0.03
"""The standard deviation that is added to what is known of walls, as a part of their nearness."""
_FAINT = 0.2
"""Weights below this, shares by distance aside, are lowered by the square of their ratio to it:
unlikely probes beyond a wall are bright, and leak (as RTXGI's DDGIGetVolumeIrradiance does)."""
_LEAST = 1e-6
"""The sum of weights below which all probes are taken for hidden."""


def color_facts(primaries: tuple[float, ...] | None) -> dict[str, list[float]]:
    """Return the fact of a grid that says which primaries its light has, if that is known."""
    return {} if primaries is None else {"chromaticities": list(primaries)}


@record(eq=False)
class ProbeGrid:
    """Probes on a lattice."""

    lattice: Lattice
    reflected: Array
    """Radiance that arrives at each probe, over the harmonics of world axes, index l(l+1)+m: that
    of surfaces and of the sky, without what comes straight from lamps, float32 of shape (n,
    (order+1)^2, 3)."""
    direct: Array
    """What comes straight from lamps, float32 of shape (n, (order+1)^2, 3)."""
    walls: Array | None
    """What is met about the directions of `octahedral_directions`: a vector whose product with a
    direction is the reciprocal of the distance of a plane, at least that of a cell's diagonal, and
    the mean square by which reciprocals around there are less; None where nothing is known, float32
    of shape (n, EDGE^2, 4)."""
    alive: NDArray[np.bool_]
    """Whether a probe counts; those within walls do not, shape (n,)."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """What made it, as JSON has it."""
    lamps: SeenLamps | None = None
    """Lamps whose light is not interpolated; of `direct` it is what their `others` are not."""

    @property
    def order(self) -> int:
        """The largest degree of the harmonics."""
        return order_of(self.reflected.shape[1])

    @cached_property
    def coefficients(self) -> Array:
        """The coefficients of all light, reflected and direct."""
        return self.reflected + self.direct

    @property
    def chromaticities(self) -> tuple[float, ...] | None:
        """The chromaticities of the light's primaries and white; None where nothing tells them."""
        told = self.facts.get("chromaticities")
        return sound_primaries(tuple(told)) if isinstance(told, list) else None

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told of the grid."""
        lattice = self.lattice
        return {
            "shape": list(lattice.shape),
            "low": lattice.low.tolist(),
            "high": lattice.high.tolist(),
            "order": self.order,
            "walls": self.walls is not None,
            "in_walls": int((~self.alive).sum()),
            "lamps": 0 if self.lamps is None else self.lamps.seen.shape[1],
            **{name: fact for name, fact in self.facts.items() if name != "made"},
        }

    def irradiance(self, points: ArrayLike, normals: ArrayLike, direct: bool = True) -> Array:
        """Return the irradiance of surfaces, shape (n, 3), without 1/pi and not below 0.

        `points` and `normals`, each of shape (n, 3), are in world axes; normals are unit vectors.
        `direct` tells whether light counts that comes straight from lamps.
        """
        points, normals = np.asarray(points, dtype=float), np.asarray(normals, dtype=float)
        probes, weights = self.weights(points, normals)
        shares = lambert_factors(self.order)[degrees(self.order)]
        light = self._between(probes, weights, direct)
        values = np.einsum("nj,njc->nc", shares * real_harmonics(self.order, normals), light)
        if direct and self.lamps is not None:
            seen = self.lamps.shares(probes, weights)
            values += self.lamps.lamps.irradiance(points, normals, seen)
        return np.maximum(values, 0)

    def light(self, points: ArrayLike, normals: ArrayLike, order: int | None = None) -> Array:
        """Return the light of surfaces: of lamps where they are, else between the probes about.

        `points` and `normals` are those of `irradiance`. `order` is the largest degree; that of the
        grid by default. What is interpolated has none above that.

        Returns coefficients over the harmonics of world axes, index l(l+1)+m, of shape (n,
        (order+1)^2, 3).
        """
        points, normals = np.asarray(points, dtype=float), np.asarray(normals, dtype=float)
        order = self.order if order is None else order
        probes, weights = self.weights(points, normals)
        light = cut_or_padded(self._between(probes, weights, direct=True), (order + 1) ** 2)
        if self.lamps is not None:
            seen = self.lamps.shares(probes, weights)
            light += self.lamps.lamps.coefficients(points, order, seen)
        return light

    def _between(self, probes: Array, weights: Array, direct: bool) -> Array:
        """Return coefficients of what is interpolated of the light, shape (n, j, 3)."""
        held = self._interpolated if direct else self.reflected
        return np.einsum("nk,nkjc->njc", weights, held[probes])

    @cached_property
    def _interpolated(self) -> Array:
        """Coefficients of all light but that of lamps that are added."""
        return self.coefficients if self.lamps is None else self.reflected + self.lamps.others

    def weights(self, points: Array, normals: Array) -> tuple[Array, Array]:
        """Return the probes about points, and how much each of them counts, shapes (n, 8)."""
        probes, near = self.lattice.corners(points)
        places = self.lattice.points()[probes]
        to_probe = places - points[:, None]
        to_probe /= np.maximum(np.linalg.norm(to_probe, axis=-1, keepdims=True), 1e-12)
        facing = (np.einsum("nkv,nv->nk", to_probe, normals) + 1) / 2
        near = near * self.alive[probes]
        weights = facing**2 + _BACK
        if self.walls is not None:
            weights = weights * self._seen(probes, points[:, None] - places)
            weights *= np.minimum(weights / _FAINT, 1) ** 2
        weights = near * weights
        # Where every probe is hidden, distance alone tells.
        total = weights.sum(axis=1, keepdims=True)
        weights = np.where(total > _LEAST, weights, near)
        return probes, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)

    def _seen(self, probes: Array, ways: Array) -> Array:
        """Return how likely probes see points at some ways from them, shape (n, 8)."""
        assert self.walls is not None
        distance = np.linalg.norm(ways, axis=-1)
        ways, distance = np.where(distance[..., None] > 0, ways, 1e-9), np.maximum(distance, 1e-9)
        directions = ways / distance[..., None]
        texels, shares = _texels(directions)
        known = self.walls[probes[..., None], texels]
        near = np.maximum(np.einsum("nktv,nkv->nkt", known[..., :3], directions), 0)
        variance = known[..., 3] + (_UNEVEN * near) ** 2 + 1e-30
        beyond = np.maximum(near - 1 / distance[..., None], 0)
        chance = variance / (variance + beyond**2)
        # Their product, not their mean: in a corner the nearest of its walls is what is met.
        return np.exp(_SHARPER * (shares * np.log(chance)).sum(axis=-1))


def octahedral_directions() -> Array:
    """Directions of the texels of an octahedral map, shape (EDGE^2, 3), row after row.

    With u and v in -1 .. 1 from left to right and from top to bottom, a direction is that of
    ``(u, v, 1 - |u| - |v|)``, and where that z is negative x and y are folded over:
    ``x = (1 - |v|) sign(u), y = (1 - |u|) sign(v)``.

    References: Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit
    Vectors.
    """
    axis = (np.arange(EDGE) + 0.5) / EDGE * 2 - 1
    v, u = (each.ravel() for each in np.meshgrid(axis, axis, indexing="ij"))
    z = 1 - np.abs(u) - np.abs(v)
    x = np.where(z < 0, (1 - np.abs(v)) * np.where(u < 0, -1, 1), u)
    y = np.where(z < 0, (1 - np.abs(u)) * np.where(v < 0, -1, 1), v)
    return normalize(np.stack([x, y, z], axis=-1))


def _texels(directions: Array) -> tuple[Array, Array]:
    """Return the four texels about directions, and their shares, shapes (..., 4).

    Past an edge of the map the texels are those of the mirrored row or column.
    """
    scaled = directions / np.abs(directions).sum(axis=-1, keepdims=True)
    x, y, z = np.moveaxis(scaled, -1, 0)
    u = np.where(z < 0, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x)
    v = np.where(z < 0, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y)
    column, row = ((each + 1) / 2 * EDGE - 0.5 for each in (u, v))
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    texels, shares = [], []
    for down in (0, 1):
        for right in (0, 1):
            j, i = left + right, top + down
            beside, beyond = (j < 0) | (j >= EDGE), (i < 0) | (i >= EDGE)
            # The neighbour over an edge lies mirrored about the edge's middle.
            i, j = np.where(beside, EDGE - 1 - i, i), np.where(beyond, EDGE - 1 - j, j)
            i, j = np.clip(i, 0, EDGE - 1), np.clip(j, 0, EDGE - 1)
            texels.append(i * EDGE + j)
            across = column - left if right else 1 - column + left
            upward = row - top if down else 1 - row + top
            shares.append(across * upward)
    return np.stack(texels, axis=-1), np.stack(shares, axis=-1)


_VERSION = 2
_DIMENSIONS = {
    "reflected": 3, "direct": 3, "alive": 1, "walls": 3, "moments": 3, "box": 2,
    "lamps": 3, "seen": 2, "others": 3,
}  # fmt: skip


def write_grid(path: str | os.PathLike[str], grid: ProbeGrid) -> None:
    """Write a grid, whole or not at all; the same grid gives the same bytes."""
    lattice = grid.lattice
    arrays: dict[str, Any] = {
        "reflected": grid.reflected.astype("<f4"),
        "direct": grid.direct.astype("<f4"),
        "alive": grid.alive.astype("<f4"),
        "box": np.stack([lattice.low, lattice.high]).astype("<f8"),
    }
    if grid.walls is not None:
        arrays["walls"] = grid.walls.astype("<f4")
    settings = {"version": _VERSION, "shape": list(lattice.shape), "facts": dict(grid.facts)}
    if grid.lamps is not None:
        lamps = grid.lamps.lamps
        both = np.concatenate([lamps.corners, lamps.radiance[:, None]], axis=1)
        arrays["lamps"] = both.astype("<f4")
        arrays["seen"] = grid.lamps.seen.astype("<f4")
        arrays["others"] = grid.lamps.others.astype("<f4")
        settings["lamps"] = np.bincount(lamps.of).tolist()
    npz.write_npz(path, {**arrays, "settings": json.dumps(settings)})


def is_grid(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file holds a grid; whether it is sound, reading it tells."""
    return npz.holds(path, {"reflected", "direct", "box", "settings"})


def made_by(path: str | os.PathLike[str]) -> str | None:
    """Return the digest of what a grid was made of, of files and options; None if it is not known.

    The file is only looked at, and is no input.
    """
    with suppress(ValueError, KeyError, TypeError, OSError), npz.opened(Path(path)) as archive:
        return str(parse_json(archive.text("settings"))["facts"]["made"])
    return None


def read_grid(path: str | os.PathLike[str]) -> ProbeGrid:
    """Read a grid."""
    missing, again = "name a grid that shrm grid wrote", "make it again with shrm grid"
    with npz.checked_archive(Path(path), MeshError, missing, again) as archive:
        return _grid(archive.those_of(_DIMENSIONS), parse_json(archive.text("settings")))


def as_grid(path: str | os.PathLike[str]) -> ProbeGrid | None:
    """Read a grid; return None of a file that holds none."""
    return read_grid(path) if is_grid(path) else None


def _grid(arrays: dict[str, Array], settings: object) -> ProbeGrid:
    """Return a grid whose arrays fit each other."""
    if not isinstance(settings, dict) or not isinstance(settings.get("facts"), dict):
        raise ValueError("its settings are not those of a grid")
    version, shape = settings.get("version"), settings.get("shape")
    if isinstance(version, int) and version > _VERSION:
        raise ValueError(f"written by a newer shrm (grid format {version})")
    if not isinstance(shape, list) or len(shape) != 3:
        raise ValueError("its shape is wrong")
    if not all(type(each) is int and 1 <= each <= MOST for each in shape):
        raise ValueError("its shape is wrong")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds NaN or infinite values")
    box = arrays["box"]
    if box.shape != (2, 3) or not (box[1] > box[0]).all():
        raise ValueError("its box is wrong")
    lattice = Lattice(box[0], box[1], (shape[0], shape[1], shape[2]))
    count, order = lattice.count, round(np.sqrt(arrays["reflected"].shape[1])) - 1
    if count > MOST or not 1 <= order <= MAX_GRID_ORDER:
        raise ValueError("its size or its order is out of range")
    expected = {
        "reflected": (count, (order + 1) ** 2, 3),
        "direct": (count, (order + 1) ** 2, 3),
        "alive": (count,),
        "walls": (count, EDGE**2, 4),
        "others": (count, (order + 1) ** 2, 3),
    }
    if "moments" in arrays:  # the first version has distances and their squares in place of planes
        arrays["walls"] = _spheres(arrays.pop("moments"))
    for name, wanted in expected.items():
        if name in arrays and arrays[name].shape != wanted:
            raise ValueError(f"{name} of shape {arrays[name].shape} in a grid of {shape}")
    lamps = _lamps(arrays, settings.get("lamps"), count) if "lamps" in arrays else None
    return ProbeGrid(
        lattice, arrays["reflected"], arrays["direct"], arrays.get("walls"),
        arrays["alive"] > 0.5, settings["facts"], lamps,
    )  # fmt: skip


def _lamps(arrays: dict[str, Array], counts: object, probes: int) -> SeenLamps:
    """Return lamps whose arrays fit each other and so many probes."""
    held = arrays["lamps"].astype(float)
    if not isinstance(counts, list) or not all(type(each) is int and each > 0 for each in counts):
        raise ValueError("its settings have no numbers of triangles of lamps")
    if held.shape != (sum(counts), 4, 3) or len(held) > MOST_TRIANGLES:
        raise ValueError(f"lamps of shape {held.shape}")
    if not {"seen", "others"} <= arrays.keys() or arrays["seen"].shape != (probes, len(counts)):
        raise ValueError("lamps without what probes see of each")
    of = np.repeat(np.arange(len(counts)), counts)
    return SeenLamps(Lamps(held[:, :3], held[:, 3], of), arrays["seen"], arrays["others"])


def _spheres(moments: Array) -> Array:
    """Return what is known of walls by means of distances and of their squares, (n, t, 2)."""
    if moments.shape[1:] != (EDGE**2, 2):
        raise ValueError(f"moments of shape {moments.shape}")
    mean, square = np.moveaxis(moments, -1, 0)
    mean = np.maximum(mean, np.finfo(np.float32).tiny)
    spread = np.abs(square / mean**2 - 1) / mean**2
    return np.concatenate([octahedral_directions() / mean[..., None], spread[..., None]], axis=-1)
