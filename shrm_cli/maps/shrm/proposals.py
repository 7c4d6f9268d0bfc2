"""SHRMs that could be made: those of fewest bytes, what is seen of them, and how they are made.

Transfer functions hold every degree p of the view, so that whoever has them for another form knows
the errors of SHRMs without sampling the BRDF again.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.maps.expansion import Chosen, Expansion, carry, predicted_wrong_share
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.maps.shrm.rows import ShrmRows
from shrm_cli.maps.size import (
    TRIED_SIZES,
    largest_p,
    nothing_fits,
    sizes_of,
    stored_bytes,
    supported_order,
)
from shrm_cli.maps.wrong_pixels import are_look_ups_seen
from shrm_cli.orders import Orders, choose_orders
from shrm_cli.plan.search import Candidate, Row, fewest_bytes
from shrm_cli.probe.lighting import Projection
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_P

_LEAST_TOLERANCE = 1e-4
"""The least part of a BRDF's energy that its coefficients are computed to."""
OTHERS = "other forms may: take `to` auto"
"""What is said where no SHRM keeps what is asked."""


def sufficient_tolerance(error: float) -> float:
    """Return the part of a BRDF's energy that may be unknown for an error of the light.

    Real light fades towards high degrees.
    """
    return float(np.clip(error**2 / 2, _LEAST_TOLERANCE, 0.5))


@record(eq=False)
class ShrmProposals(ShrmRows):
    """The SHRMs of a probe and a BRDF of a single term."""

    @classmethod
    def of(
        cls, light: Projection, request: Request, transfer: TransferFunctions
    ) -> "ShrmProposals":
        """Expand transfer functions into coefficients of the largest P that maps have."""
        is_zonal = request.brdf.zonal
        order_p = 0 if is_zonal else min(MAX_ORDER_P, 2 * len(transfer.theta_o) // 3)
        return cls(light, request, BrdfCoefficients.of(transfer, order_p, is_zonal))

    @classmethod
    def known(
        cls, light: Projection, request: Request, error: float, eps: float = DEFAULT_EPS
    ) -> "ShrmProposals":
        """Compute the coefficients that maps of about an error need."""
        least = sizes_of(request.size)[0]

        def most_p(order_f: int) -> int:
            """Return the largest P of any map: light may need far fewer texels than F does."""
            return largest_p(min(order_f, supported_order(least)), least, request.allowed)

        tolerance = sufficient_tolerance(error)
        return cls(light, request, choose_orders(request.brdf, tolerance, most_p=most_p)[1], eps)

    def within(self, max_size: int, most_p: int) -> "ShrmProposals":
        """Return the maps of at most so many bytes, and to a P."""
        return replace(self, request=replace(self.request, max_size=max_size), most_p=most_p)

    def least(self, error: float) -> tuple[Expansion, bool]:
        """Return the SHRM of the fewest bytes that keeps an error, or the best one that fits.

        The second of the two is whether it keeps the error.
        """
        found = fewest_bytes(self.expansions(), error)
        if found is None:
            raise nothing_fits(self.request.size)
        return found

    def wrong_by_views(self, most_p: int) -> float:
        """Predict the share of wrong pixels of SHRMs to a P that lose nothing else.

        They hold all degrees of the light that are known, which takes little time.
        """
        known = self.coefficients
        orders = Orders(known.order_f, min(most_p, known.order_p), DEFAULT_EPS, 1.0)
        whole = Chosen(self.request.brdf, orders, known, TRIED_SIZES[0])
        return predicted_wrong_share([carry(self.light, whole, is_exact=True)])

    def fits(self, max_size: int) -> bool:
        """Tell whether any map fits into a number of bytes."""
        return stored_bytes(sizes_of(self.request.size)[0], 1) <= max_size

    def made(self, found: Expansion, dtype: type = np.float64) -> Prefiltered:
        """Make one of these SHRMs, which states what it captures as what was asked of it."""
        chosen = self._stated(found)
        asked = replace(
            self.request, eps=chosen.orders.eps, size=chosen.size, max_size=self.request.allowed
        )
        return prefilter_shrm(self.light, asked, chosen, dtype)

    def _stated(self, found: Expansion) -> Chosen:
        f, p = found.orders.order_f, found.orders.order_p
        captured = float(self.coefficients.captured[self.carried(found.size), p])
        orders = Orders.capturing(f, p, captured)
        return Chosen(self.request.brdf, orders, self.coefficients, found.size)

    def proposed(self, found: Expansion) -> Candidate[Prefiltered]:
        """Return one of these SHRMs as the search knows it, which looks between texels at last."""

        def wrong_share() -> float:
            return predicted_wrong_share([carry(self.light, self._stated(found))])

        def share_of_made() -> float | None:
            share: float | None = self.made(found, np.float32).further["predicted_wrong_share"]()
            return share

        rough = Candidate(
            "shrm", found.bytes, (found.orders.order_p + 1) ** 2, found.total_error, wrong_share,
            partial(self.made, found), limit=OTHERS,
        )  # fmt: skip
        if not are_look_ups_seen(found.error, found.filter_error):
            return rough
        return replace(rough, find_exact=partial(replace, rough, find_wrong_share=share_of_made))

    def candidate(self, error: float) -> Candidate[Prefiltered]:
        return self.proposed(self.least(error)[0]).exact

    def rows(self, max_size: int) -> Iterator[Row[Candidate[Prefiltered]]]:
        """Yield all maps of at most so many bytes."""
        for row in self.expansions(max_size):
            yield row.mapped(self.proposed)
