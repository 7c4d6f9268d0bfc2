"""`grid` and `capture`: the light at the points of a grid, and the probe of a place, of a room."""

import hashlib
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shrm_cli.brdf.base import Color
from shrm_cli.errors import ArgumentError, ShrmWarning
from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.lights.split import split_lamps
from shrm_cli.messages import first_of, whole_number
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.options import check_numbers
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.proxy import ProxyBox
from shrm_cli.progress import Progress
from shrm_cli.records import record
from shrm_cli.rooms.bake import bake
from shrm_cli.rooms.capture import box_around, trace_probe
from shrm_cli.rooms.grid import MOST, Lattice, ProbeGrid, color_facts, is_grid, read_grid
from shrm_cli.rooms.room import Room, untold
from shrm_cli.rooms.table import is_table, read_positions
from shrm_cli.vocabulary import ALBEDO, MAX_GRID_ORDER, MAX_LATLONG_HEIGHT, MAX_SAMPLES

_LONGEST = 16
"""Probes along the longest edge of a room, where their number is not given."""
_NAMED = 4
"""The most materials that a warning names."""


@record(eq=False)
class RoomPlan:
    """What is baked of a room."""

    mesh: Mesh
    lattice: Lattice
    """Where its probes are."""
    warnings: list[str]
    """What of its materials does not count, in sentences."""
    made: str
    """A digest of the files and options, which is the fact ``made`` of the grid."""


@record(eq=False)
class OpenRoom:
    """A room that was read, and what is known of its files."""

    room: Room
    surroundings: Probe | None
    """All of the light past it, its lamps, too."""
    warnings: list[str]
    """What of its materials does not count, in sentences."""


def open_room(
    source: str | os.PathLike[str],
    probe: AnyProbe | None = None,
    albedo: Mapping[str, Color] | None = None,
    emission: Mapping[str, Color] | None = None,
) -> OpenRoom:
    """Read a room; the arguments are those of `grid`."""
    albedo, emission = dict(albedo or {}), dict(emission or {})
    mesh = load_mesh(os.fspath(source))
    light = None if probe is None else as_probe(probe)
    outside: tuple[Probe | None, tuple[Disc, ...]] = (None, ())
    if light is not None:
        split = split_lamps(light)
        outside = split.residual_probe, split.discs
        for line in light.warnings():  # its pixels have been read
            warnings.warn(line, ShrmWarning, stacklevel=3)
    changes = {"albedo": albedo, "emission": emission}
    room = Room.of(mesh, (ALBEDO,) * 3, changes, *outside)
    return OpenRoom(room, light, _warnings(mesh, room, albedo))


def _warnings(mesh: Mesh, room: Room, albedo: Mapping[str, Color]) -> list[str]:
    """Return what does not count of the materials of a room, and what is not known of them.

    `albedo` has what some reflect, by their names.
    """
    used = {int(each) for each in np.unique(mesh.face_materials) if each >= 0}
    walls = [mesh.materials[k] for k in used if mesh.materials[k].name not in albedo]
    walls = [each for each in walls if not each.is_clear and not any(each.emission)]
    silent = {each.name for each in untold(mesh)}
    unsaid = [
        f"{each.name!r} ({each.unread[0]})" if not each.is_known and k == 0 else repr(each.name)
        for k, each in enumerate(each for each in walls if each.name in silent)
    ]
    white = [repr(each.name) for each in walls if each.name not in silent and not each.has_color]
    clear = [repr(mesh.materials[k].name) for k in used if mesh.materials[k].is_clear]
    holes = [repr(each.material.name) for each in room.paints.values() if each.has_holes]
    unread = [
        f"{each.name!r} ({', '.join(each.unread)})"
        for each in (mesh.materials[k] for k in used)
        if each.unread and each.is_known and not each.is_clear
    ]
    said = [
        (unsaid, "half is reflected, unless `albedo` says what, by the material "),
        (white, "nothing is lost of the light, unless `albedo` says so, at the material "),
        (clear, "light passes through what is less than half opaque, the material "),
        (holes, "light does not pass through the holes in the texture of the material "),
        (unread, "only the colour and the glow count of the material "),
    ]
    return [f"{mesh.name}: {text}{first_of(names, _NAMED)}" for names, text in said if names]


def grid(
    source: str | os.PathLike[str],
    *,
    size: tuple[int, int, int] | None = None,
    box: Sequence[float] | None = None,
    order: int = 2,
    probe: AnyProbe | None = None,
    albedo: Mapping[str, Color] | None = None,
    emission: Mapping[str, Color] | None = None,
    samples: int = 1024,
    begin: Callable[[RoomPlan], object] | None = None,
    progress: Progress | None = None,
) -> ProbeGrid:
    r"""Find the light at the points of a grid.

    Parameters
    ----------
    source : path-like
        A mesh that is a room; a table of positions and probes, ``.csv``, ``.toml`` or a stage of
        USD, with the probes in its folder or below; or a grid that was written. All arguments are
        about rooms, but `order` is about tables, too.
    size : tuple of 3 int, optional
        Probes along x, y and z; by default 16 along the longest edge.
    box : sequence of 6 float, optional
        Two corners of the box with the probes; by default that of the room.
    order : int
        The largest degree of the harmonics.
    probe : Probe, path-like or array, optional
        Light that is seen past the room.
    albedo, emission : mapping of str to tuple of 3 float, optional
        What materials reflect in place of their base colors, and the radiance that they send.
    samples : int
        Directions along which each probe looks.
    begin : callable, optional
        Called with the `RoomPlan` of a room before it is baked.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    ProbeGrid

    Raises
    ------
    ArgumentError
        If the box is flat, or there are too many probes.
    MeshError, ProbeError
        If a file cannot be read, or nothing sends light.

    Examples
    --------
    >>> import pathlib
    >>> rows = "x,y,z,file\n0,0,0,probes/furnace.exr\n"
    >>> _ = pathlib.Path("one.csv").write_text(rows)
    >>> shrm.grid("one.csv", order=1).summary()["shape"]
    [1, 1, 1]
    """
    name, order = os.fspath(source), whole_number("order", order, 0, MAX_GRID_ORDER)
    check_numbers("box", box, 6)
    if is_grid(name):
        return read_grid(name)
    if is_table(name):
        return read_positions(name, order, progress)
    samples = whole_number("samples", samples, 1, MAX_SAMPLES)
    opened = open_room(name, probe, albedo, emission)
    mesh = opened.room.mesh
    lattice = _lattice(mesh.bounds, size, box)
    light = opened.surroundings
    options = [
        lattice.low.tolist(), lattice.high.tolist(), lattice.shape, order, samples,
        dict(albedo or {}), dict(emission or {}), "" if light is None else light.digest(),
    ]  # fmt: skip
    made = hashlib.sha256(
        Path(name).read_bytes() + json.dumps(options, default=list).encode()
    ).hexdigest()
    if begin is not None:
        begin(RoomPlan(mesh, lattice, opened.warnings, made))
    baked = bake(opened.room, lattice, order, samples, progress)
    colors = color_facts(None if light is None else light.chromaticities)
    return replace(baked, facts={**baked.facts, "made": made, **colors})


def capture(
    source: str | os.PathLike[str],
    at: Sequence[float],
    *,
    size: int = 256,
    samples: int = 64,
    box: Sequence[float] | None = None,
    probe: AnyProbe | None = None,
    albedo: Mapping[str, Color] | None = None,
    emission: Mapping[str, Color] | None = None,
    progress: Progress | None = None,
) -> Probe:
    r"""Make the light probe of a place in a room.

    Parameters
    ----------
    source : path-like
        A mesh that is a room.
    at : sequence of 3 float
        Where the probe is, in the mesh's axes.
    size : int
        Rows of the probe, which is a lat-long in world axes.
    samples : int
        Paths of light through each pixel.
    box : sequence of 6 float, optional
        Two corners of the box that stands for the room where light is looked up; by default
        that of what is seen from the place.
    probe, albedo, emission, progress
        As `grid` takes them.

    Returns
    -------
    Probe

    Raises
    ------
    MeshError, ProbeError
        If a file cannot be read, nothing sends light, or the place is not within the box.

    Examples
    --------
    >>> import pathlib
    >>> corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 2 3 4\n"
    >>> _ = pathlib.Path("corner.obj").write_text(corners)
    >>> sky = "probes/furnace.exr"
    >>> shrm.capture("corner.obj", (0.2, 0.2, 0.2), size=8, samples=2, probe=sky).proxy.at
    (0.2, 0.2, 0.2)
    """
    size = whole_number("size", size, 2, MAX_LATLONG_HEIGHT)
    samples = whole_number("samples", samples, 1, MAX_SAMPLES)
    for name, numbers, count in (("at", at, 3), ("box", box, 6)):
        check_numbers(name, numbers, count)
    opened = open_room(source, probe, albedo, emission)
    light = opened.surroundings
    place = np.array(at, dtype=float)
    low, high = box_around(opened.room, place) if box is None else np.reshape(box, (2, 3))
    proxy = ProxyBox.of(low, high, at)
    found = trace_probe(opened.room, place, size, samples, light, progress)
    made = Probe.from_array(
        found.pixels, "latlong", name=opened.room.mesh.name,
        chromaticities=None if light is None else light.chromaticities,
    )  # fmt: skip
    return replace(made, proxy=proxy)


def _lattice(
    bounds: object, size: tuple[int, int, int] | None, box: Sequence[float] | None
) -> Lattice:
    """Return where the probes of a room are."""
    low, high = np.asarray(bounds if box is None else np.reshape(box, (2, 3)), dtype=float)
    if not (high > low).all():
        what = "is flat" if box is not None else "must be given, for the room is flat"
        raise ArgumentError("box", f"{what}; give two corners x0,y0,z0,x1,y1,z1, the lesser first")
    edges = high - low
    for each in size or ():
        whole_number("size", each, 1, MOST)
    x, y, z = size or (max(1, round(_LONGEST * each)) for each in edges / edges.max())
    if x * y * z > MOST:
        raise ArgumentError("size", f"makes {x * y * z:,} probes; {MOST:,} are the most")
    return Lattice(low, high, (x, y, z))
