"""The page that puts the figures of Kautz et al. 2002 beside ours, as Markdown."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.page import short_form, table
from research.product.incident import BRUSHED as BRUSHED_IN_ROOM
from research.product.incident import Placed
from research.product.materials import Material
from research.product.orders import MORE_POINTS, Truncated
from research.product.shadows import Shadowed
from research.product.textures import EXAMPLE, Varied
from research.product.turned import BRUSHED
from shrm_cli.rooms.grid import ProbeGrid


def introduction(meshes: Sequence[str], extent: Extent) -> str:
    """Write the title, and what stands for the paper's models."""
    text = f"""`make tables` wrote this page. The paper's meshes are not at hand. What stands for
them: {", ".join(meshes)}, and a vase. All product textures have {extent.product_texels} x
{extent.product_texels} texels (the paper: 128 x 128), and 25 coefficients except in figure 6.
Surfaces are brushed along +Y, projected onto them, if nothing else is said: x is the direction of
the grooves, and the exponent nu in it is the larger one. Errors are relative RMS errors over
{extent.product_points} orientations, tangents and views drawn at random, against sums over all
pixels of probes of {extent.product_source} rows, which hold all of the light and not the first
degrees alone. The window "auto" keeps the light from being negative
anywhere, except in figure 6."""
    return f"""# Product textures: any BRDF under light of low frequency

Kautz, Sloan and Snyder, *Fast, Arbitrary BRDF Shading for Low-Frequency Lighting Using Spherical
Harmonics* (2002).

{fill(text, 100)}
{short_form(extent)}"""


def figure_2(file: str, bands: NDArray[np.floating]) -> str:
    """Write the part on figure 2, the components of a product texture."""
    body = [(f"{k}", f"{2 * k + 1}", f"{share:.1%}") for k, share in enumerate(bands)]
    return f"""
## Figure 2: the product texture of `{EXAMPLE}`

Views are mapped to the circles by the parabolic parameterization; the normal is in the middle, the
tangent to the right. Red is positive and blue negative, on one scale for all components. On the
right is each band's squared energy. The paper notes smooth textures and weaker high bands.

![components and squared energy by band]({file})

{table(("band", "components", "energy over all views"), body)}
The bands hold {bands.sum():.1%} of the energy of the product functions; the rest is beyond them.
"""


def figure_3(file: str, change: float) -> str:
    """Write the part on figure 3, a light that is turned."""
    text = f"""`{BRUSHED}`, the sphere brushed around +Y and the mesh along it. The coefficients of
the light were turned, and the background is the image turned by as much. Those of an image whose
columns are moved differ from the turned ones by {change:.1e} (relative RMS, all yaws together)."""
    return f"""
## Figure 3: brushed metal under a light that is turned

{fill(text, 100)}

![brushed surfaces under four yaws of a light]({file})
"""


def figure_4(file: str, rows: Sequence[Varied], extent: Extent) -> str:
    """Write the part on figure 4, materials that vary over a surface."""
    values = ", ".join(f"{each:g}" for each in extent.product_exponents)
    body = [(row.what, row.brdfs, f"{row.expected:.1%}") for row in rows]
    head = ("what varies", "between", "error midway between two textures")
    return f"""
## Figure 4: materials that vary over a surface

An exponent follows a smooth noise on the vertices. There is a texture for each of {values}, and
coefficients between them are interpolated linearly, as a 3D texture does it. Beside each vase that
varies are those with the least and with the largest exponent everywhere. Above, the exponent
changes in both directions; below, in that across the grooves alone, and the last vase is isotropic.

![varying exponent and varying anisotropy]({file})

{table(head, body)}"""


def figures_5_and_7(file: str, rows: Sequence[Shadowed]) -> str:
    """Write the part on figures 5 and 7, shadows of glossy surfaces."""
    body = [
        (row.what, f"`{row.spec}`", f"{row.left:.2f}", f"{row.change:.1%}", f"{row.expected:.1%}")
        for row in rows
    ]
    head = (
        "material", "BRDF", "mean with shadows / without", "differs from the first",
        "error against rays",
    )  # fmt: skip
    text = """Above without shadows (figure 5a), below with precomputed transfer (5b and 7), all
with one exposure. The last column's material is brushed along +X instead of +Y. Numbers are of
the vertices that face the camera, hidden by others or not. The last one is the error at some of
them against sums over rays under light of the same 25 coefficients, which share only the rays
with the transfer: it is what a transfer matrix and a product function of 25 coefficients each
lose."""
    return f"""
## Figures 5 and 7: shadows, and the direction of the brush

{fill(text, 100)}

![shadows and brushes]({file})

{table(head, body)}"""


def figure_6(file: str, rows: Sequence[Truncated], probe: str) -> str:
    """Write the part on figure 6, the number of coefficients."""
    body = [
        (
            "({}, {})".format(*row.exponents), row.column.name, f"{row.predicted:.1%}",
            f"{row.measured:.1%}", f"{row.pictured:.1%}",
        )
        for row in rows
    ]  # fmt: skip
    head = ("AS", "coefficients", "predicted error", "measured error", "of the picture")
    text = f"""The top row is the light, as a lat-long, by as many coefficients; below it are
spheres of Ashikhmin-Shirley models that are more and more specular, brushed around +Y, and the
sums over all pixels of the light on the right. The window is Hann's, which ends one degree beyond
the last. The predicted error is that of all orientations and views, from the coefficients alone;
the measured one is at {MORE_POINTS} times as many of them as elsewhere. The paper: few
coefficients suffice for less specular BRDFs even where the light loses most of its detail; windows
reduce ringing and blur."""
    return f"""
## Figure 6: the number of coefficients and the gloss, under `{probe}`

{fill(text, 100)}

![orders and exponents]({file})

{table(head, body)}"""


def figure_8(file: str, rows: Sequence[Material], probes: Sequence[str], given: bool) -> str:
    """Write the part on figure 8, several BRDFs."""
    body = [
        (
            f"`{row.name}`", f"{row.captured:.1%}", *(f"{each:.1%}" for each in row.errors),
            f"{row.seconds:.0f}",
        )
        for row in rows
    ]  # fmt: skip
    head = (
        "BRDF", "energy within 25 coefficients", *(f"error under `{each}`" for each in probes),
        "seconds",
    )  # fmt: skip
    measured = "measured files" if given else "Lafortune's fits to measurements"
    text = f"""The paper shows Ashikhmin and Shirley's model, Poulin and Fournier's, and measured
vinyl and aluminium foil, which are not at hand; {measured} take their place. Each row has one
exposure. The seconds are those of making a texture with all threads; the paper took a few minutes
for models and up to 90 minutes for measured data."""
    return f"""
## Figure 8: models and measured materials

{fill(text, 100)}

![several BRDFs]({file})

{table(head, body)}"""


def incident_field(
    file: str, grid: ProbeGrid, rows: Sequence[Placed], mesh: str, size: Sequence[float]
) -> str:
    """Write the part on light that varies over an object."""
    body = [
        (f"{row.place:g} m", *(f"{each:.1%}" for each in (
            row.alone, row.grid, row.own, row.grid_in_degree)))
        for row in rows
    ]  # fmt: skip
    head = (
        "middle of the mesh", "error with one probe", "with the grid",
        "with the light of each point", "the grid against that",
    )  # fmt: skip
    x, y, z = size
    shape = " x ".join(map(str, grid.lattice.shape))
    text = f"""Section 4 of the paper: "for finite lighting (that varies over points p on the
object), we can use an incident light field which interpolates lighting sampled at various points
around the object". {mesh}, brushed along +Y, in a room of {x:g} x {y:g} x {z:g} m with a lamp below
the ceiling at the left and a window at the right, under the light of one probe in the middle of the
room (above), and of {shape} probes (below), each of 25 coefficients. No window is taken, and the
mesh does not shade the room. The truth is a sum over all directions and points of lamps from each
point; most of the error is what degrees beyond 4 would add, which the last but one column has
alone. `shrm grid` and `shrm render --probe GRID` do it."""
    return f"""
## Incident light field: `{BRUSHED_IN_ROOM}` in a room

{fill(text, 100)}

![a mesh at several places of a room]({file})

{table(head, body)}"""
