"""Maps of a process that has made others before, and of threads beside each other: the same."""

import gc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from shrm_cli.arrays import Memo
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe

FORMS = [
    ("shrm", {"brdf": "microfacet:sigma=0.4"}),
    ("shrm", {"brdf": "phong:exponent=8", "frame": "local"}),
    ("shrm", {"brdf": "ggx:roughness=0.6", "eps": 0.2}),
    ("irradiance", {}),
]


def memories():
    return [each for each in gc.get_objects() if isinstance(each, Memo)]


def probes(rng, count):
    """Lights of different sharpness, so that maps of several orders are made."""
    shapes = [rng.random((32, 64, 3)) ** (1 + 4 * k) for k in range(count)]
    return [Probe.from_array(light.astype(np.float32)) for light in shapes]


def values(probe, to, given):
    made = prefilter_with_facts(probe, to, given)
    planes = [part.channels for part in made.map.encode()]
    return {f"{k} {name}": plane for k, part in enumerate(planes) for name, plane in part.items()}


def same(one, other):
    return one.keys() == other.keys() and all(np.array_equal(one[k], other[k]) for k in one)


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.parametrize(("to", "given"), FORMS)
def test_what_is_kept_changes_no_map(rng, to, given):
    lights = probes(rng, 4)
    cold = []
    for light in lights:
        for memory in memories():
            memory.clear()
        cold.append(values(light, to, given))
    for light, expected in zip(reversed(lights), reversed(cold), strict=True):
        assert same(values(light, to, given), expected)


def test_threads_share_what_is_kept(rng):
    lights = probes(rng, 4)
    expected = [values(light, *FORMS[0]) for light in lights]
    for memory in memories():
        memory.clear()
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda light: values(light, *FORMS[0]), lights * 4))
    assert all(map(same, found, expected * 4))


def test_a_second_map_for_the_same_brdf_samples_it_no_more(rng, monkeypatch):
    (one,) = probes(rng, 1)
    values(one, *FORMS[0])
    monkeypatch.setattr("shrm_cli.brdf.transfer.compute_coefficients", None)
    monkeypatch.setattr("shrm_cli.brdf.lobe_expansion.lobe_width", None)
    values(one, *FORMS[0])
    before = sum(memory.bytes for memory in memories())
    values(one, *FORMS[0])
    assert sum(memory.bytes for memory in memories()) == before
