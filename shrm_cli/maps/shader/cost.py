"""What a look-up costs in a shader, for the GLSL that ``shrm prefilter --shader`` prints.

Look-ups are texels that are fetched and cubes that are filtered. Multiply-adds are multiplications
of single numbers, each of which takes an addition along for nothing; a division, a root or another
function counts as one, too. What depends on nothing but whole numbers (indices) is not counted. The
numbers follow the code line by line, and a test counts the same by running it.
"""

from collections.abc import Sequence

from shrm_cli.maps.base import Map
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.records import record

_MIRROR = 7
"""Multiply-adds of the mirror direction, ``2 (n.v) n - v``."""
_TANGENT = 5
"""Those of the horizontal tangent."""
_BILINEAR = 11
"""Those of one bilinear look-up in a table of RGB, which fetches four texels."""
_TRIANGLES = 20 * 3 * 9 + 3 * 20 + 3 + 9
"""Those of Cabral's mixture: three volumes of each triangle, solid angles, shares and colours."""
_GREY = 47
"""Those of an SH exponential for one f0, without its series."""
_PAIR, _ALONE, _BRUSHED = 128, 79, 94
"""Those of two taps of brushed GGX, of one in the middle, and of all that is around them."""
_TAP, _EVEN = 39, 33
"""Of a tap of even GGX, and of all around them, without the weight that the first one has not."""


@record
class Cost:
    """The work of a look-up."""

    look_ups: int
    """Fetches of textures."""
    multiply_adds: int

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(self.look_ups + other.look_ups, self.multiply_adds + other.multiply_adds)


def shrm_cost(order_p: int, center: str) -> Cost:
    """Return the cost of an SHRM: every harmonic of the view times its cube."""
    return Cost((order_p + 1) ** 2, _of_center(center) + _harmonics(order_p, 4))


def principal_cost(degrees: Sequence[int], center: str) -> Cost:
    """Return the cost of a lobe of principal functions, whose bundles have some degrees."""
    of_lobe = _of_center(center) + 25
    return Cost(sum(2 * p + 1 for p in degrees), of_lobe + sum(map(_bundle, degrees)))


def _bundle(p: int) -> int:
    """Return the multiply-adds of a bundle of degree p."""
    return 2 + (p + 1) ** 2 * (24 + 4 * p) + 3 * (2 * p + 1) + 4 * (p + 1)


def cost_of(made: Map) -> Cost | None:
    """Return the cost of an SHRM or of a map of principal functions; None of others, as of lamps.

    What lies beside a map takes what its BRDF takes.
    """
    if isinstance(made, Shrm):
        return shrm_cost(made.info.order_p, made.center)
    if isinstance(made, PrincipalMap):
        return sum(
            (principal_cost(each.degrees, each.center) for each in made.lobes), start=Cost(0, 0)
        )
    return None


def split_sum_cost() -> Cost:
    """Return the cost of a split sum, whose levels are linear in the roughness."""
    return Cost(2 + 4, _MIRROR + 1 + 3 + 3 + _BILINEAR + 6)


def brushed_cost(taps: int) -> Cost:
    """Return the cost of brushed GGX under a split sum, whose table is looked up twice.

    Taps beside the middle are pairs, which have their numbers together.
    """
    pairs, alone = divmod(taps, 2)
    return Cost(2 * taps + 2 * 4, _PAIR * pairs + _ALONE * alone + _BRUSHED)


def even_cost(taps: int) -> Cost:
    """Return the cost of GGX that is not brushed under a split sum, with taps."""
    return Cost(2 * taps + 4, _TAP * taps + _EVEN)


def exponential_cost(order_p: int, order_q: int, is_grey: bool) -> Cost:
    """Return the cost of an SH exponential for an f0 that is the same in all channels, or is not.

    The coefficients are constants of the code; the table of moments is looked up twice.
    """
    series = _harmonics(order_p, 16) + _harmonics(order_q, 16)
    return Cost(2 * 4, 3 + 2 * _BILINEAR + (1 if is_grey else 3) * (_GREY + series))


def irradiance_cost(order: int) -> Cost:
    """Return the cost of irradiance times an albedo; its coefficients are constants of the code."""
    if order > 2:
        return Cost(0, _harmonics(order, 4) + 3)
    return Cost(0, (0, 9, 38)[order] + 3)


def cabral_cost(center: str) -> Cost:
    """Return the cost of Cabral's twelve maps, of which the three around the view are mixed."""
    return Cost(3, _of_center(center) + _TRIANGLES)


def _of_center(center: str) -> int:
    """Return the multiply-adds of a central direction."""
    return {"reflection": _MIRROR, "normal": 0, "tangent": _TANGENT}[center]


def _harmonics(order: int, each: int) -> int:
    """Return the multiply-adds of a loop over all harmonics, with what is done with each."""
    pairs = (order + 1) * (order + 2) // 2
    return (order + 1) ** 2 * each + 5 * pairs + 7 * (order + 1)
