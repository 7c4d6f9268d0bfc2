"""How one SHRM is made: its center, orders and size, the expansion, and the map of it.

The method is that of section 5.6.2 of Ramamoorthi's thesis.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Expansion, carry, map_wrong_share
from shrm_cli.maps.info import provenance
from shrm_cli.maps.prefiltered import Notes, Prefiltered, wrong_light
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.budget import (
    SHRM_FORM,
    Choice,
    Form,
    affordable,
    halved,
    refuse_large,
    shortfall,
)
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.orders import choose_center, choose_orders
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import tell_time_left

if TYPE_CHECKING:
    from shrm_cli.probe.lighting import Projection

# Seconds of one processor for each series, that is a coefficient map of one colour, measured from
# F = 36 to 320 and P = 2 to 28. The time of the series and of their texels grows with the cube of
# the order F + P, and that of packing with the number of values.
_COUPLING, _MOST_TERMS = 6e-10, 10  # for each term of order P; sums over rings replace many
_SYNTHESIS = 3e-9
_STORED_VALUE = 1.5e-7


def centered(request: Request) -> tuple[Request, Notes]:
    """Recenter the BRDF of a request about the center that is asked for.

    Returns `request`; and `notes`, how the center was chosen; empty unless it is ``auto``, the one
    of the fewest coefficients.

    Raises BrdfError or OrderError if the BRDF cannot be expanded about that center.
    """
    brdf, center = request.brdf, request.center
    if center is None:
        return request, ()
    if center != "auto":
        return replace(request, brdf=brdf.recentered(center)), ()  # type: ignore[arg-type]
    brdf, counts = choose_center(brdf, request.eps)
    needs = ", ".join(f"{count:,} about the {name}" for name, count in counts.items())
    why = f"coefficients: {needs}" if counts else "too sharp to count coefficients"
    return replace(request, brdf=brdf), (("centre", f"{brdf.center} ({why})"),)


def order_warnings(made: Prefiltered, request: Request) -> tuple[str, ...]:
    """Return a line for each way in which orders that are given fall short of what was asked for.

    `request` is what it was made for.
    """
    if request.is_free:
        return ()
    from shrm_cli.plan import policy  # most orders are chosen

    info, brdf, lines = made.map.info, request.brdf, []
    if request.order_p is not None and request.order_p > info.order_p:
        lines.append(f"{brdf.name} does not depend on the view, so P = 0 only")
    if info.captured < 1 - request.eps and info.predicted_error > policy.ERROR:
        why = f"for F = {info.order_f} and P = {info.order_p} are too few orders of {brdf!r}"
        lines.append(wrong_light(info.predicted_error, why, "leave them to `eps`"))
    return tuple(lines)


def prefilter_shrm(
    light: Projection,
    request: Request,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
    dtype: type = np.float32,
) -> Prefiltered:
    """Prefilter a probe for a BRDF, and make one SHRM about the BRDF's own center.

    `light` is the light of the probe. `chosen` is what `affordable` returns, where it is known.
    `dtype` is as `Shrm.from_coefficients` takes it.

    Returns the map, and what it misses of the tolerance as a warning, if the orders are chosen.
    Raises ArgumentError if no map fits into the bytes, or those of the given orders do not. Raises
    OrderError, ProbeError, BrdfError or MapError if the tolerance cannot be met with a given order,
    the probe or the BRDF cannot be used, or the map would be too large.
    """
    expansion, warnings = expand(light, request, SHRM_FORM, chosen)
    made = from_expansion(expansion, light.probe, request, dtype)
    kept: Map = made
    compress = request.own.get("compress")
    if compress is not None:
        from shrm_cli.maps.shrm.compressed import compressed  # most maps are not

        kept = compressed(made, compress)

    facts = {"error_bound": expansion.bound}
    further = {"predicted_wrong_share": partial(map_wrong_share, [expansion], kept)}
    return Prefiltered(kept, facts, warnings=warnings, further=further)


def expand(
    light: Projection,
    request: Request,
    form: Form,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
) -> tuple[Expansion, tuple[str, ...]]:
    """Choose the orders and the size of a map within its bytes, and expand light and BRDF.

    `light`, `request` and `chosen` are the same as for `prefilter_shrm`. `form` is what the map
    holds that the SHRM is made for. Both have to fit into the bytes.

    Returns `expansion`; and `warnings`, what the map misses of the tolerance, and BRDFs that were
    not sampled finely enough.
    """
    brdf, order_f, order_p, size = request.brdf, request.order_f, request.order_p, request.size
    allowed, is_free, is_sized = request.allowed, request.is_free, size is not None
    if is_free:
        choice, coefficients = chosen or affordable(light, request, form.largest_p(allowed))
    else:
        if order_f is not None and not brdf.zonal:
            check_size(order_f, order_p or 0, size)
        orders, coefficients = choose_orders(brdf, request.eps, order_f, order_p)
        choice = Choice(orders, choose_size(orders.order_f) if size is None else size)
    count = form.images(choice.orders.order_p)
    if is_free and not is_sized:
        choice = halved(choice, coefficients, count, allowed) or choice
    orders, size = choice.orders, choice.size
    refuse_large(size, count, request.max_size)
    check_size(orders.order_f, orders.order_p, size)
    if form.check is not None:
        form.check(size, count)
    expansion = carry(
        light, brdf, orders, coefficients, size,
        is_exact=order_f is not None, is_exact_view=not is_free,
    )  # fmt: skip
    lines = [expansion.remark]
    if is_free:
        lines.append(shortfall(brdf, coefficients, orders, allowed, expansion.error, form))
    return expansion, tuple(line for line in lines if line is not None)


def from_expansion(
    expansion: Expansion, probe: Probe, request: Request, dtype: type = np.float32
) -> Shrm:
    """Make the SHRM of an expansion.

    `probe` is the probe of the expansion's light. `request` says the frame and the sampling.
    `dtype` is as `Shrm.from_coefficients` takes it.
    """
    orders, brdf = expansion.orders, expansion.brdf
    tell_time_left(making_seconds(expansion.carried, orders.order_p, expansion.size))
    info = replace(
        provenance(probe, brdf, orders),
        predicted_error=expansion.error,
        filter_error=expansion.filter_error(request.sampling),
        carried=expansion.carried,
    )
    return Shrm.from_coefficients(
        expansion.lighting.coefficients,
        expansion.kept, brdf.center, info, expansion.size, request.frame, request.sampling, dtype,
    )  # fmt: skip


def making_seconds(order_f: int, order_p: int, size: int) -> float:
    """Estimate the seconds until an SHRM is made and written.

    `order_f` is the order F to which the light is carried. `size` is the number of texels along a
    face's edge.

    It is right within a factor of 2 where the rates were measured, if no other work is going on
    there.
    """
    series = 3 * (order_p + 1) ** 2
    coupling = _COUPLING * min(order_p, _MOST_TERMS)
    made = series * (order_f + order_p) ** 3 * (coupling + _SYNTHESIS)
    return made + series * 6 * size**2 * _STORED_VALUE
