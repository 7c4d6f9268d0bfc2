"""What lobes reflect of a light, at points that stand for all pixels of spheres.

About a central direction C the light is a sum over few numbers (eq. 5.9 of Ramamoorthi's thesis),

    B(C, V) = sum over l, q of A_lq(C) (-1)^q rho_hat_lq(theta_o) exp(i q phi_o),
    A_lq(C) = sum over m of L_lm d^l_mq(theta) exp(i m phi),

in which rho_hat_lq is the lobe for the view, with all its degrees p, and (-1)^q is there for q > 0
only.

All views of a direction share its A_lq. The terms of a sum reflect their light at the same point, a
normal and a view, though each about its own central direction. The mirror direction, the normal and
the view lie in one plane, so that lobes about one direction become lobes about the other when they
are turned in this plane, each view's by an angle of its own.
"""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import reduce
from hashlib import blake2b
from itertools import pairwise

import numpy as np

from shrm_cli.arrays import Array, Memo, kept_order
from shrm_cli.maps.sphere_pixels import Pixels, Rings, pixels, sample_views
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import complex_from_real, degrees
from shrm_cli.sphere.wigner import folded_small_d, small_d_degrees
from shrm_cli.vocabulary import LUMINANCE, Center

_KEPT_ORDER = 96
_known_rings = Memo(2**25)
"""The functions on the rings, up to some orders of the light; those of order 96 take 5 to 9 MB."""
_AT_ONCE = 16
"""The degrees that are computed together, because small products take long to start."""
_ORDERS_AT_ONCE, _FEW_MORE = 7, 2
"""The azimuthal orders q for which light is computed together. Lobes have as many at first, and
more where these do not suffice. A few more take hardly longer with the others than alone."""
_kept_light: ContextVar[Memo | None] = ContextVar("_kept_light", default=None)
_LIGHT_BYTES = 2**28
"""The most bytes of `keeping_light`. The light to order 512 takes 14 to 165 MB."""
_FADING = 0.25
"""The part of the known degrees that fades out where the light goes on beyond them. A principal map
of 1 MB of `ward:ax=0.2,ay=0.2` has 10.0 % wrong pixels under a sunrise. 12.6 % were predicted where
degrees ended at once, and 9.2 % with this part, or with a half. Rings count in dark places even
where little light is beyond: of `microfacet:sigma=0.2` 7.5 % of the pixels are wrong under the same
sunrise, and 12.9 % were predicted with rings."""
_BLURRED = 10.0
"""The exponent at the end of a Gaussian over degrees. With 4 rings are seen; with 10 it
blurs by 1.3 degrees (standard deviation) where the last one is 192."""


@record(eq=False)
class Lobes:
    """Lobes of a BRDF for some views, and what a map leaves out of them."""

    whole: Array
    error: Array
    """`whole` and `error`: rho_hat_lq(theta_o), indexed [q, l, view, channel], with one channel for
    a grey BRDF, at the angles of `sample_views`, shape (Q+1, F+1, views, channels). There is one
    view where all have the same lobe. Those of anisotropic BRDFs are complex, at the azimuths of
    `sample_tangents`."""
    center: Center = "reflection"
    """What the lobes are about."""
    known_as: Hashable = None
    """What tells `whole` from that of all other lobes, where that is known without its values."""

    @classmethod
    def of(cls, whole: Array, error: Array, center: Center) -> "Lobes":
        """Return lobes with one channel where all three are the same."""
        both = whole, error
        if all(np.array_equal(each[..., 1:], each[..., :-1]) for each in both):
            whole, error = (each[..., :1] for each in both)
        return cls(whole, error, center)

    @property
    def order(self) -> int:
        return self.whole.shape[1] - 1

    @property
    def max_q(self) -> int:
        return self.whole.shape[0] - 1

    def ended(self, beyond: Array, light: Array, aside: float = 0.0) -> "Lobes":
        """Return lobes whose last known degrees fade out, and whose error has all azimuthal orders.

        What is visible at the last degree that `beyond` knows goes on, and would ring around lamps
        where it is cut off. Some lobes have even degrees alone. Higher azimuthal orders than the
        known ones are in no map, and show in dark places: the last octave of orders takes their
        energy, from each view in proportion to its last two orders.

        `beyond`, of shape (>= F+1,), is the RMS of what truncation after each degree leaves out,
        relative to the mean light. `light`, of shape (>= F+1, 3), is ``4 pi / (2l+1)`` times its
        power. `aside` is the energy of the reflected light in these orders, relative to the known.
        """
        factors = np.ones(self.order + 1)
        fading = int(_FADING * len(factors))
        if self.order >= len(beyond) - 2:
            last = np.arange(1, fading + 1) / (fading + 1)
            factors[len(factors) - fading :] = (1 + np.cos(np.pi * last)) / 2
        scale = factors[:, None, None]
        whole, error = self.whole * scale, self.error * scale
        if aside <= 0:
            return Lobes(whole, error, self.center)
        light = light[: self.order + 1]
        if whole.shape[-1] == 1:
            light = light.sum(axis=1, keepdims=True)
        octave = np.log2((np.arange(self.max_q + 1) + 0.5) * 2 / (self.max_q + 1))
        added = whole * np.where(octave > 0, np.sin(np.pi * octave) ** 2, 0.0)[:, None, None, None]
        square = _energy(added, added, light)
        last_two = _energy(whole, whole, light, self.max_q - 1)
        if not (square.any() and last_two.any()):  # no degree has as many orders as are known
            return Lobes(whole, error, self.center)
        shares = sample_views(self.center, whole.shape[2])[1]
        more = last_two * aside * (_energy(whole, whole, light) @ shares) / (last_two @ shares)
        # What is added is partly there: both together have the energy of what is missing.
        both = _energy(error, added, light)
        amount = (np.sqrt(both**2 + square * more) - both) / np.maximum(square, 1e-300)
        return Lobes(whole, error + added * amount[:, None], self.center)

    def at_views(self, count: int) -> "Lobes":
        """Return them at a multiple of their views, where those differ, each for its neighbors."""
        own = self.whole.shape[2]
        if own in (1, count):
            return self
        whole, error = (each.repeat(count // own, axis=2) for each in (self.whole, self.error))
        return Lobes(whole, error, self.center)

    def to_order(self, order: int) -> "Lobes":
        """Return them without the degrees beyond an order, and without errors."""
        whole = self.whole[: order + 1, : order + 1]
        return Lobes(whole, np.zeros_like(whole), self.center)

    def recentered(self, views: int) -> "Lobes":
        """Return lobes about the normal as lobes about the mirror direction, or the reverse.

        `views` is the number of views, which differ even where those of the lobes do not.
        """
        is_normal = self.center == "normal"
        theta_o = sample_views(self.center, views)[0]
        order, spins = self.order, np.arange(-self.max_q, self.max_q + 1)
        # The normal lies between the mirror direction and the view.
        turned = small_d_degrees(order, theta_o if is_normal else -theta_o / 2, self.max_q)
        # Rotations are for harmonics with Condon and Shortley's signs, which lobes do not have.
        signs = np.where(spins > 0, (-1.0) ** spins, 1.0)[:, None, None, None]
        own = np.stack([self.whole, self.error])[:, np.abs(spins)] * signs
        own = np.where(spins[:, None, None, None] < 0, own.conj(), own)
        result = np.zeros((2, order + 1, order + 1, views, own.shape[-1]), own.dtype)
        for degree, d in turned:
            width = d.shape[1] // 2
            inner = slice(self.max_q - width, self.max_q + width + 1)
            lobes = np.broadcast_to(own[:, inner, degree], (2, d.shape[1], *result.shape[3:]))
            np.einsum("mqv,kqvc->kmvc", d[degree:], lobes, out=result[:, : degree + 1, degree])
        result *= (-1.0) ** np.arange(order + 1)[:, None, None, None]
        return Lobes(result[0], result[1], "reflection" if is_normal else "normal")

    def __add__(self, other: "Lobes") -> "Lobes":
        """Return the lobes of the sum of two BRDFs about the same central direction."""
        whole, error = _added(self.whole, other.whole), _added(self.error, other.error)
        return Lobes(whole, error, self.center)


def _energy(first: Array, second: Array, light: Array, first_q: int = 0) -> Array:
    """Return the energy of the light that two lobes reflect together for each view, (views,).

    That of azimuthal orders from one on, of both signs. `light`, of shape (F+1, channels), is its
    power in each degree.
    """
    signs = np.where(np.arange(first_q, len(first)), 2, 1)
    product = (first[first_q:] * second[first_q:].conj()).real
    return np.asarray(np.einsum("q,lc,qlvc->v", signs, light, product, optimize=True))


def _added(first: Array, second: Array) -> Array:
    """Add lobes of other orders, numbers of views or channels."""
    orders = np.maximum(first.shape[:2], second.shape[:2])
    shape = *orders, *np.broadcast_shapes(first.shape[2:], second.shape[2:])
    result: Array = np.zeros(shape, np.result_type(first, second))
    for each in (first, second):
        result[: each.shape[0], : each.shape[1]] += each
    return result


def reflected(lobes: Lobes, light: Array, at: Pixels) -> Array:
    """Return the luminance of what lobes reflect of some light, at all pixels.

    `light`, of shape (n, 3), are its coefficients, world axes. They fade out as a Gaussian over the
    degrees of the lobes, for nothing else does not ring around lamps: at night, at 192 degrees that
    fade out within an octave, 32 % of the points were said to be wrong for what discs change under
    a coat of roughness .1, and none is.
    """
    fading = np.exp(-_BLURRED * (degrees(lobes.order) / (lobes.order + 1)) ** 2)
    faded = np.zeros((len(fading), 3))
    known = light[: len(faded)]
    faded[: len(known)] = known * fading[: len(known), None]
    return _reflected_at(faded * LUMINANCE, lobes.at_views(len(at.theta_o)), at)[0]


def together(lobes: Iterable[Lobes]) -> list[Lobes]:
    """Add lobes about the same central direction; those of the highest order come first."""
    found: dict[Center, Lobes] = {}
    lobes = list(lobes)
    count = max(each.whole.shape[2] for each in lobes)
    for each in (each.at_views(count) for each in lobes):
        found[each.center] = found[each.center] + each if each.center in found else each
    return sorted(found.values(), key=lambda each: -each.order)


def lit(light: Array, groups: Sequence[Lobes], at: Pixels | None = None) -> tuple[Array, Array]:
    """Evaluate what lobes reflect, and their error, at the same points.

    `light`, of shape (>= (F+1)^2, channels), holds the coefficients over the real harmonics of
    world axes, in which the channels are weighted that are added. `groups` are each about another
    central direction; the tangent stands alone. `at` are the points, by default those of `judged`.

    Returns `whole` and `error`, each of shape (directions, views, azimuths).
    """
    at = at or judged(groups)
    # Lobes that are the same for all views reflect the light for one.
    values: Array = reduce(np.add, (_reflected_at(light, each, at) for each in groups))
    return values[0], values[1]


def judged(groups: Sequence[Lobes], is_dense: bool = False) -> Pixels:
    """Return the pixels that lobes are judged by together; more if they are to be dense."""
    first, *others = groups
    is_brushed = any(np.iscomplexobj(each.whole) for each in groups)
    is_zonal = not others and first.max_q == 0 and first.whole.shape[2] == 1
    return pixels(first.center, is_brushed, is_dense, is_zonal)


def _reflected_at(light: Array, lobes: Lobes, at: Pixels) -> Array:
    """Reflect light by lobes at pixels, which may have another central direction than they.

    Returns an array of shape (2, directions, views, azimuths): the light that is reflected, and the
    error of it.
    """
    if lobes.center != at.center:
        lobes = lobes.recentered(len(at.theta_o))
    light = light[: (lobes.order + 1) ** 2]
    if lobes.whole.shape[-1] == 1:
        light = light.sum(axis=1, keepdims=True)
    kept = _kept_light.get()
    known = None if kept is None else _identity(light)
    local = _local_light(light, lobes, at.rings, known)
    if kept is None:
        whole = _reflected(local, lobes.whole, at)
    else:  # the maps that are compared have the same whole lobes, and errors of their own
        own = lobes.known_as or _identity(lobes.whole)
        what = known, own, at
        whole = kept.get(what, lambda: _reflected(local, lobes.whole, at))
    return np.stack([whole, _reflected(local, lobes.error, at)])


def _identity(array: Array) -> tuple[bytes, tuple[int, ...]]:
    """Return what tells an array from others by its values."""
    return blake2b(array.tobytes()).digest(), array.shape


def _reflected(local: Sequence[Array], lobes: Array, at: Pixels) -> Array:
    """Reflect the light about central directions by lobes, (directions, views, azimuths)."""
    max_q, views = len(lobes) - 1, lobes.shape[2]
    if not lobes.any():
        return np.zeros((at.rings.count * at.rings.around, views, at.azimuths.shape[-1]))
    if is_complex := np.iscomplexobj(lobes):
        lobes = np.concatenate([lobes.real, lobes.imag], axis=2)
    flat = lobes.transpose(0, 2, 1, 3).reshape(*lobes.shape[::2], -1).astype(np.float32)
    # All degrees are added before waves go around the rings, which are the same for all of them.
    real, imaginary = np.concatenate(
        [
            flat[orders.start : orders.stop] @ light
            for light, orders in zip(local, _together(max_q), strict=True)
        ],
        axis=1,
    )
    sums = (real + 1j * imaginary).reshape(max_q + 1, -1, 2, at.rings.count // 2, at.rings.around)
    if is_complex:  # those on the southern rings are conjugated in the end
        sums = sums[:, :views] + sums[:, views:] * np.array([[[1j]], [[-1j]]], np.complex64)
    by_q = _around(sums, at.rings)
    # The sum over both signs of q is twice the real part of that over q > 0. Lobes lack Condon and
    # Shortley's signs, which the light has.
    q = np.arange(max_q + 1)
    signs = np.where(q == 0, 1, 2) * (-1.0) ** q
    if at.azimuths.ndim == 1:
        waves = signs[:, None] * np.exp(1j * np.outer(q, at.azimuths))
        parts = np.concatenate([by_q.real, by_q.imag]).reshape(2 * len(q), -1)
        values = parts.T @ np.concatenate([waves.real, -waves.imag])
        return np.asarray(values.reshape(views, -1, len(at.azimuths)).swapaxes(0, 1))
    turn = np.exp(1j * at.azimuths.T).astype(np.complex64)
    values = np.zeros_like(turn)
    for sign, wave in zip(signs[::-1].astype(np.float32), by_q[::-1], strict=True):  # Horner's
        values = values * turn + sign * wave
    return np.asarray(values.real.T, dtype=float)


def _around(sums: Array, rings: Rings) -> Array:
    """Return what waves around the rings add up to at all directions, (orders q, n, directions).

    `sums`, of shape (orders q, n, 2, pairs of rings, waves), are those of `_local_light`, added
    over the degrees.
    """
    values = np.fft.ifft(sums, norm="forward")
    north, south = values[:, :, 0], values[:, :, 1, ::-1].conj()
    found = np.concatenate([north, south], axis=2).reshape(*sums.shape[:2], -1)
    found *= np.exp(1j * np.arange(len(sums))[:, None, None] * rings.twists).astype(np.complex64)
    return np.asarray(found)


def _local_light(light: Array, lobes: Lobes, rings: Rings, known: object) -> list[Array]:
    """Expand the light about the directions on rings.

    `light`, of shape ((order+1)^2, channels), holds the coefficients over the real harmonics of
    world axes. `lobes` tell the largest l and q. `known` tells the light from others, where it is
    kept.

    Returns arrays of shape (2, orders q, (order+1) channels, waves), of single precision, for some
    of the orders q = 0 .. max_q each: the real and the imaginary part of the waves around pairs of
    rings that `_around` takes for ``A_lq(C)``, zero where q > l.
    """
    kept, order = _kept_light.get(), lobes.order

    def make(orders: range) -> Array:
        if kept is None:
            return _make_local_light(light, order, orders, rings)
        return kept.get(
            (known, order, orders, rings), lambda: _make_local_light(light, order, orders, rings)
        )

    return [make(orders) for orders in _together(lobes.max_q)]


def _together(max_q: int) -> list[range]:
    """Return the azimuthal orders from 0 on in groups that are computed together."""
    starts = range(0, max(max_q + 1 - _FEW_MORE, 1), _ORDERS_AT_ONCE)
    return [range(*each) for each in pairwise([*starts, max_q + 1])]


@contextmanager
def keeping_light() -> Iterator[None]:
    """Keep the light about central directions, for whoever compares many maps of a probe.

    Where it is kept already, it goes on being kept.
    """
    known = _kept_light.get()
    token = _kept_light.set(Memo(_LIGHT_BYTES, _LIGHT_BYTES) if known is None else known)
    try:
        yield
    finally:
        _kept_light.reset(token)


def _make_local_light(light: Array, order: int, orders: range, rings: Rings) -> Array:
    """Compute what `_local_light` returns for some orders q.

    As ``d^l_mq(pi - theta) = (-1)^(l+q) d^l_-mq(theta)`` and the light is real, its ``A_lq`` on a
    southern ring follow from the northern ring of the same latitude: they are the conjugates half a
    turn away. Around a ring, orders m that differ by the number of its directions are the same
    wave.
    """
    channels, height, around = light.shape[1], rings.count, rings.around
    middle = -(-kept_order(order) // around) * around
    m = np.arange(-middle, middle + around)
    # The rings from the north to the equator, each beside the one on the other side.
    north, south = np.split(rings.turns, 2)
    starts = np.stack([north, south[::-1] + np.pi], axis=1)
    phases = np.exp(1j * m[:, None] * starts[:, None]).astype(np.complex64)
    phases = phases.repeat(channels, axis=2)  # long rows of numbers take the least time
    by_degree = np.zeros((order + 1, len(m), 2, channels), np.complex64)
    by_degree[:, middle - order : middle + order + 1] = complex_from_real(light, order)[:, :, None]
    by_degree = by_degree.reshape(order + 1, 1, len(m), -1)
    result = np.empty((2, len(orders), order + 1, channels, 2, height // 2, around), np.float32)
    first = _first_degree(orders)
    result[:, :, :first] = 0.0
    for functions in _ring_functions(order, orders, rings):
        count, *_, blocks = functions.shape
        some = slice(first, first + count)
        rows = slice(middle - blocks // 2 * around, middle + (blocks // 2 + 1) * around)
        lit = (by_degree[some, :, rows] * phases[:, rows]).view(np.float32)
        lit = lit.reshape(count, height // 2, blocks, around, -1).transpose(0, 3, 1, 2, 4)
        folded = (functions @ lit).reshape(*functions.shape[:-1], 2, channels, 2)
        result[:, :, some] = folded.transpose(6, 3, 0, 5, 4, 2, 1)
        first += count
    is_odd = np.add.outer(orders, np.arange(order + 1)) % 2 == 1
    result[:, is_odd, :, 1] *= -1
    return result.reshape(2, len(orders), (order + 1) * channels, -1)


def _ring_functions(order: int, orders: range, rings: Rings) -> Iterator[Array]:
    """Yield the functions on the northern rings from the `_first_degree` on.

    They are what `folded_small_d` yields to the `kept_order`, which is kept for the next call
    unless it is large.
    """
    kept, north = kept_order(order), rings.theta[: rings.count // 2]
    first = _first_degree(orders)
    made = folded_small_d(kept, north, orders, rings.around, first, _AT_ONCE)
    is_kept = order <= _KEPT_ORDER
    found = _known_rings.get((kept, orders, rings), lambda: list(made)) if is_kept else made
    for count, functions in zip(range(order + 1 - first, 0, -_AT_ONCE), found, strict=False):
        yield functions[:count]


def _first_degree(orders: range) -> int:
    """Return the first of the degrees that are computed together, below which no q is."""
    return orders[0] // _AT_ONCE * _AT_ONCE
