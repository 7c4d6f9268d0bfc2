"""Figure 3: brushed surfaces under light that is turned."""

from pathlib import Path

import numpy as np

from research.extent import Extent
from research.inputs import small_probes
from research.product.orders import relative
from research.product.scenes import Shot, exposure, write_sheet
from research.product.textures import ORDER, light_of, texture
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.drawing import SphereSubject
from shrm_cli.sphere.directions import turn_matrix
from shrm_cli.sphere.rotation import transform_coefficients

BRUSHED = "ashikhmin-shirley:nu=48,nv=4"
"""The paper does not name the exponents. Grooves along x make highlights that are wide in y."""
YAWS = 0, 90, 180, 270
_VIEWER = Viewer(0, 10)


def figure_3(file: Path, mesh: Mesh, folder: Path, extent: Extent) -> tuple[str, float]:
    """Draw a brushed sphere and a brushed mesh under a light of four yaws, before the light.

    Returns
    -------
    str
        The file's name.
    float
        The relative RMS difference between coefficients that are turned, as those of the pictures
        are, and those of an image that is turned by moving its columns.
    """
    made = texture(BRUSHED, extent.product_texels)
    ball = SphereSubject(extent.product_picture)
    shot = Shot(mesh, _VIEWER, extent.product_picture)
    probe = open_probe(file)
    light = light_of(probe)
    rows: list[list] = [[], []]
    plain = []
    for yaw in YAWS:
        image = open_probe(file, yaw=yaw)
        turned = transform_coefficients(light, turn_matrix(yaw))
        lit = made.lit(turned)
        label = f"{file.stem}, yaw {yaw}"
        behind = ball.background(image, _VIEWER)
        rows[0].append((ball.draw(lit, _VIEWER, behind, None), label))
        rows[1].append((shot.picture(lit, surroundings=image), label))
        plain.append(ball.draw(lit, _VIEWER, None, None))
    name = write_sheet(folder / "figure-3.png", rows, [exposure(plain)] * 2)
    return name, _turned_apart(probe, extent.product_source)


def _turned_apart(probe: Probe, height: int) -> float:
    """Return how far turned coefficients are from those of an image whose columns are moved."""
    (small,) = small_probes([probe], height)
    light, image = project(small, ORDER).coefficients, small.image()
    turned, moved = [], []
    for yaw in YAWS:
        turned.append(transform_coefficients(light, turn_matrix(yaw)))
        # The middle of a lat-long looks along +Z, and the left quarter along +X.
        columns = np.roll(image, -yaw * image.shape[1] // 360, axis=1)
        moved.append(project(Probe.from_array(columns, layout="latlong"), ORDER).coefficients)
    return relative(np.array(turned), np.array(moved))
