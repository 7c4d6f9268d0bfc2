"""From a mesh to its transfer: blocks of vertices or texels on all threads, bounce after bounce."""

import hashlib
import json
import os
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.errors import ArgumentError, ShrmWarning
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.paint import Paint, linear_colors, points_of
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import brushed_tangents, perpendicular
from shrm_cli.geometry.textures import Shelf
from shrm_cli.maps.info import spec_of
from shrm_cli.messages import check_call
from shrm_cli.progress import Progress, in_order, tell
from shrm_cli.records import record
from shrm_cli.sources import TRANSFER, fingerprint
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.transfer.gather import (
    DiffuseLight,
    Gathering,
    GlossyLight,
    Sent,
    Sites,
    sites_of,
    sufficient_order,
)
from shrm_cli.transfer.transfer import Facts, Transfer
from shrm_cli.transfer.work import Work, unfinished
from shrm_cli.vocabulary import (
    ALBEDO,
    DEFAULT_PRODUCT_ORDER,
    MAX_MATRIX_ORDER,
    MAX_SAMPLES,
    MAX_TRANSFER_ORDER,
    TRANSFER_TEXTURES,
)

if TYPE_CHECKING:
    from shrm_cli.maps.product.product import ProductTexture

_RAYS_AT_ONCE = 2**16
"""Rays of the vertices or texels that a thread takes at a time."""
_MOST_BOUNCES = 64
"""The most bounces; each of them dims the light at least as much as the one before it did."""


@record(eq=False)
class Plan:
    """What is to be baked, and what it will take.

    `bounces` is how often light may be reflected within the mesh. `samples` is the number of rays
    that are traced for each vertex and bounce. `albedo` is what the mesh reflects of its
    irradiance, for bounces and for pictures: a number, three for R, G and B, or an array of shape
    (v, 1 or 3); or ``"mesh"``, what its materials say. `product` is the product function of what
    the mesh reflects in bounces in place of `albedo`. Its order is at least `order`, and matrices
    are needed. `glossy` tells whether matrices are baked besides the vectors. `tangents`, of shape
    (v, 3), are the x axes of the vertices' frames, unit vectors at right angles to the normals;
    horizontal by default. `texture` is the number of texels along the edge of a texture whose
    texels are baked in place of the vertices. `known_sites` are those of mesh and texture, where
    these were looked at before.
    """

    mesh: Mesh
    order: int = 4
    bounces: int = 0
    samples: int = 1024
    albedo: ArrayLike = ALBEDO
    glossy: bool = False
    tangents: Array | None = None
    product: "ProductTexture | None" = None
    texture: int | None = None
    known_sites: Sites | None = None

    def __post_init__(self) -> None:
        limits = {
            "order": (0, MAX_TRANSFER_ORDER),
            "bounces": (0, _MOST_BOUNCES),
            "samples": (1, MAX_SAMPLES),
            "texture": TRANSFER_TEXTURES,
        }
        if self.glossy:
            limits["order"] = (0, MAX_MATRIX_ORDER)
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if name == "texture" and value is None:
                continue
            if not low <= value <= high:
                raise ArgumentError(name, f"is {value}, but must be {low} .. {high}")
        self.reflected()
        if self.product is not None and not (self.glossy and self.product.order >= self.order):
            raise ArgumentError("product", "needs matrices, and a product function of their order")

    def reflected(self) -> Array:
        """The albedo of the mesh, or of each site, as an array of shape (1 or s, channels)."""
        if isinstance(self.albedo, str):
            return self._own_colors
        albedo = np.atleast_2d(np.asarray(self.albedo, dtype=float))
        rows, channels = albedo.shape[0], albedo.shape[-1]
        if albedo.ndim != 2 or rows not in (1, len(self.mesh.vertices)) or channels not in (1, 3):
            raise ArgumentError("albedo", f"has the shape {albedo.shape}; give one row or one each")
        if not (albedo.min() >= 0 and albedo.max() <= 1):  # NaN is neither
            raise ArgumentError("albedo", "has numbers outside 0 .. 1")
        return albedo if rows == 1 else self.sites.of_vertices(albedo)

    @cached_property
    def _own_colors(self) -> Array:
        """What the materials of the mesh reflect at the sites, shape (s, 3)."""
        mesh, sites = self.mesh, self.sites
        shelf, found = Shelf("give another `albedo`"), np.full((len(sites.faces), 3), ALBEDO)
        for number in {int(each) for each in np.unique(mesh.face_materials) if each >= 0}:
            if not mesh.materials[number].is_known:
                continue
            paint = Paint(mesh, mesh.materials[number].matte, shelf)
            where = sites.faces, sites.weights, sites.steps
            for some, points in points_of(mesh, number, *where):
                found[some] = paint.base_color(points)
        return found

    @cached_property
    def sites(self) -> Sites:
        """What is baked for: the vertices, or the texels."""
        return self.known_sites or sites_of(self.mesh, self.texture)

    @property
    def channels(self) -> int:
        """Channels of the transfer: colours matter only where light is reflected."""
        return self._channels(self.bounces)

    def _channels(self, bounce: int) -> int:
        if not bounce:
            return 1
        return self.reflected().shape[1] if self.product is None else self.product.channels

    @property
    def step(self) -> int:
        """Sites of a block: rotations of high orders have more numbers than there are rays."""
        return max(1, _RAYS_AT_ONCE // max(self.samples, (self.order + 1) ** 4 // 8))

    def frames(self) -> Array:
        """The frames of the sites, shape (s, 3, 3), with axes as rows."""
        normals = self.sites.normals
        if self.tangents is None:
            return surface_frames(normals, horizontal_tangents(normals))
        tangents = self.sites.of_vertices(self.tangents)
        if self.texture is not None:
            tangents = perpendicular(tangents, normals)
        return surface_frames(normals, tangents)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of the arrays that are filled, in the order of the work."""
        sites, count = len(self.sites.positions), (self.order + 1) ** 2
        found: dict[str, tuple[int, ...]] = {}
        for bounce in range(self.bounces + 1):
            found[_stage(bounce)] = (sites, count, self._channels(bounce))
            if self.has_matrices(bounce):
                found[_matrices(bounce)] = (sites, count, count, self._channels(bounce))
        return found

    def has_matrices(self, bounce: int) -> bool:
        """Whether matrices are baked after so many bounces: glossy bounces need those before."""
        return self.glossy and (bounce == self.bounces or self.product is not None)

    def size(self) -> int:
        """The bytes of all arrays together, which are on disk where there is an output."""
        return 4 * sum(int(np.prod(shape)) for shape in self.shapes().values())

    def facts(self) -> Facts:
        """What the transfer's file says of it."""
        mesh, product = self.mesh, self.product
        return Facts(
            Path(mesh.name).name, mesh_digest(mesh.vertices, mesh.faces), self.bounces,
            self.samples, "" if product is None else spec_of(product.info.brdf),
        )  # fmt: skip

    def is_of(self, transfer: Transfer) -> bool:
        """Whether a transfer was baked by such a plan, as far as it says, without tracing rays."""
        own, its = self.sites.texels, transfer.texels
        facts = self.facts(), self.order, self.glossy, own is None
        if (transfer.facts, transfer.order, transfer.matrices is not None, its is None) != facts:
            return False
        pairs: list[tuple[NDArray[Any], NDArray[Any]]] = [(self.reflected(), transfer.albedo)]
        if transfer.frames is not None:
            pairs.append((self.frames(), transfer.frames))
        if own is not None and its is not None:
            pairs.append((own.rows, its.rows))
        digits = np.float32  # what files hold
        return all(np.array_equal(a.astype(digits), b.astype(digits)) for a, b in pairs)

    def key(self) -> str:
        """A digest of everything that the arrays depend on, the program included."""
        program = fingerprint(TRANSFER)
        options = json.dumps([self.order, self.bounces, self.samples, self.glossy, program])
        digest = hashlib.sha256(options.encode())
        mesh = self.mesh
        arrays = [mesh.vertices, mesh.faces, mesh.normals, self.frames(), self.reflected()]
        arrays.append(self.sites.origins)
        for array in [*arrays, *([] if self.product is None else [self.product.table])]:
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()


def transfer_plan(
    mesh: Mesh | str | os.PathLike[str],
    *,
    order: int | None = None,
    bounces: int = 0,
    albedo: ArrayLike | None = None,
    samples: int = 1024,
    matrices: bool = False,
    brush: str | tuple[float, float, float] | None = None,
    brdf: AnyBrdf | None = None,
    texture: int | None = None,
) -> Plan:
    """Return what is baked of a mesh; `bake` does it.

    `order` is by default what the mesh needs, see `shrm_cli.transfer.gather`; with matrices, whose
    size grows with its fourth power, it is `DEFAULT_PRODUCT_ORDER`. `albedo` is what the mesh
    reflects, as `Plan` takes it, or ``"vertex"``, the colors of its vertices; by default what its
    materials say, if they do, and else `ALBEDO`. `brush` says the tangents of the matrices, as
    `brushed_tangents` takes them. `brdf` is what the mesh reflects in bounces in place of `albedo`;
    matrices are baked with it.
    """
    from shrm_cli.geometry.load import load_mesh
    from shrm_cli.maps.product.prefilter import product_texture
    from shrm_cli.maps.product.product import ProductTexture

    found = load_mesh(mesh) if isinstance(mesh, str | os.PathLike) else mesh
    if albedo is None:
        albedo = "mesh" if any(each.has_color for each in found.materials) else ALBEDO
    if isinstance(albedo, str) and albedo == "vertex":
        if found.colors is None:
            raise ArgumentError("albedo", f"cannot be vertex: {found.name} has no vertex colours")
        encodings = [each.colored for each in found.materials if each.colored]
        albedo = linear_colors(found.colors, encodings[0] if encodings else "linear")
    tangents = None if brush is None else brushed_tangents(found, brush)
    matrices = matrices or brdf is not None
    sites = product = None
    if order is None and matrices:
        order = DEFAULT_PRODUCT_ORDER
    elif order is None:
        sites = sites_of(found, texture)
        order = sufficient_order(sites, Rays(found))
    if brdf is not None:
        product = cast(ProductTexture, product_texture(as_brdf(brdf), order).map)
    options = order, bounces, samples, albedo, matrices, tangents, product, texture, sites
    return Plan(found, *options)


def transfer(
    mesh: Mesh | str | os.PathLike[str], *, progress: Progress | None = None, **arguments: Any
) -> Transfer:
    r"""Bake how a mesh shadows and lights itself.

    Parameters
    ----------
    mesh : Mesh or path-like
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **arguments
        Those of `transfer_plan`: `order`, `bounces`, `albedo`, `samples`, `matrices`, `brush`,
        `brdf`, `texture`.

    Returns
    -------
    Transfer
        In memory; `shrm_cli.transfer.file.write_transfer` writes it.

    Raises
    ------
    ArgumentError, MeshError

    Warns
    -----
    ShrmWarning
        Where light between vertices is off, as the triangles are large beside their shadows.

    Examples
    --------
    >>> corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    >>> import pathlib
    >>> _ = pathlib.Path("triangle.obj").write_text(corners)
    >>> shrm.transfer("triangle.obj", order=1, samples=16).summary()["vertices"]
    3
    """
    from shrm_cli.transfer.between import error_between, remarks

    check_call(transfer_plan, mesh, **arguments)
    plan = transfer_plan(mesh, **arguments)
    made: Transfer = bake(plan, progress=progress)
    for line in remarks(plan.mesh, error_between(plan.mesh, made)):
        warnings.warn(line, ShrmWarning, stacklevel=2)
    return made


def mesh_digest(vertices: Array, faces: NDArray[np.integer]) -> str:
    """SHA-256 of the vertices and triangles of a mesh, in hexadecimal digits."""
    digest = hashlib.sha256(np.ascontiguousarray(vertices, "<f8").data)
    digest.update(np.ascontiguousarray(faces, "<i8").data)
    return digest.hexdigest()


def bake(
    plan: Plan,
    *,
    rays: Rays | None = None,
    keep: str | os.PathLike[str] | None = None,
    use: Callable[[Transfer], Any] | None = None,
    progress: Progress | None = None,
) -> Any:
    """Bake the transfer of a mesh.

    `keep` is an output beside which unfinished work is kept, so that a later run goes on with it.
    The arrays are on disk then rather than in memory. `use` is called with the transfer; unfinished
    work is kept until it returns. With `keep` the transfer is valid until then only.

    Returns the transfer, or what `use` returns.
    """
    use = use or (lambda transfer: transfer)
    if rays is None:
        rays = Rays(plan.mesh)
    shapes, step = plan.shapes(), plan.step
    place = (
        nullcontext(Work(shapes, step))
        if keep is None
        else unfinished(Path(keep), plan.key(), shapes, step)
    )
    with place as work:
        _fill(work, plan, rays, progress)
        vectors = work.arrays[_stage(plan.bounces)]
        matrices = work.arrays.get(_matrices(plan.bounces))
        frames = plan.frames() if plan.glossy else None
        direct = work.arrays[_stage(0)] if plan.bounces else None
        parts = vectors, plan.reflected(), plan.facts(), matrices, frames, direct
        return use(Transfer(*parts, plan.sites.texels))


def _fill(work: Work, plan: Plan, rays: Rays, progress: Progress | None) -> None:
    gathering = Gathering(plan.sites, plan.frames(), rays, plan.order, plan.samples)
    total = (plan.bounces + 1) * -(-len(plan.sites.positions) // plan.step)
    for bounce in range(plan.bounces + 1):
        glossy = plan.has_matrices(bounce)
        sent = _sent(work, plan, bounce) if bounce else None
        pending = _pending(work, bounce, glossy)
        finished = (bounce + 1) * total // (plan.bounces + 1) - len(pending)

        def one(part: slice, sent: Any = sent, glossy: bool = glossy, bounce: int = bounce) -> None:
            vectors, matrices = gathering.transfer(part, sent, glossy)
            if matrices is not None:
                work.put(_matrices(bounce), part, matrices)
            work.put(_stage(bounce), part, vectors.astype(np.float32))

        for done, _ in enumerate(in_order(one, pending), start=1):
            tell(progress, finished + done, total)


def _sent(work: Work, plan: Plan, bounce: int) -> Sent:
    """What the vertices send that is to be gathered as light of a bounce."""
    if plan.product is None:
        vectors = work.arrays[_stage(bounce - 1)]
        return DiffuseLight((plan.reflected()[:, None] / np.pi * vectors).astype(np.float32))
    matrices = work.arrays[_matrices(bounce - 1)]
    return GlossyLight(matrices, plan.frames(), plan.product, plan.product.channels)


def _pending(work: Work, bounce: int, glossy: bool) -> list[slice]:
    """The blocks of a bounce that are not done: the matrices of a block come before its vectors."""
    names = [_matrices(bounce), _stage(bounce)] if glossy else [_stage(bounce)]
    starts = {part.start: part for name in names for part in work.blocks(name)}
    return [starts[start] for start in sorted(starts)]


def _stage(bounce: int) -> str:
    """The name of the array of transfer vectors after so many bounces."""
    return f"bounce{bounce}"


def _matrices(bounce: int) -> str:
    """The name of the array of transfer matrices after so many bounces."""
    return f"matrices{bounce}"
