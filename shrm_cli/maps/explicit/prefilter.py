"""How explicit maps are made: from an SHRM, or by one integral for each texel and view."""

from dataclasses import replace
from typing import Any, cast

import numpy as np

from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.prefiltered import Prefiltered, error_lines
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.budget import Form
from shrm_cli.maps.shrm.prefilter import centered, expand, order_warnings
from shrm_cli.maps.shrm.shrm import from_expansion
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
    """
    is_angular = request.domain == "angular"
    if is_angular and not request.is_free:
        given = "order_p" if request.order_f is None else "order_f"
        raise ArgumentError(given, "applies with `domain` frequency")
    if request.source_height is not None and not is_angular:
        raise ArgumentError("source_height", "applies with `domain` angular")
    request, notes = centered(request)
    if is_angular:
        from shrm_cli.maps.explicit.angular import prefilter_angular

        return replace(prefilter_angular(probe, request), notes=notes)
    made = prefilter_explicit(probe, request)
    return replace(made, notes=notes, warnings=(*order_warnings(made, request), *made.warnings))


def explicit_kind(representation: str) -> type[ExplicitMap]:
    """Return the class of the explicit maps of a representation."""
    return cast(type[ExplicitMap], registry.map_class(representation))


def view_count(request: Request) -> int | None:
    """Return the samples along an axis of the view that are asked for; None where none are."""
    own = request.own
    return explicit_kind(request.to).view_count(own.get("slices"), own.get("views"))


def explicit_form(request: Request) -> Form:
    """Return what an explicit map holds that is made from an SHRM of order P.

    It has `ExplicitMap.default_view_count` of P samples, unless the request gives their number.
    """
    kind, count = explicit_kind(request.to), view_count(request)

    def images(order_p: int) -> int:
        return kind.image_count(kind.default_view_count(order_p) if count is None else count)

    return Form(images, kind.check_images)


def prefilter_explicit(probe: Probe, request: Request, dtype: type = np.float32) -> Prefiltered:
    """Prefilter a probe in the frequency domain, and tabulate the SHRM.

    Where the images exceed the bytes at the size that the orders ask for, the size is halved until
    they fit.

    Parameters
    ----------
    probe : Probe
    request : Request
    dtype : type
        As `prefilter_shrm` takes it.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
        If the tolerance cannot be met, the probe or the BRDF cannot be used, or the map would be
        too large.
    """
    expansion, warnings = expand(Projection(probe), request, explicit_form(request))
    shrm = from_expansion(expansion, probe, request, dtype)
    made = explicit_kind(request.to).from_shrm(shrm, view_count(request))

    def share() -> float | None:
        # Only a whole summary needs this module, which `--quiet` runs do without.
        from shrm_cli.maps.expansion import shown_wrong_share

        return shown_wrong_share([expansion], made)

    facts, further = {"error_bound": expansion.bound}, {"predicted_wrong_share": share}
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
