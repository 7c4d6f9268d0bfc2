"""Figure 8: several BRDFs, models and measured ones, on several meshes."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from research.extent import Extent
from research.inputs import say, small_probes
from research.product.orders import measured_errors
from research.product.scenes import Shot, exposure, write_sheet
from research.product.textures import energy_of, light_of, texture
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer

FITS = "lafortune:fit=brushedmetal", "lafortune:fit=bluepaint"
"""What stands for measured files where none are given: fits to measurements."""
_MOST_MEASURED = 2


@dataclass(frozen=True)
class Material:
    """What figure 8 says of one BRDF.

    Attributes
    ----------
    name : str
    captured : float
        The part of the energy of its product functions within the order.
    errors : list of float
        Relative RMS error under each probe, over orientations and views drawn at random, against
        brute force.
    seconds : float
        How long the product texture took, with all threads.
    """

    name: str
    captured: float
    errors: list[float]
    seconds: float


def figure_8(
    probes: Sequence[Probe],
    shapes: Sequence[Mesh],
    measured: Sequence[str],
    folder: Path,
    extent: Extent,
) -> tuple[str, list[Material]]:
    """Draw a row for each mesh, under the probes in turn, with a picture for each BRDF."""
    specs = [*extent.product_models, *(measured[:_MOST_MEASURED] or FITS)]
    shots = [Shot(mesh, Viewer(0, 10), extent.product_picture) for mesh in shapes]
    lights = [light_of(probe) for probe in probes]
    small = small_probes(probes, extent.product_source)
    small_lights = [light_of(probe) for probe in small]
    rows: list[list] = [[] for _ in shots]
    found = []
    for spec in specs:
        say(f"figure 8, {Path(spec).name}")
        texture.cache_clear()  # an earlier figure may have made the texture
        start = time.perf_counter()
        made = texture(spec, extent.product_texels)
        seconds = time.perf_counter() - start
        name = Path(spec).stem if Path(spec).suffix else spec.partition(":")[0]
        if spec in FITS:
            name = spec
        for k, (row, shot) in enumerate(zip(rows, shots, strict=True)):
            at = k % len(probes)
            label = f"{name}, {Path(probes[at].name).stem}"
            row.append((shot.picture(made.lit(lights[at])), label))
        errors = [
            measured_errors(probe, parse_spec(spec), [made.lit(light)], extent.product_points)[0]
            for probe, light in zip(small, small_lights, strict=True)
        ]
        found.append(Material(name, float(energy_of(spec).sum()), errors, seconds))
    # Materials reflect very differently much, and are shown equally bright.
    stops = [exposure([picture for picture, _ in row]) for row in rows]
    return write_sheet(folder / "figure-8.png", rows, stops), found
