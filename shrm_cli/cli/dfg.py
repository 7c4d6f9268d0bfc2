"""`shrm dfg` makes the environment-BRDF tables of split sums and SH exponentials."""

from __future__ import annotations

import os
from itertools import combinations
from typing import TYPE_CHECKING

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import progress_bar, tell
from shrm_cli.cli.types import PATH, flag, option, whole
from shrm_cli.files.whole import keeping
from shrm_cli.progress import using
from shrm_cli.vocabulary import CONTAINERS, Precision

if TYPE_CHECKING:
    from shrm_cli.brdf.environment.file import Kind

_GAIN = 1.001
"""Albedos above it are no rounding."""
_COLUMNS = "fdez-aguera", "turquin", "gltf", "filament"
"""The tables of GGX that have a third column."""


@click.command()
@option("--size", whole(2, 1024), "Texels along both edges.", default=128)
@option(
    "--multiscatter/--no-multiscatter", bool, default=False,
    help="Channels for shaders that add light which meets several facets.",
)  # fmt: skip
@flag("--moments", "Channels for SH exponentials: how much the lobe reflects, and from where.")
@option(
    "--columns", click.Choice(_COLUMNS),
    help="A third column of GGX's table: the light that multiple scattering adds (fdez-aguera, "
    "turquin), or cloth as the engine has it (gltf, filament).",
)  # fmt: skip
@options.optional_brdf_option
@option("-o --output", PATH, "OpenEXR, KTX 2 or 16-bit PNG file to write.", default="dfg.exr")
@usage.force_option
@options.precision_option
@options.report_options
def dfg(
    size: int,
    multiscatter: bool,
    moments: bool,
    columns: Kind | None,
    brdf: str | None,
    output: str,
    force: bool,
    precision: Precision,
) -> None:
    """Make the table that goes with a split sum: GGX's reflectance in a uniform environment.

    Columns are N.V, rows the perceptual roughness from 0 at the top, at texel centres. R is the
    scale and G the bias of f0: the surface reflects f0 * R + G. With --multiscatter R is the
    bias and G their sum; it reflects mix(R, G, f0) * (1 + f0 * (1 / G - 1)), and loses nothing
    where f0 is 1.

    With --moments it is the table that goes with an SH exponential. Its channels base.E, base.N
    and base.T are the integrals of 1, N.L and T.L / T.T over the lobe without Fresnel's term,
    where T = (N.V) N - V points away from the viewer; tail.E, tail.N and tail.T are those with
    (1 - V.H)^5. The lobe of f0 has mix(tail, base, f0).

    With --columns fdez-aguera B is 1 - R - G, and it reflects (f0 * R + G) * (1 + F * B / (1 - F *
    B)) with F = f0 + (1 - f0) / 21; with turquin B is (1 - R - G) / (R + G), and it reflects (f0 *
    R + G) * (1 + f0 * B). With gltf and filament B is what white cloth reflects,
    charlie:visibility=neubelt, beside the columns that each has for GGX.

    With --brdf, such as charlie, R, G and B are the directional albedo of that BRDF, with its
    colours, for each roughness. Of brushed GGX, ggx:anisotropy=0.6, the channels are scale and
    bias of views along the tangent, across it and between both; the file says how a shader mixes
    them. Of charlie it is the E of KHR_materials_sheen: what lies below cloth is scaled by max(0, 1
    - max(color) * E), since the model itself reflects more than it gets at grazing angles.

    \b
      shrm dfg -o dfg.ktx2
      shrm dfg --brdf charlie -o sheen.ktx2
      shrm dfg --columns filament -o dfg.ktx2
    """
    from shrm_cli.brdf.environment.dfg import kind_of
    from shrm_cli.brdf.environment.file import MEANINGS, write_dfg
    from shrm_cli.export.table import SUFFIXES, check_range, check_texture, write_texture

    for one, other in combinations(("multiscatter", "moments", "columns", "brdf"), 2):
        usage.exclude(one, other)
    usage.check_outputs([output], specs=[brdf], suffixes=(*CONTAINERS, *SUFFIXES))
    kind: Kind | None = "moments" if moments else "multiscatter" if multiscatter else columns
    material = None if brdf is None else shrm.parse_spec(brdf)
    is_texture = output.lower().endswith(SUFFIXES)
    if is_texture:
        known = kind or "scale-bias" if material is None else kind_of(material)
        check_texture(output, len(MEANINGS[known].names), precision)
        # A coarse table takes a tenth of the time, and shows what PNG cannot hold.
        check_range(output, shrm.dfg(material, kind=kind, size=min(size, 32)).texels)
    with progress_bar("integrating") as progress, using(progress):
        made = shrm.dfg(material, kind=kind, size=size)
    is_kept = not force and "output" not in usage.given_options()
    with keeping(*([output] if is_kept else [])):
        if is_texture:
            pixel_type = write_texture(output, made.texels, precision)
        else:
            pixel_type = write_dfg(output, made.texels, made.kind, precision, made.brdf)
    meaning, white = made.meaning, made.white_furnace
    result = {
        "file": os.fspath(output),
        "size": size,
        "multiscatter": multiscatter,
        "moments": moments,
        "channels": meaning.channels,
        "reflectance": meaning.reflectance,
        "maximum": float(made.texels.max()),
        "white_furnace": {"minimum": float(white.min()), "maximum": float(white.max())},
        "precision": pixel_type,
    }
    if brdf is not None or columns:
        result |= {"columns": made.kind, "brdf": made.brdf}
    if moments:
        result["mean_direction"] = meaning.mean
    lines = [
        f"{output}: {size} x {size}, N.V across, roughness down; {', '.join(meaning.names)}; "
        f"{pixel_type}",
        f"  channels       {meaning.channels}",
        f"  reflects       {meaning.reflectance}",
        *([f"  mean           {meaning.mean}"] if moments else []),
        f"  white furnace  {white.min():.2%} to {white.max():.2%}"
        + ("" if made.kind == "albedo" else " at f0 = 1 by single scattering"),
    ]
    if made.kind == "albedo" and white.max() > _GAIN:
        gaining = f"{(white > _GAIN).mean():.1%} of the texels"
        lines.append(f"  gains energy   in {gaining}, as the model has it; nothing passes there")
    tell(result, lines)
