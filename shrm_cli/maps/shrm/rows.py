"""All SHRMs of some coefficients, known by bytes and errors, and the best one of some bytes."""

from collections.abc import Iterator
from dataclasses import field, replace
from functools import partial
from math import inf

from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.maps.expansion import Chosen, Expansion
from shrm_cli.maps.request import Request
from shrm_cli.maps.size import (
    TRIED_SIZES,
    choose_size,
    largest_p,
    nothing_fits,
    sizes_of,
    stored_bytes,
    supported_order,
)
from shrm_cli.orders import coefficients_to, least_orders
from shrm_cli.plan.search import Row, least_errors
from shrm_cli.probe.lighting import Projection
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_P


@record(eq=False)
class ShrmRows:
    """The SHRMs of a probe and a BRDF of a single term, as far as its coefficients are known."""

    light: Projection
    request: Request
    """What they are asked for: the BRDF, the texels, and the bytes."""
    coefficients: BrdfCoefficients
    eps: float = DEFAULT_EPS
    """What their F, which is only stated, may miss of the BRDF's energy."""
    most_p: int = MAX_ORDER_P
    _tried: dict[tuple[int, int], Expansion] = field(default_factory=dict, repr=False)
    """The expansions that searches asked for, by size and P."""

    def expansions(self, max_size: float = inf, largest: float = inf) -> Iterator[Row[Expansion]]:
        """Yield all of at most so many bytes, by their size, which is at most the largest one."""
        most = int(min(max_size, self.request.allowed))
        for size in sizes_of(self.request.size):
            if size <= largest:
                p = largest_p(self.carried(size), size, most)
                count = min(p, self.coefficients.order_p, self.most_p) + 1
                yield Row(count, partial(_bytes_at, size), partial(self._expansion, size))

    def carried(self, size: int) -> int:
        """Return the largest known order of the light that cubes of a size hold."""
        return min(supported_order(size), self.coefficients.order_f)

    def _expansion(self, size: int, p: int) -> Expansion:
        if (size, p) not in self._tried:
            orders = least_orders(self.coefficients, self.eps, order_p=p)
            orders = replace(orders, order_f=min(orders.order_f, self.carried(size)))
            chosen = Chosen(self.request.brdf, orders, self.coefficients, size)
            lighting = self.light.to_order(self.coefficients.order_f)
            self._tried[size, p] = Expansion.known(chosen, lighting, self.request.sampling)
        return self._tried[size, p]


def _bytes_at(size: int, order_p: int) -> int:
    return stored_bytes(size, (order_p + 1) ** 2)


def fitting(light: Projection, chosen: Chosen, request: Request, most: int = MAX_ORDER_P) -> Chosen:
    """Choose the orders and the size of the best map of a BRDF that fits.

    `chosen` is the map that a tolerance asks for. Where the best map has all of its coefficients'
    degrees of the view, more are computed: they are as many as fit beside the texels that F asks
    for, and the light may need far fewer. `most` is the largest P in any case.
    """
    brdf, coefficients, eps = chosen.brdf, chosen.coefficients, request.eps
    while True:
        largest = choose_size(least_orders(coefficients, eps).order_f)
        asked = replace(request, brdf=brdf)
        rows = ShrmRows(light, asked, coefficients, eps, most).expansions(
            largest=inf if request.size else largest
        )
        best = min(
            least_errors(rows), key=lambda each: (each.total_error, each.bytes), default=None
        )
        if best is None:
            raise nothing_fits(request.size)
        known, order_p = coefficients.order_p, best.orders.order_p
        texels = request.size or max(best.size // 2, TRIED_SIZES[0])
        more = min(largest_p(supported_order(texels), texels, request.allowed), 2 * known, most)
        if brdf.zonal or order_p < known or more <= known:
            return Chosen(brdf, best.orders, coefficients, best.size)
        coefficients = coefficients_to(brdf, eps, coefficients.order_f, more)
