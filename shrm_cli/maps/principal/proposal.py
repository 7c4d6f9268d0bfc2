"""A map that could be made: the form of each of its terms, its errors, and how it is made.

A first look at a BRDF tells where no map keeps what is asked by far. Brushed lobes take long to
sample. A few azimuths of the view tell nearly what error the best map has, in a tenth of the time,
and a share of wrong pixels that is too large, as functions have too few waves over the azimuth.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.brushed_transfer import scout_brushed_transfer
from shrm_cli.brdf.cache import cached_transfer
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.coupling import bundle_coefficients
from shrm_cli.maps.info import MapInfo, provenance
from shrm_cli.maps.joint import brightness
from shrm_cli.maps.lobes_lit import Lobes
from shrm_cli.maps.principal.brushed import BrushedLobe, BrushedSpectrum
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.maps.principal.plan import Form, Joint, Planner, Sharing, Term
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.principal.selection import bundle_degrees, bundle_functions
from shrm_cli.maps.principal.terms import (
    COARSE,
    factorized,
    first_order,
    first_planner,
    planned,
    planner_of,
    shared_maps,
    terms_of,
    unknown_light,
)
from shrm_cli.maps.request import Notes, Prefiltered, Request
from shrm_cli.maps.size import sizes_of, supported_order, total_error
from shrm_cli.maps.wrong_pixels import LookUps, are_look_ups_seen, wrong_share
from shrm_cli.orders import Orders
from shrm_cli.plan.search import Candidate, Row
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.records import once_each, record
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import Sampling

_SMALL = 16
"""The texels along a face's edge of the maps that tell how coherent the terms of a sum are."""
TABLED = "more bytes gain little: what it has of the view is in tables, which are no finer"
"""What is said where tables make most of an error."""


@record(eq=False)
class Proposal:
    """The form of each term of a map, and what the map would be."""

    terms: tuple[Term, ...]
    info: MapInfo
    """The record of the map, with its errors."""
    sampling: Sampling
    notes: Notes
    """How centers were chosen."""
    is_met: bool
    """Whether what was asked for is kept."""

    @property
    def bytes(self) -> int:
        """The bytes of the cubes in half precision, before they are packed."""
        return sum(term.form.bytes for term in self.terms)

    @property
    def look_ups(self) -> int:
        """The number of RGB cubes."""
        return sum(term.form.cubes for term in self.terms)

    @property
    def total_error(self) -> float:
        """The relative RMS error, with bilinear look-ups and half precision."""
        return total_error(self.info.predicted_error, self.info.filter_error)

    def wrong_share(self) -> float:
        """Predict the share of what is visible whose luminance is wrong by more than 5 %.

        Look-ups count where they lose much.
        """
        are_seen = are_look_ups_seen(self.info.predicted_error, self.info.filter_error)
        return predicted_wrong_share(self.terms, self._map if are_seen else None)

    @cached_property
    def _map(self) -> PrincipalMap:
        lobes = tuple(lobe_of(term, self.sampling) for term in self.terms)
        return PrincipalMap(lobes, self.info, self.sampling)

    def make(self, warnings: Sequence[str] = ()) -> Prefiltered:
        """Make the map, with remarks about the BRDF's sampling before other warnings."""
        said = (term.planner.spectrum.transfer.remark for term in self.terms)
        remarks = [f"the BRDF is {each}" for each in said if each is not None]
        facts, further = {"error_bound": None}, {"predicted_wrong_share": self.wrong_share}
        return Prefiltered(self._map, facts, self.notes, (*remarks, *warnings), further)

    def candidate(self) -> Candidate[Prefiltered]:
        """Return the map as the search knows it."""
        return Candidate(
            "principal", self.bytes, self.look_ups, self.total_error, self.wrong_share, self.make,
            any(1 < len(term.planner.choices) > term.form.cubes for term in self.terms), self.limit,
            partial(predicted_wrong_share, self.terms),
        )  # fmt: skip

    @property
    def limit(self) -> str:
        """Why more bytes gain little: most of the error is that of tables; empty otherwise."""
        tabled = error = 0.0
        for term in self.terms:
            form, weight = term.form, term.planner.whole
            plain = term.planner.form(form.counts, form.size)
            tabled += weight * (form.error**2 - plain.error**2)
            error += weight * form.total_error**2
        return TABLED if tabled > error / 2 else ""


class Proposals:
    """The maps of a probe and a BRDF that could be made."""

    def __init__(self, light: Projection, request: Request) -> None:
        self.light, self.brdf, self.asked = light, request.brdf, request
        divide = request.own.get("divide", False)
        if divide and not self.brdf.isotropic:
            raise ArgumentError(
                "divide", "does not apply to an anisotropic BRDF, whose albedo depends on tangents"
            )
        self.parts, self.notes = terms_of(self.brdf, request.center, divide)
        self._planners: list[Planner] = []

    @cached_property
    def _look(self) -> list[Planner]:
        """A first look at each term, coarse at a brushed one; none at sums with brushed terms."""
        if self.asked.error is None:
            return []
        if all(part.isotropic for part in self.parts):
            return [first_planner(self.light, part, self.asked) for part in self.parts]
        return [scouted(self.light, self.parts[0], self.asked)] if len(self.parts) == 1 else []

    @once_each
    def is_out_of_reach(self, most: int, by_error: bool) -> bool:
        """Tell whether a first look says that no map of so many bytes keeps what is asked, by far.

        `by_error` tells whether to look at the error alone.
        """
        seen = None if by_error else self.asked.seen
        want = replace(self.asked, max_size=min(most, self.asked.allowed), seen=seen)
        return bool(self._look) and is_out_of_reach(self._look, want)

    @property
    def planners(self) -> list[Planner]:
        """The terms, factorized as far as was asked by now."""
        if not self._planners:
            self._know(self.asked.error)
        return self._planners

    def _know(self, error: float | None) -> None:
        """Factorize the terms as far as an error of the light needs it."""
        want = replace(self.asked, error=error)
        known: Sequence[Planner | None] = self._planners or [None] * len(self.parts)
        coarse: Planner | None = None
        if self._look and self.parts[0].isotropic:  # of which a first look is exact
            known = self._planners or self._look
        elif self._look:
            (coarse,) = self._look
        is_coarse = coarse is not None and self.is_out_of_reach(self.asked.allowed, False)
        self._planners = [
            planner_of(self.light, part, want, each, coarse, is_coarse)
            for part, each in zip(self.parts, known, strict=True)
        ]

    @property
    def sharing(self) -> Sharing:
        """What the terms may share their bytes by, as far as the planners know now."""
        return Sharing(self.planners, self._coherence)

    @cached_property
    def _coherence(self) -> float:
        """The RMS of the light of all terms, relative to the sum of the RMS of each.

        It is 1 where all are bright in the same places. Small maps of the first function of each
        term tell it well enough.
        """
        if len(self.planners) == 1:
            return 1.0
        info, sampling = MapInfo(0, 0, 0.0, 1.0, 0.0), self.asked.sampling
        terms = (Term(planner, planner.with_maps(1, _SMALL)) for planner in self.planners)
        small = [PrincipalMap((lobe_of(each, sampling),), info, sampling) for each in terms]
        strengths, together = brightness(small)
        separate = float(strengths.sum())
        return together / separate if separate > 0 else 1.0

    def propose(self, error: float | None = None) -> Proposal:
        """Choose the form of every term."""
        if error is None:
            error = self.asked.error
        else:
            self._know(error)
        if error is not None:
            found, is_met = self.sharing.kept(error, self.asked.allowed, self.asked.size)
            return self.proposal(found.forms, is_met)
        # Terms of a single cube take next to nothing, and the others share the bytes.
        broad = max(sum(len(planner.choices) > 1 for planner in self.planners), 1)
        want = replace(self.asked, max_size=self.asked.allowed // broad)
        maps, count = want.own.get("maps"), len(self.parts)
        shares = [None] * count if maps is None else shared_maps(self.planners, maps)
        pairs = zip(self.planners, shares, strict=True)
        forms, are_met = zip(*(planned(each, want, share) for each, share in pairs), strict=True)
        return self.proposal(forms, all(are_met))

    def proposal(self, forms: Sequence[Form], is_met: bool = True) -> Proposal:
        """Return the map of a form of each term, whose errors are exact."""
        terms = tuple(map(Term, self.planners, forms))
        info = _info(self.light.probe, self.brdf, terms, self.asked.eps, self.sharing)
        return Proposal(terms, info, self.asked.sampling, self.notes, is_met)

    def candidate(self, error: float) -> Candidate[Prefiltered]:
        return self.propose(error).candidate()

    def rows(self, max_size: int) -> Iterator[Row[Candidate[Prefiltered]]]:
        """Yield all maps of at most so many bytes, as far as the planners know now."""
        for row in self.sharing.rows(max_size, sizes_of(self.asked.size)):
            yield row.mapped(self.rough)

    def rough(self, joint: Joint) -> Candidate[Prefiltered]:
        """Return the map of a form of each term as it is known in little time."""
        look_ups, make = sum(form.cubes for form in joint.forms), lambda: self._exact(joint).make()
        find_share = partial(predicted_wrong_share, list(map(Term, self.planners, joint.forms)))
        return Candidate(
            "principal", joint.bytes, look_ups, joint.total_error, find_share, make,
            find_exact=partial(self._exact, joint),
        )  # fmt: skip

    def _exact(self, joint: Joint) -> Candidate[Prefiltered]:
        exact = self.sharing.joint(joint.forms, is_exact=True)
        return self.proposal(exact.forms).candidate()


def lobe_of(term: Term, sampling: Sampling) -> Lobe:
    """Make the cubes and the tables of a term."""
    spectrum, counts = term.planner.spectrum, term.form.counts
    bundles = bundle_functions(counts)
    cubes = np.concatenate([_cubes(term, each, sampling) for each in bundles.values()], axis=2)
    functions = np.concatenate(
        [
            spectrum.table(q, k, k + 1)
            for same in bundles.values()
            for bundle in same
            for q, k in enumerate(bundle)
        ]
    )
    degrees, center = bundle_degrees(counts), spectrum.center
    if isinstance(spectrum, BrushedSpectrum):
        by_wave = functions.reshape(len(functions), len(spectrum.waves), -1, 3)
        return BrushedLobe(cubes, degrees, by_wave, center, None, spectrum.waves)
    return Lobe(cubes, degrees, functions, center, spectrum.albedo_table())


def _cubes(term: Term, bundles: Sequence[tuple[int, ...]], sampling: Sampling) -> Array:
    """Make the cubes of all bundles of a degree, shape (6N, N, cubes, 3), one after the other."""
    spectrum, form = term.planner.spectrum, term.form
    kept = spectrum.bundle_parts(bundles, form.carried)
    kept *= form.band.factors[:, None, None, None]
    series = bundle_coefficients(term.planner.lighting.coefficients, kept)
    flat = series.swapaxes(1, 2).reshape(len(series), -1)
    planes = synthesize_cube(flat, form.size, sampling, np.float32)
    return planes.reshape(-1, 3, 6 * form.size, form.size).transpose(2, 3, 0, 1)


def _info(probe: Probe, brdf: Brdf, terms: Sequence[Term], eps: float, sharing: Sharing) -> MapInfo:
    """Return the record of the map, with the errors of the terms combined."""
    energies = np.array([planner.spectrum.transfer.total_energy.sum() for planner, _ in terms])
    each = [planner.captured(form.counts, form.carried) for planner, form in terms]
    captured = energies @ each / max(energies.sum(), 1e-300)
    orders = Orders(
        max(min(each.for_tolerance(eps)[1], supported_order(form.size)) for each, form in terms),
        max(len(form.counts) - 1 for _, form in terms), eps, float(captured),
    )  # fmt: skip
    error, filter_error = sharing.errors([form for _, form in terms])
    return replace(
        provenance(probe, brdf, orders), predicted_error=error, filter_error=filter_error,
        carried=max(form.carried for _, form in terms),
    )  # fmt: skip


_FAR, _FAR_BRUSHED = 1.5, 4.0
"""How many times the error, or the share of wrong pixels, of the best map must be too large here to
be so in truth; and the share for brushed lobes. Those that were compared were up to 3.2 times the
shares of enough azimuths."""


def scouted(light: Projection, brdf: Brdf, want: Request) -> Planner:
    """Take a coarse look at a brushed lobe, the only term of a BRDF."""
    transfer = cached_transfer(brdf, first_order(brdf), MAX_Q, COARSE, scout_brushed_transfer)
    return factorized(light, brdf, transfer, want)


def is_out_of_reach(planners: Sequence[Planner], want: Request) -> bool:
    """Tell whether the best map misses what is asked of it by far, after a first look at its terms.

    Each term has all bytes that the map may have, and is as bright as the others where these are.
    """
    assert want.error is not None
    limits = want.allowed, want.size, len(planners)
    forms = [planner.best_fitting(*limits) for planner in planners]
    shares = np.square(Sharing(planners).shares)
    # What lies at higher orders is no error of maps that are made of more of them.
    unknown = [sum(unknown_light(planner)) for planner in planners]
    missed = float(shares @ (np.square([form.total_error for form in forms]) - unknown))
    accuracies = [planner.spectrum.transfer.accuracy for planner in planners]
    if missed <= shares @ accuracies:  # which coarse sampling hides
        return False
    if missed > (_FAR * want.error) ** 2:
        return True
    if want.seen is None:
        return False
    share = predicted_wrong_share(list(map(Term, planners, forms)))
    return share > (_FAR_BRUSHED if _is_brushed(planners) else _FAR) * want.seen


def _is_brushed(planners: Iterable[Planner]) -> bool:
    return any(isinstance(planner.spectrum, BrushedSpectrum) for planner in planners)


def predicted_wrong_share(terms: Sequence[Term], made: PrincipalMap | None = None) -> float:
    """Predict the share of what is visible whose luminance is wrong by more than 5 %.

    The transfer functions that were factorized are the lobes of all views, and what the map leaves
    out of them is known, so that nothing of the BRDF is sampled again. `made` is the map, whose
    look-ups count; without it nothing is lost by these.

    Returns what `shrm_cli.maps.expansion.predicted_wrong_share` does.
    """
    lighting = max((planner.lighting for planner, _ in terms), key=lambda each: each.order)
    held = [_held(*term) for term in terms]
    lobes = [_missed(planner, each) for (planner, _), each in zip(terms, held, strict=True)]
    if made is None:
        return wrong_share(lighting, lobes)
    is_coarse = _is_brushed(planner for planner, _ in terms)
    return wrong_share(lighting, lobes, LookUps(made.brushed_radiance, None if is_coarse else held))


def _held(planner: Planner, form: Form) -> Lobes:
    """Return the lobes of some views as the map has them, as far as is visible."""
    spectrum, seen = planner.spectrum, planner.seen
    held, factors = np.zeros_like(seen.whole), form.band.factors[: seen.whole.shape[1]]
    for q, used in enumerate(form.counts):
        functions = seen.between(spectrum.looked_up(q, used)[:, seen.between.nodes])
        functions = functions[:, : held.shape[2]]
        parts = spectrum.scaled_parts(q, used, factors)
        by_degree = parts.transpose(2, 1, 0) @ functions.transpose(2, 0, 1)
        held[q, : len(factors)] = 2 * np.pi * by_degree.transpose(1, 2, 0)
    return Lobes.of(held, np.zeros_like(held), spectrum.center)


def _missed(planner: Planner, held: Lobes) -> Lobes:
    """Return the lobes themselves, and what a map leaves out of them."""
    seen, spectrum = planner.seen, planner.spectrum
    lobes = Lobes.of(seen.whole, seen.whole - held.whole, spectrum.center)
    lobes = lobes.ended(seen.beyond, spectrum.light, planner.aside)
    return replace(lobes, known_as=(seen, lobes.whole.shape[-1]))
