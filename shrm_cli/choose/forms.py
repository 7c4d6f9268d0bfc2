"""SHRMs and maps of principal functions that could be made, in rows of ever more cubes.

They are known by bytes and errors before any is made, so that hundreds of them can be searched.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.choose.cost import Cost, principal_cost, shrm_cost
from shrm_cli.maps.joint import joint_error
from shrm_cli.maps.options import counted
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.principal.plan import Form, Planner
from shrm_cli.maps.principal.proposal import Proposals
from shrm_cli.maps.principal.selection import bundle_degrees
from shrm_cli.maps.principal.terms import Term, Wanted, planner_of
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.budget import map_errors
from shrm_cli.maps.shrm.proposal import ShrmProposals
from shrm_cli.maps.size import (
    TRIED_SIZES,
    largest_p,
    stored_bytes,
    supported_order,
    total_error,
)
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate
from shrm_cli.probe.lighting import Projection
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE

ASKED = Request("principal", error=policy.LEAST_ERROR)
"""What all maps are proposed for: the BRDF is sampled once, as far as the best of them need it."""
_ROUNDING = 1e-9
"""How much more than an error may be asked for, to get the map that has it."""


@record(eq=False)
class Known:
    """A map that could be made, and what is known of it before its errors are looked at closely.

    Attributes
    ----------
    bytes : int
    total_error : float
        Its relative RMS error, roughly for maps of principal functions.
    find : callable
        Returns it as the planner knows it, with exact errors and the share of wrong pixels.
    what : str
        Its cubes in words.
    cost : Cost
    arguments : dict, optional
        Those of `shrm_cli.prefilter.prefilter`; None where no arguments make it.
    """

    bytes: int
    total_error: float
    find: Callable[[], Candidate[Prefiltered]]
    what: str
    cost: Cost
    arguments: Mapping[str, Any] | None

    @cached_property
    def candidate(self) -> Candidate[Prefiltered]:
        """The map, with exact errors."""
        return self.find()


class Forms(Protocol):
    """What one representation can be for a probe and a BRDF."""

    rows: list[list[Known]]
    """Its maps, in each row by rising bytes. Those of a row have cubes of one size, so that hardly
    any is more often wrong than the one before it; that none has more error is nearly true."""


class PrincipalForms:
    """Maps of principal functions.

    Those of a sum have every combination of its terms' forms that no other one beats, because the
    bytes that a term takes for its part of the error depend on the light.

    Parameters
    ----------
    light : Projection
    brdf : Brdf
    """

    def __init__(self, light: Projection, brdf: Brdf) -> None:
        self._proposals = Proposals(light, replace(ASKED, brdf=brdf))
        self._base = self._proposals.propose()
        planners = self._proposals.planners
        by_size = [_forms_of(planner) for planner in planners]
        if len(planners) == 1:
            self.rows = [[self._known((form,)) for form in forms] for forms in by_size[0]]
            return
        found: list[tuple[Form, ...]] = [()]
        for rows in by_size:
            front = list(_front([(form,) for forms in rows for form in forms], self._bytes, _own))
            joined = [(*forms, *form) for forms in found for form in front]
            found = list(_front(joined, self._bytes, self._error))
        within = [each for each in found if self._bytes(each) <= DEFAULT_MAX_SIZE]
        self.rows = [[self._known(each) for each in within]]

    @property
    def single(self) -> tuple[Brdf, Planner] | None:
        """The only term and its planner; None of a sum."""
        found = self._proposals
        return (found.parts[0], found.planners[0]) if len(found.parts) == 1 else None

    @staticmethod
    def _bytes(forms: Sequence[Form]) -> int:
        return sum(form.bytes for form in forms)

    def _error(self, forms: Sequence[Form]) -> float:
        """Return the error of a map of terms, which are taken as independent."""
        errors = [form.total_error for form in forms]
        return joint_error(self._strengths[: len(forms)], errors, self._whole)

    @cached_property
    def _strengths(self) -> Any:
        return np.sqrt([planner.whole for planner in self._proposals.planners])

    @cached_property
    def _whole(self) -> float:
        """The RMS of the light of all terms together, as the error of the proposal tells it."""
        errors = [term.form.error for term in self._base.terms]
        apart = float(np.linalg.norm(self._strengths * errors))
        told = self._base.info.predicted_error
        return apart / told if told > 0 else float(self._strengths.sum())

    def _known(self, forms: tuple[Form, ...]) -> Known:
        centers = [part.center for part in self._proposals.parts]
        cost = Cost(0, 0)
        for form, center in zip(forms, centers, strict=True):
            cost += principal_cost(bundle_degrees(form.counts), center)
        what = " + ".join(f"{counted(form.cubes, 'cube')} of {form.size}" for form in forms)
        arguments: dict[str, Any] | None = None
        if len(forms) == 1:
            arguments = {"to": "principal", "maps": forms[0].cubes, "size": forms[0].size}
        rough = forms[0].total_error if len(forms) == 1 else self._error(forms)
        find = partial(self._candidate, forms)
        return Known(self._bytes(forms), rough, find, what, cost, arguments)

    def _candidate(self, forms: tuple[Form, ...]) -> Candidate[Prefiltered]:
        """Return the map of a form of each term, with exact errors."""
        terms = tuple(
            _term(part, planner, form)
            for part, planner, form in zip(
                self._proposals.parts, self._proposals.planners, forms, strict=True
            )
        )
        errors, filtered = (
            joint_error(self._strengths, [getattr(term.form, name) for term in terms], self._whole)
            for name in ("error", "filter_error")
        )
        info = replace(
            self._base.info, predicted_error=errors, filter_error=filtered,
            carried=max(term.form.carried for term in terms),
            order_p=max(len(term.form.counts) - 1 for term in terms),
        )  # fmt: skip
        return replace(self._base, terms=terms, info=info).candidate()


def _term(part: Brdf, planner: Planner, form: Form) -> Term:
    exact = planner.form(form.counts, form.size, is_exact=True)
    captured = planner.captured(form.counts, form.carried)
    return Term(part, planner, exact, captured, form.carried, True)


def _forms_of(planner: Planner) -> list[list[Form]]:
    """Return the forms of a term by the size of their cubes, each with roughly known errors."""
    rows = planner.rows(DEFAULT_MAX_SIZE, TRIED_SIZES)
    return [[row.candidate(index) for index in range(row.count)] for row in rows]


def _own(forms: Sequence[Form]) -> float:
    """Return the error of a single term."""
    return forms[0].total_error


def _front(
    items: Sequence[tuple[Form, ...]],
    bytes_of: Callable[[Sequence[Form]], int],
    error_of: Callable[[Sequence[Form]], float],
) -> Iterator[tuple[Form, ...]]:
    """Yield what has less error than all that takes fewer bytes, by rising bytes."""
    least = np.inf
    costs = sorted((bytes_of(each), error_of(each), index) for index, each in enumerate(items))
    for _, error, index in costs:
        if error < least:
            least = error
            yield items[index]


class ShrmForms:
    """SHRMs of every order P and size.

    Parameters
    ----------
    light : Projection
    brdf : Brdf
    known : (Brdf, Planner), optional
        The BRDF about the center that the map shall have, whose transfer functions are known.
    """

    def __init__(
        self, light: Projection, brdf: Brdf, known: tuple[Brdf, Planner] | None = None
    ) -> None:
        self._own_center = brdf.center
        if known is None:
            known = brdf, planner_of(light, brdf, Wanted.of(ASKED), False, "center")
        self._brdf, planner = known
        transfer = planner.spectrum.transfer
        self._proposals = ShrmProposals.of(light, self._brdf, transfer)
        coefficients = self._proposals.coefficients
        self._lighting = light.to_order(coefficients.order_f)
        self.rows = []
        for size in TRIED_SIZES:
            carried = min(supported_order(size), coefficients.order_f)
            most = min(largest_p(carried, size, DEFAULT_MAX_SIZE), coefficients.order_p)
            self.rows.append([self._known(size, order_p) for order_p in range(most + 1)])

    def _known(self, size: int, order_p: int) -> Known:
        coefficients = self._proposals.coefficients
        error = total_error(*map_errors(self._lighting, coefficients, order_p, size))
        propose = replace(self._proposals, size=size).proposing(DEFAULT_MAX_SIZE)
        arguments: dict[str, Any] = {"to": "shrm", "order_p": order_p, "size": size}
        if self._brdf.center != self._own_center:
            arguments["center"] = self._brdf.center
        cubes = (order_p + 1) ** 2
        return Known(
            stored_bytes(size, cubes), error, partial(propose, error * (1 + _ROUNDING)),
            f"P = {order_p}, {counted(cubes, 'cube')} of {size}",
            shrm_cost(order_p, self._brdf.center), arguments,
        )  # fmt: skip
