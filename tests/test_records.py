"""Records do as frozen dataclasses do; `dataclasses` itself is the judge."""

import copy
import dataclasses
import inspect
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.records import MOST_NUMBERS, once_each, record


def both(body, **options):
    """The same class as a frozen dataclass and as a record."""
    made = []
    for decorate in (dataclass(frozen=True, **options), record(**options)):
        found = type("Found", (), {**body, "__annotations__": dict(body["__annotations__"])})
        made.append(decorate(found))
    return made


BODY = {
    "__annotations__": {"a": int, "b": str, "c": list, "d": float, "e": int},
    "b": "none",
    "c": field(default_factory=list, compare=False),
    "d": field(default=2.0, kw_only=True, repr=False),
    "e": field(default=7, init=False),
}
CALLS = [((1,), {}), ((1, "x", [3]), {"d": 4.0}), ((), {"a": 2, "c": [1]}), ((1,), {"b": "y"})]
FAULTS = [((), {}), ((1,), {"a": 2}), ((1, "x", [], 4.0), {}), ((1,), {"z": 1}), ((1,), {"e": 1})]


@pytest.mark.parametrize(("values", "named"), CALLS)
@pytest.mark.parametrize("eq", [True, False])
def test_a_record_is_a_frozen_dataclass(values, named, eq):
    expected, found = (cls(*values, **named) for cls in both(BODY, eq=eq))
    assert dataclasses.asdict(found) == dataclasses.asdict(expected)
    assert repr(found) == repr(expected)
    assert [each.name for each in fields(found)] == [each.name for each in fields(expected)]
    changed = replace(found, b="changed")
    assert (changed.b, changed.a, changed.d) == ("changed", found.a, found.d)
    assert (found == copy.copy(found)) is (expected == copy.copy(expected)) is eq
    assert (found == replace(found, c=[9])) is (expected == replace(expected, c=[9])) is eq
    assert found != changed
    assert found != expected
    assert inspect.signature(type(found)).parameters.keys() == {"a", "b", "c", "d"}
    assert (hash(found) == hash(copy.copy(found))) is eq


@pytest.mark.parametrize(("values", "named"), FAULTS)
def test_wrong_fields_are_refused(values, named):
    """Those of dataclasses raise a `TypeError`; ours are of the library, as `Viewer` is."""
    for cls in both(BODY):
        with pytest.raises((TypeError, ArgumentError)) as caught:
            cls(*values, **named)
    assert caught.type is ArgumentError


def test_nothing_is_set_or_deleted():
    for cls in both(BODY):
        one = cls(1)
        for name in ("a", "new"):
            with pytest.raises(FrozenInstanceError):
                setattr(one, name, 2)
        with pytest.raises(FrozenInstanceError):
            del one.a
        assert one.a == 1


def test_default_lists_are_not_shared():
    _, cls = both(BODY)
    assert cls(1).c is not cls(1).c


@record
class Base:
    """A record with a check."""

    a: int
    b: tuple[int, ...] = ()

    def __post_init__(self):
        if self.a < 0:
            raise ValueError("negative")


@record
class Derived(Base):
    """A record of a record."""

    c: str = "c"

    def __repr__(self):
        return "own"


def test_records_inherit_fields_checks_and_own_methods():
    found = Derived(1, (2,), "x")
    assert (found.a, found.b, found.c, repr(found)) == (1, (2,), "x", "own")
    assert found == Derived(1, c="x", b=(2,))
    assert found != Base(1, (2,))
    with pytest.raises(ValueError, match="negative"):
        Derived(-1)
    assert copy.deepcopy(found) == found  # as processes hand them to each other
    assert {found: 1}[Derived(1, (2,), "x")] == 1


def test_an_array_of_many_numbers_is_text_by_its_shape():
    """A map that is typed at a prompt would fill the screen with its texels."""
    made = record(type("Found", (), {"__annotations__": {"a": np.ndarray, "b": tuple}}))
    assert repr(made(np.eye(3), (made(np.zeros((6, 8, 8)), ()),))) == (
        f"Found(a={np.eye(3)!r}, b=(Found(a=<6 x 8 x 8 float64>, b=()),))"
    )
    few, many = np.zeros(MOST_NUMBERS), np.zeros(MOST_NUMBERS + 1, np.float32)
    assert repr(made(few, ())) == f"Found(a={few!r}, b=())"
    assert repr(made(many, ())) == f"Found(a=<{MOST_NUMBERS + 1} float32>, b=())"
    shape = f"<{MOST_NUMBERS + 1} float32>"
    assert repr(made(few, (many, ("x", many)))) == f"Found(a={few!r}, b=({shape}, ('x', {shape})))"
    assert repr(made(few, (many,))) == f"Found(a={few!r}, b=({shape},))"


def test_what_is_found_once_is_found_by_each_instance_and_for_each_argument():
    asked = []

    @record
    class Counting:
        first: int

        @once_each
        def plus(self, second, third=0):
            asked.append((self.first, second, third))
            return self.first + second + third

    one, two = Counting(1), Counting(2)
    assert [one.plus(1), two.plus(1), one.plus(2), one.plus(1), one.plus(1, third=5)] == [
        2, 3, 3, 2, 7,
    ]  # fmt: skip
    assert asked == [(1, 1, 0), (2, 1, 0), (1, 2, 0), (1, 1, 5)]
    assert replace(one, first=9).plus(1) == 10
    assert one == Counting(1)
