"""SHRMs that could be made, known by bytes and errors from a BRDF's transfer functions.

Transfer functions hold every degree p of the view, so that whoever has them for another form knows
the errors of SHRMs without sampling the BRDF again.
"""

from collections.abc import Callable, Iterator
from dataclasses import field
from functools import cached_property, partial

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.maps.expansion import carry, predicted_wrong_share
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import (
    Choice,
    map_errors,
    most_order_p,
    prefilter_shrm,
    sufficient_tolerance,
)
from shrm_cli.maps.size import (
    TRIED_SIZES,
    largest_p,
    nothing_fits,
    sizes_of,
    stored_bytes,
    supported_order,
    total_error,
)
from shrm_cli.orders import Orders, choose_orders, least_orders
from shrm_cli.plan.search import Candidate, Row, fewest_bytes
from shrm_cli.probe.lighting import Projection
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_P, Sampling


@record
class Tried:
    """Orders and a size of an SHRM, and the errors of its map."""

    choice: Choice
    error: float
    """The relative RMS error of its orders."""
    find_filter_error: Callable[[], float] = field(repr=False, compare=False)
    """Finds that of looking it up, which takes far longer."""

    @property
    def bytes(self) -> int:
        return self.choice.bytes

    @property
    def least_error(self) -> float:
        """The error without what bilinear look-ups add."""
        return total_error(self.error)

    @cached_property
    def total_error(self) -> float:
        """The error with all that a renderer adds: bilinear look-ups and half precision."""
        return total_error(self.error, self.find_filter_error())


@record(eq=False)
class ShrmProposals:
    """The SHRMs of a probe and a BRDF of a single term."""

    light: Projection
    brdf: Brdf
    coefficients: BrdfCoefficients
    size: int | None = None
    sampling: Sampling = "center"

    @classmethod
    def of(
        cls,
        light: Projection,
        brdf: Brdf,
        transfer: TransferFunctions,
        size: int | None = None,
        sampling: Sampling = "center",
    ) -> "ShrmProposals":
        """Expand transfer functions into coefficients of the largest P that maps have."""
        order_p = 0 if brdf.zonal else min(MAX_ORDER_P, 2 * len(transfer.theta_o) // 3)
        return cls(light, brdf, BrdfCoefficients.of(transfer, order_p, brdf.zonal), size, sampling)

    @classmethod
    def known(
        cls,
        light: Projection,
        brdf: Brdf,
        error: float,
        max_size: int,
        size: int | None = None,
        sampling: Sampling = "center",
    ) -> "ShrmProposals":
        """Compute the coefficients that maps of about an error need, within a number of bytes."""
        eps, most_p = sufficient_tolerance(error), most_order_p(max_size, size)
        return cls(light, brdf, choose_orders(brdf, eps, most_p=most_p)[1], size, sampling)

    def rows(
        self, max_size: int, most_p: int = MAX_ORDER_P, eps: float = DEFAULT_EPS
    ) -> Iterator[Row[Tried]]:
        """Yield the SHRMs that fit into a number of bytes, and have at most a P, by their size.

        Their F, which is only stated, may miss a part `eps` of the BRDF's energy.
        """
        for size in sizes_of(self.size):
            carried = min(supported_order(size), self.coefficients.order_f)
            most = min(largest_p(carried, size, max_size), self.coefficients.order_p, most_p)
            yield Row(most + 1, partial(_bytes_at, size), partial(self._tried, eps, size))

    @cached_property
    def _known(self) -> dict[tuple[float, int, int], Tried]:
        """The SHRMs that were asked for."""
        return {}

    def _tried(self, eps: float, size: int, p: int) -> Tried:
        """Return the SHRM of an order P and a size; searches ask for some again and again."""
        key = eps, size, p
        if key not in self._known:
            coefficients = self.coefficients
            carried = min(supported_order(size), coefficients.order_f)
            f = min(least_orders(coefficients, eps, order_p=p).order_f, carried)
            captured = float(coefficients.captured()[carried, p])
            choice = Choice(Orders(f, p, 1 - captured, captured), size)
            lighting = self.light.to_order(coefficients.order_f)
            errors = map_errors(lighting, coefficients, p, size, self.sampling)
            self._known[key] = Tried(choice, *errors)
        return self._known[key]

    def least(
        self, error: float, max_size: int, eps: float = DEFAULT_EPS
    ) -> tuple[Tried, bool] | None:
        """Return the SHRM of the fewest bytes that keeps an error, or the best one that fits.

        The second of the two is whether it keeps the error; None where no map fits.
        """
        return fewest_bytes(self.rows(max_size, eps=eps), error)

    def fits(self, max_size: int) -> bool:
        """Tell whether any map fits into a number of bytes."""
        return stored_bytes(TRIED_SIZES[0] if self.size is None else self.size, 1) <= max_size

    def proposing(
        self, max_size: int, most_p: int = MAX_ORDER_P
    ) -> Callable[[float], Candidate[Prefiltered]]:
        """Return a function that proposes a map for an error, within a number of bytes and to a P.

        Raises ArgumentError: by that function, if no map fits.
        """

        def propose(error: float) -> Candidate[Prefiltered]:
            found = fewest_bytes(self.rows(max_size, most_p), error)
            if found is None:
                raise nothing_fits(self.size)
            return self.candidate(found[0], max_size)

        return propose

    def candidate(self, tried: Tried, max_size: int) -> Candidate[Prefiltered]:
        """Return one of these SHRMs as the search knows it."""
        choice, coefficients = tried.choice, self.coefficients

        def wrong_share() -> float:
            made = carry(self.light, self.brdf, choice.orders, coefficients, choice.size)
            return predicted_wrong_share([made])

        def make() -> Prefiltered:
            request = Request(
                "shrm", self.brdf, choice.orders.eps, size=choice.size,
                sampling=self.sampling, max_size=max_size,
            )  # fmt: skip
            return prefilter_shrm(self.light, request, (choice, coefficients), np.float64)

        look_ups = (choice.orders.order_p + 1) ** 2
        return Candidate("shrm", tried.bytes, look_ups, tried.total_error, wrong_share, make)


def _bytes_at(size: int, order_p: int) -> int:
    return stored_bytes(size, (order_p + 1) ** 2)
