"""Making product textures: of a BRDF alone, or with the light of a probe."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from shrm_cli.arrays import Array, relative_difference, relative_rms
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.product import ACCURACY, ProductFunctions, own_frame
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.info import MapInfo, provenance, record_of
from shrm_cli.maps.irradiance.window import parse_window
from shrm_cli.maps.product.product import ProductTexture, VaryingProduct
from shrm_cli.maps.product.steps import ENOUGH, Steps, chosen_steps
from shrm_cli.maps.product.window import light_densities, seen_views
from shrm_cli.maps.request import Prefiltered, Request, wrong_light
from shrm_cli.maps.size import MAX_VALUES
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Stages, current, using
from shrm_cli.sphere import parabolic
from shrm_cli.sphere.cube import catmull_rom
from shrm_cli.sphere.directions import to_angles
from shrm_cli.sphere.harmonics import by_degree, degrees_and_orders
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.rotation import turn_about_z
from shrm_cli.vocabulary import DEFAULT_ERROR, DEFAULT_PRODUCT_SIZE, MAX_PRODUCT_ORDER

_KNOWN_ORDER = 16
"""The degree to which the product functions of some views are known, for errors."""
_VIEWS = 128
"""Views that errors are estimated from, spread as pixels of a sphere are."""
_VIEWS_OF_STEPS = 32
"""Some of them, which the values of parameters that vary are chosen by."""
_ACCURACY_OF_TWO = ENOUGH / 10
"""The relative accuracy of the coefficients that combinations of two parameters are compared by."""
_LEAST_COSINE = 0.02
"""The least N.V of these views. Textures are not filtered well within a degree of the horizon, of
which nobody sees much."""


def product_texture(brdf: Brdf, order: int, texels: int = DEFAULT_PRODUCT_SIZE) -> Prefiltered:
    """Make the product texture of a BRDF, without any light.

    `order` is the largest degree of the harmonics. `texels` is their number along an edge of the
    parabolic map of the views.

    The predicted error of the map is that under white noise: the root of the energy that is missed.
    The fact ``residual`` is the relative RMS change of the coefficients when the nodes of their
    quadrature are doubled.
    """
    return Prefiltered(*_texture(brdf, order, texels, order)[:2])


def varying_steps(
    brdf: Brdf, ranges: Mapping[str, tuple[float, float]], order: int, steps: int | None = None
) -> tuple[Steps, list[tuple[float, ...]]]:
    """Choose the values of parameters for which there are textures; see `steps.chosen_steps`.

    `ranges` are the ranges of one parameter or two, which are numbers or colours. `steps` is the
    number of values of each; by default as many as it takes.

    Returns `steps`; and `points`, the values of the parameters for each texture.
    """
    for ends in zip(*ranges.values(), strict=True):
        _with_values(brdf, ranges, ends)  # which names the end that is wrong, and no value between
    views = seen_views(_VIEWS, _LEAST_COSINE)[:: _VIEWS // _VIEWS_OF_STEPS]
    accuracy = ACCURACY if len(ranges) == 1 else _ACCURACY_OF_TWO

    def coefficients(*point: float) -> Array:
        functions = ProductFunctions.of(_with_values(brdf, ranges, point), order, accuracy)
        found = functions.expanded(views, order)[0]
        # A BRDF may be grey at some values only, and is coloured as a whole then.
        return found if len(ranges) == 1 else np.broadcast_to(found, (*found.shape[:2], 3))

    found, points = chosen_steps(coefficients, ranges, steps)
    if steps is None and found.error > ENOUGH:
        wide = " and ".join(f"`{name}` from {a:g} to {b:g}" for name, (a, b) in ranges.items())
        raise BrdfError(
            f"{brdf!r}: {len(points)} textures of {wide} miss {found.error:.1%} between them; "
            "narrow the range, or give `steps` to have it so"
        )
    return found, points


def varying_texture(
    brdf: Brdf, steps: Steps, points: Sequence[tuple[float, ...]], order: int, texels: int
) -> Prefiltered:
    """Make product textures of a BRDF of which parameters vary, without light."""
    _check_size(order, texels, len(points))
    each = [_with_values(brdf, steps.values, point) for point in points]
    stages = Stages(current(), len(each))
    made = []
    for index, one in enumerate(each):
        with using(stages.within):
            made.append(_texture(one, order, texels, order)[:2])
        stages.done(index + 1, len(each))
    varying = VaryingProduct.of([one for one, _ in made], steps)
    facts = {name: max(told[name] for _, told in made) for name in ("residual", "nodes")}
    return Prefiltered(varying, {**varying.details(), **facts})


def _with_values(brdf: Brdf, parameters: Iterable[str], values: Sequence[float]) -> Brdf:
    """Return a model with some of its parameters changed."""
    known = {each.name: each for each in brdf.parameters}
    for parameter in parameters:
        if parameter not in known or isinstance(known[parameter].default, str):
            numbers = [name for name, each in known.items() if not isinstance(each.default, str)]
            having = ", ".join(numbers) or "none"
            raise BrdfError(f"{brdf!r}: it has no parameter {parameter!r} to vary; it has {having}")
    return brdf.with_values(**dict(zip(parameters, values, strict=True)))


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Make the product texture of a BRDF that holds the light of a probe.

    The own options of `request` are ``order`` and ``texels``, as `product_texture` takes them, and
    ``window``, as `ProductMap.window` takes it. Of so few orders a lamp may make black spots.
    ``auto`` blurs the light as little as leaves each color negative in no more than a hundredth of
    what is seen, and not at all where no more is.

    The predicted error of the map is the relative RMS error of the reflected light of this probe,
    over all mirror directions and views, by Parseval, as that of other maps is; the added error is
    that of the window.
    """
    brdf, own = request.brdf, request.own
    order, window = own["order"], own["window"]
    parse_window(window)
    stages = Stages(current(), 2)
    known = max(_KNOWN_ORDER, order)
    with using(stages.within):
        light = Projection(probe)
        densities = light_densities(light, known)
        stages.done(1, 2)
        texture, facts, power, energy = _texture(brdf, order, own["texels"], known)
    stages.done(2, 2)
    info = texture.info
    record = provenance(probe, brdf, Orders(order, 0, info.eps, info.captured))
    series = light.to_order(order).coefficients[: (order + 1) ** 2]
    shape = texture.window(window, series)
    factors = np.zeros(len(power))
    factors[: order + 1] = shape.factors or 1.0
    squares, beyond = _reflected(densities, power, energy)
    whole = float(squares.sum()) + beyond
    missed = float(squares[order + 1 :].sum()) + beyond
    changed = float(squares[: order + 1] @ (1 - factors[: order + 1]) ** 2)
    info = replace(
        record,
        predicted_error=relative_rms(missed, whole),
        added_error=relative_rms(changed, whole),
        filter_error=info.filter_error,
    )
    lit = texture.with_info(info).lit(shape.apply(series))
    told = {**facts, "window": {"asked": window, **shape.summary(order)}}
    # Whoever asks for an error is told by the search where it is not kept.
    error = math.hypot(info.predicted_error, info.added_error)
    if "error" in request.given or error <= DEFAULT_ERROR:
        return Prefiltered(lit, told)
    remedy = "take `to` auto" if order == MAX_PRODUCT_ORDER else "raise `order`, or take `to` auto"
    line = wrong_light(error, f"for order {order} shows nothing sharper", remedy)
    return Prefiltered(lit, told, warnings=(line,))


def _texture(
    brdf: Brdf, order: int, texels: int, known: int
) -> tuple[ProductTexture, dict[str, Any], Array, Array]:
    """Make a texture, and return with it facts about its making, and the energy of the product
    functions by degree up to `known`, shape (degrees, channels), and in all, shape (channels,).
    """
    _check_size(order, texels, 1)
    functions = ProductFunctions.of(brdf, order)
    table = product_table(brdf, functions, order, texels)
    views = seen_views(_VIEWS, _LEAST_COSINE)
    exact, energy = functions.expanded(views, known)
    power = by_degree(exact**2, axis=1).mean(axis=0)
    energy = energy.mean(axis=0)
    captured = float(power[: order + 1].sum() / energy.sum()) if energy.sum() > 0 else 1.0
    captured = min(captured, 1.0)
    info = MapInfo(
        order, 0, max(1 - captured, 0.0), captured, float(np.sqrt(1 - captured)), record_of(brdf)
    )
    texture = ProductTexture(table, info)
    exact = exact[:, : (order + 1) ** 2]
    filtered = relative_difference(texture.values(views, linear=True), exact)
    texture = replace(texture, info=replace(info, filter_error=filtered))
    facts = {"residual": functions.residual, "nodes": functions.most_nodes}
    return texture, facts, power, energy


def _check_size(order: int, texels: int, count: int) -> None:
    """Refuse textures of more values than can be kept."""
    if texels**2 * (order + 1) ** 2 * 3 * count > MAX_VALUES:
        raise MapError(
            f"{count} x {texels} x {texels} texels of {(order + 1) ** 2} coefficients are too "
            "many; lower the size or the order"
        )


def _reflected(densities: tuple[Array, Array], power: Array, energy: Array) -> tuple[Array, float]:
    """Predict the mean square of the reflected light by degree, and that of the unknown degrees.

    Over all rotations of light against surface the mean square is ``sum_l |L_l|^2 |c_l|^2 /
    (2l+1)``.

    `densities` are the `light_densities`. `power`, of shape (degrees, channels), is the mean of
    ``|c_l|^2`` over the views. `energy`, of shape (channels,), is the same of all degrees together.
    """
    known, beyond = densities
    rest = np.maximum(energy - power.sum(axis=0), 0.0) * beyond
    return (known * power).sum(axis=1), float(rest.sum())


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about a product texture, from what ``--json`` prints."""
    size, order = result["size"], result["order"]
    color = "RGB" if result["channels"] == 3 else "grey"
    varied = _varied(result) if "step_error" in result else ""
    lines = [
        f"product texture, {size} x {size} views of {result['coefficients']} coefficients, {color}"
        f"{varied}",
        f"order          {order}, which captures {result['brdf_energy_captured']:.2%} of the "
        "BRDF's energy",
        f"quadrature     {result['residual']:.2g} relative change when the nodes are doubled, "
        f"{result['nodes']:,} directions at most",
        f"look-ups       {result['filter_error']:.2%} RMS error by bilinear filtering",
    ]
    if varied:
        lines.append(
            f"between        {result['step_error']:.2%} RMS error between two values at most"
        )
    of = "of this light reflected" if result["lit"] else "of white noise reflected"
    lines.append(f"RMS error      {result['predicted_error']:.2%} {of}, beyond the order")
    window = result.get("window")
    if window is not None and window["name"] != "none":
        lines.append(
            f"window         {window['name']}, changes it by {result['added_error']:.2%} RMS, and "
            f"what is seen by {window['p95_change']:.1%} (p95); without it {window['spots']:.1%} "
            "would lack a color"
        )
    return lines


def _varied(result: dict[str, Any]) -> str:
    """Say which parameters vary, from what ``--json`` prints."""
    if "parameter" in result:
        axes = {result["parameter"]: result["values"]}
    else:
        axes = dict(zip(result["parameters"], result["values"], strict=True))
    parts = [
        f"{len(own)} values of {name} from {own[0]:g} to {own[-1]:g}" for name, own in axes.items()
    ]
    sums = f", by sums of {result['textures']} textures" if len(axes) > 1 else ""
    return f", for {' x '.join(parts)}{sums}"


# ---- filling a texture: the coefficients of all its views, by as few of them as suffice ----------
# Turning light and view of an isotropic BRDF together changes nothing, so the coefficients of one
# view are those of another at the same angle from the normal, turned. A BRDF that a mirror leaves
# as it is needs the views on one side of the mirror only, and so has one that half a turn leaves as
# it is. All texels off the circle of the views are of views on its rim.

_PROBES = 512
"""Pairs of directions at which it is seen whether a BRDF is symmetric."""
_ROUNDING = 1e-5
"""The relative difference, of the largest value, that is none."""
_DIGITS = 9
"""Decimals to which the places of texels are told apart."""
_RING = 512
"""Views around the rim from which texels off the circle are interpolated, where those are more."""


def product_table(brdf: Brdf, functions: ProductFunctions, order: int, size: int) -> Array:
    """Compute the product texture of a BRDF.

    `functions` are its product functions.

    Returns an array of float32 of shape (size, size, (order+1)^2, channels), ``c_i(v)`` for the
    views of `sphere.parabolic.parabolic_directions`; one channel for a grey BRDF, else three.
    """
    views = parabolic.parabolic_directions(size)
    if brdf.isotropic and brdf.center != "tangent":
        return _turned(functions, views, order)
    x, y = parabolic.project(views)
    rim = np.hypot(x, y) > 1 - 1 / size - _ROUNDING
    if rim.sum() <= _RING:
        found = _by_symmetry(brdf, functions, views.reshape(-1, 3), order)
        return found.reshape(size, size, *found.shape[1:])
    turn = 2 * np.pi * (np.arange(_RING) + 0.5) / _RING
    radius = 1 - 1 / size
    ring = parabolic.unproject(radius * np.cos(turn), radius * np.sin(turn))
    inner = views[~rim]
    found = _by_symmetry(brdf, functions, np.concatenate([inner, ring]), order)
    table = np.empty((size, size, *found.shape[1:]), dtype=np.float32)
    table[~rim] = found[: len(inner)]
    table[rim] = _between(found[len(inner) :], np.arctan2(y[rim], x[rim]))
    return table


def _between(ring: Array, azimuths: Array) -> Array:
    """Interpolate values at the middles of even steps of the azimuth, (n, ...), by a cubic."""
    first, weights = catmull_rom(azimuths / (2 * np.pi) * len(ring) - 0.5)
    shares = np.stack(weights)[(..., *(None,) * (ring.ndim - 1))]
    return np.sum([w * ring[(first + k) % len(ring)] for k, w in enumerate(shares)], axis=0)


def _by_symmetry(brdf: Brdf, functions: ProductFunctions, views: Array, order: int) -> Array:
    """Compute the coefficients of views (n, 3) from those on one side of each symmetry.

    Returns an array of float32 of shape (n, (order+1)^2, channels).
    """
    negative = np.signbit(views[:, :2])
    keeps = [_is_kept(brdf, flips) for flips in ((-1, 1), (1, -1))]
    if not any(keeps) and _is_kept(brdf, (-1, -1)):
        negative = negative[:, [1, 1]]  # x and y change their signs together
    else:
        negative = negative & keeps
    folded = views * np.where(np.pad(negative, [(0, 0), (0, 1)]), -1.0, 1.0)
    x, y = (np.round(each, _DIGITS) for each in parabolic.project(folded))
    _, chosen, which = np.unique(x + 1j * y, return_index=True, return_inverse=True)
    found = functions.coefficients(folded[chosen], order).astype(np.float32)[which]
    _, m = degrees_and_orders(order)
    for axis, is_odd in enumerate(((m < 0) != (m % 2 == 1), m < 0)):
        found[negative[:, axis]] *= np.where(is_odd, -1.0, 1.0)[:, None]
    return found


def _turned(functions: ProductFunctions, views: Array, order: int) -> Array:
    """Compute the table of an isotropic BRDF from views along x alone."""
    size = len(views)
    radius = np.round(np.hypot(*parabolic.project(views)), _DIGITS)
    radii, which = np.unique(radius, return_inverse=True)
    along_x = functions.coefficients(parabolic.unproject(radii, np.zeros_like(radii)), order)
    flat = np.moveaxis(along_x[which.reshape(-1)], 0, -1)
    turned = turn_about_z(flat, to_angles(views)[1].reshape(-1))
    table = np.moveaxis(turned, -1, 0).reshape(size, size, *along_x.shape[1:])
    return np.ascontiguousarray(table, dtype=np.float32)


def _is_kept(brdf: Brdf, signs: tuple[int, int]) -> bool:
    """Whether a BRDF stays as it is where x and y of light and view take factors of -1 or 1."""
    light = spiral_directions(_PROBES)
    light[:, 2] = np.abs(light[:, 2])
    view = np.roll(light, _PROBES // 3, axis=0)  # neighbours would all be near each other
    flips = np.array([*signs, 1.0])
    here = brdf.transfer(own_frame(brdf, light), own_frame(brdf, view))
    there = brdf.transfer(own_frame(brdf, light * flips), own_frame(brdf, view * flips))
    return bool(np.abs(here - there).max() <= _ROUNDING * np.abs(here).max())
