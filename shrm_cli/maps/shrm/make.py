"""How one SHRM is made: its center, the best one within its bytes, the expansion, and the map.

The method is that of section 5.6.2 of Ramamoorthi's thesis. Where the orders that a tolerance asks
for make a file that is too large, there are two ways to a smaller one: a lower order P, and smaller
cubes. Both are errors of the reflected light, which are known before the map is made, so that the
best pair of the two can be chosen. What is lost is said.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Chosen, Expansion, carry, map_wrong_share
from shrm_cli.maps.info import provenance
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.request import Notes, Prefiltered, Request, wrong_light
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import (
    TRIED_SIZES,
    check_size,
    choose_size,
    largest_p,
    stored_bytes,
    supported_order,
)
from shrm_cli.orders import choose_center, choose_orders, least_orders
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import tell_time_left
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_ERROR, DEFAULT_MAX_SIZE, MAX_ORDER_P, MIN_CUBE_SIZE, Frame


@record
class Form:
    """What a map holds that is made from an SHRM of order P."""

    images: Callable[[int], int]
    """Returns the number of RGB cubes of a map of order P."""
    check: Callable[[int, int], object] | None = None
    """Called with the size and the number of cubes before the work starts; it may refuse them by
    raising an error."""

    def largest_p(self, max_size: int) -> int:
        """Return the largest P whose cubes fit at the least size; any P where none fits."""
        orders = range(MAX_ORDER_P, -1, -1)
        fitting = (p for p in orders if stored_bytes(MIN_CUBE_SIZE, self.images(p)) <= max_size)
        return next(fitting, MAX_ORDER_P)


SHRM_FORM = Form(lambda order_p: (order_p + 1) ** 2)
"""The form of an SHRM: a cube for each harmonic of the view."""


def most_order_p(max_size: int, size: int | None, most: int = MAX_ORDER_P) -> Callable[[int], int]:
    """Return a function that tells the largest P whose map fits, for an order F.

    Cubes of half the size that F asks for are counted with, because a map may be worth that.

    `most` is the largest P in any case.
    """

    def most_at(order_f: int) -> int:
        texels = max(choose_size(order_f) // 2, TRIED_SIZES[0]) if size is None else size
        return min(largest_p(order_f, texels, max_size), most)

    return most_at


def affordable(light: Projection, request: Request, most: int = MAX_ORDER_P) -> Chosen:
    """Choose the orders and the size of a map: those that a tolerance asks for, if they fit."""
    most_p = most_order_p(request.allowed, request.size, most)
    found = choose_orders(request.brdf, request.eps, most_p=most_p)
    chosen = Chosen.of(request.brdf, found, request.size)
    orders = chosen.orders
    if chosen.is_met and orders.order_p <= min(
        largest_p(orders.order_f, chosen.size, request.allowed), most
    ):
        return chosen
    from shrm_cli.maps.shrm.rows import fitting  # most maps fit

    return fitting(light, chosen, request, most)


def halved(chosen: Chosen, images: int, max_size: int) -> Chosen:
    """Halve the size of a map of other images than those of an SHRM, until they fit.

    `chosen` is the SHRM behind the map. `images` is the number of RGB cubes of the map.

    Returns what it was given where not even the least size, `vocabulary.MIN_CUBE_SIZE`, fits.
    """
    size, orders = chosen.size, chosen.orders
    while stored_bytes(size, images) > max_size:
        size //= 2
        if size < MIN_CUBE_SIZE:
            return chosen
    if size == chosen.size:
        return chosen
    f = min(orders.order_f, supported_order(size))
    captured = float(chosen.coefficients.captured[f, orders.order_p])
    return replace(chosen, size=size, orders=replace(orders, order_f=f, captured=captured))


def refuse_large(size: int, images: int, max_size: int | None) -> None:
    """Refuse a map whose form is given by hand, if it exceeds the bytes that were asked for.

    `images` is the number of RGB cubes. None refuses nothing.
    """
    stored = stored_bytes(size, images)
    if max_size is not None and stored > max_size:
        raise ArgumentError(
            "max_size",
            f"{bytes_text(max_size)} does not hold {images:,} cubes of 6 x {size} x {size} texels, "
            f"which take {bytes_text(stored)}; raise it, or ask for fewer or smaller ones",
        )


def shortfall(chosen: Chosen, max_size: int, error: float, form: Form = SHRM_FORM) -> str | None:
    """Say in one line that a picture is wrong because its map misses the tolerance.

    The line is None where the tolerance is met, and where what is missed is not seen.
    """
    brdf, kept, coefficients = chosen.brdf, chosen.orders, chosen.coefficients
    if chosen.is_met:
        return None

    if error <= DEFAULT_ERROR:
        return None
    wanted = least_orders(coefficients, kept.eps)
    is_known = wanted.captured >= 1 - kept.eps
    if brdf.zonal and not is_known:
        why = f"most beside lamps: {brdf!r} is sharper than cubes of any size can show"
        return wrong_light(error, why, "put the lamps beside the map (`sun` split)")
    where = "where it changes with the view" if wanted.order_p > kept.order_p else "beside lamps"
    why = f"most {where}: {bytes_text(max_size)} before packing hold too little of it"
    needed = stored_bytes(choose_size(wanted.order_f), form.images(wanted.order_p))
    if is_known and needed <= max_size:  # the texels that were asked for take them
        return wrong_light(error, why, "lower `size`")
    if is_known and needed <= DEFAULT_MAX_SIZE:
        return wrong_light(error, why, f"raise `max_size` to {bytes_text(needed)}")
    return wrong_light(error, why, "take `to` auto without `eps`")


# Seconds of one processor for each series, that is a coefficient map of one colour, measured from
# F = 36 to 320 and P = 2 to 28. The time of the series and of their texels grows with the cube of
# the order F + P, and that of packing with the number of values.
_COUPLING = 7e-11  # for each term of order P
_SYNTHESIS = 8e-10
_STORED_VALUE = 1.5e-7


def centered(request: Request) -> tuple[Request, Notes]:
    """Recenter the BRDF of a request about the center that is asked for.

    Returns `request`; and `notes`, how the center was chosen; empty unless it is ``auto``, the one
    of the fewest coefficients.
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
    """Return a line for each way in which given orders fall short of what was asked for."""
    if request.is_free:
        return ()

    info, brdf, lines = made.map.info, request.brdf, []
    if request.order_p is not None and request.order_p > info.order_p:
        lines.append(f"{brdf.name} does not depend on the view, so P = 0 only")
    if info.captured < 1 - request.eps and info.predicted_error > DEFAULT_ERROR:
        why = f"for F = {info.order_f} and P = {info.order_p} are too few orders of {brdf!r}"
        lines.append(wrong_light(info.predicted_error, why, "leave them to `eps`"))
    return tuple(lines)


def prefilter_shrm(
    light: Projection, request: Request, chosen: Chosen | None = None, dtype: type = np.float32
) -> Prefiltered:
    """Prefilter a probe for a BRDF, and make one SHRM about the BRDF's own center.

    `chosen` is what `affordable` returns, where it is known.

    Returns the map, and what it misses of the tolerance as a warning, if the orders are chosen.
    """
    expansion, warnings = expand(light, request, SHRM_FORM, chosen)
    made = from_expansion(expansion, light.probe, request.frame, dtype)
    kept: Map = made
    compress = request.own.get("compress")
    if compress is not None:
        from shrm_cli.maps.shrm.shrm import compressed  # most maps are not

        kept = compressed(made, compress)

    facts = {"error_bound": expansion.bound}
    further = {"predicted_wrong_share": partial(map_wrong_share, [expansion], kept)}
    return Prefiltered(kept, facts, warnings=warnings, further=further)


def expand(
    light: Projection, request: Request, form: Form, chosen: Chosen | None = None
) -> tuple[Expansion, tuple[str, ...]]:
    """Choose the orders and the size of a map within its bytes, and expand light and BRDF.

    `form` is what the map holds that the SHRM is made for. Both have to fit into the bytes.

    Returns `expansion`; and `warnings`, what the map misses of the tolerance, and BRDFs that were
    not sampled finely enough.
    """
    brdf, order_f, order_p, size = request.brdf, request.order_f, request.order_p, request.size
    allowed, is_free = request.allowed, request.is_free
    if is_free:
        chosen = chosen or affordable(light, request, form.largest_p(allowed))
    else:
        if order_f is not None and not brdf.zonal:
            check_size(order_f, order_p or 0, size)
        chosen = Chosen.of(brdf, choose_orders(brdf, request.eps, order_f, order_p), size)
    count = form.images(chosen.orders.order_p)
    if is_free and size is None:
        chosen = halved(chosen, count, allowed)
    refuse_large(chosen.size, count, request.max_size)
    check_size(chosen.orders.order_f, chosen.orders.order_p, chosen.size)
    if form.check is not None:
        form.check(chosen.size, count)
    expansion = carry(light, chosen, order_f is not None, not is_free, request.sampling)
    lines = [expansion.remark]
    if is_free:
        lines.append(shortfall(chosen, allowed, expansion.error, form))
    return expansion, tuple(line for line in lines if line is not None)


def from_expansion(
    expansion: Expansion, probe: Probe, frame: Frame = "global", dtype: type = np.float32
) -> Shrm:
    """Make the SHRM of an expansion.

    `probe` is the probe of the expansion's light. `dtype` is as `Shrm.from_coefficients` takes it.
    """
    orders, brdf = expansion.orders, expansion.brdf
    tell_time_left(making_seconds(expansion.carried, orders.order_p, expansion.size))
    info = replace(
        provenance(probe, brdf, orders),
        predicted_error=expansion.error,
        filter_error=expansion.filter_error,
        carried=expansion.carried,
    )
    return Shrm.from_coefficients(
        expansion.lighting.coefficients,
        expansion.kept, brdf.center, info, expansion.size, frame, expansion.sampling, dtype,
    )  # fmt: skip


def making_seconds(order_f: int, order_p: int, size: int) -> float:
    """Estimate the seconds until an SHRM is made and written.

    `order_f` is the order F to which the light is carried.

    It is right within a factor of 2 where the rates were measured, if no other work is going on
    there.
    """
    series = 3 * (order_p + 1) ** 2
    made = series * (order_f + order_p) ** 3 * (_COUPLING * order_p + _SYNTHESIS)
    return made + series * 6 * size**2 * _STORED_VALUE
