"""How many functions and texels a map gets: from a tolerance, an error or a number of cubes."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field
from functools import cached_property
from math import inf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shrm_cli import reflected
from shrm_cli.arrays import Array
from shrm_cli.maps.coupling import bundle_coefficients
from shrm_cli.maps.joint import joint_error
from shrm_cli.maps.principal.functions import Spectrum
from shrm_cli.maps.principal.selection import Counts, best_counts, bundle_functions, cubes_of
from shrm_cli.maps.size import (
    TRIED_SIZES,
    Band,
    furthest_order,
    most_cubes,
    nothing_fits,
    sizes_of,
    stored_bytes,
    supported_order,
    total_error,
)
from shrm_cli.maps.view_lobes import SeenLobes
from shrm_cli.plan import policy
from shrm_cli.plan.search import ROUNDING, Row, fewest_bytes, least_errors
from shrm_cli.probe.lighting import Lighting
from shrm_cli.records import once_each, record
from shrm_cli.sphere.bilinear import bilinear_errors, lost_between_texels
from shrm_cli.vocabulary import MAX_PRINCIPAL_MAPS, Sampling

_FEW_TEXELS = 48
"""The most texels along an edge of cubes that are looked through instead of predicted."""


@record
class Form:
    """How many functions a map has, how large its cubes are, and what errors that makes."""

    counts: Counts
    """The number of functions of each azimuthal order."""
    size: int
    band: Band
    """The degrees of the light that are kept."""
    error: float
    """The predicted relative RMS error of the functions and the orders."""
    find_filter_error: Callable[[], float] = field(repr=False, compare=False)
    """Finds that of looking the map up bilinearly, which takes far longer."""

    @cached_property
    def filter_error(self) -> float:
        """The predicted relative RMS error of looking the map up bilinearly."""
        return self.find_filter_error()

    @property
    def carried(self) -> int:
        """The largest order of the light that is kept."""
        return self.band.last

    @property
    def cubes(self) -> int:
        """The number of RGB cubes."""
        return cubes_of(self.counts)

    @property
    def bytes(self) -> int:
        return stored_bytes(self.size, self.cubes)

    @property
    def least_error(self) -> float:
        return total_error(self.error)

    @cached_property
    def total_error(self) -> float:
        return total_error(self.error, self.filter_error)


@record
class Planner:
    """The choices for one lobe."""

    spectrum: Spectrum
    lighting: Lighting
    """The light, to at least the order of the transfer functions."""
    sampling: Sampling = "center"

    @cached_property
    def whole(self) -> float:
        """The energy of the reflected light over visible views."""
        return self.spectrum.whole() + self.spectrum.visible * sum(self._beyond)

    @cached_property
    def _beyond(self) -> tuple[float, float]:
        return reflected.energies_beyond(self.lighting, self.spectrum.transfer)

    @property
    def aside(self) -> float:
        """The energy in higher azimuthal orders than the known ones, relative to that in these."""
        return self.spectrum.visible * self._beyond[1] / max(self.spectrum.whole(), 1e-300)

    @cached_property
    def seen(self) -> SeenLobes:
        """The lobes of which maps leave something out."""
        beyond = self.visible_beyond(np.sum(self.spectrum.light * self.spectrum.known, axis=1))
        return SeenLobes.of(self.spectrum.transfer, self.spectrum.center, beyond)

    @cached_property
    def choices(self) -> list[Counts]:
        """The best functions for every number of cubes, from one on."""
        most = 1 if self._is_zonal else MAX_PRINCIPAL_MAPS
        return best_counts(self.spectrum.energies, most)

    @cached_property
    def _places(self) -> Array | None:
        """Where on the faces of a cube the finest details of the first function are."""
        return reflected.fine_places(self.lighting, self.spectrum.parts[0][0])

    @cached_property
    def _is_zonal(self) -> bool:
        energies = self.spectrum.energies
        return bool(energies.sum() - energies[0, 0] <= 1e-12 * energies.sum())

    @once_each
    def form(self, counts: Counts, size: int, is_exact: bool = False) -> Form:
        """Return the form with these functions and cubes of this size, and its errors.

        The exact error counts that the functions are tabulated, and what look-ups in small cubes
        really miss; the other takes far less time.
        """
        energies, beyond = self._by_degree(counts)
        band = self._band(beyond, size)
        if is_exact:
            missing = self.spectrum.missing(counts, band.factors)
            left = missing + self.whole - self.spectrum.whole()
        else:
            left = self.whole - float(
                energies[: band.last + 1] @ reflected.kept_energy(band.factors)
            )
        return Form(
            counts, size, band, self._relative(left),
            lambda: self._relative(self._lost(counts, band, size, is_exact)),
        )  # fmt: skip

    @once_each
    def _by_degree(self, counts: Counts) -> tuple[Array, Array]:
        """Return the energy of each degree in some functions, and what is `visible_beyond` it.

        Cubes of all sizes share both.
        """
        energies = np.diff(self.spectrum.kept(counts), prepend=0.0)
        return energies, self.visible_beyond(energies)

    def _relative(self, energy: float) -> float:
        """Return the RMS error of an energy, relative to the reflected light."""
        return float(np.sqrt(max(energy, 0.0) / max(self.whole, 1e-300)))

    def _lost(self, counts: Counts, band: Band, size: int, is_exact: bool) -> float:
        """Return the energy that bilinear filtering takes from cubes or adds to them."""
        last = band.last
        light = self.spectrum.light[: last + 1] * band.factors[:, None] ** 2
        lost = [np.empty((count, last + 1, 3)) for count in counts]
        for p, bundles in bundle_functions(counts).items():
            parts = self.spectrum.bundle_parts(bundles, last)
            by_order = reflected.filtered_parts(parts, self._filter(size, p)).transpose(1, 2, 0, 3)
            for q, used in enumerate(zip(*bundles, strict=True)):
                lost[q][list(used)] = by_order[q]
        predicted = sum(self.spectrum.shown_energy(q, each, light) for q, each in enumerate(lost))
        if not is_exact or size > _FEW_TEXELS:
            return predicted
        return predicted * self._misjudged(counts, band, size)

    @once_each
    def _filter(self, size: int, p: int) -> Array:
        """Return the `filter_matrices` of what look-ups lose in bundles of a degree p."""
        order = min(furthest_order(size, 0), self.spectrum.transfer.order_f)
        errors = bilinear_errors(order + p, size, self.sampling, self._places)
        return reflected.filter_matrices(np.sqrt(errors), order, p)

    def _misjudged(self, counts: Counts, band: Band, size: int) -> float:
        """Return what look-ups miss of the cubes, in units of what is predicted.

        Lamps are in the same place in all channels, so that the brightest one tells enough.
        """
        order = band.last + len(counts) - 1
        errors = bilinear_errors(order, size, self.sampling, self._places)
        light = self.spectrum.light[: band.last + 1]
        channel = int(np.argmax(light.sum(axis=0)))
        one = slice(channel, channel + 1)
        # All cubes are looked through at once, because each order has tables of its own.
        series = np.zeros(((band.last + len(counts)) ** 2, cubes_of(counts)))
        predicted, first = 0.0, 0
        for bundles in bundle_functions(counts).values():
            kept = self.spectrum.bundle_parts(bundles, band.last)
            kept *= band.factors[:, None, None, None]
            found = bundle_coefficients(self.lighting.coefficients[:, one], kept[..., one])
            flat = found.reshape(len(found), -1)
            series[: len(flat), first : first + flat.shape[1]] = flat
            first += flat.shape[1]
            energies = reflected.cube_energies(light * (np.arange(3) == channel), kept)
            predicted += float(errors[: len(energies)] @ energies)
        missed = float(lost_between_texels(series, size, self.sampling).sum())
        return missed / predicted if predicted > 0 else 1.0

    def _band(self, beyond: Array, size: int) -> Band:
        """Return the degrees that are visible, as far as the texels support them.

        `beyond` is what is `visible_beyond` each degree.
        """
        order_p = 0 if self._is_zonal else 1
        ends = supported_order(size, order_p), furthest_order(size, order_p)
        known = min(self.spectrum.transfer.order_f, self.lighting.resolved_order)
        return Band.of(beyond, *ends, known)

    def visible_beyond(self, energies: Array) -> Array:
        """Return the RMS after each degree of light with an energy in each, relative to its mean.

        `energies` are of shape (F+1,).

        Returns an array of shape (F+1,): 0 for black light.
        """
        # A function may be wrong at some degrees, and take less than nothing from their error.
        beyond = np.append(np.cumsum(np.maximum(energies, 0)[::-1])[-2::-1], 0.0)
        rms = np.sqrt(beyond) / (4 * np.pi)
        return rms / self._mean if self._mean > 0 else np.zeros_like(rms)

    @cached_property
    def _mean(self) -> float:
        """The mean of the reflected light, which is that of the light, times that of the albedo."""
        albedo = self.spectrum.weights @ self.spectrum.transfer.values[0, 0] / np.sqrt(np.pi) / 2
        brightest = np.max(np.abs(self.lighting.coefficients[0] * albedo))
        return float(brightest / np.sqrt(4 * np.pi))

    def for_tolerance(self, eps: float) -> tuple[Counts, int, float]:
        """Find the least functions, and then the least order F, that miss a part of the energy.

        It is the BRDF's own energy, as for SHRMs, and not that of the reflected light.

        Returns `counts`; `order_f`; and `captured`, the part of the energy that both capture.
        """
        total = max(self.spectrum.total_energy, 1e-300)
        goal = (1 - eps) * total
        for counts in self.choices:
            by_degree = self.spectrum.captured(counts)
            if by_degree[-1] >= goal:
                break
        else:
            goal = (1 - eps) * by_degree[-1]
        order = int(np.argmax(by_degree >= goal))
        return counts, order, float(by_degree[order] / total)

    def captured(self, counts: Counts, order: int) -> float:
        """Return the part of the BRDF's energy that functions capture up to an order."""
        total = max(self.spectrum.total_energy, 1e-300)
        return float(self.spectrum.captured(counts)[order] / total)

    def with_maps(self, maps: int, size: int) -> Form:
        """Return the best form of at most so many cubes of a size."""
        return self.form(self.choices[min(maps, len(self.choices)) - 1], size)

    def best_within(self, max_size: int, largest: int) -> Form:
        """Return the form of the fewest cubes that has nearly the least total error.

        `max_size` is the most bytes, enough for a cube of some tried size. `largest` is the most
        texels along a face's edge.
        """
        sizes = [texels for texels in TRIED_SIZES if texels <= largest]
        forms = least_errors(self.rows(max_size, sizes))
        least = min(form.total_error for form in forms)
        # Light that is no number has no error that is one, and is refused elsewhere.
        good = [form for form in forms if not form.total_error > policy.NEARLY_AS_GOOD * least]
        return min(good, key=lambda form: form.cubes)

    def rows(self, max_size: int, sizes: Sequence[int]) -> Iterator[Row[Form]]:
        """Return the forms of each size of cubes that fit into a number of bytes."""

        def row(texels: int) -> Row[Form]:
            return Row(
                min(most_cubes(texels, max_size), len(self.choices)),
                lambda index: stored_bytes(texels, index + 1),
                lambda index: self.form(self.choices[index], texels),
            )

        return map(row, sizes)

    def best_fitting(self, max_size: int, size: int | None, terms: int = 1) -> Form:
        """Return the form of the least error of all that fit into a number of bytes.

        Raises ArgumentError if none fits; `terms` tells how many terms the bytes are for.
        """
        forms = least_errors(self.rows(max_size, sizes_of(size)))
        if not forms:
            raise nothing_fits(size, terms)
        return min(forms, key=lambda form: form.total_error)

    def nearly_best(self, max_size: int, size: int | None) -> Form:
        """Return a form of few bytes whose error is nearly that of the `best_fitting`."""
        error = policy.NEARLY_BEST * self.best_fitting(max_size, size).total_error
        # What a tolerance makes stays as it is, byte for byte, so that nothing near is looked at.
        found = fewest_bytes(self.rows(max_size, sizes_of(size)), error, look_near=False)
        assert found is not None
        return found[0]


# ---- the forms of terms that together take the fewest bytes for the error of a sum ---------------
# A diffuse term needs a single small cube, and a glossy one many. How many bytes one takes for its
# part of the error depends on the light, so that the forms of all terms are compared together.


_FIRST_BYTES = 2**16
"""The bytes that the forms of several terms may have at first; they double until the error is kept,
so that not all forms have to be judged."""
_NEARLY_ALL = 1 / 3
"""What functions may miss, in units of what their tables do, where those alone are too coarse."""


class Term(NamedTuple):
    """A term of a BRDF, with what the light makes of it, and a form of its map."""

    planner: Planner
    form: Form


@record
class Joint:
    """A form of each term."""

    forms: tuple[Form, ...]
    shares: tuple[float, ...] = (1.0,)
    """The RMS of the light of each term, relative to that of all."""

    @property
    def least_error(self) -> float:
        return joint_error(self.shares, [form.least_error for form in self.forms], 1.0)

    @cached_property
    def total_error(self) -> float:
        return joint_error(self.shares, [form.total_error for form in self.forms], 1.0)

    @property
    def bytes(self) -> int:
        return sum(form.bytes for form in self.forms)


@record(eq=False)
class Sharing:
    """The choices for all lobes of a BRDF."""

    planners: Sequence[Planner]
    """One for each term."""
    coherence: float = 1.0
    """The RMS of the light of all terms, relative to the sum of the RMS of each."""

    @cached_property
    def strengths(self) -> Array:
        """The RMS of the light that each term reflects."""
        return np.sqrt([planner.whole for planner in self.planners])

    @property
    def whole(self) -> float:
        """The RMS of the light that all terms reflect together."""
        return float(self.strengths.sum()) * self.coherence

    @cached_property
    def shares(self) -> tuple[float, ...]:
        """The RMS of the light of each term, relative to that of all."""
        if len(self.planners) == 1:
            return (1.0,)
        return tuple((self.strengths / max(self.whole, 1e-300)).tolist())

    def errors(self, forms: Sequence[Form]) -> tuple[float, float]:
        """Return the error of a sum, and that of looking it up; terms count as independent."""
        predicted = joint_error(self.strengths, [form.error for form in forms], self.whole)
        filtered = joint_error(self.strengths, [form.filter_error for form in forms], self.whole)
        return predicted, filtered

    def joint(self, forms: tuple[Form, ...], is_exact: bool = False) -> Joint:
        """Return forms with the error of their sum; the exact one takes longer (`Planner.form`)."""
        if is_exact:
            pairs = zip(self.planners, forms, strict=True)
            forms = tuple(planner.form(each.counts, each.size, True) for planner, each in pairs)
        return Joint(forms, self.shares)

    def rows(self, max_size: int, sizes: Sequence[int] = TRIED_SIZES) -> Iterator[Row[Joint]]:
        """Yield all that fits into a number of bytes, and that might be best.

        The forms of a single term come in a row for each size of cubes; those of several terms in
        one, with every combination that has less error than all of fewer bytes.
        """
        if len(self.planners) == 1:
            for row in self.planners[0].rows(max_size, sizes):
                yield row.mapped(lambda form: self.joint((form,)))
            return
        front = self._front(max_size, sizes)
        yield Row(len(front), lambda index: front[index].bytes, front.__getitem__)

    def _front(self, max_size: int, sizes: Sequence[int]) -> list[Joint]:
        """Return the combinations of forms that no other one beats, by rising bytes."""
        found: list[tuple[Form, ...]] = [()]
        costs, squares = np.zeros(1, dtype=np.int64), np.zeros(1)
        for planner, part in zip(self.planners, self.shares, strict=True):
            forms = _best(form for row in planner.rows(max_size, sizes) for form in row.every())
            own_costs = np.array([form.bytes for form in forms], dtype=np.int64)
            own_squares = np.square([part * form.total_error for form in forms])
            costs = np.add.outer(costs, own_costs).ravel()
            squares = np.add.outer(squares, own_squares).ravel()
            kept = _undominated(costs, squares)
            kept = kept[costs[kept] <= max_size]
            found = [(*found[k // len(forms)], forms[k % len(forms)]) for k in kept]
            costs, squares = costs[kept], squares[kept]
        return [Joint(forms, self.shares) for forms in found]

    def within_error(self, error: float, max_size: int, size: int | None) -> tuple[Joint, bool]:
        """Find the forms of the fewest bytes with a total error; else the best ones that fit.

        `error` is the relative RMS error of the reflected light that may be made by all causes.

        Returns `joint`; and `is_met`, whether its error is at most the one that was asked for.
        """
        sizes = sizes_of(size)
        most = max_size if len(self.planners) == 1 else min(_FIRST_BYTES, max_size)
        found = fewest_bytes(self.rows(most, sizes), error)
        while most < max_size and not (found and found[1]):
            most = min(2 * most, max_size)
            found = fewest_bytes(self.rows(most, sizes), error)
        if found is None:
            raise nothing_fits(size, len(self.planners))
        return found

    def kept(self, error: float, max_size: int, size: int | None) -> tuple[Joint, bool]:
        """Find the least forms that keep an error with their tables, which searches leave out."""
        allowed = error
        for _ in range(policy.TRIES):
            found, is_met = self.within_error(allowed, max_size, size)
            exact = self.joint(found.forms, is_exact=True)
            # What tables add to an error stays, however many functions there are.
            added = exact.total_error**2 - found.total_error**2
            if not is_met or exact.total_error <= error:
                break
            # Functions that miss a third of what tables do make nearly the least error there is.
            left = max(error**2 - added, added * _NEARLY_ALL**2)
            if left >= allowed**2:
                break
            allowed = 0.999 * sqrt(left)
        return exact, is_met and exact.total_error <= error * ROUNDING


def _best(forms: Iterable[Form]) -> list[Form]:
    """Return the forms that have less error than all of fewer bytes, by rising bytes.

    What look-ups miss is found of those alone that might be among them.
    """
    found: list[Form] = []
    for form in sorted(forms, key=lambda form: (form.bytes, form.least_error)):
        least = found[-1].total_error if found else inf
        if form.least_error >= least or form.total_error >= least:
            continue
        if found and found[-1].bytes == form.bytes:
            found.pop()
        found.append(form)
    return found


def _undominated(costs: NDArray[np.int64], squares: Array) -> NDArray[np.intp]:
    """Return what has less error than all that costs less, by rising costs."""
    order = np.lexsort((squares, costs))
    least = np.minimum.accumulate(squares[order])
    # What is no number is not left out: such light is refused elsewhere.
    return order[~(np.diff(least, prepend=np.inf) >= 0)]
