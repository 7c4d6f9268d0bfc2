"""`shrm transfer` bakes how a mesh shadows and lights itself."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import announce, conclude, progress_bar
from shrm_cli.cli.types import ALBEDO, BRUSH, PATH, flag, option, whole
from shrm_cli.errors import OutputError, TransferError
from shrm_cli.files.whole import exists_error, keeping, protecting
from shrm_cli.vocabulary import (
    DEFAULT_PRODUCT_ORDER,
    MAX_SAMPLES,
    MAX_TRANSFER_ORDER,
    TRANSFER_TEXTURES,
)

if TYPE_CHECKING:
    from shrm_cli.geometry.mesh import Mesh
    from shrm_cli.transfer.bake import Plan
    from shrm_cli.transfer.transfer import Transfer

_SUFFIXES = (".npz", ".glb", ".ply", ".txt")


@click.command()
@click.argument("mesh", type=PATH)
@option(
    "-o --output", PATH,
    help="File to write: .npz, .glb, .ply, or .txt as PIFu has it.  "
    "[default: MESH.transfer.npz in the current folder]",
)  # fmt: skip
@option(
    "--order", whole(0, MAX_TRANSFER_ORDER),
    help="Largest degree of the light's harmonics.  [default: 4, or up to 16 of .npz where little "
    "of the sky is seen, as in a room]",
)  # fmt: skip
@option("--bounces", whole(0, 2), "How often light is reflected within the mesh.", default=0)
@option(
    "--albedo", ALBEDO,
    help="What the mesh reflects diffusely: a number, R,G,B, the colours of its vertices, or all "
    "that the mesh says: base colours, textures and vertex colours.  [default: mesh; 0.5 where it "
    "says nothing]",
)  # fmt: skip
@option("--samples", whole(1, MAX_SAMPLES), "Rays of each vertex and bounce.", default=1024)
@option(
    "--brdf SPEC", str,
    help="What the mesh reflects in bounces in place of --albedo, glossy or not; bakes matrices, "
    "which are for this BRDF then.",
)  # fmt: skip
@flag("--matrices", "Bake matrices too, for glossy surfaces.")
@option(
    "--brush", BRUSH,
    help="Tangents of the matrices: along the texture coordinate u, or a direction.  "
    "[default: around +Y]",
)  # fmt: skip
@option(
    "--texture", whole(*TRANSFER_TEXTURES),
    help="Bake for the texels of a texture of so many along its edge in place of the vertices.",
)  # fmt: skip
@usage.force_option
@options.report_options
def transfer(
    mesh: str,
    output: str | None,
    order: int | None,
    bounces: int,
    albedo: str | tuple[float, ...] | None,
    brdf: str | None,
    matrices: bool,
    texture: int | None,
    force: bool,
    **values: Any,
) -> None:
    """Bake how MESH shadows and lights itself, vertex by vertex, for light of any kind.

    The file holds a vector for each vertex: its products with the coefficients of a light are the
    irradiance, without 1/pi. With --matrices it also holds a matrix for each vertex, which product
    textures of glossy BRDFs need. `shrm render --mesh MESH --transfer FILE` shades with it. With
    --texture there is a vector for each texel, for coarse meshes.

    Rays are traced on all threads. A run that is interrupted keeps its work in FILE.part, and the
    next one goes on with it.

    \b
      shrm transfer bunny.obj --bounces 1 --albedo 0.8
      shrm transfer bunny.obj --matrices -o glossy.npz
      shrm transfer crate.obj --texture 256
      shrm transfer bunny.obj --bounces 1 --brdf ggx:roughness=0.5,f0=gold
      shrm transfer bunny.obj --order 2 -o bounce0.txt
    """
    from shrm_cli.transfer.bake import bake, transfer_plan
    from shrm_cli.transfer.between import error_between, remarks
    from shrm_cli.transfer.file import FACES, WRITERS, write_transfer

    matrices = matrices or brdf is not None
    usage.refuse_inapplicable({
        "brush": (matrices, "with --matrices"),
        "brdf": (bounces > 0, "with --bounces; shadows alone are the same for all"),
        "albedo": (brdf is None, "without --brdf"),
    })  # fmt: skip
    target = output or f"{Path(mesh).stem}.transfer.npz"
    suffix = _checked_suffix(target, matrices, texture)
    beside = [str(Path(target).with_name(FACES))] if suffix == ".txt" else []
    usage.check_outputs([target, *beside], files=[mesh])
    if order is None and suffix != ".npz":  # engines hold few numbers a vertex
        order = DEFAULT_PRODUCT_ORDER
    plan = transfer_plan(
        mesh, order=order, bounces=bounces, albedo=albedo, matrices=matrices, brdf=brdf,
        texture=texture, **values,
    )  # fmt: skip
    if not (force or output):
        _keep_other(target, plan)
    found, beside_it = plan.mesh, f"{plan.size():,} bytes beside the output while it works"
    announce([f"{mesh}: {_sites(plan)}, order {plan.order}; {beside_it}"])

    def write(baked: Transfer) -> dict[str, Any]:
        if suffix == ".npz":
            write_transfer(target, baked, found)
        else:
            WRITERS[suffix](target, found, baked)
        error = error_between(found, baked)
        return baked.summary() | ({} if error is None else {"error_between": error})

    unchanged = [] if force else [*beside, *([] if output else [target])]
    with progress_bar("tracing") as progress, keeping(*unchanged):
        said = bake(plan, keep=target, use=write, progress=progress)
    said = {"file": target, **said, "bytes": Path(target).stat().st_size}
    warnings = _missing(found) if albedo in (None, "mesh") and brdf is None else []
    warnings += remarks(found, said.get("error_between"))
    conclude(said, _report(target, plan, said), warnings)


def _sites(plan: Plan) -> str:
    """Return how many vertices or texels there are, in words."""
    of = "vertices" if plan.sites.texels is None else "texels"
    return f"{len(plan.sites.positions):,} {of}"


def _report(target: str, plan: Plan, said: dict[str, Any]) -> list[str]:
    """Return lines about what was written, of which the facts are given."""
    texels = plan.sites.texels
    of = f"{len(plan.mesh.file_rows):,} in the file"
    if texels is not None:
        of = "a texture of {1} x {0}".format(*texels.rows.shape)
    kinds = "vectors and matrices" if plan.glossy else "vectors"
    lines = [
        f"{target}: transfer {kinds} of {_sites(plan)}, of {of}, order {plan.order}, "
        f"{plan.bounces} bounces, {said['bytes']:,} bytes",
    ]
    if Path(target).suffix.lower() == ".npz":  # others hold none
        average = ", ".join(f"{each:g}" for each in said["albedo"])
        lines.append(f"  albedo         {average} on average")
    if "error_between" in said:
        lines.append(f"  between them   {said['error_between']:.1%} RMS error of the light")
    return lines


def _checked_suffix(target: str, matrices: bool, texture: int | None) -> str:
    """Return the suffix of an output, which tells its format."""
    suffix = Path(target).suffix.lower()
    if suffix not in _SUFFIXES:
        raise OutputError(f"{target}: transfer is written as {', '.join(_SUFFIXES)}; name it so")
    if (matrices or texture is not None) and suffix != ".npz":
        kind = "matrices" if texture is None else "textures of transfer"
        raise OutputError(f"{target}: {kind} are written as .npz only; name it so")
    return suffix


def _keep_other(target: str, plan: Plan) -> None:
    """Refuse to replace what is no such transfer, as far as it says, before rays are traced."""
    from shrm_cli.files.npz import is_cut_off
    from shrm_cli.transfer.file import read_transfer

    # What is cut off may be of the same inputs, which is known when the transfer is written.
    if not os.path.lexists(target) or (os.path.isfile(target) and is_cut_off(target)):
        return
    with suppress(TransferError), protecting():
        if plan.is_of(read_transfer(target)):
            return
    raise exists_error(target, "other inputs or options made it")


def _missing(mesh: Mesh) -> list[str]:
    """Return a line about the first material of a mesh whose file is missing, if there is one."""
    return [
        f"{mesh.name}: half is reflected, unless `albedo` says what, by the material "
        f"{each.name!r}, {each.unread[0]}"
        for each in mesh.materials
        if not each.is_known
    ][:1]
