"""How explicit maps are made: from an SHRM, or by one integral for each texel and view."""

from dataclasses import replace
from typing import cast

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.shrm.budget import Form
from shrm_cli.maps.shrm.prefilter import centered, expand, is_chosen, order_warnings
from shrm_cli.maps.shrm.single import from_expansion
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import DEFAULT_EPS, Sampling


def prefilter(
    probe: Probe,
    brdf: Brdf,
    to: str,
    eps: float = DEFAULT_EPS,
    order_f: int | None = None,
    order_p: int | None = None,
    center: str | None = None,
    domain: str = "frequency",
    source_height: int | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
    slices: int | None = None,
    views: int | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> Prefiltered:
    """Prefilter a probe for a BRDF; the arguments are those of `shrm_cli.prefilter.prefilter`.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
    """
    is_angular = domain == "angular"
    if is_angular and (order_f, order_p) != (None, None):
        given = "order_p" if order_f is None else "order_f"
        raise ArgumentError(given, "applies with `domain` frequency")
    if source_height is not None and not is_angular:
        raise ArgumentError("source_height", "applies with `domain` angular")
    kind = explicit_kind(to)
    count = kind.view_count(slices, views)
    brdf, notes = centered(brdf, eps, center, progress)
    if is_angular:
        from shrm_cli.maps.explicit.angular import prefilter_angular

        made = prefilter_angular(
            probe, brdf, eps, kind, count, size, sampling, source_height, max_size, progress
        )
        return replace(made, notes=notes)
    made = prefilter_explicit(
        probe, brdf, eps, to, order_f, order_p, count, size, sampling, np.float32, max_size,
        progress,
    )  # fmt: skip
    warnings = () if is_chosen(order_f, order_p) else order_warnings(made, brdf, eps, order_p)
    return replace(made, notes=notes, warnings=(*warnings, *made.warnings))


def explicit_kind(representation: str) -> type[ExplicitMap]:
    """Return the class of the explicit maps of a representation."""
    return cast(type[ExplicitMap], registry.map_class(representation))


def explicit_form(kind: type[ExplicitMap], view_count: int | None) -> Form:
    """Return what an explicit map holds that is made from an SHRM of order P.

    Parameters
    ----------
    kind : type of ExplicitMap
    view_count : int, optional
        Samples along an axis of the view; `ExplicitMap.default_view_count` of P by default.
    """

    def images(order_p: int) -> int:
        views = kind.default_view_count(order_p) if view_count is None else view_count
        return kind.image_count(views)

    return Form(images, kind.check_images)


def prefilter_explicit(
    probe: Probe,
    brdf: Brdf,
    tolerance: float,
    representation: str,
    order_f: int | None = None,
    order_p: int | None = None,
    view_count: int | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
    dtype: type = np.float64,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> Prefiltered:
    """Prefilter a probe in the frequency domain, and tabulate the SHRM.

    Parameters
    ----------
    representation : str
        The representation of an explicit map.
    view_count : int, optional
        Samples along an axis of the view; `ExplicitMap.default_view_count` of P by default.
    probe, brdf, tolerance, order_f, order_p, size, sampling, dtype, max_size, progress
        The same as for `prefilter_shrm`. Where the images exceed the bytes at the size that the
        orders ask for, the size is halved until they fit.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
        If the tolerance cannot be met, the probe or the BRDF cannot be used, or the map would be
        too large.
    """
    kind = explicit_kind(representation)

    light, form = Projection(probe, progress), explicit_form(kind, view_count)
    expansion, warnings = expand(
        light, brdf, tolerance, order_f, order_p, size, sampling, max_size, form
    )
    shrm = from_expansion(expansion, probe, "global", sampling, dtype, progress)
    made = kind.from_shrm(shrm, view_count)

    def share() -> float | None:
        # Only a whole summary needs this module, which `--quiet` runs do without.
        from shrm_cli.maps.wrong_share import shown_wrong_share

        return shown_wrong_share([expansion], made)

    facts, further = {"error_bound": expansion.bound}, {"predicted_wrong_share": share}
    return Prefiltered(made, facts, warnings=warnings, further=further)
