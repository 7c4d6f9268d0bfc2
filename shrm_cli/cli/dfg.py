"""`shrm dfg` makes the environment-BRDF tables of split sums and SH exponentials."""

import os

import click

from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.options import precision_option, report_options, tell
from shrm_cli.cli.outputs import check_outputs, force_option
from shrm_cli.cli.usage import exclude, given_options
from shrm_cli.files.whole import keeping
from shrm_cli.vocabulary import CONTAINERS, Precision


@click.command()
@click.option(
    "--size", type=click.IntRange(2, 1024), default=128, show_default=True,
    help="Texels along both edges.",
)  # fmt: skip
@click.option(
    "--multiscatter/--no-multiscatter", default=False, show_default=True,
    help="Channels for shaders that add light which meets several facets.",
)  # fmt: skip
@click.option(
    "--moments", is_flag=True,
    help="Channels for SH exponentials: how much the lobe reflects, and from where.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(), default="dfg.exr", show_default=True,
    help="OpenEXR file to write.",
)  # fmt: skip
@force_option
@precision_option
@report_options
def dfg(
    size: int,
    multiscatter: bool,
    moments: bool,
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
    """
    from shrm_cli.brdf.environment.environment_brdf import environment_table, moments_table
    from shrm_cli.brdf.environment.file import MEANINGS, Kind, write_dfg

    exclude("multiscatter", "moments")
    check_outputs([output], suffixes=CONTAINERS)
    kind: Kind = "moments" if moments else "multiscatter" if multiscatter else "scale-bias"
    with progress_bar("integrating") as progress:
        if moments:
            table = moments_table(size, progress)
        else:
            table = environment_table(size, multiscatter, progress)
    is_kept = not force and "output" not in given_options()
    with keeping(*([output] if is_kept else [])):
        pixel_type = write_dfg(output, table, kind, precision)
    meaning = MEANINGS[kind]
    # This is what a white metal reflects in a white furnace, by single scattering.
    white = {
        "scale-bias": table[..., :2].sum(axis=-1),
        "multiscatter": table[..., 1],
        "moments": table[..., 0],
    }[kind]
    result = {
        "file": os.fspath(output),
        "size": size,
        "multiscatter": multiscatter,
        "moments": moments,
        "channels": meaning.channels,
        "reflectance": meaning.reflectance,
        "maximum": float(table.max()),
        "white_furnace": {"minimum": float(white.min()), "maximum": float(white.max())},
        "precision": pixel_type,
    }
    if moments:
        result["mean_direction"] = meaning.mean
    lines = [
        f"{output}: {size} x {size}, N.V across, roughness down; {', '.join(meaning.names)}; "
        f"{pixel_type}",
        f"  channels       {meaning.channels}",
        f"  reflects       {meaning.reflectance}",
        *([f"  mean           {meaning.mean}"] if moments else []),
        f"  white furnace  {white.min():.2%} to {white.max():.2%} at f0 = 1 by single scattering",
    ]
    tell(result, lines)
