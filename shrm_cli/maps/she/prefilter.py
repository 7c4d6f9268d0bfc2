"""Fitting spherical harmonic exponentials to the light that GGX reflects."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.environment.lobe_moments import lobe_moments, whole_lobe
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import MapError
from shrm_cli.maps.prefiltered import provenance
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential, exponent_series
from shrm_cli.maps.she.fit import Problem, fit_exponent, fit_logarithm
from shrm_cli.maps.she.reflectance import ReflectanceSamples, sample_reflectance
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import MAX_EXPONENTIAL_ORDER, Law

Array = NDArray[np.floating]

_ORDERS_F = 32, 128
_ORDER_OF_ALPHA = 6.5
"""Order of the light that is reflected, times alpha of the sharpest lobe, within bounds."""
_NORMAL_REFLECTANCES = 1.0, 0.04
"""Of the surfaces that are fitted: a metal and a plastic."""
_LEAST_ROUGHNESS = 0.05  # of `Ggx`
_ROUGHNESSES = 6
_PAPER_ROUGHNESSES = 4
_LEAST_RINGS = 8
_VIEW_RINGS = 6, 1
"""Of views about each mirror direction, and views on each."""
_SHADE = 0.4
"""Of the mean. Squared errors of brighter samples count in proportion to their brightness, not to
its square: else a sun, which no low order reaches, would bend all the rest."""
_DARK = 1e-6
"""Of the light's own reflection: what a split sum misses by less is as good as exact."""


@dataclass(frozen=True)
class _Form:
    """Orders and law of what is to be fitted."""

    order_p: int
    order_q: int
    law: Law


@dataclass(frozen=True)
class BakedExponential:
    """An SH exponential, and what is known of it.

    Attributes
    ----------
    map : SphericalHarmonicExponential
    roughness : tuple of 2 float
        Perceptual; what it was fitted to.
    """

    map: SphericalHarmonicExponential
    roughness: tuple[float, float]

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        made, info = self.map, self.map.info
        return {
            "representation": made.representation,
            "frame": made.frame,
            "center": made.center,
            "law": made.law,
            "order_f": info.order_f,
            "p_order": made.order_p,
            "q_order": made.order_q,
            "coefficients": len(made.coefficients),
            "roughness": list(self.roughness),
            "ggx_alpha": list(made.ggx_alpha),
            "fit_residual": info.fit_residual,
            "brdf": info.brdf,
            "probe": info.probe,
            "probe_sha256": info.probe_sha256,
        }


def bake_exponential(
    probe: Probe,
    order_p: int = 4,
    order_q: int = 2,
    roughness: tuple[float, float] = (0.45, 1.0),
    law: Law = "lobe",
    progress: Progress | None = None,
) -> BakedExponential:
    """Fit an SH exponential to what GGX reflects of a probe, at all views and roughnesses.

    Parameters
    ----------
    probe : Probe
    order_p, order_q : int
        Of the two factors.
    roughness : tuple of 2 float
        Perceptual, the range to fit; by default that of the paper, whose alpha begins at 0.2.
    law : {"lobe", "paper"}
        ``paper`` is the linear least-squares fit in log space of Silvennoinen et al.
    progress : callable, optional
        Called with rows read and rows in all.

    Raises
    ------
    MapError
        If the orders or the roughness are out of range, or the probe is black.
    """
    low, high = roughness
    if not _LEAST_ROUGHNESS <= low <= high <= 1:
        raise MapError(
            f"roughness {low:g} .. {high:g} is not a range within {_LEAST_ROUGHNESS:g} .. 1"
        )
    if not (0 <= order_p <= MAX_EXPONENTIAL_ORDER and 0 <= order_q <= MAX_EXPONENTIAL_ORDER):
        raise MapError(
            f"orders P = {order_p}, Q = {order_q} are outside 0 .. {MAX_EXPONENTIAL_ORDER}"
        )
    order_f = int(np.clip(np.ceil(_ORDER_OF_ALPHA / low**2), *_ORDERS_F))
    lighting = project(probe, order_f, progress)
    rings = _rings(order_p, order_q)
    samples = sample_reflectance(lighting, _sampled_roughness(roughness, law), rings, *_VIEW_RINGS)
    if not samples.reflected.any():
        raise MapError(f"{probe.name}: the probe is black, and has no logarithm")
    moments = [_moments(samples, each) for each in samples.roughness]
    problems = _problems(samples, moments, _Form(order_p, order_q, law))
    fit = fit_logarithm if law == "paper" else fit_exponent
    coefficients = np.stack([fit(each) for each in problems], axis=-1)
    info = replace(
        provenance(probe, Ggx(), Orders(order_f, 0, 0.0, 1.0)),
        brdf={"name": "ggx", "parameters": {}},
    )
    made = SphericalHarmonicExponential(
        coefficients[: (order_p + 1) ** 2],
        coefficients[(order_p + 1) ** 2 :],
        (low**2, high**2),
        info,
        law,
    )
    residual = _residual(made, samples, moments)
    return BakedExponential(replace(made, info=replace(info, fit_residual=residual)), roughness)


def _rings(order_p: int, order_q: int) -> int:
    """Of mirror directions: with fewer than P needs, the fit would be free between them."""
    return max(_LEAST_RINGS, order_p + 2, order_q)


def _sampled_roughness(roughness: tuple[float, float], law: Law) -> tuple[float, ...]:
    low, high = roughness
    if low == high:
        return (low,)
    if law == "paper":  # evenly in alpha
        return tuple(np.sqrt(np.linspace(low**2, high**2, _PAPER_ROUGHNESSES)).tolist())
    return tuple(np.linspace(low, high, _ROUGHNESSES).tolist())


def _problems(samples: ReflectanceSamples, moments: list[Array], form: _Form) -> list[Problem]:
    """What each channel's coefficients are to fit.

    After the paper's law it is base reflectance, all samples alike (eq. 14). Otherwise it is the
    whole reflection of a metal and a plastic, each relative to what a split sum makes of it.
    """
    parts = []
    for roughness, (base, tail), mirrored, own in zip(
        samples.roughness, samples.reflected, samples.mirrored, moments, strict=True
    ):
        for f0 in _NORMAL_REFLECTANCES if form.law == "lobe" else (1.0,):
            series = exponent_series(form, samples.normals, samples.views, roughness, own, f0)
            reflected, albedo = f0 * base + (1 - f0) * tail, series.albedo[:, None]
            weights = samples.weights
            if form.law == "lobe":
                split_sum = whole_lobe(own, f0)[0][:, None] * mirrored
                scale = weights @ np.mean((split_sum - reflected) ** 2, axis=-1)
                scale += _DARK * (weights @ np.mean(reflected**2, axis=-1))
                weights = weights * series.albedo**2 / scale
            parts.append((series.rows, series.variances, reflected / albedo, weights))
    rows, variances, targets, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    if form.law == "lobe":
        weights = weights[:, None] / (_brightness(targets) + _SHADE)
    else:
        weights = np.repeat(weights[:, None], 3, axis=1)
    return [Problem(rows, variances, targets[:, c], weights[:, c]) for c in range(3)]


def _brightness(targets: Array) -> Array:
    """Samples (n, 3) in units of their channel's mean."""
    light = np.maximum(targets, 0.0)
    return light / np.maximum(light.mean(axis=0), np.finfo(float).tiny)


def _moments(samples: ReflectanceSamples, roughness: float) -> Array:
    """The lobe's moments at every sample; few of them differ in N.V."""
    cosines = np.sum(samples.normals * samples.views, axis=-1)
    different, where = np.unique(np.round(cosines, 9), return_inverse=True)
    return lobe_moments(roughness, different)[..., where]


def _residual(
    made: SphericalHarmonicExponential, samples: ReflectanceSamples, moments: list[Array]
) -> float:
    """Relative RMS error of base reflectance over all views, normals and roughnesses sampled."""
    error = total = 0.0
    normals, views = samples.normals, samples.views
    for roughness, (base, _), own in zip(
        samples.roughness, samples.reflected, moments, strict=True
    ):
        series = exponent_series(made, normals, views, roughness, own, 1.0)
        found = series.albedo[:, None] * np.exp(series.exponent(made.coefficients))
        error += float(samples.weights @ np.sum((found - base) ** 2, axis=-1))
        total += float(samples.weights @ np.sum(base**2, axis=-1))
    return float(np.sqrt(error / total))
