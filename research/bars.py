"""What is asked of maps on the page on what is seen, and which maps miss it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from research.seen import AFTER, BEFORE, PRINCIPAL, SAME_BYTES, VIEW_ALONE, Seen, find

ZONAL_P95 = 0.03
"""The largest p95 of lobes that do not depend on the view."""
OTHER_P95 = 1.15
"""The largest p95 of other lobes, in units of that of the map with the same P alone."""
PRINCIPAL_P95 = 0.5
"""The largest p95 of principal maps, in units of that of an SHRM that ends at F."""
PRINCIPAL_RMS = {"ggx": 0.5, "microfacet": 0.7}
"""The largest RMS error of principal maps of a model at the same bytes, in units of that of the
default SHRM."""
PREDICTED = 0.1
"""How far a predicted error may be from the measured one, in units of the predicted one."""


@dataclass(frozen=True)
class Case:
    """One map, and one number of it.

    Attributes
    ----------
    spec, probe, way : str
        As `Seen` has them.
    value, limit : float
        The number, and the largest that it may be.
    """

    spec: str
    probe: str
    way: str
    value: float
    limit: float

    @property
    def is_kept(self) -> bool:
        return self.value <= self.limit


@dataclass(frozen=True)
class Bar:
    """One thing that is asked of maps.

    Attributes
    ----------
    text : str
        A sentence that says what.
    cases : callable
        From all rows to the cases that it is asked of.
    """

    text: str
    cases: Callable[[Sequence[Seen]], list[Case]]


def _zonal_p95(rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        if row.way == AFTER and row.zonal:
            yield row, row.p95, ZONAL_P95


def _zonal_negative(rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        if row.way == AFTER and row.zonal:
            yield row, row.negative, 0.0


def _view_alone(rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        if row.way == AFTER and not row.zonal:
            yield row, row.p95, OTHER_P95 * find(rows, row.spec, row.probe, VIEW_ALONE).p95


def _principal_p95(way: str, rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        if row.way == way:
            yield row, row.p95, PRINCIPAL_P95 * find(rows, row.spec, row.probe, BEFORE).p95


def _principal_rms(rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        part = PRINCIPAL_RMS.get(row.spec.partition(":")[0])
        if row.way == SAME_BYTES and part is not None:
            yield row, row.rms, part * find(rows, row.spec, row.probe, AFTER).rms


def _predicted(rows: Sequence[Seen]) -> Iterator[tuple[Seen, float, float]]:
    for row in rows:
        if row.way in (AFTER, PRINCIPAL, SAME_BYTES) and row.gpu_predicted > 0:
            yield row, abs(row.gpu_rms / row.gpu_predicted - 1), PREDICTED


def _bar(
    text: str, numbers: Callable[[Sequence[Seen]], Iterator[tuple[Seen, float, float]]]
) -> Bar:
    def cases(rows: Sequence[Seen]) -> list[Case]:
        return [
            Case(row.spec, row.probe, row.way, value, limit) for row, value, limit in numbers(rows)
        ]

    return Bar(text, cases)


BARS = (
    _bar(
        f"Lobes that do not depend on the view have a p95 of at most {ZONAL_P95:.0%}.", _zonal_p95
    ),
    _bar("Lobes that do not depend on the view have no negative pixel.", _zonal_negative),
    _bar(
        f'Other lobes have a p95 of at most {OTHER_P95:g} times that of "{VIEW_ALONE}".',
        _view_alone,
    ),
    _bar(
        f"Principal maps of as many cubes have a p95 of at most {PRINCIPAL_P95:g} times that of "
        f'"{BEFORE}".',
        partial(_principal_p95, PRINCIPAL),
    ),
    _bar(
        f"Principal maps of the same bytes have a p95 of at most {PRINCIPAL_P95:g} times that of "
        f'"{BEFORE}".',
        partial(_principal_p95, SAME_BYTES),
    ),
    _bar(
        "Principal maps of the same bytes have an RMS error of at most "
        + " and ".join(f"{part:g} ({model})" for model, part in PRINCIPAL_RMS.items())
        + f' times that of "{AFTER}".',
        _principal_rms,
    ),
    _bar(
        f"The errors on a GPU of default and principal maps are within {PREDICTED:.0%} of the "
        "predicted ones.",
        _predicted,
    ),
)
