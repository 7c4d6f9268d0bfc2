"""What is asked of a map: resolved once, and recorded so that it can be asked again."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.request import Request, recorded_defaults
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import AUTO, DEFAULT_SEEN, REPRESENTATIONS

SPEC = "ggx:roughness=0.5"
GIVEN = {
    "shrm": {"eps": 0.1, "frame": "local", "split": False, "compress": 3},
    "principal": {"error": 0.1, "size": np.int64(32), "max_size": "300kB"},
    "cabral": {"center": "normal", "order_p": 3},
    "kautz-mccool": {"slices": 5},
    "lightfield": {"domain": "angular", "source_height": 16, "views": 3},
    "irradiance": {"order_f": 3, "window": "hann", "form": "sh"},
    "splitsum": {"levels": (0.2, 1), "mapping": "filament"},
    "she": {"roughness": (0.3, 0.8), "law": "paper"},
    "product": {"order": 2, "texels": 16},
    AUTO: {"seen": 0.1, "sampling": "border"},
}
FIELDS = ("to", "eps", "error", "seen", "order_f", "order_p", "center", "frame", "size", "sampling",
          "max_size", "domain", "source_height")  # fmt: skip


@pytest.fixture(scope="module")
def probe():
    return Probe.from_array(np.ones((8, 16, 3)))


def asked(to, given, probe):
    needs_brdf = registry.description(to).needs_brdf
    return Request.of(to, {**given, **({"brdf": SPEC} if needs_brdf else {})}, probe)


def test_every_form_is_among_them():
    assert GIVEN.keys() == {AUTO, *REPRESENTATIONS}


@pytest.mark.parametrize("to", GIVEN)
@pytest.mark.parametrize("is_plain", [True, False])
def test_what_is_recorded_asks_for_the_same_again(probe, to, is_plain):
    one = asked(to, {} if is_plain else GIVEN[to], probe)
    told = one.record(probe)
    assert told["reading"] == probe.reading()
    again = asked(to, {key: value for key, value in told.items() if key not in ("to", "reading")},
                  probe)  # fmt: skip
    assert again.record(probe) == told
    assert dict(again.own) == dict(one.own)
    if to != AUTO:  # of which what is asked for by default is recorded as if it had been given
        assert [getattr(again, name) for name in FIELDS] == [getattr(one, name) for name in FIELDS]


@pytest.mark.parametrize("to", GIVEN)
def test_what_is_given_comes_before_defaults(probe, to):
    found = asked(to, GIVEN[to], probe)
    for name, value in found.given.items():
        assert found.own.get(name, getattr(found, name, None)) == value
    assert found.given.keys() == GIVEN[to].keys()
    for name, value in recorded_defaults(to, found.given).items():
        if name not in found.given:
            recorded = found.record(probe)[name]
            assert recorded == value == asked(to, {}, probe).record(probe)[name]


def test_an_error_is_asked_for_instead_of_eps(probe):
    for name in ("error", "seen"):
        assert "eps" not in asked("shrm", {name: 0.1}, probe).record(probe)
    with pytest.raises(ArgumentError, match="`eps` does not apply with `error`, which chooses it"):
        asked("principal", {"error": 0.1, "eps": 0.2}, probe)
    assert asked("shrm", {}, probe).record(probe)["eps"] == asked("shrm", {}, probe).eps


def test_principal_maps_are_made_by_what_is_seen_unless_told_otherwise(probe):
    by_default = asked("principal", {"center": "auto"}, probe)
    assert by_default.seen == DEFAULT_SEEN
    assert by_default.record(probe)["seen"] == DEFAULT_SEEN
    assert "eps" not in by_default.record(probe)
    for given in ({"eps": 0.1}, {"maps": 3}, {"error": 0.1}):
        assert asked("principal", given, probe).seen is None
    assert asked("principal", {"seen": 0.2}, probe).seen == 0.2
    assert asked("shrm", {}, probe).seen is None


def test_auto_with_arguments_of_shrms_is_one(probe):
    assert asked(AUTO, {"eps": 0.1}, probe).to == "shrm"
    assert asked(AUTO, {"eps": None, "size": 16}, probe).to == AUTO


def test_nothing_of_it_changes(probe):
    found = asked("she", GIVEN["she"], probe)
    with pytest.raises(FrozenInstanceError):
        found.size = 8
    for values in (found.own, found.given):
        with pytest.raises(TypeError):
            values["law"] = "lobe"


def test_what_does_not_apply_is_refused(probe):
    with pytest.raises(ArgumentError, match="`views` applies with `to` lightfield"):
        asked("shrm", {"views": 3}, probe)
    with pytest.raises(ArgumentError, match="`brdf` is missing"):
        Request.of("shrm", {}, probe)
    with pytest.raises(ArgumentError, match="neither a BRDF nor"):
        Request.of("shrm", {"brdf": 3}, probe)
    assert repr(Request.of("shrm", {"brdf": parse_spec(SPEC)}, probe).brdf) == repr(
        parse_spec(SPEC)
    )
    with pytest.raises(ArgumentError, match="`seen` applies with `to` auto, shrm"):
        Request.of("irradiance", {"seen": 0.05}, probe)


@pytest.mark.parametrize(("to", "name"), [("splitsum", "levels"), ("she", "roughness")])
def test_text_is_no_row_of_numbers(to, name, probe):
    """Its digits were taken for numbers, one by one."""
    with pytest.raises(ArgumentError, match=f"^`{name}` '11' is not"):
        Request.of(to, {name: "11"}, probe)
