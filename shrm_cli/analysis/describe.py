"""`describe`: what a file is, and what is known of it."""

import os
import shlex
from collections.abc import Callable
from functools import cached_property
from typing import Any

from shrm_cli.analysis.facts import in_percent, in_words, map_facts, probe_facts
from shrm_cli.batch.collect import is_collection, read_collection
from shrm_cli.brdf.environment.file import read_table_facts
from shrm_cli.brdf.measured.table import Table, is_table
from shrm_cli.brdf.spec import is_measured_file
from shrm_cli.export.facts import read_engine_facts
from shrm_cli.export.ktx import read_ktx2_facts
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.shader.file import read_layers_facts
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.records import record
from shrm_cli.rooms.export import read_grid_facts
from shrm_cli.rooms.grid import is_grid, read_grid
from shrm_cli.transfer.file import (
    is_pifu,
    is_transfer,
    read_baked_facts,
    read_pifu_facts,
    read_transfer,
)
from shrm_cli.vocabulary import MESH_SUFFIXES


@record(eq=False)
class Description:
    """What a file is."""

    what: str
    """The words that follow the name of the file: ``is a map``."""
    facts: dict[str, Any]
    """Its ``kind``, and what is known of it, as JSON has it."""
    warnings: tuple[str, ...] = ()
    """What the user should know of a probe."""
    has_statistics: bool = False
    """Whether the facts have those of the pixels of a probe."""
    is_probe: bool = False
    """Whether it is light, to which the options of reading apply."""

    @cached_property
    def words(self) -> dict[str, str]:
        """What the statistics of a probe, or errors, say to people, by the names of the facts."""
        return in_words(self.facts) if self.has_statistics else in_percent(self.facts)


def describe(
    file: str | os.PathLike[str], reading: ReadOptions | None = None, *, stats: bool = True
) -> Description:
    """Tell what a file is: a map or table of shrm, light, a measured BRDF, a mesh.

    Parameters
    ----------
    file : path-like
    reading : ReadOptions, optional
        How a probe is read.
    stats : bool
        Whether the pixels of a probe are read: range, irradiance, white balance, lamps.

    Raises
    ------
    ShrmError
        If it is damaged, or nothing that is known.

    Examples
    --------
    >>> shrm.describe("probes/studio.exr", stats=False).facts["layout"]
    'latlong'
    """
    name = os.fspath(file)
    if (made := read_engine_facts(name)) is not None:
        return Description("is for engines", made)
    for is_one, what, facts in _KINDS:
        if is_one(name):
            return Description(what, facts(name))
    if (table := read_table_facts(name)) is not None:
        kind = "environment-BRDF table"
        return Description(f"is an {kind}", {"kind": kind, **table})
    if (textures := read_layers_facts(name)) is not None:
        facts_of = {"kind": "textures of --shader", **textures}
        return Description("holds the textures of a map", facts_of)
    if (grid := read_grid_facts(name)) is not None:
        facts_of = {"kind": "grid of probes, as a picture of coefficients", **grid}
        return Description("is a grid of probes", facts_of)
    if (texture := read_ktx2_facts(name)) is not None:
        return Description("is a texture", {"kind": "KTX 2 texture of engines", **texture})
    if is_measured_file(name):
        return Description("is a measured BRDF", _measured(name))
    return _probe(name, reading, stats)


def _is_mesh(name: str) -> bool:
    return os.path.splitext(name)[1].lower() in MESH_SUFFIXES and os.path.isfile(name)


def _mesh(name: str) -> dict[str, Any]:
    from shrm_cli.geometry.load import load_mesh  # what reads meshes is slow to load

    mesh = load_mesh(name)
    low, high = mesh.bounds.tolist()
    baked, quoted = read_baked_facts(name), shlex.quote(name)
    see = f"shrm render MAP --mesh {quoted}"
    if baked is not None:  # which `shrm render` does not read
        see = f"shrm transfer {quoted} -o x.npz, then {see} --transfer x.npz"
    return {
        "kind": "mesh" if baked is None else "mesh with precomputed transfer",
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "low": low,
        "high": high,
        "texture_coordinates": mesh.uvs is not None,
        "vertex_colors": mesh.colors is not None,
        "materials": [material.name for material in mesh.materials],
        **({} if baked is None else {"transfer": baked}),
        "see": see,
    }


def _transfer(name: str) -> dict[str, Any]:
    return {"kind": "precomputed transfer", **read_transfer(name).summary()}


def _pifu(name: str) -> dict[str, Any]:
    use = "for PIFu; shrm render reads what shrm transfer MESH -o x.npz writes"
    return {"kind": "precomputed transfer of PIFu", **read_pifu_facts(name), "use": use}


def _grid(name: str) -> dict[str, Any]:
    return {"kind": "grid of probes", **read_grid(name).summary()}


def _collection(name: str) -> dict[str, Any]:
    found = read_collection(name)
    return {"kind": "collection of coefficients", "probes": len(found.names), **found.settings()}


def _table(name: str) -> dict[str, Any]:
    table = Table.open(name)
    return {
        "kind": "BRDF table",
        "nodes": [len(axis) for axis in table.axes],
        "center": table.center,
        "includes_cosine": table.includes_cosine,
        "see": f"shrm brdf {name}",
    }


def _measured(name: str) -> dict[str, Any]:
    from shrm_cli.brdf.measured import open_measured  # it is slow to load

    found = open_measured(name)
    return {"kind": "measured BRDF", "format": found.name, "see": f"shrm brdf {name}"}


def _probe(name: str, reading: ReadOptions | None, stats: bool) -> Description:
    """Describe a probe, which a file is that is nothing else."""
    probe = open_probe(name, reading)
    facts = probe_facts(probe, stats)
    # That integers end at white is among the facts.
    lines = probe.report.warnings(white=False) if stats else probe.report.notes
    said = tuple(f"{name}: {line}" for line in lines)
    return Description("is a probe", facts, said, stats, is_probe=True)


_KINDS: tuple[tuple[Callable[[str], bool], str, Callable[[str], dict[str, Any]]], ...] = (
    (is_map, "is a map", lambda name: map_facts(open_map(name))),
    (is_transfer, "is a precomputed transfer", _transfer),
    (is_pifu, "is a precomputed transfer", _pifu),
    (is_grid, "is a grid of probes", _grid),
    (is_collection, "is a collection of coefficients", _collection),
    (is_table, "is a BRDF table", _table),
    (_is_mesh, "is a mesh", _mesh),
)
"""How files are recognized, what they are, and how their facts are read."""
