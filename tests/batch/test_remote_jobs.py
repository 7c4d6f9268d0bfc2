"""Probes and maps behind URLs."""

import numpy as np
import pytest

from shrm_cli.batch.collect import Collection, check_collection, write_collection
from shrm_cli.batch.entry import Entry
from shrm_cli.batch.work import Result
from shrm_cli.errors import OutputError, RemoteError
from shrm_cli.maps.file import open_map
from shrm_cli.prefilter import prefilter
from tests.batch.helpers import records_of, statuses, write_probes

fsspec = pytest.importorskip("fsspec", reason="pip install fsspec")


@pytest.fixture
def store(tmp_path):
    """A file system in memory with three probes, one of them damaged; its name is its own."""
    system = fsspec.filesystem("memory")
    root = f"/{tmp_path.name}"
    for k, path in enumerate(write_probes(tmp_path, 3)):
        with open(path, "rb") as stream:
            system.pipe(f"{root}/day/p{k}.exr", stream.read())
    system.pipe(f"{root}/day/p1.exr", b"damaged")
    yield system, f"memory:/{root}"
    system.rm(root, recursive=True)


def test_maps_are_made_and_skipped_where_they_belong(store, tmp_path):
    system, url = store
    entry = Entry((f"{url}/**/*.exr",), (), ("irradiance",), f"{url}/bake/{{folder}}/{{probe}}.exr")
    records = {record["probe"]: record for record in records_of(entry)}
    assert {name: each["status"] for name, each in records.items()} == {
        f"{url}/day/p0.exr": "made", f"{url}/day/p1.exr": "failed", f"{url}/day/p2.exr": "made",
    }  # fmt: skip
    assert f"{url}/day/p1.exr: not an image" in records[f"{url}/day/p1.exr"]["error"]
    copy = tmp_path / "copy.exr"
    copy.write_bytes(system.cat(f"/{tmp_path.name}/bake/day/p2.exr"))
    made = open_map(copy)
    alone = prefilter(tmp_path / "p2.exr", to="irradiance")
    assert made.info.probe == "p2.exr"
    assert made.info.probe_sha256 == alone.info.probe_sha256
    again = Entry((f"{url}/day/p[02].exr",), (), ("irradiance",), f"{url}/bake/day/{{probe}}.exr")
    assert set(statuses(records_of(again)).values()) == {"skipped"}
    left_out = []
    assert [job.probe for job in entry.jobs(left_out)] == [f"{url}/day/p{k}.exr" for k in range(3)]
    assert sorted(left_out) == [f"{url}/bake/day/p{k}.exr" for k in (0, 2)]


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_a_collection_is_written_where_it_belongs(store, tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow", reason="pip install pyarrow")
    system, url = store
    made = Collection.of([Result("a.exr", [], np.ones((4, 3)), "0" * 64)], "radiance", 1)
    check_collection(f"{url}/sets/light{suffix}")
    write_collection(f"{url}/sets/light{suffix}", made)
    write_collection(tmp_path / f"light{suffix}", made)
    expected = (tmp_path / f"light{suffix}").read_bytes()
    assert system.cat(f"/{tmp_path.name}/sets/light{suffix}") == expected


def test_a_store_that_cannot_be_reached_takes_no_collection():
    with pytest.raises(RemoteError, match="nowhere"):
        check_collection("nowhere://user:secret@set/light.npz")
    with pytest.raises(OutputError, match=r"memory://\*\*\*@set/light.csv: collections are"):
        check_collection("memory://user:secret@set/light.csv")


def test_a_probe_that_is_not_there_fails_alone(store):
    _, url = store
    entry = Entry(
        (f"{url}/gone.exr", f"{url}/day/p0.exr"), (), ("irradiance",), f"{url}/{{probe}}.e.exr"
    )
    found = statuses(records_of(entry))
    assert found == {f"{url}/gone.e.exr": "failed", f"{url}/p0.e.exr": "made"}
