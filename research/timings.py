"""Tables 5.4 and 5.5: prefiltering in the angular and in the frequency domain, timed together.

They are tables of chapter 5 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward and
Inverse Rendering" (2002). Both sides take the same small probe from memory, are given one thread,
and make the same texels. The frequency side starts without any table kept from an earlier run.
"""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shrm_cli.arrays import Memo
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.views import LightField
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.orders import choose_orders
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.sphere import double_fourier, rotation
from shrm_cli.sphere.cube import cube_directions

SIZES = (128, 52)
"""Texels along a face's edge. Six faces of 52 x 52 have about as many texels as 128 x 128."""
ANGULAR_TOLERANCE = 0.05
"""The part of a lobe's energy that the angular side may leave out."""
VIEW_COUNT = 10
"""The number T of a light field of T x T views."""


@dataclass(frozen=True)
class Timing:
    """One row of a table.

    Attributes
    ----------
    value : float
        The exponent s of a Phong lobe, or the roughness sigma of a microfacet lobe.
    size : int
        Texels along a face's edge.
    order_f, order_p : int
        The orders F and P of the frequency side.
    angular, frequency : float
        Seconds that each side takes.
    shrm : float
        Seconds that the frequency side takes for the SHRM alone.
    paper_angular, paper_frequency, paper_shrm : float
        The seconds in the thesis, on a Pentium IV.
    """

    value: float
    size: int
    order_f: int
    order_p: int
    angular: float
    frequency: float
    shrm: float
    paper_angular: float
    paper_frequency: float
    paper_shrm: float = 0.0

    @property
    def ratio(self) -> float:
        return self.angular / self.frequency

    @property
    def paper_ratio(self) -> float:
        return self.paper_angular / self.paper_frequency


PAPER_5_4: dict[float, tuple[float, float]] = {
    8: (67.28, 0.081),
    16: (38.03, 0.114),
    32: (21.80, 0.159),
    64: (11.94, 0.227),
    128: (7.17, 0.328),
    256: (3.55, 0.461),
    512: (2.28, 0.686),
}
"""The seconds of table 5.4 in the thesis for each exponent: angular, frequency."""
PAPER_5_5: dict[float, tuple[float, float, float]] = {
    0.1: (923, 2.70, 1.55),
    0.2: (2744, 1.55, 0.72),
    0.3: (5731, 1.49, 0.67),
    0.4: (9034, 1.47, 0.65),
    0.5: (12580, 1.45, 0.64),
}
"""The seconds of table 5.5 in the thesis for each sigma: angular, frequency, SHRM."""


def table_5_4(probe: Probe, size: int, exponents: Sequence[float], repeats: int) -> list[Timing]:
    """Time prefiltering for Phong lobes, one map each, with F = 1 + sqrt(6 s)."""
    rows = []
    for exponent in exponents:
        paper = PAPER_5_4[exponent]
        brdf = parse_spec(f"phong:exponent={exponent}")
        order_f = round(1 + np.sqrt(6 * exponent))

        def frequency(brdf=brdf, order_f=order_f):
            lighting = project(probe, order_f)
            values = compute_coefficients(brdf, order_f, 0).values
            return _build(lighting.coefficients, values, size)

        def angular(brdf=brdf):
            integral = Reference(probe, brdf, tolerance=ANGULAR_TOLERANCE, exact=True)
            texels = cube_directions(size)
            return integral.central_radiance(texels, texels)

        slow, fast = _seconds(angular), _median_seconds(frequency, repeats)
        rows.append(Timing(exponent, size, order_f, 0, slow, fast, fast, *paper))
    return rows


def table_5_5(
    probe: Probe, size: int, rng: np.random.Generator, sigmas: Sequence[float], repeats: int
) -> list[Timing]:
    """Time prefiltering for microfacet lobes, T x T = 100 maps each.

    On the angular side a random one of the maps is timed, and its time multiplied by 100.
    """
    rows = []
    for sigma in sigmas:
        paper_angular, paper_frequency, paper_shrm = PAPER_5_5[sigma]
        brdf = parse_spec(f"microfacet:sigma={sigma}")
        orders = choose_orders(brdf, 0.03)[0]

        def shrm(brdf=brdf):
            # The BRDF is sampled here, until it has converged, because this is part of the work.
            orders, coefficients = choose_orders(brdf, 0.03)
            lighting = project(probe, orders.order_f)
            values = coefficients.truncated(orders.order_f, orders.order_p)
            return _build(lighting.coefficients, values, size)

        def frequency(shrm=shrm) -> ExplicitMap:
            return LightField.from_shrm(shrm(), VIEW_COUNT)

        count = VIEW_COUNT**2
        view = LightField.sample_views(count)[rng.integers(count)]

        def angular(brdf=brdf, view=view):
            integral = Reference(probe, brdf, tolerance=ANGULAR_TOLERANCE, exact=True)
            return integral.central_radiance(cube_directions(size), view)

        rows.append(
            Timing(
                sigma, size, orders.order_f, orders.order_p, count * _seconds(angular),
                _median_seconds(frequency, repeats), _median_seconds(shrm, repeats),
                paper_angular, paper_frequency, paper_shrm,
            )
        )  # fmt: skip
    return rows


def _build(lighting, values, size) -> Shrm:
    info = MapInfo(values.shape[0] - 1, values.shape[1] - 1, 0.0, 0.0, 0.0)
    return Shrm.from_coefficients(lighting, values, "reflection", info, size, dtype=np.float32)


def _seconds(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def _median_seconds(function: Callable[[], object], repeats: int) -> float:
    """Return the median seconds of `repeats` runs, after one run to warm up.

    Before each run the tables that were kept are deleted.
    """
    seconds = []
    for _ in range(repeats + 1):
        for module in (rotation, double_fourier):
            for value in vars(module).values():
                if isinstance(value, Memo):
                    value.clear()
        seconds.append(_seconds(function))
    return statistics.median(seconds[1:])
