"""SHRMs and maps of principal functions that could be made, in rows of ever more cubes.

They are known by bytes and errors before any is made, so that hundreds of them can be searched.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Protocol

from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.options import counted
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.principal.plan import Planner
from shrm_cli.maps.principal.proposal import Proposals, predicted_wrong_share
from shrm_cli.maps.principal.selection import bundle_degrees
from shrm_cli.maps.principal.sharing import Joint
from shrm_cli.maps.principal.terms import Wanted, planner_of
from shrm_cli.maps.request import Request
from shrm_cli.maps.shader.cost import Cost, principal_cost, shrm_cost
from shrm_cli.maps.shrm.make import Tried
from shrm_cli.maps.shrm.proposal import ShrmProposals
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate
from shrm_cli.probe.lighting import Projection
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE

ASKED = Request("principal", error=policy.LEAST_ERROR)
"""What all maps are proposed for: the BRDF is sampled once, as far as the best of them need it."""


@record(eq=False)
class Known:
    """A map that could be made, and what is known of it before its errors are looked at closely."""

    bytes: int
    total_error: float
    """Its relative RMS error, roughly for maps of principal functions."""
    find: Callable[[], Candidate[Prefiltered]]
    """Returns it as the planner knows it, with exact errors and the share of wrong pixels."""
    find_share: Callable[[], float | None]
    """Predicts the share of wrong pixels, which takes far less time than exact errors."""
    what: str
    """Its cubes in words."""
    cost: Cost
    arguments: Mapping[str, Any] | None
    """Those of `shrm_cli.prefilter.prefilter`; None where no arguments make it."""

    @cached_property
    def candidate(self) -> Candidate[Prefiltered]:
        """The map, with exact errors."""
        return replace(self.find(), find_wrong_share=lambda: self.wrong_share)

    @cached_property
    def wrong_share(self) -> float | None:
        """The predicted share of what is visible whose luminance is wrong."""
        return self.find_share()


class Forms(Protocol):
    """What one representation can be for a probe and a BRDF."""

    rows: list[list[Known]]
    """Its maps, in each row by rising bytes. Those of a row have cubes of one size, so that hardly
    any is more often wrong than the one before it; that none has more error is nearly true."""


class PrincipalForms:
    """Maps of principal functions."""

    def __init__(self, light: Projection, brdf: Brdf) -> None:
        self._proposals = Proposals(light, replace(ASKED, brdf=brdf))
        rows = self._proposals.sharing.rows(DEFAULT_MAX_SIZE)
        self.rows = [[self._known(joint) for joint in row.every()] for row in rows]

    @property
    def single(self) -> tuple[Brdf, Planner] | None:
        """The only term and its planner; None of a sum."""
        found = self._proposals
        return (found.parts[0], found.planners[0]) if len(found.parts) == 1 else None

    def _known(self, joint: Joint) -> Known:
        forms, parts = joint.forms, self._proposals.parts
        cost = Cost(0, 0)
        for form, part in zip(forms, parts, strict=True):
            cost += principal_cost(bundle_degrees(form.counts), part.center)
        what = " + ".join(f"{counted(form.cubes, 'cube')} of {form.size}" for form in forms)
        arguments: dict[str, Any] | None = None
        if len(forms) == 1:
            arguments = {"to": "principal", "maps": forms[0].cubes, "size": forms[0].size}
        find, find_share = partial(self._candidate, joint), partial(self._wrong_share, joint)
        return Known(joint.bytes, joint.total_error, find, find_share, what, cost, arguments)

    def _candidate(self, joint: Joint) -> Candidate[Prefiltered]:
        """Return the map with exact errors."""
        exact = self._proposals.sharing.joint(joint.forms, is_exact=True)
        return self._proposals.proposal(exact.forms).candidate()

    def _wrong_share(self, joint: Joint) -> float:
        """Predict the share of wrong pixels, of which look-ups between texels are no part."""
        return predicted_wrong_share(list(zip(self._proposals.planners, joint.forms, strict=True)))


class ShrmForms:
    """SHRMs of every order P and size.

    `known` is the BRDF about the center that the map shall have, whose transfer functions are
    known.
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
        rows = self._proposals.rows(DEFAULT_MAX_SIZE)
        self.rows = [[self._known(tried) for tried in row.every()] for row in rows]

    def _known(self, tried: Tried) -> Known:
        size, order_p = tried.choice.size, tried.choice.orders.order_p
        arguments: dict[str, Any] = {"to": "shrm", "order_p": order_p, "size": size}
        if self._brdf.center != self._own_center:
            arguments["center"] = self._brdf.center
        find = partial(self._proposals.candidate, tried, DEFAULT_MAX_SIZE)
        return Known(
            tried.bytes, tried.total_error, find, lambda: find().wrong_share,
            f"P = {order_p}, {counted((order_p + 1) ** 2, 'cube')} of {size}",
            shrm_cost(order_p, self._brdf.center), arguments,
        )  # fmt: skip
