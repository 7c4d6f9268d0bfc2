"""A room: triangles that reflect diffusely, lamps among them, and what is seen through openings."""

from collections.abc import Mapping

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.normals import face_normals
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record

Color = tuple[float, float, float]


@record(eq=False)
class Room:
    """Diffuse triangles, of which some send light, and the surroundings of all."""

    mesh: Mesh
    normals: Array
    """Unit normals of the triangles, on the side where their vertices' normals are, shape (m, 3).
    What is met from behind blocks light, and sends none."""
    albedo: Array
    """What each triangle reflects of its irradiance, shape (m, 3)."""
    emission: Array
    """The radiance that it sends, shape (m, 3)."""
    sky: Probe | None = None
    """What is seen past the room, without its compact lamps; black by default."""
    discs: tuple[Disc, ...] = ()
    """These lamps."""

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        albedo: Color,
        changes: Mapping[str, Mapping[str, Color]],
        sky: Probe | None = None,
        discs: tuple[Disc, ...] = (),
    ) -> "Room":
        """Return the room that a mesh is.

        The base colours of the materials of `mesh` are their albedos. `albedo` is that of triangles
        without a material. `changes` has under ``albedo`` and ``emission`` other values for
        materials, by their names. `sky` and `discs` are those of `Room`.

        Raises MeshError if no material has a name, or nothing sends light.
        """
        names = [each.name for each in mesh.materials]
        if max((max(each) for each in changes.get("albedo", {}).values()), default=0) > 1:
            raise MeshError(f"{mesh.name}: `albedo` has a number above 1, which makes light")
        for given in changes.values():
            for name in given:
                if name not in names:
                    known = ", ".join(sorted({each for each in names if each})[:8]) or "no names"
                    raise MeshError(f"{mesh.name}: no material {name!r:.80}; it has {known}")
        # The last row is that of triangles without a material, whose index is -1.
        values = {
            "albedo": [*(each.base_color for each in mesh.materials), albedo],
            "emission": [*(each.emission for each in mesh.materials), (0.0, 0.0, 0.0)],
        }
        found = {}
        for key, colors in values.items():
            others = changes.get(key, {})
            row = [others.get(name, each) for name, each in zip([*names, ""], colors, strict=True)]
            found[key] = np.array(row, dtype=float)[mesh.face_materials]
        if sky is None and not found["emission"].any():
            raise MeshError(
                f"{mesh.name}: nothing in it sends light; give `emit` NAME=R,G,B for a material, "
                "or `probe` for what is seen through its openings"
            )
        normals = face_normals(mesh.vertices, mesh.faces)
        smooth = mesh.normals[mesh.faces].sum(axis=1)
        sides = np.where(np.einsum("fi,fi->f", normals, smooth) < 0, -1.0, 1.0)
        return cls(mesh, sides[:, None] * normals, found["albedo"], found["emission"], sky, discs)

    @property
    def size(self) -> float:
        """The diagonal of the room's box."""
        return float(np.linalg.norm(np.ptp(self.mesh.vertices, axis=0)))

    def sky_radiance(self, directions: Array) -> Array:
        """Return what is seen past the room, shape (..., 3), without the compact lamps."""
        if self.sky is None:
            return np.zeros((*directions.shape[:-1], 3))
        return self.sky.radiance(directions)
