"""What each term of a BRDF's map gets: transfer functions to sufficient orders, and a form.

Forms are chosen here from tolerances and numbers of cubes, and from errors in `plan.Sharing`.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import compute_brushed_transfer
from shrm_cli.brdf.cache import cached_transfer
from shrm_cli.brdf.coefficients import octaves_to_come, power_of_two_times
from shrm_cli.brdf.lobe_expansion import SHARP, lobe_width, squared_lobes, view_azimuths, width_for
from shrm_cli.brdf.polar_rule import PolarRule, azimuths
from shrm_cli.brdf.sums import Sum, split
from shrm_cli.brdf.transfer import TransferFunctions, compute_transfer
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.principal.brushed import BrushedSpectrum
from shrm_cli.maps.principal.functions import MAX_Q, Spectrum
from shrm_cli.maps.principal.plan import Form, Planner
from shrm_cli.maps.request import Notes, Request
from shrm_cli.maps.size import TRIED_SIZES, choose_size, most_cubes, supported_order
from shrm_cli.plan import policy
from shrm_cli.probe.lighting import Projection
from shrm_cli.reflected import energies_beyond, own_energies_beyond, weighted_power
from shrm_cli.vocabulary import MAX_ORDER_F, Center

_FIRST_ORDER = 64
"""The least order F to which transfer functions are computed first; it grows until it suffices."""
_FEW_DEGREES = 192
"""Degrees that a probe is projected to in a tenth of the time that all take."""
_WAVES_A_LOBE = 3.0
"""Few lobes have enough with an F below this over their width in radians. Most need more."""
_ACCURACY = 1e-4, 1e-3
"""The part of the energy that the sampling of models and of measured BRDFs may miss."""
_MOST_OCTAVES = 2
"""The most doublings at once for a measured BRDF, whose noise makes the estimate too large."""
_FIRST_Q = 6
"""The largest azimuthal order q that is computed first. Sharp lobes have more at grazing views."""
_MOST_BRUSHED_Q = 24
"""The largest azimuthal order q of brushed lobes. No map holds as many, but what they leave out is
seen: without it 2 % wrong pixels were predicted of `ggx:roughness=0.5,anisotropy=0.9`, not 10 %."""
COARSE = 1e-3
"""That part where no map keeps what is asked of a brushed lobe by far; it is sampled once."""
_COARSE_Q = 16
"""The largest q of brushed lobes there: with 24 the best maps are no better, and far slower."""
_PART_ASIDE = 0.1
"""The part of the BRDF's energy that higher q may have, in units of what higher degrees may."""
_PART_BEYOND = 0.1
"""The part of the squared error that may lie beyond the transfer functions."""


def terms_of(brdf: Brdf, center: str | None, divide: bool) -> tuple[list[Brdf], Notes]:
    """Take a BRDF apart into terms, each about the center that is asked for, or the best one.

    The best one has nothing to do with the number of harmonics, of which maps have none. Quotients
    keep the center of the BRDF: about the normal the last degree before the horizon, where they
    are steep, is a large part of all views.
    """
    terms = split(brdf) if isinstance(brdf, Sum) else [brdf]
    if center is not None and center != "auto":
        return [term.recentered(center) for term in terms], ()  # type: ignore[arg-type]
    found = [term if divide else term.recentered(gathering_center(term)) for term in terms]
    is_own = all(a.center == b.center for a, b in zip(found, terms, strict=True))
    if is_own and center is None:
        return found, ()
    centers = " and ".join(dict.fromkeys(term.center for term in found))
    return found, (("centre", f"{centers}, about which its lobes gather"),)


def shared_maps(planners: Sequence[Planner], maps: int) -> list[int]:
    """Share a number of cubes among terms, of which some need one only."""
    is_single = [len(planner.choices) == 1 for planner in planners]
    left, others = maps - sum(is_single), len(planners) - sum(is_single)
    if left < others:
        raise ArgumentError("maps", f"is less than the {len(planners)} terms of the BRDF need")
    return [1 if single else left // others for single in is_single]


def planner_of(
    light: Projection, brdf: Brdf, want: Request, known: Planner | None = None,
    scouted: Planner | None = None, is_coarse: bool = False,
) -> Planner:  # fmt: skip
    """Factorize a BRDF for a probe, to an order that suffices for what is asked.

    `known` is what this function returned for a larger error, or `first_planner` did. `scouted` is
    the coarse look at a brushed lobe, which tells the orders to begin with. `is_coarse` tells
    whether no map of a brushed lobe keeps what is asked for by far; see
    `proposal.is_out_of_reach`. All three are of maps that an error is asked of.
    """
    if want.error is None:
        return _planner_for_tolerance(light, brdf, want)
    limit = _PART_BEYOND * want.error**2
    most_q = _COARSE_Q if is_coarse else _most_q(brdf)
    order, max_q = first_order(brdf), most_q if is_coarse else min(_FIRST_Q, most_q)
    if known is None and scouted is not None and not is_coarse:
        above, aside = unknown_light(scouted)
        order = min(2 * order, MAX_ORDER_F) if above > limit else order
        max_q = most_q if aside > limit else max_q
    planner = known or factorized(light, brdf, _transfer(brdf, order, max_q, is_coarse), want)
    while True:
        order, max_q = planner.spectrum.transfer.order_f, planner.spectrum.transfer.max_q
        above, aside = unknown_light(planner)
        is_low = above > limit and order < MAX_ORDER_F
        is_narrow = aside > limit and max_q < most_q
        if not (is_low or is_narrow):
            return planner
        order = min(2 * order, MAX_ORDER_F) if is_low else order
        transfer = _transfer(brdf, order, most_q if is_narrow else max_q, is_coarse)
        planner = factorized(light, brdf, transfer, want)


def _planner_for_tolerance(light: Projection, brdf: Brdf, want: Request) -> Planner:
    """Factorize a BRDF to an order that suffices for the part of its energy that may be missed.

    The BRDF's own energy tells without the light, which takes seconds, whether to go on.
    """
    limit, most_q = want.eps / 5, _most_q(brdf)
    order, max_q = first_order(brdf), min(_FIRST_Q, most_q)
    while True:
        transfer = _transfer(brdf, order, max_q)
        whole = max(float(transfer.total_energy.sum()), 1e-300)
        above, aside = (float(each.sum()) / whole for each in own_energies_beyond(transfer))
        if aside > limit * _PART_ASIDE and max_q < most_q:
            max_q = most_q
            if above <= limit or order >= MAX_ORDER_F:
                continue
        elif order >= MAX_ORDER_F:
            return factorized(light, brdf, transfer, want)
        if above <= limit:
            planner = factorized(light, brdf, transfer, want)
            if not _hides_visible(planner, want):
                return planner
            order = 2 * order
            continue
        if want.own.get("maps") is None:
            planner = factorized(light, brdf, transfer, want)
            if _fills_budget(planner, want):
                if transfer.max_q == most_q:
                    return planner
                max_q = most_q
                continue
        # Sharp lobes need far more, and every try costs the time to sample the BRDF.
        octaves = octaves_to_come(transfer, limit)
        if brdf.is_measured:
            octaves = min(octaves, _MOST_OCTAVES)
        # Lobes that need far more degrees need more azimuthal orders, too, at grazing views.
        max_q = most_q if octaves > 1 else max_q
        order = min(2**octaves * order, MAX_ORDER_F)


def first_planner(light: Projection, brdf: Brdf, want: Request) -> Planner:
    """Factorize an isotropic BRDF to the orders with which `planner_of` begins.

    Of a sharp lobe few degrees do where the light has no more, as without its lamps.
    """
    assert want.error is not None
    order, max_q = first_order(brdf), min(_FIRST_Q, _most_q(brdf))
    if order > 2 * _FEW_DEGREES:
        planner = factorized(light, brdf, _transfer(brdf, _FEW_DEGREES, max_q), want)
        if unknown_light(planner)[0] <= _PART_BEYOND * want.error**2:
            return planner
    return factorized(light, brdf, _transfer(brdf, order, max_q), want)


def factorized(
    light: Projection, brdf: Brdf, transfer: TransferFunctions, want: Request
) -> Planner:
    """Factorize transfer functions of a BRDF for a probe."""
    lighting = light.to_order(transfer.order_f)
    power = weighted_power(lighting, transfer.order_f)
    kind = Spectrum if brdf.isotropic else BrushedSpectrum
    spectrum = kind.of(transfer, brdf.center, power, want.own.get("divide", False))
    return Planner(spectrum, lighting, want.sampling)


def _most_q(brdf: Brdf) -> int:
    """Return the largest azimuthal order q to which transfer functions are computed."""
    return 0 if brdf.zonal else MAX_Q if brdf.isotropic else _MOST_BRUSHED_Q


def first_order(brdf: Brdf) -> int:
    """Return the order F to which transfer functions are computed first."""
    if brdf.zonal or brdf.center != "reflection":
        return _FIRST_ORDER
    return power_of_two_times(_FIRST_ORDER, _WAVES_A_LOBE / lobe_width(brdf), MAX_ORDER_F)


def _hides_visible(planner: Planner, want: Request) -> bool:
    """Tell whether the map that a tolerance asks for could carry light beyond the known degrees."""
    if want.own.get("maps") is None and _fills_budget(planner, want):
        return False
    form = (
        _simplest(planner, want)
        if want.own.get("maps") is not None
        else _tolerated(planner, want)[0]
    )
    return form.carried == planner.spectrum.transfer.order_f < supported_order(form.size)


def _simplest(planner: Planner, want: Request) -> Form:
    """Return the least functions, with the least order F, that keep the tolerance.

    The texels are chosen by F, and the bytes may be any number.
    """
    counts, order_f, _ = planner.for_tolerance(want.eps)
    return planner.form(counts, choose_size(order_f) if want.size is None else want.size)


def _tolerated(planner: Planner, want: Request) -> tuple[Form, bool]:
    """Find the form that the tolerance asks for, and tell whether it is kept.

    The simplest form that keeps the tolerance says how many bytes the map may have, if these are
    not few anyway. Half of the texels along an edge leave room for four times the functions, which
    is nearly always better.
    """
    simplest = _simplest(planner, want)
    known = planner.spectrum.transfer.order_f
    if simplest.bytes > want.allowed or not _is_captured(planner, simplest, known, want):
        return planner.nearly_best(want.allowed, want.size), False
    if want.size is not None:
        return simplest, True
    room = min(max(simplest.bytes, policy.LEAST_BYTES), want.allowed)
    form = planner.best_within(room, simplest.size)
    # Its fewer texels may end before the order F, beyond which this light may have nothing.
    order = min(supported_order(form.size), known)
    return (form if _is_captured(planner, form, order, want) else simplest), True


def _is_captured(planner: Planner, form: Form, order: int, want: Request) -> bool:
    """Tell whether the functions of a form miss no more of the BRDF up to an order than asked."""
    return planner.captured(form.counts, order) >= 1 - want.eps


def _fills_budget(planner: Planner, want: Request) -> bool:
    """Tell whether the bytes, and not the known degrees, bound the map that a tolerance asks for.

    More degrees ask for more bytes, never for fewer. They could only help if cubes of the next
    size, which the best map within the budget did without, were judged by far fewer degrees than
    they support.
    """
    if _simplest(planner, want).bytes <= want.allowed:
        return False
    best = planner.best_fitting(want.allowed, want.size)
    larger = [texels for texels in TRIED_SIZES if texels > best.size]
    rival = larger[0] if larger and want.size is None else best.size
    return supported_order(rival) <= policy.FAIRLY * planner.spectrum.transfer.order_f


def unknown_light(planner: Planner) -> tuple[float, float]:
    """Return the parts of the energy of the reflected light at unknown degrees, and in unknown q.

    Degrees that are finer than the pixels of the light stay unknown.
    """
    above, aside = energies_beyond(planner.lighting, planner.spectrum.transfer)
    if planner.lighting.resolved_order < planner.spectrum.transfer.order_f:
        above = 0.0
    whole = max(planner.whole / max(planner.spectrum.visible, 1e-300), 1e-300)
    return above / whole, aside / whole


def _transfer(brdf: Brdf, order: int, max_q: int, is_coarse: bool = False) -> TransferFunctions:
    """Compute transfer functions to their orders, or take them from the cache."""
    accuracy = COARSE if is_coarse else _ACCURACY[brdf.is_measured]
    compute = compute_transfer if brdf.isotropic else compute_brushed_transfer
    return cached_transfer(brdf, order, max_q, accuracy, compute)


def planned(planner: Planner, want: Request, maps: int | None = None) -> tuple[Form, bool]:
    """Choose a form by a number of cubes or the tolerance, and tell whether that is kept."""
    if maps is not None:
        size = _simplest(planner, want).size
        if want.size is None:  # as many texels as the order F asks for, if their bytes are allowed
            allowed = [texels for texels in TRIED_SIZES if most_cubes(texels, want.allowed) >= maps]
            size = min(size, max(allowed, default=size))
        form, is_met = planner.with_maps(maps, size), True
    else:
        form, is_met = _tolerated(planner, want)
    return planner.form(form.counts, form.size, is_exact=True), is_met


# ---- where lobes gather --------------------------------------------------------------------------

_VIEWS, _LIGHTS, _AZIMUTHS = 12, 48, 16
"""The numbers of samples in theta_o, theta_i and, over half a turn, phi."""
_NEARLY = 0.9
"""How many times as much lobes gather about the mirror direction that are still about the normal.

Maps of `ggx:roughness=0.7,f0=1` (1.13 times) are as good about the one as about the other, and
those of `microfacet:sigma=0.8` (1.09) have half the error about the normal. Brushed lobes are wide
along the tangent only, and turn with the view across it: of `ggx:roughness=0.5,anisotropy=0.9`
(0.96) and 0.3 (0.91) maps have half the error about the mirror direction, of 0.7 (1.08) three
quarters about the normal. There both count alike."""


def gathering_center(brdf: Brdf) -> Center:
    """Return the direction about which a BRDF's own functions of the view are the fewest.

    Sharp lobes are about the mirror direction. The lobes of rough surfaces, felt and diffuse
    standards hardly turn with the view, and sheen is a ring along the horizon: about the normal,
    few functions hold them. Lobes gather about the direction that has the larger mean cosine with
    the light, weighted by the squared lobe.

    Returns the BRDF's own central direction, unless that is the mirror direction and its lobes
    gather about the normal.
    """
    if brdf.center != "reflection" or brdf.zonal:
        return brdf.center
    if width_for(brdf, 0.0) < SHARP:  # the lobe is too sharp to gather about anything else
        return brdf.center
    theta_o = np.pi * (np.arange(_VIEWS) + 0.5) / _VIEWS
    theta, weights = PolarRule().nodes(_LIGHTS)
    gathered, nearly = 0.0, _NEARLY if brdf.isotropic else 1.0
    for azimuth in view_azimuths(brdf):
        light, squares = squared_lobes(brdf, theta, azimuths(_AZIMUTHS), theta_o / 2, azimuth)
        squares = weights[:, None, None] * squares
        whole = np.maximum(squares.sum(axis=(0, 2)), 1e-300)
        of_mirror = np.cos(theta) @ squares.sum(axis=2)
        of_normal = np.sum(squares * light[..., 2], axis=(0, 2))
        # All views count alike, whatever they reflect, because errors are seen where they are dark.
        even = np.sin(theta_o) / whole
        gathered += float(even @ of_normal - nearly * (even @ of_mirror))
    return "normal" if gathered > 0 else "reflection"
