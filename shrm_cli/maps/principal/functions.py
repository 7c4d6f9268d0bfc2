"""The functions of the view that belong to a BRDF: singular vectors instead of harmonics.

About the central direction the reflected light is, for each azimuthal order q,

    B_q(R, theta_o) = sum over l, m of L_lm rho_hat_lq(theta_o) D^l_mq(R).

An SHRM expands the dependence on theta_o in Legendre functions (eq. 5.22 of Ramamoorthi's thesis).
Here it is expanded in the right singular vectors of ``rho_hat_lq(theta_o)``, whose rows are
weighted by the power of the probe's light: no other functions come closer with as few of them.
Views are weighted, too, because the same error is seen more easily where little light is reflected.
It is the factorization of Kautz and McCool, made in the frequency domain and order by order, which
section 5.8 of the thesis names as future work. The first function of q = 0 is the split sum.

References: Kautz and McCool 1999, "Interactive Rendering with Arbitrary BRDFs using Separable
Approximations".
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.coefficients import both_signs
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.maps.principal.selection import Counts
from shrm_cli.records import record
from shrm_cli.sphere.quadrature import interpolation_matrix, linear_matrix
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS, Center

TABLES = 91, 181, 361
"""The entries that the table of a function may have: one for each degree of the angle of the view,
or for a part of it."""
BENT = 0.01
"""The part of the light, as an RMS, that straight lines between the entries may leave out. Sheens,
which fall steeply beside the horizon, miss 2 to 5 % between whole degrees, others .01 to .6 %."""
MAX_Q = 12
"""The largest azimuthal order q that maps hold."""
_EVENNESS = 0.25
"""The power of the directional albedo relative to which functions keep errors small: 0 would be the
least RMS error, and 1 the least relative to each view's light. This one costs half a percent of
the RMS error, of plastics with many functions up to four, and takes up to an eighth from the errors
that are seen in dark places."""


_AT_ONCE = 4
"""The functions of an azimuthal order that are looked up in tables together."""
_FEW_NODES = 400
"""The most nodes over which singular vectors are found directly; isotropic BRDFs have no more."""
_NOTHING = 1e-13
"""The square of a singular value beside the largest one that is a rounding error."""


def span_of(center: Center) -> float:
    """Return the largest angle of a visible view from the central direction, radians.

    The view is as far from the mirror direction as twice its angle from the normal. About a tangent
    it may lie anywhere.
    """
    return np.pi / 2 if center == "normal" else np.pi


def _with_sign(basis: Array) -> Array:
    """Return eigenvectors, one a column, whose largest number is positive.

    Their signs mean nothing, and would hang on the last bit of the matrix otherwise.
    """
    largest = np.abs(basis).argmax(axis=0)
    return basis * np.where(basis[largest, np.arange(basis.shape[1])] < 0, -1.0, 1.0)


def _right_vectors(rows: Array, count: int) -> Array:
    """Return the strongest right singular vectors of a matrix, shape (columns, <= count).

    They are eigenvectors of a small matrix over columns, or follow from those of one over rows.
    """
    if rows.shape[1] <= _FEW_NODES:
        return _with_sign(np.linalg.eigh(rows.T @ rows)[1])[:, ::-1][:, :count]
    squares, basis = np.linalg.eigh(rows @ rows.T)
    strong = np.flatnonzero(squares > _NOTHING * squares[-1])[-count:]
    basis = rows.T @ basis[:, strong] / np.sqrt(squares[strong])
    return _with_sign(basis)[:, ::-1]


@record(eq=False)
class Spectrum:
    """The singular vectors of a BRDF, weighted by light, for every azimuthal order and channel."""

    transfer: TransferFunctions
    """The transfer functions that are factorized."""
    center: Center
    """What the functions are about."""
    light: Array
    """``4 pi / (2l+1) sum_m |L_lm|^2`` of each degree and channel, shape (F+1, 3)."""
    weights: Array
    """The weights of the nodes of the visible views; the others are 0, shape (n,)."""
    is_divided: bool = False
    """Whether the BRDF is divided by its directional albedo."""

    @classmethod
    def of(
        cls, transfer: TransferFunctions, center: Center, light: Array, divide: bool = False
    ) -> "Spectrum":
        """Prepare to factorize transfer functions.

        `divide` tells whether to factorize the BRDF divided by its directional albedo, so that the
        error is small relative to the albedo. Otherwise it is small relative to a power of it.
        """
        weights = np.where(transfer.theta_o <= span_of(center), transfer.weights, 0.0)
        return cls(transfer, center, light[: transfer.order_f + 1], weights, divide)

    @cached_property
    def albedo(self) -> Array | None:
        """What the BRDF is divided by, at the nodes, shape (n, 3), if it is."""
        return directional_albedo(self.transfer) if self.is_divided else None

    @cached_property
    def unit(self) -> Array:
        """The size of an error that is as bad at one node as at another, shape (n, 3).

        The functions are singular vectors of the transfer functions in these units.
        """
        if self.albedo is not None:
            return self.albedo
        return np.asarray(directional_albedo(self.transfer) ** _EVENNESS)

    @cached_property
    def vectors(self) -> list[Array]:
        """The singular vectors at the nodes, for each q: (k, n, 3), the strongest first.

        There are as many as a map may hold, which has as many of all lower orders, and two cubes
        for each of an order that is not 0. Their squares integrate to ``1 / (2 pi)`` over
        ``sin(theta_o) dtheta_o``, as those of the Legendre functions do. They are in units of
        `unit`.
        """
        transfer = self.transfer
        # Dark places beside lamps are lit by the broad parts of lobes, which a plain RMS would
        # neglect: low degrees count more.
        emphasis = self.light / (2 * np.arange(len(self.light)) + 1)[:, None]
        # Only seen views take part: others would only make vectors that are nowhere seen.
        seen = self.weights > 0
        scale = np.sqrt(2 * np.pi * self.weights[seen])
        found: list[Array] = []
        for q in range(min(transfer.max_q, MAX_Q) + 1):
            count = min(len(self.light), len(scale), MAX_PRINCIPAL_MAPS // (2 * q + 1))
            vectors = np.zeros((count, len(self.weights), 3))
            for channel in range(3):
                values = transfer.values[q, q:, seen, channel].T
                rows = np.sqrt(emphasis[q:, channel])[:, None] * values
                rows = rows * (scale / self.unit[seen, channel])
                basis = _right_vectors(rows, count)
                vectors[: basis.shape[1], seen, channel] = (basis / scale[:, None]).T
            found.append(vectors)
        return found

    @property
    def functions(self) -> Iterator[Array]:
        """For each q what the transfer functions are expanded in: `vectors` in no unit."""
        return (vectors * self.unit for vectors in self.vectors)

    @cached_property
    def energies(self) -> Array:
        """The energy of the reflected light in each function, [q, k], both signs of q together.

        It is 0 where there is no function.
        """
        found = [np.diff(each[:, -1]) for each in self._reflected]
        return np.array([np.pad(each, (0, len(found[0]) - len(each))) for each in found])

    @cached_property
    def _reflected(self) -> list[Array]:
        """The energy of the reflected light in the first k functions, to degree l: q: [k, l]."""
        return [self._sums(gains * self.light, q) for q, gains in enumerate(self._gains)]

    @cached_property
    def _own(self) -> list[Array]:
        """The BRDF's own energy in the first k functions, to degree l: a list by q of [k, l].

        Where it is divided by its albedo, that of the quotient.
        """
        squares = self._gains if self.albedo is None else [part**2 for part in self.parts]
        return [self._sums(each, q) for q, each in enumerate(squares)]

    @cached_property
    def _gains(self) -> list[Array]:
        """The energy that each function takes from the error, for each q: [k, l, channel].

        It would be the square of its part if functions were orthogonal, as they are but for the
        unit: the square of the rest is ``sum(rho^2) - 2 sum(a p) + sum(a G a)``, with the parts a,
        the projections p of rho on the functions, and the products G of two functions.
        """
        found = []
        for q, each in enumerate(self.functions):
            weighted = each.transpose(2, 0, 1) * self.weights
            parts = self.parts[q].transpose(2, 0, 1)
            projected = weighted @ self.transfer.values[q].transpose(2, 1, 0)
            # Each product of two different functions comes with the later of them, and twice.
            products = self._products[q]
            later = np.tril(products) + np.tril(products, -1)
            found.append((parts * (2 * projected - later @ parts)).transpose(1, 2, 0))
        return found

    @cached_property
    def _products(self) -> list[Array]:
        """The integrals of two functions' product, times 2 pi, for each q: [channel, k, k]."""
        by_channel = (each.transpose(2, 0, 1) for each in self.functions)
        return [2 * np.pi * (each * self.weights) @ each.swapaxes(-1, -2) for each in by_channel]

    @staticmethod
    def _sums(energies: Array, q: int) -> Array:
        """Add energies [k, l, channel] of an order up: over channels, functions and degrees."""
        sums = (2 if q else 1) * energies.sum(axis=2).cumsum(axis=0).cumsum(axis=1)
        return np.concatenate([np.zeros((1, sums.shape[1])), sums])

    def shown_energy(self, q: int, parts: Array, light: Array) -> float:
        """Return the energy of reflected light that the first functions of an order q make up.

        `parts`, of shape (k, F+1, 3), are what the light of each degree is multiplied with, for the
        first k functions.

        Returns that of both signs of q together, integrated over visible views.
        """
        by_channel = parts.transpose(2, 0, 1)
        products = self._products[q][:, : len(parts), : len(parts)]
        squares = np.sum(by_channel * (products @ by_channel), axis=1)
        return float((2 if q else 1) * np.sum(light.T * squares))

    def bundle_parts(self, bundles: Sequence[tuple[int, ...]], order: int) -> Array:
        """Return what the light of each degree is multiplied with, for bundles of a degree p.

        `bundles` has for each bundle the index of its function of each order 0 .. p.

        Returns an array of shape (order+1, p+1, bundles, 3): the coefficients rho_hat_lqk, which
        take the place of rho_hat_lpq.
        """
        by_order = enumerate(zip(*bundles, strict=True))
        parts = [self.parts[q][list(used), : order + 1] for q, used in by_order]
        return np.stack(parts).transpose(2, 0, 1, 3)

    @cached_property
    def parts(self) -> list[Array]:
        """What the light of each degree is multiplied with, for each q and function k.

        A list by q of arrays of shape (k, F+1, 3): the coefficients rho_hat_lkq, which take the
        place of rho_hat_lpq.
        """
        found = []
        for q, vectors in enumerate(self.vectors):
            values = self.transfer.values[q]
            weighted = (vectors * (self.weights[:, None] / self.unit)).transpose(2, 0, 1)
            found.append((weighted @ values.transpose(2, 1, 0)).transpose(1, 2, 0))
        return found

    def table(self, q: int, first: int, last: int) -> Array:
        """Return functions of an order q at even angles, shape (last - first, entries, 3)."""
        stored = self.vectors[q][first:last]
        if self.albedo is None:
            stored = stored * self.unit
        # Views that nobody sees have no value, and must not take part.
        return self._tabulated(q, stored[:, self.weights > 0])

    def _tabulated(self, q: int, functions: Array) -> Array:
        """Functions of an order q at the seen nodes, (k, n, 3), as entries of tables, (k, m, 3)."""
        nodes = self.transfer.theta_o[self.weights > 0]
        return np.einsum("to,koc->ktc", _to_entries(q, nodes, self.angles()), functions)

    def _looked_up(self, tables: Array) -> Array:
        """Functions at the nodes, (k, n, 3), as renderers read them from tables, (k, m, 3)."""
        matrix = linear_matrix(self.angles(), self.transfer.theta_o)
        return np.einsum("ot,ktc->koc", matrix, tables)

    def albedo_table(self) -> Array | None:
        """Return the directional albedo at even angles, shape (entries, 3), if it is divided by."""
        if self.albedo is None:
            return None
        return interpolation_matrix(self.transfer.theta_o, self.angles(), odd=False) @ self.albedo

    def angles(self) -> Array:
        """Return the angles of the entries of tables, radians, shape (entries,)."""
        return np.linspace(0.0, span_of(self.center), self.entries)

    @cached_property
    def entries(self) -> int:
        """The entries of a table: the fewest that leave next to nothing out between them."""
        allowed = BENT**2 * self.whole()
        fits = (entries for entries in TABLES[:-1] if self._between(entries) <= allowed)
        return next(fits, TABLES[-1])

    def _between(self, entries: int) -> float:
        """The energy of reflected light that is lost if the transfer functions are in tables."""
        angles = np.linspace(0.0, span_of(self.center), entries)
        seen = self.weights > 0
        nodes, values = self.transfer.theta_o[seen], self.transfer.values[:, :, seen]
        look_up, own = linear_matrix(angles, nodes), np.eye(len(nodes))
        scale, total = np.sqrt(self.weights[seen])[:, None], 0.0
        for q, sign in enumerate(both_signs(self.transfer.max_q)):
            matrix = scale * (own - look_up @ _to_entries(q, nodes, angles))
            # A single product takes half the time of one for each degree.
            rest = matrix @ values[q].transpose(1, 0, 2).reshape(len(nodes), -1)
            squares = np.einsum("on,on->n", rest, rest).reshape(self.light.shape)
            total += float(sign * np.sum(self.light * squares)) / (2 * np.pi)
        return total

    def missing(self, counts: Counts, factors: Array) -> float:
        """Return the energy of the reflected light that some of the functions do not represent.

        `counts` are the number of functions of each q. `factors`, of shape (order + 1,), are what
        each degree of the light that is kept is multiplied with.

        Returns the integral of the squared error over visible views, from tables as renderers read
        them, for the degrees that the transfer functions have.
        """
        light, held = self.light[: len(factors)].T, 0.0
        for q, used in enumerate(counts):
            parts = self.scaled_parts(q, used, factors).transpose(2, 0, 1)
            projected, products = self._held(q, used)
            gains = parts * (2 * projected[..., : len(factors)] - products @ parts)
            held += (2 if q else 1) * float(np.sum(light * gains.sum(axis=1)))
        return self.whole() - held

    def scaled_parts(self, q: int, used: int, factors: Array) -> Array:
        """Return `parts` of the first functions of an order q, times factors of their degrees."""
        return self.parts[q][:used, : len(factors)] * factors[:, None]

    def looked_up(self, q: int, used: int) -> Array:
        """Return the first functions of an order q at the nodes, as renderers look them up.

        Returns an array of shape (used, n, 3), in the units of the transfer functions.
        """
        known = self._known_look_ups.get(q)
        count = 0 if known is None else len(known)
        if count < used:
            # Maps of ever less error use a few more each.
            last = min(-(-used // _AT_ONCE) * _AT_ONCE, len(self.vectors[q]))
            more = self._looked_up(self.table(q, count, last))
            if (albedo := self.albedo_table()) is not None:
                more = more * self._looked_up(albedo[None])
            known = more if known is None else np.concatenate([known, more])
            self._known_look_ups[q] = known
        assert known is not None
        return known[:used]

    @cached_property
    def _known_look_ups(self) -> dict[int, Array]:
        return {}

    def _held(self, q: int, used: int) -> tuple[Array, Array]:
        """Return what tells the error of functions of an order q that are read from tables.

        Returns the projections of the transfer functions on them, shape (3, used, F+1); and their
        products as `_products` has them, shape (3, used, used).
        """
        known = self._known_held.get(q)
        if known is None or known[0].shape[1] < used:
            self.looked_up(q, used)
            by_channel = self._known_look_ups[q].transpose(2, 0, 1)
            weighted = by_channel * self.weights
            known = (
                weighted @ self.transfer.values[q].transpose(2, 1, 0),
                2 * np.pi * weighted @ by_channel.swapaxes(1, 2),
            )
            self._known_held[q] = known
        return known[0][:, :used], known[1][:, :used, :used]

    @cached_property
    def _known_held(self) -> dict[int, tuple[Array, Array]]:
        return {}

    @cached_property
    def known(self) -> Array:
        """The BRDF's energy of each degree over visible views, shape (F+1, 3)."""
        return self._energy(self.transfer.values)

    def _energy(self, values: Iterable[Array]) -> Array:
        """Integrate the squares of transfer functions over visible views, shape (F+1, 3).

        `values` are those of each order q, of shape (F+1, n, 3).
        """
        squares = [np.einsum("loc,loc,o->lc", each, each, self.weights) for each in values]
        return np.tensordot(both_signs(self.transfer.max_q), squares, 1) / (2 * np.pi)

    @cached_property
    def visible(self) -> float:
        """The part of the BRDF's energy that is in visible views; 1 about the mirror direction.

        About the normal, a BRDF goes on below the horizon, where nobody sees it.
        """
        every = self.transfer.degree_energy.sum()
        return float(self.known.sum() / every) if every > 0 else 1.0

    @cached_property
    def total_energy(self) -> float:
        """The BRDF's energy in visible views, of all degrees.

        Where it is divided by its albedo it is the quotient's, of which the same part is unknown.
        """
        whole = float(self.visible * self.transfer.total_energy.sum())
        known = float(self.known.sum())
        if self.albedo is None or known <= 0:
            return whole
        quotients = (values / self.albedo for values in self.transfer.values)
        return whole * float(self._energy(quotients).sum()) / known

    def whole(self) -> float:
        """Return the energy of the reflected light over visible views, of the known degrees."""
        return float(np.sum(self.light * self.known))

    def captured(self, counts: Counts) -> Array:
        """Return the BRDF's own energy in some functions, up to each degree, shape (F+1,)."""
        return np.sum([self._own[q][used] for q, used in enumerate(counts)], axis=0)

    def kept(self, counts: Counts) -> Array:
        """Return the energy of the reflected light in some functions, up to each degree."""
        return np.sum([self._reflected[q][used] for q, used in enumerate(counts)], axis=0)


def _to_entries(q: int, nodes: Array, angles: Array) -> Array:
    """The matrix from a function of an order q at nodes to the entries of its table."""
    matrix = interpolation_matrix(nodes, angles, odd=q % 2 == 1)
    if q > 0:  # a function of the azimuth has no value where there is none
        matrix[0] = 0.0
    return matrix


def directional_albedo(transfer: TransferFunctions) -> Array:
    """Return the integral of a transfer function over the light, for each node, shape (n, 3)."""
    albedo = transfer.values[0, 0].astype(float) / np.sqrt(np.pi)
    if transfer.azimuths.size:  # the imaginary parts have none of their own
        albedo = np.tile(albedo[: len(albedo) // 2], (2, 1))
    floor = 1e-3 * np.max(albedo, axis=0)
    return np.asarray(np.maximum(albedo, np.maximum(floor, 1e-30)))
