"""`analyze`: what orders capture of a BRDF, and of the light that it reflects of a probe."""

from collections.abc import Sequence

from shrm_cli.analysis.orders import (
    AccuracyCurve,
    EnergyGrid,
    OrderPictures,
    accuracy_curve,
    energy_grid,
    order_pictures,
)
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress, Stages, using
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.vocabulary import DEFAULT_EPS

TOLERANCES = (0.1, DEFAULT_EPS, 0.01)
"""The tolerances that orders are found for, where none are given."""
_LEAST_ROWS = 128
"""The fewest rows that the probe is averaged down to by default for the exact pictures."""


@record(eq=False)
class Analysis:
    """What orders capture."""

    brdf: Brdf
    grid: EnergyGrid
    """The part of the BRDF's energy that each pair of orders captures."""
    curve: AccuracyCurve | None = None
    """The accuracy of the light that is reflected of a probe, against F."""
    pictures: OrderPictures | None = None
    """Spheres for P = 0 .. 5 beside exact ones."""
    source_height: int | None = None
    """Rows that the probe was averaged down to for the exact ones."""


def analyze(
    brdf: Brdf | str,
    probe: AnyProbe | None = None,
    *,
    tolerances: Sequence[float] = TOLERANCES,
    order_f: int | None = None,
    order_p: int | None = None,
    views: Sequence[tuple[float, float]] = (),
    size: int = 96,
    source_height: int | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Analyze what the orders F and P capture of a BRDF.

    Parameters
    ----------
    brdf : Brdf or str
    probe : Probe, path-like or array, optional
        For the accuracy of the reflected light, and pictures of it.
    tolerances : sequence of float
        Fractions of the energy that orders may miss, for each of which orders are found.
    order_f, order_p : int, optional
        The largest orders; by default 32 and 8, or what the tolerances need.
    views : sequence of 2 float
        Azimuth and elevation of the viewers of pictures, degrees; without any, none are drawn.
    size : int
        Width and height of a picture, pixels.
    source_height : int, optional
        Rows that the probe is averaged down to for the exact pictures; by default the greater of
        128 and 4 F, or the probe's own if it has no more.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Analysis

    Raises
    ------
    OrderError, BrdfError, ProbeError
        If a tolerance cannot be met, or a file cannot be used.

    Examples
    --------
    >>> found = shrm.analyze("microfacet:sigma=0.4", tolerances=[0.03])
    >>> [(each.order_f, each.order_p) for each in found.grid.orders]
    [(5, 2)]
    """
    source = None if probe is None else as_probe(probe)
    if isinstance(brdf, str):
        brdf = parse_spec(brdf, primaries=None if source is None else source.chromaticities)
    stages = Stages(progress, 1 if source is None else 3)
    grid = energy_grid(brdf, tolerances, order_f, order_p, stages.within)
    stages.done(1, 3)
    if source is None:
        return Analysis(brdf, grid)
    with using(stages.within):
        lighting = project(source, grid.coefficients.order_f)
    stages.done(2, 3)
    least = min(grid.orders, key=lambda each: each.eps)
    curve_p = min(least.order_p, grid.order_p) if order_p is None else grid.order_p
    curve = accuracy_curve(lighting, grid.coefficients, grid.order_f, curve_p)
    if not views:
        return Analysis(brdf, grid, curve)
    enough = max(4 * grid.order_f, _LEAST_ROWS)
    if not source_height and source.grid.latlong_rows > enough:
        source_height = enough
    truth = Reference(source, brdf, source_height, progress=stages.within, exact=True)
    pictures = order_pictures(
        lighting, grid.coefficients, brdf.center, [Viewer(*view) for view in views], grid.order_f,
        size, truth,
    )  # fmt: skip
    return Analysis(brdf, grid, curve, pictures, source_height)
