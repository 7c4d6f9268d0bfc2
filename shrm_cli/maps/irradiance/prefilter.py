"""Prefiltering for diffuse surfaces: a probe's first lighting coefficients, windowed where they
would turn negative.

Section 4.3.1 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward and Inverse
Rendering" (2002), describes the method. Eq. 5.18 is one of its chapter 5.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from shrm_cli.arrays import relative_rms
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import provenance
from shrm_cli.maps.irradiance import irradiance
from shrm_cli.maps.irradiance.window import make_window, parse_window
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import unconverted
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import MAX_ORDER_F

_HIGH_ORDER = 64
"""The light is projected to this order at least, to know the error of the degrees left out."""
_LAST_DEGREES = 16
"""The mean power of this many last degrees tells how the light goes on beyond them."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Make the irradiance map of a probe, to the degree `order_f`; 2 makes nine coefficients.

    The own options of `request` are ``window``, as `make_window` takes it, and ``form``, as
    `in_form` does: which numbers are kept of degree 2. The window ``auto`` changes nothing where
    nothing is negative.

    Returns the map, and a warning if its irradiance is negative all the same.
    """
    order_f = request.order_f
    assert order_f is not None  # it has a default
    window, form = request.own["window"], request.own["form"]
    parse_window(window)
    size = choose_size(order_f) if request.size is None else request.size
    check_size(order_f, 0, size)
    high = min(max(_HIGH_ORDER, 2 * order_f), MAX_ORDER_F)
    lighting = project(probe, high)
    captured = _captured(order_f)
    orders = Orders.capturing(order_f, 0, captured)
    info = replace(
        provenance(probe, Lambertian(), orders), predicted_error=_missing(lighting, order_f)
    )
    whole = irradiance.Irradiance(
        lighting.coefficients[: (order_f + 1) ** 2], info, size, request.sampling
    )
    if form == "sh":
        return _windowed(whole, window)
    formed = irradiance.in_form(whole, form)
    # Coefficients of degree 2 that are guessed from the others cannot be damped.
    is_free = window == "auto" and form == "zh3-hallucinated"
    made = _windowed(formed, "none" if is_free else window)
    return replace(made, facts={**made.facts, "form_errors": irradiance.form_errors(whole, formed)})


def converted(source: Map, to: str, form: str | None = None, **options: Any) -> Map:
    """Return an irradiance map in one of the forms of ZH3; see `Map.converted`."""
    found = unconverted(source, to, **options)
    if form is None or not isinstance(found, irradiance.Irradiance):
        return found
    return irradiance.in_form(found, form)


def _windowed(whole: irradiance.Irradiance, spec: str) -> Prefiltered:
    """Apply a window to a map, and tell its least irradiance without and with the window."""
    before = least = whole.minimum()
    made, window = whole, make_window(spec, whole.series)
    if window.factors:
        made = whole.windowed(window, irradiance.with_change(whole.info, window.change))
        least = made.minimum()
    facts = {
        "brdf_energy_captured": made.info.captured,
        "predicted_error": made.info.predicted_error,
        "added_error": made.info.added_error,
        "window": {"asked": spec, **made.window.summary(made.order_f)},
        "minimum_irradiance": least,
        "minimum_without_window": before,
        **made.numbers(),
    }
    return Prefiltered(made, facts, warnings=(_dark(made, least),) if least < 0 else ())


def _dark(made: irradiance.Irradiance, least: float) -> str:
    """Return the line about a map that is negative on some side."""
    mean = float(np.mean(made.coefficients[0])) * np.sqrt(np.pi) / 2  # A_0 Y_00
    helps = "`window` auto" if made.takes_windows else "`form` zh3"
    return (
        f"surfaces that face away from the brightest lamp are black: the irradiance falls to "
        f"{least:.3g}, where its mean is {mean:.3g}; take {helps}, which keeps it non-negative"
    )


def _missing(lighting: Lighting, order_f: int) -> float:
    """Relative RMS error of the irradiance without the degrees above an order (Parseval)."""
    energies = irradiance.irradiance_energies(lighting.power()).sum(axis=1)
    beyond = _unknown(lighting)
    return relative_rms(energies[order_f + 1 :].sum() + beyond, energies.sum() + beyond)


def _unknown(lighting: Lighting) -> float:
    """Estimate the energy of the irradiance that the light beyond its expansion makes.

    Two estimates are made, and the smaller one counts. In the first, the light goes on as white
    light does, with ``(2l+1)`` times the mean power of the last degrees. In the second, all energy
    of the light that is left is in one of the next two degrees, the one with the larger A_l.
    """
    power = lighting.power().sum(axis=1)
    known = int(np.flatnonzero(power).max(initial=0)) + 1  # the pixels may hold no more degrees
    rest = max(float(lighting.energy.sum() - power.sum()), 0.0)
    last = slice(max(known - _LAST_DEGREES, 0), known)
    density = power[last].sum() / (2 * np.arange(known) + 1)[last].sum()
    white = density * 4 * np.pi * (2 * np.pi / 3) * (1 - _captured(known - 1))
    following = irradiance.lambert_factors(known + 1)[known:]  # above degree 1, one of the two is 0
    return float(min(white, rest * np.max(following**2)))


def _captured(order_f: int) -> float:
    """The part of the clamped cosine's energy, 2 pi / 3, that lies up to an order (eq. 5.18)."""
    measure = (2 * np.arange(order_f + 1) + 1) / (4 * np.pi)
    return float(irradiance.lambert_factors(order_f) ** 2 @ measure / (2 * np.pi / 3))


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about irradiance, from what ``--json`` prints."""
    size, window, errors = result["size"], result["window"], result.get("form_errors")
    missing, added = result["predicted_error"], result["added_error"]
    error = f"{math.hypot(missing, added):.2%} of the irradiance predicted"
    if added >= 5e-5:
        error += f", {missing:.2%} of degrees above {result['order_f']} alone"
    lines = [
        f"irradiance, {counted(result['coefficients'], 'coefficient')} and a cube of "
        f"6 x {size} x {size} texels",
        f"order          F = {result['order_f']}",
        f"RMS error      {error}",
    ]
    if errors is not None:
        lines.append(
            f"form           {result['form']}: {errors['form']:.2%} with what it leaves out of "
            f"degree 2; {errors['four']:.2%} with four coefficients, {errors['nine']:.2%} with nine"
        )
    least = f"minimum        {result['minimum_irradiance']:.4g} over all sides and channels"
    if window["name"] == "none":
        asked = " is needed" if window["asked"] == "auto" else ""
        return [*lines, f"window         none{asked}", least]
    width = "" if window["width"] is None else f" of width {window['width']:.4g}"
    return [
        *lines,
        f"window         {window['name']}{width}: takes "
        f"{window['energy_lost']:.2%} of the energy, changes {window['change']:.2%} (RMS)",
        f"{least}, {result['minimum_without_window']:.4g} without the window",
    ]
