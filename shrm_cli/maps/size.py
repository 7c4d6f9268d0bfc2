"""How large maps are and may be, which degrees they carry, and what bilinear look-ups in them cost.

A series that ends where light is still visible rings: beside a lamp its ripples are far brighter
than dark places, and negative. Where a map can carry no more, its last degrees therefore fall
smoothly to nothing, by half a wave of a cosine, as a tapered cosine (or Tukey) window does. That
costs a part of what they would have shown, which predicted errors count.

Sections 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

import math
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.probe.lighting import Lighting
from shrm_cli.records import record
from shrm_cli.reflected import filtering_error, last_visible
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE, MAX_CUBE_SIZE, MAX_ORDER_P, Sampling

MAX_VALUES = 2**30
"""The most values in the cubes of a map, which take 4 GB as 32-bit floats."""
MAX_SERIES = 2**26
"""The most coefficients of a map's harmonic series.

They take 0.5 GB as 64-bit floats, and several times that while they are computed.
"""

_BYTES_A_TEXEL = 6
"""The bytes of three colours in half precision."""

_ORDERS_A_TEXEL = 1.25
"""The largest order that maps carry, for each texel along a face's edge. Texels in the middle of a
face could tell more orders apart, and this guard band keeps what filtering adds between them small.
More was measured to gain little where the order P is what limits a map."""
_ORDERS_A_TEXEL_ALONE = 2.0
"""The same for maps of a single cube, whose error is all in the orders. It is all that the texels
can tell apart, which kinks such as the horizon of Lambert's law need."""

_FADING_ORDERS_A_TEXEL = 4 / 3
"""The same for maps that fade out. So they have about the error of those that are cut off, and the
tried sizes need no degrees beyond 64, 128 or 256, to which transfer functions are computed."""

TRIED_SIZES = (12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)
"""The sizes of cubes that are tried for a map of few bytes, texels along a face's edge. Twice the
bytes are a cube of the next size but one, so that those in between often share them better between
texels and functions of the view."""
HALF_ERROR = 2.1e-4
"""The relative RMS error of rounding values of any size to half precision."""

_SMALLEST_CHOICE = 16
"""The least texels along a face's edge that `choose_size` returns."""


def choose_size(order_f: int) -> int:
    """Choose the texels along a face's edge of a map of order F.

    It is the least power of two that gives at least 10 F texels around the equator
    (section 5.5.2), between 16 and the largest size of maps.
    """
    needed = max(10 * order_f / 4, _SMALLEST_CHOICE)
    return int(min(2 ** int(np.ceil(np.log2(needed))), MAX_CUBE_SIZE))


def supported_order(size: int, order_p: int = 1) -> int:
    """Return the largest order that cubes with so many texels along an edge support."""
    return int((_ORDERS_A_TEXEL if order_p else _ORDERS_A_TEXEL_ALONE) * size)


def furthest_order(size: int, order_p: int) -> int:
    """Return the largest order of cubes that fade out; see `supported_order`."""
    return int((_FADING_ORDERS_A_TEXEL if order_p else _ORDERS_A_TEXEL_ALONE) * size)


def total_error(error: float, filter_error: float = 0.0) -> float:
    """Combine a relative RMS error with those of bilinear look-ups and of half precision."""
    return float(np.linalg.norm([error, filter_error, HALF_ERROR]))


def sizes_of(size: int | None) -> tuple[int, ...]:
    """Return the sizes of cubes that are tried, which are one where it is given."""
    return TRIED_SIZES if size is None else (size,)


def nothing_fits(size: int | None, terms: int = 1) -> ArgumentError:
    """Return the error that refuses a number of bytes which not even a cube a term fits into."""
    least = stored_bytes(sizes_of(size)[0], terms)
    return ArgumentError("max_size", f"is too small: the least map takes {least:,} bytes")


def stored_bytes(size: int, cubes: int) -> int:
    """Return the bytes of RGB cubes in half precision, before they are packed."""
    return 6 * size**2 * cubes * _BYTES_A_TEXEL


def converted_bytes(size: int, cubes: int, max_size: int | None) -> int:
    """Return the most bytes of what a map of so many cubes becomes, where its form is not given.

    They are `max_size`; by default those that all maps may have, or that the map itself has.
    """
    return max(DEFAULT_MAX_SIZE, stored_bytes(size, cubes)) if max_size is None else max_size


def most_cubes(size: int, max_size: int) -> int:
    """Return how many RGB cubes fit into `max_size` bytes in half precision; it may be 0."""
    return max_size // stored_bytes(size, 1)


def largest_p(order_f: int, size: int, max_size: int) -> int:
    """Return the largest P of an SHRM within `max_size` bytes that can be made, or -1."""
    cubes = min(most_cubes(size, max_size), MAX_VALUES // (18 * size**2))
    p = min(math.isqrt(cubes) - 1, MAX_ORDER_P)
    while p > 0 and largest_f(p) < order_f:
        p -= 1
    return p


def largest_f(order_p: int) -> int:
    """Return the largest order of the light with which an SHRM of order P can be computed."""
    return math.isqrt(MAX_SERIES // (3 * (order_p + 1) ** 2)) - order_p - 1


def check_size(order_f: int, order_p: int, size: int | None = None) -> None:
    """Check that a map of these orders can be computed and kept in memory."""
    series = (order_f + order_p + 1) ** 2 * (order_p + 1) ** 2 * 3
    if series > MAX_SERIES:
        raise MapError(
            f"orders F = {order_f} and P = {order_p} make {series:,} coefficients, more than "
            f"{MAX_SERIES:,}; lower `order_f` and `order_p`, or raise `eps`"
        )
    size = choose_size(order_f) if size is None else size
    values = 6 * size**2 * (order_p + 1) ** 2 * 3
    if values > MAX_VALUES:
        raise MapError(
            f"a map of size {size} and order P = {order_p} holds {values:,} coefficients, more "
            f"than {MAX_VALUES:,}; lower `size` or the orders"
        )


_RINGS = 0.02
"""The RMS of what a series loses at its end, relative to the mean reflected light, above which its
rings are seen. Lobes that their texels resolve lose up to a hundredth, sharper ones a twentieth or
more."""
_WHOLE = 0.8
"""The part of the degrees before the fall. A longer fall was measured to remove hardly more rings,
and to blur lamps more."""

_FEW_VIEWS = 20
"""The least P of maps whose last degrees of the view are weakened. With P = 28 and 32 that was
measured to take from the 95th percentile of what is seen as well as from the median; with P = 13
the percentile rose as often as it fell."""


@record
class Band:
    """Degrees from 0 on, of which the last may be weakened."""

    whole: int
    """The largest degree that is kept as it is."""
    last: int
    """The largest degree that is kept at all."""

    @classmethod
    def exact(cls, order: int) -> "Band":
        """Return the degrees up to an order, none of which is weakened."""
        return cls(order, order)

    @classmethod
    def of(cls, beyond: Array, limit: int, furthest: int, known: int, least: int = 0) -> "Band":
        """Choose the degrees of a map.

        `beyond`, of shape (> known,), is the RMS of the reflected light after each degree, as
        `visible_beyond` returns it. `limit` is the largest degree that a map may end with at once.
        `furthest` is the largest degree of a map that fades out. `known` is the largest degree that
        is known. Where nothing visible is left out, the degrees up to this one are kept in any
        case.

        The band is exact where no rings are seen.
        """
        visible = last_visible(beyond)
        # What is visible at the last known degree goes on beyond it.
        if visible <= limit and visible < known:
            return cls.exact(max(visible, least))
        end = min(limit, known)
        if beyond[int(_WHOLE * end)] <= _RINGS:
            return cls.exact(end)
        last = min(furthest, known)
        return cls(int(_WHOLE * last), last)

    @classmethod
    def of_views(cls, beyond: float, order_p: int) -> "Band":
        """Choose how the degrees of the view end.

        `beyond` is the RMS of the reflected light after the last degree, as `visible_beyond_p`
        returns it. `order_p` is the last degree.

        The band is exact where no rings are seen, and where degrees are too few to lose one.
        """
        if order_p < _FEW_VIEWS or beyond <= _RINGS:
            return cls.exact(order_p)
        return cls(int(_WHOLE * order_p), order_p)

    @property
    def fades(self) -> bool:
        """Whether the last degrees are weakened."""
        return self.whole < self.last

    @cached_property
    def factors(self) -> Array:
        """What each degree is multiplied with, shape (last + 1,), falling from 1 towards 0."""
        beyond = np.maximum(np.arange(self.last + 1) - self.whole, 0)
        return np.asarray(np.cos(np.pi / 2 * beyond / (self.last + 1 - self.whole)) ** 2)


_DEGREES_A_TEXEL = 2
"""Texels show no more degrees than this many for each of them along an edge."""
_PLACES_ORDER = 16
"""The largest degree that tells where on the faces the details lie."""
_FEW_TEXELS = 16
"""The most texels along an edge of cubes that are looked through instead of predicted."""
_FEW_TEXELS_ALONE = 48
"""The same limit for maps of a single cube."""
_FEW_HARMONICS = 4
"""The largest P of SHRMs whose cubes are looked through."""


def shrm_look_up_error(
    lighting: Lighting, coefficients: BrdfCoefficients, factors: Array, size: int,
    sampling: Sampling,
) -> float:  # fmt: skip
    """Return the relative RMS error of looking an SHRM up by bilinear filtering.

    Small cubes are looked through, because a prediction is up to a fifth off where they show a
    single lamp.

    `factors`, of shape (F+1, P+1), are what the map multiplies each degree of the light and each
    one of the view with.

    Returns the error of the map as it is made, without that of its orders; 0 for black light.
    """
    order_f, order_p = (count - 1 for count in factors.shape)
    most = _FEW_TEXELS if order_p else _FEW_TEXELS_ALONE
    if size > most or order_p > _FEW_HARMONICS:
        return filtering_error(lighting, coefficients, factors, size, sampling)
    from shrm_cli.maps.coupling import coupled, separated
    from shrm_cli.sphere.bilinear import lost_between_texels

    kept = coefficients.truncated(order_f, order_p) * factors[..., None, None]
    light = separated(lighting.coefficients[: (order_f + 1) ** 2], order_f)
    lost = whole = 0.0
    for p in range(order_p + 1):
        series = coupled(light, kept[:, p, : p + 1, None])
        series = series.reshape(len(series), -1)
        lost += float(lost_between_texels(series, size, sampling).sum())
        whole += float(np.sum(series**2))
    return relative_rms(lost, whole)


def look_up_error(cube: Array, sampling: Sampling, order: int) -> float:
    """Predict the relative RMS error of looking a cube up by bilinear filtering.

    `shrm_cli.reflected.filtering_error` predicts it from light and BRDF before a map is made; this
    is for maps that have neither any more. Each degree that the texels show loses what
    `bilinear_errors` says.

    `cube`, of shape (6N, N, channels), holds functions over the sphere, that count by their energy.
    `order` is the largest degree of the functions; what is beyond is the rounding of files.

    Returns the error against what the texels show; 0 for a black cube.
    """
    from shrm_cli.sphere.bilinear import bilinear_errors, detail_places
    from shrm_cli.sphere.grid.cube import Cube

    size = cube.shape[1]
    order = min(order, _DEGREES_A_TEXEL * size)
    grid = Cube(size, sampling)
    analysis = grid.analysis(order)
    analysis.add(0, cube, grid.weights())
    coefficients = analysis.coefficients()
    degree = degrees(order)
    energy = np.bincount(degree, weights=np.sum(coefficients**2, axis=1))
    if not energy.any():
        return 0.0
    places = detail_places(coefficients[degree <= _PLACES_ORDER])
    errors = bilinear_errors(order, size, sampling, places)
    return float(np.sqrt(errors @ energy / energy.sum()))
