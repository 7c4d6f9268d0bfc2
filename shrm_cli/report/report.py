"""`report`: a page about a probe and its maps."""

from collections.abc import Sequence
from typing import Any

from shrm_cli.analysis.probe_statistics import ProbeStatistics, probe_statistics
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.report.measure import Measured, Plan, measure_maps
from shrm_cli.report.page import Look, report_page
from shrm_cli.vocabulary import REPORTED


@record(eq=False)
class ProbeReport:
    """A page, and what it tells."""

    html: str
    """To be written as UTF-8."""
    measured: Measured
    """The maps and how far they are from the truth."""
    statistics: ProbeStatistics
    warnings: list[str]


def report(
    probe: AnyProbe,
    brdfs: Sequence[str],
    to: Sequence[str] = REPORTED,
    *,
    angles: Sequence[tuple[float, float]] = Plan.views,
    picture_size: int = 256,
    truth_height: int | None = None,
    exact: bool = False,
    flips: bool = True,
    look: Look | None = None,
    progress: Progress | None = None,
    **arguments: Any,
) -> ProbeReport:
    """Make the page of a probe and its maps, which needs no network.

    Parameters
    ----------
    probe : Probe, path-like or array
    brdfs, to : sequence of str
        Specifications and representations; each pair that there is makes a map.
    angles : sequence of 2 float
        Azimuth and elevation of the viewers, degrees.
    picture_size : int
        Width and height of the spheres' pictures, pixels.
    truth_height : int, optional
        Rows that the probe is averaged down to for the truth.
    exact : bool
        Whether the truth sums all pixels.
    flips : bool
        Whether HDR-FLIP is measured, where it is installed.
    look : Look, optional
        What the page shows, and how large it may be.
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **arguments
        Other arguments of `prefilter`.

    Returns
    -------
    ProbeReport

    Raises
    ------
    ArgumentError, ProbeError, BrdfError, OutputError

    Examples
    --------
    >>> made = shrm.report("probes/studio.exr", ["lambertian"], picture_size=32)
    >>> len(made.measured.summary())
    1
    """
    light = as_probe(probe)
    plan = Plan(
        tuple(brdfs), tuple(to), arguments, tuple(angles), picture_size, truth_height, exact, flips
    )
    plan.recipes()  # refuses what no probe could make, before long work
    stages = Stages(progress, 2)
    statistics = probe_statistics(light)
    measured = measure_maps(light, plan, stages.within)
    stages.done(1, 2)
    made = report_page(measured, statistics, look, stages.within)
    return ProbeReport(made.text, measured, statistics, [*measured.warnings, *made.remarks])
