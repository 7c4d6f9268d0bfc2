"""`analyze`: what orders capture of a BRDF, and of the light that it reflects of a probe.

Energy of the BRDF, accuracy of the reflected light, and pictures of it are the studies of sections
5.5.1 (figure 5.5) and 5.7.1 (figures 5.6 and 5.7). Sections, figures and equations 5.x are those of
chapter 5 of Ramamoorthi's thesis.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.errors import ArgumentError, BrdfError, OrderError
from shrm_cli.files.image import Picture
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import check_size
from shrm_cli.messages import short_repr, whole_number
from shrm_cli.orders import Orders, known_coefficients, sufficient_orders
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress, Rising, Stages, tell, using
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.reflected import error_bound, predicted_error
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import measure
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import PAPER, SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import Reflecting, render_sphere
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_F, MAX_ORDER_P, MAX_PICTURE_SIZE, Center

DEFAULT_ORDER_F = 32
"""The largest F of a grid, unless a tolerance needs a larger one."""

DEFAULT_ORDER_P = 8
"""The largest P of a grid, unless a tolerance needs a larger one."""

PICTURE_ORDER_P = 5
"""The largest P of the pictures, as in figure 5.6."""

MATERIAL_F, MATERIAL_P = 30, 5
"""The order F and the largest order P of figure 5.7, which compares materials."""

_ACCURACY = 1e-3
"""The fraction of a material's energy that the sampling of its coefficients may miss."""

_HIGHER = 2
"""The reflected light counts as known at an F that is this many times the F of the grid."""


@record(eq=False)
class EnergyGrid:
    """The fraction of a BRDF's energy in every pair of orders (eq. 5.18)."""

    captured: Array
    """Fractions of the energy of all colour channels together, shape (F+1, P+1)."""
    orders: tuple[Orders, ...]
    """The least orders that meet each tolerance, but for those that none do."""
    unmet: str | None
    """What is to be said of the largest tolerance that no orders meet; None if all are met."""
    coefficients: BrdfCoefficients
    """Coefficients to the same P and a much higher F, where the reflected light counts as known."""

    @property
    def order_f(self) -> int:
        return self.captured.shape[0] - 1

    @property
    def order_p(self) -> int:
        return self.captured.shape[1] - 1


def energy_grid(
    brdf: Brdf,
    tolerances: Sequence[float],
    order_f: int | None = None,
    order_p: int | None = None,
    progress: Progress | None = None,
) -> EnergyGrid:
    """Compute the energy that all orders up to (F, P) capture, and the orders tolerances need.

    `tolerances` are at least one fraction of the energy, in (0, 1), that orders may miss. `order_f`
    and `order_p` are the largest orders of the grid; by default 32 and 8, or more if a tolerance
    needs them: the largest F if no orders meet one. A zonal BRDF has P = 0 only.
    """
    _check_isotropic(brdf)
    # One attempt at the orders follows another, and nobody knows how many.
    rising = Rising(progress)
    with using(rising):
        known = known_coefficients(brdf, min(tolerances))
    orders, unmet = [], {}
    for eps in tolerances:
        try:
            orders.append(sufficient_orders(brdf, known, eps))
        except OrderError as error:
            unmet[eps] = str(error)
    if order_f is None:
        # A tolerance that no orders meet needs the largest, not the least ones.
        needed = [known.order_f] if unmet else [each.order_f for each in orders]
        order_f = max([DEFAULT_ORDER_F, *needed])
    if order_p is None:
        order_p = max([DEFAULT_ORDER_P, *(each.order_p for each in orders)])
    if brdf.zonal:
        order_p = 0
    high = min(max(_HIGHER * order_f, known.order_f), MAX_ORDER_F)
    accuracy = max(min(tolerances) / 300, 1e-5)
    with using(rising):
        coefficients = compute_coefficients(brdf, high, order_p, accuracy)
    told = unmet[max(unmet)] if unmet else None
    return EnergyGrid(coefficients.captured[: order_f + 1], tuple(orders), told, coefficients)


def material_energies(
    brdfs: Sequence[Brdf],
    order_f: int = MATERIAL_F,
    order_p: int = MATERIAL_P,
    progress: Progress | None = None,
) -> Array:
    """Compute the energy that F = `order_f` and P = 0 .. `order_p` capture of several BRDFs.

    Returns an array of shape (BRDFs, P+1): fractions of the energy (eq. 5.18) for P = 0, 1, and so
    on. A BRDF that does not depend on the view has the same fraction for all P.
    """
    rows = []
    for brdf in brdfs:
        _check_isotropic(brdf)
    for index, brdf in enumerate(brdfs):
        found = compute_coefficients(brdf, order_f, 0 if brdf.zonal else order_p, _ACCURACY)
        captured = found.captured[order_f]
        rows.append(np.pad(captured, (0, order_p + 1 - len(captured)), mode="edge"))
        tell(progress, index + 1, len(brdfs))
    return np.array(rows)


def _check_isotropic(brdf: Brdf) -> None:
    """Refuse a BRDF that orders F and P do not describe."""
    if not brdf.isotropic:
        raise BrdfError(
            f"{brdf!r}: anisotropic, of which orders F and P tell nothing; a principal map holds it"
        )


@record(eq=False)
class AccuracyCurve:
    """Accuracy of the reflected light against F, and estimates of it (figure 5.5).

    All curves are fractions of energy, ``1 - eps``; eps is the square of a relative RMS error.
    """

    order_p: int
    """P, the same for all F."""
    truth_order_f: int
    """The F at which the reflected light counts as known."""
    accuracy: Array
    """Accuracy of the reflected light over all orientations and views, by Parseval's theorem, shape
    (F+1,)."""
    estimate_minimum: Array
    """Estimate from the lesser of the errors of the light and of the BRDF, shape (F+1,)."""
    estimate_brdf: Array
    """Estimate from the error of the BRDF alone, shape (F+1,)."""
    estimate_bound: Array
    """Estimate from the bound of the residual energy (eq. 5.19), shape (F+1,)."""


def accuracy_curve(
    lighting: Lighting, coefficients: BrdfCoefficients, order_f: int, order_p: int
) -> AccuracyCurve:
    """Compute the accuracy of the reflected light for every F up to `order_f`, and estimates.

    The rule of the minimum (section 5.5.1) is about the frequency l alone: light without high
    frequencies does not make up for a P that is too small. The energy that P misses at every F is
    therefore added to the error of the light; it is 0 for the zonal BRDFs of figure 5.5.

    `lighting` holds coefficients of the light to at least the order of those of the BRDF.
    `coefficients` are coefficients of the BRDF to a much higher F than `order_f`.

    Raises ValueError if the lighting or the coefficients are of too low an order.
    """
    if lighting.order < coefficients.order_f:
        raise ValueError(f"lighting of order {lighting.order}, not {coefficients.order_f}")
    if order_f > coefficients.order_f or order_p > coefficients.order_p:
        raise ValueError(f"orders {order_f}, {order_p} are more than the coefficients have")
    # The values keep only these p, but the energies still count the others.
    known = replace(coefficients, values=coefficients.truncated(coefficients.order_f, order_p))
    orders = range(order_f + 1)
    error = np.array([predicted_error(lighting, known, f, order_p) for f in orders])
    bound = np.array([error_bound(lighting, known, f, order_p) for f in orders])
    captured = known.captured[:, order_p]
    light = _missing(lighting.power(), lighting.energy)[: order_f + 1]
    brdf = np.clip(1 - captured[: order_f + 1], 0, 1)
    minimum = np.minimum(light + max(1 - captured[-1], 0), brdf)
    return AccuracyCurve(
        order_p, coefficients.order_f, 1 - error**2, 1 - minimum, 1 - brdf, 1 - bound**2
    )


def _missing(degrees: Array, total: Array) -> Array:
    """Return the fraction of all channels' energy beyond each degree; 0 for black light."""
    whole = total.sum()
    found = np.cumsum(degrees.sum(axis=-1))
    return np.clip(1 - found / whole, 0, 1) if whole > 0 else np.zeros(len(degrees))


@record(eq=False)
class OrderPictures:
    """Spheres drawn from maps of different P, and as they truly are (figure 5.6)."""

    views: Sequence[Viewer]
    order_f: int
    """F of all maps."""
    captured: Array
    """Fraction of the BRDF's energy that each P captures, shape (P+1,)."""
    predicted_errors: Array
    """Relative RMS error of the reflected light over all orientations and views, by Parseval's
    theorem, shape (P+1,)."""
    pictures: Picture
    """Linear, premultiplied by the coverage of the sphere, shape (P+1, views, size, size, 3)."""
    truth: Picture
    """Exact pictures in the same form, shape (views, size, size, 3)."""

    def error(self, order_p: int, view: int) -> float:
        """Return the relative RMS error over the sphere."""
        return measure(self.pictures[order_p, view], self.truth[view]).relative_rmse

    def exposure(self) -> float:
        """Return the stops, in halves, that bring the brightest 5 % of the spheres near white.

        They are 0 if all spheres are black.
        """
        shining = self.truth.max(axis=-1)
        shining = shining[shining > 0]
        return float(np.round(-2 * np.log2(np.percentile(shining, 95))) / 2) if len(shining) else 0

    def sheet(self, exposure: float = 0.0) -> Picture:
        """Draw all pictures on one labelled sheet.

        There is a column for each P and one for the truth. Each view has a row of pictures and a
        row of absolute differences from the truth, which are not amplified. The exposure, in
        stops, is the same for both.
        """
        orders = len(self.pictures)
        tiles: list[Picture] = []
        labels: list[str] = []
        for view, viewer in enumerate(self.views):
            tiles += list(self.pictures[:, view])
            labels += [f"P = {p}: {part:.1%}" for p, part in enumerate(self.captured)]
            differences = np.abs(self.pictures[:, view] - self.truth[view])
            nothing = np.full_like(differences[0], PAPER * 2.0**-exposure)
            tiles += [self.truth[view], *differences, nothing]
            errors = [f"error {self.error(p, view):.1%}" for p in range(orders)]
            labels += [f"exact {viewer.azimuth:.4g},{viewer.elevation:.4g}", *errors, ""]
        layout = _pictures_layout(orders, len(self.views), self.pictures.shape[2])
        return draw_sheet(layout, [expose(tile, exposure) for tile in tiles], labels)


def _pictures_layout(orders: int, views: int, size: int) -> SheetLayout:
    columns = orders + 1
    return arrange(columns * 2 * views, size, columns)


def order_pictures(
    lighting: Lighting,
    coefficients: BrdfCoefficients,
    center: Center,
    views: Sequence[Viewer],
    order_f: int,
    size: int,
    truth: Reflecting,
    progress: Progress | None = None,
) -> OrderPictures:
    """Draw spheres for P = 0 .. 5 and for the truth (figure 5.6).

    The pictures stop at the P of the coefficients. `truth` is the exact reflected light, such as
    `shrm_cli.reference.Reference`; `progress` is called with its views that are drawn, and all.
    """
    orders = range(min(PICTURE_ORDER_P, coefficients.order_p) + 1)
    _pictures_layout(len(orders), len(views), size)  # it refuses a sheet that is too large
    check_size(order_f, orders[-1])
    captured = coefficients.captured[order_f, : len(orders)]
    errors = np.array([predicted_error(lighting, coefficients, order_f, p) for p in orders])
    parts = zip(orders, captured.tolist(), errors.tolist(), strict=True)
    infos = [MapInfo(order_f, p, 1 - part, part, error) for p, part, error in parts]
    whole = Shrm.from_coefficients(
        lighting.coefficients, coefficients.truncated(order_f, orders[-1]), center, infos[-1],
        dtype=np.float32,
    )  # fmt: skip
    # Coefficients of different p do not mix, so the map of the largest P holds all the others.
    maps = [
        replace(whole, coefficients=whole.coefficients[:, :, : (p + 1) ** 2], info=infos[p])
        for p in orders
    ]
    exact = []
    for view in views:
        exact.append(render_sphere(truth, view, size))
        tell(progress, len(exact), len(views))
    pictures = np.stack(
        [np.stack([render_sphere(one, view, size) for view in views]) for one in maps]
    )
    return OrderPictures(views, order_f, captured, errors, pictures, np.stack(exact))


TOLERANCES = (0.1, DEFAULT_EPS, 0.01)
"""The tolerances that orders are found for, where none are given."""
PICTURES_F = 128
"""The largest F of pictures where none is given: maps of P = 5 and twice as many take gigabytes."""


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
    """Rows that the probe was averaged down to for the exact ones; None for its own pixels."""


def analyze(
    brdf: AnyBrdf,
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
    brdf : Brdf, str or path-like
    probe : Probe, path-like or array, optional
        For the accuracy of the reflected light, and pictures of it.
    tolerances : sequence of float
        Fractions of the energy that orders may miss, for each of which orders are found.
    order_f, order_p : int, optional
        The largest orders; by default 32 and 8, or what the tolerances need, but for pictures an
        F of 128 at most.
    views : sequence of 2 float
        Azimuth and elevation of the viewers of pictures, degrees; without any, none are drawn.
    size : int
        Width and height of a picture, pixels.
    source_height : int, optional
        Rows that the probe is averaged down to for the exact pictures; by default it is not.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Analysis

    Raises
    ------
    BrdfError, ProbeError
        If a file cannot be used.

    Examples
    --------
    >>> found = shrm.analyze("microfacet:sigma=0.4", tolerances=[0.03])
    >>> [(each.order_f, each.order_p) for each in found.grid.orders]
    [(5, 2)]
    """
    if not tolerances or not all(0 < each < 1 for each in tolerances):
        raise ArgumentError("tolerances", f"{short_repr(tolerances)} are not within 0 and 1")
    for name, order, most in (("f", order_f, MAX_ORDER_F), ("p", order_p, MAX_ORDER_P)):
        if order is not None:
            whole_number(f"order_{name}", order, 0, most)
    size = whole_number("size", size, 1, MAX_PICTURE_SIZE)
    source = None if probe is None else as_probe(probe)
    brdf = as_brdf(brdf, None if source is None else source.chromaticities)
    stages = Stages(progress, 1 if source is None else 2 + max(len(views), 1))
    grid = energy_grid(brdf, tolerances, order_f, order_p, stages.within)
    stages.done(1, 3)
    if source is None:
        return Analysis(brdf, grid)
    with using(stages.within):
        lighting = project(source, grid.coefficients.order_f)
    stages.done(2, 3)
    curve_p = grid.order_p
    if order_p is None and grid.orders:
        curve_p = min(curve_p, min(grid.orders, key=lambda each: each.eps).order_p)
    curve = accuracy_curve(lighting, grid.coefficients, grid.order_f, curve_p)
    if not views:
        return Analysis(brdf, grid, curve)
    truth = Reference(source, brdf, source_height, progress=stages.within)
    pictures = order_pictures(
        lighting, grid.coefficients, brdf.center, [Viewer(*view) for view in views],
        grid.order_f if order_f is not None else min(grid.order_f, PICTURES_F), size, truth,
        lambda drawn, count: stages.done(2 + drawn, count),
    )  # fmt: skip
    return Analysis(brdf, grid, curve, pictures, source_height)
