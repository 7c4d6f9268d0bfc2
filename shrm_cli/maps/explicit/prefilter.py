"""How explicit maps are made: from an SHRM, or by one integral for each texel and view."""

from dataclasses import replace
from functools import partial
from typing import Any, TypeVar, cast

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array
from shrm_cli.brdf.lobe import lobe_tail
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Chosen, shown_wrong_share
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.info import MapInfo, provenance
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.request import Prefiltered, Request, error_lines
from shrm_cli.maps.shrm import make
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import converted_bytes, largest_f, most_cubes, shrm_look_up_error
from shrm_cli.messages import refuse_arguments
from shrm_cli.orders import choose_orders
from shrm_cli.probe.lighting import Projection, project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.reflected import reflected_rms
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import to_angles, views_around
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import Center, Frame, Sampling

Kind = TypeVar("Kind", bound=ExplicitMap)

_PAIRS = 4096
"""The pairs of central directions and views at which the error of a tabulated sum is measured."""
_AZIMUTHS = 32
"""The azimuths of the view over which sums are averaged for maps that have none."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF."""
    request, notes = make.centered(request)
    if request.domain == "angular":
        return replace(prefilter_angular(probe, request), notes=notes)
    made = prefilter_explicit(probe, request)
    return replace(
        made, notes=notes, warnings=(*make.order_warnings(made, request), *made.warnings)
    )


def converted(
    source: Map,
    to: str,
    order_p: int | None = None,
    frame: Frame | None = None,
    slices: int | None = None,
    views: int | None = None,
    max_size: int | None = None,
    **options: Any,
) -> Map:
    """Make the map that tabulates another map; see `Map.converted`.

    A map of this kind already is returned itself where it has what is asked for: a fit would lose
    what is beyond its order.

    `order_p` is the order P of the SHRM that is tabulated. By default it is the order that the
    source has or determines. A sum of terms is tabulated as it is. `slices` and `views` are the
    numbers of samples along an axis of the view, as `ExplicitMap.view_count` takes them; by default
    as many as P takes, as far as they fit into `max_size` bytes.
    """
    kind = explicit_kind(to)
    refuse_arguments(f"explicit maps such as {to}", frame=frame, **options)
    count = kind.view_count(slices, views)
    if to == source.representation and order_p is None:
        if count is None:
            has_asked = source.cube_count <= _most_cubes(source, max_size)
        else:
            has_asked = source.cube_count == kind.image_count(count)
        if has_asked:
            return source
    is_sum = "+" in source.center
    if isinstance(source, SummedShrm) or (isinstance(source, PrincipalMap) and is_sum):
        refuse_arguments("a sum of terms", order_p=order_p)
        count = _views_within(kind, source, max(source.info.order_p, 1), count, max_size)
        return tabulate_sum(kind, source, count)
    shrm = source.to_shrm(order_p, "global")
    return kind.from_shrm(shrm, _views_within(kind, source, shrm.order_p, count, max_size))


_LEAST_VIEWS = 2
"""The fewest samples along an axis of the view that are taken to save bytes."""


def _views_within(
    kind: type[ExplicitMap], source: Map, order_p: int, count: int | None, max_size: int | None
) -> int:
    """Return the samples along an axis of the view: those that are asked for, or as many as fit."""
    if count is None:
        count = kind.default_view_count(order_p)
        most = _most_cubes(source, max_size)
        while count > _LEAST_VIEWS and kind.image_count(count) > most:
            count -= 1
    make.refuse_large(source.size, kind.image_count(count), max_size)
    return count


def _most_cubes(source: Map, max_size: int | None) -> int:
    """Return the most cubes that what is made of a map may have."""
    return most_cubes(source.size, converted_bytes(source.size, source.cube_count, max_size))


def explicit_kind(representation: str) -> type[ExplicitMap]:
    """Return the class of the explicit maps of a representation."""
    return cast(type[ExplicitMap], registry.map_class(representation))


def view_count(request: Request) -> int | None:
    """Return the samples along an axis of the view that are asked for; None where none are."""
    own = request.own
    return explicit_kind(request.to).view_count(own.get("slices"), own.get("views"))


def explicit_form(request: Request) -> make.Form:
    """Return what an explicit map holds that is made from an SHRM of order P.

    It has `ExplicitMap.default_view_count` of P samples, unless the request gives their number.
    """
    kind, count = explicit_kind(request.to), view_count(request)

    def images(order_p: int) -> int:
        return kind.image_count(kind.default_view_count(order_p) if count is None else count)

    return make.Form(images, kind.check_images)


def prefilter_explicit(probe: Probe, request: Request, dtype: type = np.float32) -> Prefiltered:
    """Prefilter a probe in the frequency domain, and tabulate the SHRM.

    Where the images exceed the bytes at the size that the orders ask for, the size is halved until
    they fit.

    `dtype` is as `prefilter_shrm` takes it.
    """
    expansion, warnings = make.expand(Projection(probe), request, explicit_form(request))
    shrm = make.from_expansion(expansion, probe, request.frame, dtype)
    made = explicit_kind(request.to).from_shrm(shrm, view_count(request))

    facts = {"error_bound": expansion.bound}
    further = {"predicted_wrong_share": partial(shown_wrong_share, [expansion], made)}
    return Prefiltered(made, facts, warnings=warnings, further=further)


_AZIMUTH = "leaving out the azimuth, and interpolation between slices"
"""What causes the added error of a local map."""


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about an explicit map, from what ``--json`` prints."""
    size, maps, kind = result["size"], result["maps"], result["representation"]
    what = f"{result['frame']} {kind} map, {maps} cubes of 6 x {size} x {size} texels"
    # A local map has slices, which depend on the view by its angle only.
    added_by = _AZIMUTH if result["frame"] == "local" else "interpolation between views"
    return [what, *error_lines(result, added_by)]


_TEXELS_TO_MEASURE = 16
"""The most texels along a face's edge of the SHRM from which the added error is measured."""
_ORDER_TO_MEASURE = 10
"""The order P of the coefficients from which the errors are measured."""
_FINEST_GRID = 0.01
"""The least tolerance from which size and number of views are chosen. A smaller tolerance makes no
finer grid, because some BRDFs have no orders that meet it."""


def prefilter_angular(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF in the angular domain: one integral for each texel and view.

    The fraction `eps` of the lobe may be left out, far from its centre (eq. 5.30). The orders that
    meet it determine the size and the number of views, unless they are given.
    """
    brdf, kind = request.brdf, explicit_kind(request.to)
    size, sampling = request.size, request.sampling
    allowed, finest = request.allowed, max(request.eps, _FINEST_GRID)
    most_p = make.most_order_p(allowed, size, explicit_form(request).largest_p(allowed))
    with using(None):  # all of this takes a moment beside the images
        chosen = Chosen.of(brdf, choose_orders(brdf, finest, most_p=most_p), size)
        _, coefficients = choose_orders(brdf, finest, order_p=_ORDER_TO_MEASURE)
        views = view_count(request)
        views = kind.default_view_count(chosen.orders.order_p) if views is None else views
        count = kind.image_count(views)
        if size is None:
            chosen = make.halved(chosen, count, allowed)
        orders, size = replace(chosen.orders, eps=request.eps), chosen.size
        make.refuse_large(size, count, request.max_size)
        kind.check_images(size, count)
        integral = Reference(probe, brdf, request.source_height, request.eps, exact=True)
        lighting = project(probe, coefficients.order_f)
        # What the truncated lobe lacks is little, so that an accuracy of one percent suffices.
        rest, kept = lobe_tail(brdf, integral.angle), coefficients
        tail = compute_coefficients(rest, kept.order_f, kept.order_p, 1e-2)
        captured = 1 - tail.total_energy.sum() / max(coefficients.total_energy.sum(), 1e-300)
        orders = replace(orders, captured=float(captured))
        whole, lost = (reflected_rms(lighting, each) for each in (coefficients, tail))
        error = lost / whole if whole > 0 else 0.0
        info = replace(provenance(probe, brdf, orders), predicted_error=error, domain="angular")
        # The error of interpolating between views is measured in the frequency domain, where it
        # takes little time. A few texels suffice for that, and the orders F that fit into memory.
        order_p = coefficients.order_p
        smooth = Shrm.from_coefficients(
            lighting.coefficients,
            coefficients.truncated(largest_f(order_p), order_p), brdf.center, info,
            min(size, _TEXELS_TO_MEASURE), dtype=np.float32,
        )  # fmt: skip
        views_error = kind.from_shrm(smooth, views).info.added_error
        every = np.ones((coefficients.order_f + 1, orders.order_p + 1))
        looked_up = shrm_look_up_error(lighting, coefficients, every, size, sampling)
        info = replace(info, added_error=views_error, filter_error=looked_up)
    built = tabulate(kind, integral, brdf.center, info, size, views, sampling)
    return Prefiltered(built, {"error_bound": None, "predicted_wrong_share": None})


@record(eq=False)
class _Sum:
    """A sum of terms as `tabulate` takes it, over the mirror direction."""

    terms: SummedShrm | PrincipalMap

    def central_radiance(self, centers: Array, views: Array) -> Array:
        return self.terms.central_radiance(centers, views)

    def zonal_radiance(self, centers: Array, view_theta: float) -> Array:
        around = views_around(centers, view_theta, _AZIMUTHS)
        return np.mean([self.central_radiance(centers, views) for views in around], axis=0)


def tabulate(
    kind: type[Kind],
    integral: Reference | _Sum,
    center: Center,
    info: MapInfo,
    size: int,
    view_count: int,
    sampling: Sampling = "center",
) -> Kind:
    """Make an explicit map of a given kind, by one integral for each texel of each image.

    `integral` is asked for its `central_radiance`, or its `zonal_radiance` where views are local.
    `view_count` is the number of samples along an axis of the view.
    """
    count = kind.image_count(view_count)
    kind.check_images(size, count)
    images = np.empty((count, 3, 6 * size, size), dtype=np.float32)
    texels = cube_directions(size, sampling)
    for index, view in enumerate(kind.sample_views(count)):
        if kind.frame == "local":
            image = integral.zonal_radiance(texels, float(to_angles(view)[0]))
        else:
            image = integral.central_radiance(texels, view)
        images[index] = np.moveaxis(image, -1, 0)
        progress.report(index + 1, count)
    return kind(images.transpose(0, 2, 3, 1), center, info, sampling)


def tabulate_sum(kind: type[Kind], summed: SummedShrm | PrincipalMap, view_count: int) -> Kind:
    """Tabulate a sum of terms as an explicit map over the mirror direction.

    `view_count` is the number of samples along an axis of the view.
    """
    made = tabulate(
        kind, _Sum(summed), "reflection", summed.info, summed.size, view_count, summed.sampling
    )
    centers = spiral_directions(_PAIRS)
    views = np.random.default_rng(0).permutation(centers)
    exact = summed.central_radiance(centers, views)
    error = np.sum((made.central_radiance(centers, views) - exact) ** 2)
    added = np.sqrt(error / max(float(np.sum(exact**2)), 1e-300))
    return replace(made, info=summed.info.adding(added))
