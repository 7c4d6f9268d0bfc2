"""Coefficients kept on disk: the same to the last bit, or computed anew."""

import hashlib
import json
import os
import sys
from subprocess import Popen

import numpy as np
import platformdirs
import pytest

from shrm_cli import settings
from shrm_cli.arrays import Memo
from shrm_cli.brdf import cache
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import (
    cached_coefficients,
    cached_first_order,
    cached_lobes,
    cached_transfer,
)
from shrm_cli.brdf.coefficients import BrdfCoefficients, FirstOrder
from shrm_cli.brdf.lobe_expansion import expand_lobes, first_order_f
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.sums import Sum
from shrm_cli.brdf.transfer import compute_coefficients, compute_transfer
from shrm_cli.errors import OutputError
from tests.brdf.caches import Counted, new_cache
from tests.cli.helpers import assert_refused, environment, run

ORDERS = (8, 3, 1e-3)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    return new_cache(tmp_path, monkeypatch)


def same(one, other):
    return one.samples == other.samples and all(
        np.array_equal(getattr(one, name), getattr(other, name))
        and getattr(one, name).dtype == getattr(other, name).dtype
        for name in ("values", "total_energy", "degree_energy")
    )


def entry(folder):
    (path,) = folder.iterdir()
    return path


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.4", "lambertian:albedo=0.3", "ggx:f0=gold"])
def test_what_was_computed_comes_back_to_the_last_bit(spec):
    brdf, compute = parse_spec(spec), Counted(compute_coefficients)
    first = cached_coefficients(brdf, *ORDERS, compute)
    again = cached_coefficients(parse_spec(spec), *ORDERS, compute)
    assert compute.calls == 1
    assert same(first, again)
    assert same(again, compute_coefficients(brdf, *ORDERS))
    for each in (first, again):
        with pytest.raises(ValueError, match="read-only"):
            each.values[0, 0, 0] = 7


def test_the_key_is_all_that_coefficients_depend_on(monkeypatch):
    compute = Counted(compute_coefficients)
    brdf = parse_spec("microfacet:sigma=0.4")
    cached_coefficients(brdf, *ORDERS, compute)
    for changed in [(9, 3, 1e-3), (8, 4, 1e-3), (8, 3, 1e-4)]:
        assert cached_coefficients(brdf, *changed, compute).order_f == changed[0]
    cached_coefficients(parse_spec("microfacet:sigma=0.41"), *ORDERS, compute)
    cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    cached_coefficients(brdf.recentered("normal"), *ORDERS, compute)
    assert compute.calls == 7
    monkeypatch.setattr(cache, "fingerprint", lambda folders: "another")
    cached_coefficients(brdf, *ORDERS, compute)
    assert compute.calls == 8
    cached_coefficients(brdf, *ORDERS, compute)
    assert compute.calls == 8


def test_quick_results_are_not_kept(folder, monkeypatch):
    monkeypatch.setattr(cache, "_SLOW", 1000)
    compute = Counted(compute_coefficients)
    for _ in range(2):
        cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    assert compute.calls == 2
    assert not folder.exists()


def test_grey_lobes_take_the_place_of_one_channel(folder, monkeypatch):
    monkeypatch.setattr(cache, "_in_memory", Memo(0))
    compute, sizes = Counted(compute_transfer), []
    for spec in ("ggx:f0=1", "ggx:f0=gold"):
        first, again = (cached_transfer(parse_spec(spec), 32, 4, 1e-3, compute) for _ in range(2))
        assert np.array_equal(first.values, again.values)
        assert first.values.strides[-1] == again.values.strides[-1]
        sizes.append(max(path.stat().st_size for path in folder.iterdir()))
    assert compute.calls == 2
    assert sizes[1] > 2.9 * sizes[0]
    assert sizes[1] < 4.2 * first.values.size  # which were sampled in single precision


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.4", "ggx:f0=gold", "ward:ax=0.2,ay=0.4"])
def test_lobes_are_kept_as_well(folder, spec):
    asked = (16, 3), (60, 18), (0.1, 0.7, 1.2)
    compute = Counted(expand_lobes)
    first, again = (cached_lobes(parse_spec(spec), *asked, compute) for _ in range(2))
    assert compute.calls == 1
    entry(folder)
    made = expand_lobes(parse_spec(spec), 16, 3, *asked[1:])
    for name in ("values", "energy", "error_theta", "error_phi"):
        for found in (first, again):
            np.testing.assert_array_equal(getattr(found, name), getattr(made, name))
    others = [((24, 3), *asked[1:]), ((16, 4), *asked[1:]), (asked[0], (63, 18), asked[2])]
    for other in [*others, (*asked[:2], (0.1, 0.7, 1.3))]:
        cached_lobes(parse_spec(spec), *other, compute)
    assert compute.calls == 5


def of_samples(brdf):
    return FirstOrder(first_order_f(brdf))


@pytest.mark.parametrize("spec", ["microfacet:sigma=0.1", "coated", "ggx:f0=gold"])
def test_the_first_order_is_kept_as_well(folder, monkeypatch, spec):
    """Of a coat it takes tables to find, which coefficients that are kept do not need.

    It is kept however quickly it was found, because whoever finds it loads modules for it.
    """
    monkeypatch.setattr(cache, "_SLOW", 1000)
    compute = Counted(of_samples)
    first, again = (cached_first_order(parse_spec(spec), compute) for _ in range(2))
    assert first == again == first_order_f(parse_spec(spec))
    assert compute.calls == 1
    text = entry(folder).read_bytes()
    start = text.index(b'{"')
    impossible = json.loads(text[start:])
    impossible["others"]["order_f"] = 10**6
    body = json.dumps(impossible).encode()
    body = len(body).to_bytes(4, "little") + body
    entry(folder).write_bytes(cache._MAGIC + hashlib.sha256(body).digest() + body)
    assert cached_first_order(parse_spec(spec), compute) == first
    assert compute.calls == 2


@pytest.mark.parametrize("on_disk", [True, False])
def test_a_process_keeps_what_it_computed(folder, monkeypatch, on_disk):
    memory = Memo(2**20)
    monkeypatch.setattr(cache, "_in_memory", memory)
    monkeypatch.setattr(cache, "_SLOW", 1000)
    compute = Counted(compute_coefficients)
    with settings.using(cache=on_disk):
        first, again = (
            cached_coefficients(parse_spec("phong"), *ORDERS, compute) for _ in range(2)
        )
        other = cached_coefficients(parse_spec("phong:exponent=3"), *ORDERS, compute)
        turned = cached_coefficients(parse_spec("phong").recentered("normal"), *ORDERS, compute)
        higher = cached_coefficients(parse_spec("phong"), 9, 3, 1e-3, compute)
    assert compute.calls == 4
    assert first is again
    assert len({id(each) for each in (first, other, turned, higher)}) == 4
    assert sum(each.values.nbytes for each in (first, other, turned, higher)) < memory.bytes


def test_brdfs_of_others_are_not_kept_in_memory(monkeypatch):
    """Two of them may have the same name and values, and differ all the same."""
    memory = Memo(2**20)
    monkeypatch.setattr(cache, "_in_memory", memory)
    compute = Counted(compute_coefficients)
    mine = Sum([(1, Foreign()), (1, parse_spec("lambertian"))])
    for brdf in (Foreign(), Foreign(), mine):
        cached_coefficients(brdf, *ORDERS, compute)
    assert compute.calls == 3
    assert len(memory) == 0


class Foreign(Brdf):
    """A BRDF of somebody else, whose code is not known here."""

    name, summary, source = "lambertian", "", ""

    def evaluate(self, light, view):
        return np.full((*np.broadcast_shapes(light.shape, view.shape)[:-1], 3), 0.1)


@pytest.mark.parametrize(
    "brdf", [Foreign(), Sum([(1, parse_spec("ggx")), (0.5, Foreign())])], ids=["alone", "in a sum"]
)
def test_brdfs_of_others_are_not_kept(folder, brdf):
    compute = Counted(compute_coefficients)
    for _ in range(2):
        cached_coefficients(brdf, *ORDERS, compute)
    assert compute.calls == 2
    assert not folder.exists()


def test_sums_are_kept():
    compute = Counted(compute_coefficients)
    for weights in [(1, 0.5), (1, 0.5), (1, 0.6)]:
        terms = [parse_spec("phong"), parse_spec("lambertian")]
        cached_coefficients(Sum(list(zip(weights, terms, strict=True))), *ORDERS, compute)
    assert compute.calls == 2


def test_it_can_be_switched_off(folder):
    compute = Counted(compute_coefficients)
    cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    before = entry(folder).stat().st_mtime_ns
    with settings.using(cache=False):
        for _ in range(2):
            cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    assert compute.calls == 3
    assert entry(folder).stat().st_mtime_ns == before
    cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    assert compute.calls == 3


def test_the_settings_can_name_its_folder(folder, tmp_path):
    compute = Counted(compute_coefficients)
    with settings.using(cache=tmp_path / "mine"):
        for _ in range(2):
            cached_coefficients(parse_spec("phong"), *ORDERS, compute)
        assert settings.cache_folder() == tmp_path / "mine"
        assert cache.cache_usage()[0] == 1
    assert compute.calls == 1
    assert not folder.exists()
    assert settings.cache_folder() == folder


# Damaged and hostile entries.


def rebuilt(path):
    """Whether an entry is computed anew, correctly, and whole again afterwards."""
    compute = Counted(compute_coefficients)
    brdf = parse_spec("microfacet:sigma=0.4")
    found = cached_coefficients(brdf, *ORDERS, compute)
    assert same(found, compute_coefficients(brdf, *ORDERS))
    again = cached_coefficients(brdf, *ORDERS, compute)
    assert same(found, again)
    return compute.calls == 1


@pytest.fixture
def kept(folder):
    cached_coefficients(parse_spec("microfacet:sigma=0.4"), *ORDERS, compute_coefficients)
    return entry(folder)


def test_truncated_entries_are_made_anew(kept):
    content = kept.read_bytes()
    for length in [0, 1, 19, 20, 52, 55, 60, 500, len(content) // 2, len(content) - 1]:
        kept.write_bytes(content[:length])
        assert rebuilt(kept)
        assert kept.read_bytes() == content


@pytest.mark.slow
def test_every_changed_bit_is_noticed(kept, rng):
    content = kept.read_bytes()
    for position in [*range(0, 60, 7), *rng.integers(0, len(content), 15)]:
        damaged = bytearray(content)
        damaged[position] ^= 1 << rng.integers(8)
        kept.write_bytes(damaged)
        assert rebuilt(kept)


@pytest.mark.parametrize("content", [b"hello", b"\0" * 10000, b"\xff" * 100, b"{}"])
def test_garbage_is_made_anew(kept, content):
    kept.write_bytes(content)
    assert rebuilt(kept)


def test_longer_entries_are_made_anew(kept):
    content = kept.read_bytes()
    kept.write_bytes(content + b"\0")
    assert rebuilt(kept)
    with open(kept, "r+b") as stream:
        stream.truncate(2**40)  # a terabyte of nothing is not read
    assert rebuilt(kept)
    assert kept.read_bytes() == content


def parts(content):
    """Header and arrays of an entry, by its description."""
    start = len(b"shrm coefficients 1\n") + 32
    length = int.from_bytes(content[start : start + 4], "little")
    return json.loads(content[start + 4 : start + 4 + length]), content[start + 4 + length :]


def forged(header, arrays):
    """An entry with a correct digest."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    body = len(text).to_bytes(4, "little") + text + arrays
    return b"shrm coefficients 1\n" + hashlib.sha256(body).digest() + body


def test_the_format_is_the_one_described(kept):
    header, arrays = parts(kept.read_bytes())
    expected = compute_coefficients(parse_spec("microfacet:sigma=0.4"), *ORDERS)
    assert header["shapes"]["values"] == [9, 4, 4, 3]
    assert np.array_equal(np.frombuffer(arrays, "<f8")[: 9 * 4 * 4 * 3], expected.values.ravel())
    assert forged(header, arrays) == kept.read_bytes()
    assert json.loads(header["key"])["values"] == {"sigma": 0.4}


def with_nan(header, arrays):
    return header, arrays[:80] + np.float64(np.nan).tobytes() + arrays[88:]


def with_shape(*shape):
    def change(header, arrays):
        return header | {"shapes": header["shapes"] | {"values": list(shape)}}, arrays

    return change


@pytest.mark.parametrize(
    "change",
    [
        with_nan,
        with_shape(9, 4, 12),
        with_shape(3, 4, 12, 3),
        with_shape(-1),
        with_shape(),
        with_shape(2**62, 2**62),
        with_shape("a"),
        with_shape(0),
        lambda header, arrays: (header | {"key": "another"}, arrays),
        lambda header, arrays: (header | {"shapes": []}, arrays),
        lambda header, arrays: (header | {"shapes": {}}, arrays),
        lambda header, arrays: (header | {"others": {}}, arrays),
        lambda header, arrays: (header | {"others": {"samples": [1, 2, 3], "more": 1}}, arrays),
        lambda header, arrays: ([header], arrays),
        lambda header, arrays: (3, arrays),
        lambda header, arrays: (b"[" * 60000, arrays),
        lambda header, arrays: (b"\xff\xfe", arrays),
        lambda header, arrays: (header, arrays[:-8]),
        lambda header, arrays: (header, arrays + bytes(8)),
        lambda header, arrays: (header, b""),
    ],
)
def test_sound_digests_of_unsound_content(kept, change):
    kept.write_bytes(forged(*change(*parts(kept.read_bytes()))))
    assert rebuilt(kept)


def test_entries_of_other_orders_are_not_taken(kept):
    header, _ = parts(kept.read_bytes())
    small = BrdfCoefficients(np.ones((2, 4, 4, 3)), np.ones(3), np.ones((2, 3)), (1, 1, 1))
    header["shapes"] = {"values": [2, 4, 4, 3], "total_energy": [3], "degree_energy": [2, 3]}
    data = b"".join(a.tobytes() for a in (small.values, small.total_energy, small.degree_energy))
    kept.write_bytes(forged(header, data))
    assert rebuilt(kept)


def test_what_is_no_file_is_left_alone(kept):
    kept.unlink()
    os.mkfifo(kept)  # to open it would wait for ever
    compute = Counted(compute_coefficients)
    for _ in range(2):
        cached_coefficients(parse_spec("microfacet:sigma=0.4"), *ORDERS, compute)
    assert compute.calls == 2
    kept.unlink()
    kept.mkdir()
    cached_coefficients(parse_spec("microfacet:sigma=0.4"), *ORDERS, compute)
    assert compute.calls == 3
    assert kept.is_dir()


def test_a_folder_that_cannot_be_written_is_no_cache(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    for name in ("file", "file/below", "x" * 300, "a\0b"):
        if "\0" not in name:
            monkeypatch.setenv("SHRM_CACHE_DIR", str(tmp_path / name))
        else:
            monkeypatch.setattr(settings, "cache_folder", lambda: tmp_path / "a\0b")
        compute = Counted(compute_coefficients)
        for _ in range(2):
            cached_coefficients(parse_spec("phong"), *ORDERS, compute)
        assert compute.calls == 2
        assert cache.cache_usage() == (0, 0)
    assert (tmp_path / "file").read_text() == "in the way"


# Room, and removal.


def test_the_entries_used_longest_ago_make_room(folder, monkeypatch):
    specs = [f"microfacet:sigma={s}" for s in (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)]
    compute = Counted(compute_coefficients)

    def take(spec):
        before = compute.calls
        cached_coefficients(parse_spec(spec), *ORDERS, compute)
        return compute.calls > before

    for age, spec in enumerate(specs[:5]):
        take(spec)
        for path in folder.iterdir():
            status = path.stat()
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns - 10**9))
        assert len(list(folder.iterdir())) == age + 1
    assert not take(specs[0])  # used now
    size = sum(path.stat().st_size for path in folder.iterdir())
    monkeypatch.setattr(cache, "MOST_BYTES", size + 10)
    assert take(specs[5])
    assert len(list(folder.iterdir())) == 5
    assert [take(specs[k]) for k in (0, 2, 3, 4, 5)] == [False] * 5
    assert take(specs[1])


def test_what_would_fill_the_cache_is_not_kept(folder, monkeypatch):
    monkeypatch.setattr(cache, "MOST_BYTES", 4000)
    cached_coefficients(parse_spec("phong"), 20, 8, 1e-3, compute_coefficients)
    assert not folder.exists()


def test_clearing_removes_entries_and_nothing_else(folder):
    for spec in ("phong:exponent=2", "phong:exponent=3"):
        cached_coefficients(parse_spec(spec), *ORDERS, compute_coefficients)
    (folder / "notes.txt").write_text("mine")
    (folder / "below").mkdir()
    (folder / "below" / "x.coefficients").write_text("mine")
    (folder / ".x.shrm-host-1-ab.coefficients").write_text("left by a killed process")
    count, size = cache.cache_usage()
    assert count == 3
    assert cache.clear_cache() == (count, size)
    assert sorted(path.name for path in folder.iterdir()) == ["below", "notes.txt"]
    assert (folder / "below" / "x.coefficients").exists()
    assert cache.clear_cache() == (0, 0)


def test_clearing_removes_an_empty_folder(folder, kept):
    cache.clear_cache()
    assert not folder.exists()
    assert cache.clear_cache() == (0, 0)


def test_what_cannot_be_removed_is_said(folder, kept, monkeypatch):
    def refuse(self, missing_ok=False):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(kept), "unlink", refuse)
    with pytest.raises(OutputError, match="cannot be removed"):
        cache.clear_cache()


def test_links_are_not_followed(folder, tmp_path):
    (tmp_path / "precious").write_text("data")
    folder.mkdir()
    (folder / "a.coefficients").symlink_to(tmp_path / "precious")
    assert cache.cache_usage() == (0, 0)
    cache.clear_cache()
    assert (tmp_path / "precious").read_text() == "data"


def test_the_default_is_the_users_cache_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("SHRM_CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    if sys.platform == "linux":
        assert settings.cache_folder() == tmp_path / "home" / "shrm"
    assert "shrm" in str(settings.cache_folder())


def no_home():
    raise RuntimeError("could not determine the home directory")


@pytest.mark.parametrize("asked", [no_home, lambda: "~/.cache/shrm"])
def test_users_without_a_home_have_no_cache(monkeypatch, tmp_path, asked):
    """As in containers whose user is a number without a name; versions of platformdirs differ."""
    monkeypatch.setenv("SHRM_CACHE_DIR", "")
    monkeypatch.setattr("shrm_cli.settings._users_folder", asked)
    monkeypatch.chdir(tmp_path)
    compute = Counted(compute_coefficients)
    for _ in range(2):
        cached_coefficients(parse_spec("phong"), *ORDERS, compute)
    assert compute.calls == 2
    assert list(tmp_path.iterdir()) == []
    for command in ("info", "clear"):
        found = run("cache", command)
        assert_refused(found, 1, "there is no home folder", "set HOME or SHRM_CACHE_DIR")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere platformdirs is asked")
@pytest.mark.parametrize("base", [None, "", "/somewhere/else", "{}"])
def test_the_folder_of_users_is_that_of_platformdirs(monkeypatch, tmp_path, base):
    """It is found without loading that package, which takes as long as writing a map."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if base is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", base.format(tmp_path))
    assert settings._users_folder() == platformdirs.user_cache_dir("shrm")


@pytest.mark.slow
def test_concurrent_runs_share_it(folder):
    code = (
        "from shrm_cli.brdf import cache\n"
        "from shrm_cli.brdf.transfer import compute_coefficients as compute\n"
        "from shrm_cli.brdf.spec import parse_spec\n"
        "from shrm_cli.arrays import Memo\n"
        "import numpy as np, sys\n"
        "cache._SLOW, cache.MOST_BYTES = -1.0, 40000\n"
        "cache._in_memory = Memo(0)\n"
        "for turn in range(12):\n"
        "    brdf = parse_spec(f'microfacet:sigma=0.{3 + turn % 3}')\n"
        "    found = cache.cached_coefficients(brdf, 8, 3, 1e-2, compute)\n"
        "    right = np.array_equal(found.values, compute(brdf, 8, 3, 1e-2).values)\n"
        "    sys.exit('wrong') if not right else cache.cache_usage()\n"
        "    cache.clear_cache() if turn == 7 else None\n"
    )
    runs = [Popen([sys.executable, "-c", code], env=environment()) for _ in range(3)]
    assert [run.wait(timeout=60) for run in runs] == [0, 0, 0]
    assert all(path.name.endswith(".coefficients") for path in folder.iterdir())
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]
