"""How spherical harmonic exponentials are made: by fitting them to the light that GGX reflects.

The reflected light is sampled at mirror directions and views (`reflectance`). The law ``paper``,
that of Silvennoinen et al. 2025, fits the exponent to the logarithm of the samples by linear least
squares. The law ``lobe`` starts from such a fit, and then fits the exponential to the samples
themselves by Gauss and Newton's method.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.environment_brdf import lobe_moments, whole_lobe
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.color import luminance_weights
from shrm_cli.errors import MapError
from shrm_cli.maps.info import provenance
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.she.exponential import (
    LARGEST_EXPONENT,
    SphericalHarmonicExponential,
    exponent_series,
)
from shrm_cli.maps.she.reflectance import ReflectanceSamples, sample_reflectance
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sphere.directions import turn_about
from shrm_cli.sphere.rotation import own_axes, transform_coefficients
from shrm_cli.vocabulary import Law

_ORDERS_F = 32, 128
"""The lowest and the highest order to which the light is expanded."""
_ORDER_OF_ALPHA = 6.5
"""The order to which the light is expanded, times alpha of the sharpest lobe."""
_SHARPEST = math.sqrt(_ORDER_OF_ALPHA / _ORDERS_F[1])
"""The least roughness that is sampled, 0.23. Sharper lobes show that the light ends at an order, by
rings about lamps, negative ones too: fits to them were black at all roughnesses under a sunrise,
and 8000 times too bright beside its sun with P = 16."""
_NORMAL_REFLECTANCES = 1.0, 0.04
"""The reflectances f0 of the surfaces that the law ``lobe`` fits, a metal and a plastic."""
_ROUGHNESSES = 6
"""The number of roughnesses that the law ``lobe`` samples."""
_PAPER_ROUGHNESSES = 4
"""The number of roughnesses that the law ``paper`` samples."""
_LEAST_RINGS = 8
"""The fewest rings of mirror directions."""
_MORE_RINGS = 1, 3
"""How many more rings the samples have that a fit is judged by. They lie between those that it was
fitted to, where it is free: of metals of roughness 0.3 at night it misses 77 % of the light, and
50 % at the samples of the fit."""
_VIEW_RINGS = 6, 1
"""The number of rings of views about each mirror direction, and of views on each ring."""
_OFF_POLE = 6.0
"""How far the mean direction of the light lies from the z axis of the samples, degrees. About it
they are dense; with a sun on their equator fits missed 27 % of the light of a city for 21 %. On the
axis itself those that judge a fit miss the same as it did: they told 33 % of a sunrise, of which
37 % were missed."""
_SHADE = 0.4
"""A sample counts as bright when it exceeds this part of the mean sample. The squared errors of
bright samples are weighted by 1 / brightness: otherwise a sun, which no low order can reproduce,
would dominate the fit."""
_EXACT = 0.03
"""A split sum whose mean squared error is below this part of the squared reflected light counts as
having this one. It is nearly exact of sharp metals, which no exponential shows, and which would
have nearly all the weight."""

BAD_FIT = 0.33
"""The relative RMS error of a fit beyond which people are told. Of eight real probes, six have fits
of 0.11 .. 0.28, with 7 % to 42 % of what the sharpest surfaces show wrong by more than a quarter;
a studio and a sunrise have 0.34, with 66 % and 80 %, about twice as much as split sums have."""

FLOOR = 1e-3
"""Samples below this part of the mean sample count as this part in log space. They come from a
truncated series, so that they are within its error and may even be negative, where the light is
not. Their logarithm would count far too much."""
_STEPS = 20
"""The most steps of Gauss and Newton's method."""
_SETTLED = 1e-4
"""The fit is finished when a step lowers the weighted squared error by less than this part."""
RIDGE = 1e-6
"""The part of the mean diagonal that is added to the diagonal of the normal equations."""
_TRIALS = 6
"""The most dampings that are tried for one step."""
_PARTS = 1.0, 0.5, 0.25, 0.0
"""The fit in log space is multiplied by each of these to find the start of the method."""
_LARGEST_EXPONENT = 60.0
"""Exponents are kept within plus and minus this number during the fit."""


@record(eq=False)
class Problem:
    """The n samples of one channel that k coefficients are fitted to."""

    rows: Array
    variances: Array
    """`rows` and `variances`: the exponent of coefficients x is ``rows @ x - variances @ x^2``,
    shape (n, k)."""
    target: Array
    """The value that the exponential should have at each sample, shape (n,)."""
    weights: Array
    """The weight of each sample's squared error, shape (n,)."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Fit an SH exponential to what GGX reflects of a probe, at all views and roughnesses.

    The own options of `request` are the orders ``p_order`` and ``q_order`` of the two factors, the
    range of perceptual ``roughness`` to fit, by default that of the paper, whose alpha begins at
    0.2, and the ``law``: how the degrees are attenuated, and how they are fitted. ``paper`` is the
    linear least-squares fit in log space of Silvennoinen et al. 2025. No lobe is sampled that is
    sharper than `_SHARPEST`; the law goes on below.
    """
    p_order, q_order = request.own["p_order"], request.own["q_order"]
    law, roughness = request.own["law"], request.own["roughness"]
    low, high = roughness
    order_f = int(np.clip(np.ceil(_ORDER_OF_ALPHA / low**2), *_ORDERS_F))
    lighting = project(probe, order_f)
    # The axes of the samples turn with the light, so that the fit is the same however it is turned.
    pole = own_axes(lighting.coefficients @ luminance_weights(probe.chromaticities))[[1, 2, 0]]
    axes = turn_about([1, 0, 0], _OFF_POLE) @ pole  # rows in world axes
    own = transform_coefficients(lighting.coefficients, axes)
    lighting = Lighting(own, lighting.energy)
    # With fewer rings than the orders need, the fit would be free between them.
    rings = max(_LEAST_RINGS, p_order + 2, q_order)
    sampled = partial(sample_reflectance, lighting, _sampled_roughness(roughness, law))
    samples = sampled(rings, *_VIEW_RINGS)
    if not samples.reflected.any():
        raise MapError(f"{probe.name}: the probe is black, and has no logarithm; take another form")
    info = replace(
        provenance(probe, Ggx(), Orders(order_f, 0, 0.0, 1.0)),
        brdf={"name": "ggx", "parameters": {}},
    )
    p, q = np.zeros(((p_order + 1) ** 2, 3)), np.zeros(((q_order + 1) ** 2 - 1, 3))
    empty = SphericalHarmonicExponential(p, q, (low**2, high**2), info, law)
    fit = fit_logarithm if law == "paper" else fit_exponent
    fitted = np.stack([fit(each) for each in _problems(samples, empty)], axis=-1)
    made = replace(empty, p_coefficients=fitted[: len(p)], q_coefficients=fitted[len(p) :])
    residual, sharpest = _residuals(
        made, [sampled(rings + more, *_VIEW_RINGS) for more in _MORE_RINGS]
    )
    made = replace(made.turned(axes.T), info=replace(info, fit_residual=residual))
    least = samples.roughness[0]
    more = "sharper ones by more, " if low < least else ""
    bad = (
        f"the fit to this light is bad: metals of roughness {least:.2g} are wrong by "
        f"{sharpest:.0%} of their light (RMS), {more}and those of all fitted roughnesses by "
        f"{residual:.0%}; `to` splitsum shows sharp reflections better"
    )
    warnings = (bad,) if residual > BAD_FIT else ()
    facts = {**_facts(made, roughness), "sharpest": {"roughness": least, "error": sharpest}}
    return Prefiltered(made, facts, warnings=warnings)


def _facts(made: SphericalHarmonicExponential, roughness: tuple[float, float]) -> dict[str, Any]:
    """Return what is known of the making of a map, with the roughness as it was asked for."""
    return {
        "law": made.law,
        "order_f": made.info.order_f,
        "p_order": made.order_p,
        "q_order": made.order_q,
        "coefficients": len(made.coefficients),
        "roughness": list(roughness),
        "ggx_alpha": list(made.ggx_alpha),
        "fit_residual": made.info.fit_residual,
    }


def _sampled_roughness(roughness: tuple[float, float], law: Law) -> tuple[float, ...]:
    low, high = (max(each, _SHARPEST) for each in roughness)
    if low == high:
        return (low,)
    if law == "paper":  # its roughnesses are even in alpha
        return tuple(np.sqrt(np.linspace(low**2, high**2, _PAPER_ROUGHNESSES)).tolist())
    return tuple(np.linspace(low, high, _ROUGHNESSES).tolist())


def _problems(samples: ReflectanceSamples, factors: SphericalHarmonicExponential) -> list[Problem]:
    """Set up the samples that each channel's coefficients are fitted to.

    The law ``paper`` fits base reflectance, with the same weight for samples of equal solid angle
    (eq. 14 of Silvennoinen et al. 2025). The law ``lobe`` fits the whole reflection of a metal and
    a plastic, and measures their squared errors relative to those of a split sum.
    """
    parts = []
    for roughness, (base, tail), mirrored in zip(
        samples.roughness, samples.reflected, samples.mirrored, strict=True
    ):
        own = _moments(samples, roughness)
        for f0 in _NORMAL_REFLECTANCES if factors.law == "lobe" else (1.0,):
            series = exponent_series(factors, samples.normals, samples.views, roughness, own, f0)
            reflected, albedo = f0 * base + (1 - f0) * tail, series.albedo[:, None]
            weights = samples.weights
            if factors.law == "lobe":
                split_sum = whole_lobe(own, f0)[0][:, None] * mirrored
                scale = weights @ np.mean((split_sum - reflected) ** 2, axis=-1)
                scale = max(scale, _EXACT * (weights @ np.mean(reflected**2, axis=-1)))
                weights = weights * series.albedo**2 / scale
            parts.append((series.rows, series.variances, reflected / albedo, weights))
    rows, variances, targets, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    if factors.law == "lobe":
        weights = weights[:, None] / (_brightness(targets) + _SHADE)
    else:
        weights = np.repeat(weights[:, None], 3, axis=1)
    return [Problem(rows, variances, targets[:, c], weights[:, c]) for c in range(3)]


def _brightness(targets: Array) -> Array:
    """Divide samples, shape (n, 3), by the mean of their channel; negative ones count as 0."""
    light = np.maximum(targets, 0.0)
    return light / np.maximum(light.mean(axis=0), np.finfo(float).tiny)


def _moments(samples: ReflectanceSamples, roughness: float) -> Array:
    """Compute the lobe's moments at every sample, once for samples of the same N.V."""
    cosines = np.sum(samples.normals * samples.views, axis=-1)
    different, where = np.unique(np.round(cosines, 9), return_inverse=True)
    return lobe_moments(roughness, different)[..., where]


def _residuals(
    made: SphericalHarmonicExponential, judges: Sequence[ReflectanceSamples]
) -> tuple[float, float]:
    """Relative RMS errors of base reflectance over the views and normals of several samples.

    The first is that over all roughnesses, the second that of the least roughness.
    """
    sums = np.sum([_square_sums(made, samples) for samples in judges], axis=0)
    error, total = sums.sum(axis=0)
    return float(np.sqrt(error / total)), float(np.sqrt(sums[0, 0] / sums[0, 1]))


def _square_sums(made: SphericalHarmonicExponential, samples: ReflectanceSamples) -> Array:
    """Return the mean square of the error and of the light for each roughness, shape (A, 2)."""
    sums = []
    for roughness, (base, _) in zip(samples.roughness, samples.reflected, strict=True):
        own = _moments(samples, roughness)
        series = exponent_series(made, samples.normals, samples.views, roughness, own, 1.0)
        exponent = np.minimum(series.exponent(made.coefficients), LARGEST_EXPONENT)
        found = series.albedo[:, None] * np.exp(exponent)
        pair = np.sum((found - base) ** 2, axis=-1), np.sum(base**2, axis=-1)
        sums.append([float(samples.weights @ each) for each in pair])
    return np.array(sums)


def fit_logarithm(problem: Problem) -> Array:
    """Fit ``rows @ x`` to the logarithm of the target by linear least squares.

    The first column of the rows must be constant. The logarithm of a target that is black does not
    exist; it gets an exponential that is as good as 0.

    Returns an array of shape (k,): the coefficients x.

    References: Silvennoinen et al. 2025, eq. 13 and 14.
    """
    mean = float(problem.weights @ problem.target / problem.weights.sum())
    if mean <= 0:
        black = np.zeros(problem.rows.shape[1])
        black[0] = -_LARGEST_EXPONENT / problem.rows[0, 0]
        return black
    logarithm = np.log(np.maximum(problem.target, FLOOR * mean))
    weighted = problem.rows * problem.weights[:, None]
    normal = weighted.T @ problem.rows
    return np.linalg.solve(normal + _ridge(normal), weighted.T @ logarithm)


def fit_exponent(problem: Problem) -> Array:
    """Fit the exponential to the target itself.

    Gauss and Newton's method, damped after Levenberg and Marquardt, starts from the fit in log
    space, or from a part of it. The target is divided by its mean before, so that exponents of
    light of any unit are far from the largest one.

    The first column of the rows must be constant, and that of the variances 0.

    Returns an array of shape (k,): the coefficients x.
    """
    mean = float(problem.weights @ problem.target / problem.weights.sum())
    if mean <= 0:
        return _fit_exponent(problem)
    x = _fit_exponent(replace(problem, target=problem.target / mean))
    x[0] += np.log(mean) / problem.rows[0, 0]
    return x


def _fit_exponent(problem: Problem) -> Array:
    x = _start(problem)
    twice, roots = 2 * problem.variances, np.sqrt(problem.weights)
    value, cost = _evaluate(problem, x)
    damping = 1e-3
    for _ in range(_STEPS):
        slopes = twice * -x
        slopes += problem.rows
        slopes *= (roots * value)[:, None]
        normal = slopes.T @ slopes
        gradient = slopes.T @ (roots * (problem.target - value))
        before = cost
        for _ in range(_TRIALS):
            damped = normal + damping * np.diag(np.diag(normal)) + _ridge(normal)
            step = np.linalg.solve(damped, gradient)
            tried, tried_cost = _evaluate(problem, x + step)
            if tried_cost < cost:
                x, value, cost = x + step, tried, tried_cost
                damping = max(damping / 10, 1e-7)
                break
            damping *= 10
        if cost >= before * (1 - _SETTLED):
            break
    return x


def _start(problem: Problem) -> Array:
    """Return the fit in log space, or the part of it whose exponential is nearest to the target.

    The fit in log space ignores the variances. Where the light has much contrast, they would make
    everything so dark that no slope is left for the method to climb.
    """
    whole = fit_logarithm(problem)
    found = [whole]
    for part in _PARTS:
        x = part * whole
        value, _ = _evaluate(problem, x)
        weighted = problem.weights * value
        overlap = float(weighted @ problem.target)
        if overlap > 0:
            x[0] += np.log(overlap / float(weighted @ value)) / problem.rows[0, 0]
            found.append(x)
    return min(found, key=lambda x: _evaluate(problem, x)[1])


def _ridge(normal: Array) -> Array:
    """Return a small diagonal matrix, because some combinations of P and Q nearly cancel."""
    return RIDGE * np.mean(np.diag(normal)) * np.eye(len(normal))


def _evaluate(problem: Problem, x: Array) -> tuple[Array, float]:
    """Compute the exponential, and its weighted squared distance from the target."""
    exponent = problem.rows @ x - problem.variances @ x**2
    value = np.exp(np.clip(exponent, -_LARGEST_EXPONENT, _LARGEST_EXPONENT))
    return value, float(problem.weights @ (value - problem.target) ** 2)


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about an SH exponential, from what ``--json`` prints."""
    p, q = result["p_order"], result["q_order"]
    (first, last), (low, high) = result["roughness"], result["ggx_alpha"]
    sharpest = result["sharpest"]
    return [
        f"SH exponential, {(p + 1) ** 2} + {(q + 1) ** 2 - 1} coefficients a channel",
        f"orders         P = {p}, Q = {q}, attenuated by the law {result['law']!r}",
        f"roughness      {first:.4g} .. {last:.4g} (GGX's alpha {low:.4g} .. {high:.4g})",
        f"RMS error      {result['fit_residual']:.2%} of the reflected light left by the fit, "
        f"{sharpest['error']:.0%} of metals of roughness {sharpest['roughness']:.2g}",
    ]
