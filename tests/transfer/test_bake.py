"""Baking: what resumes, what does not change the result, and what is refused."""

from importlib import import_module

import numpy as np
import pytest

from shrm_cli import settings
from shrm_cli.errors import ArgumentError, OutputError
from shrm_cli.geometry.rays import Rays
from shrm_cli.transfer import bake as bake_module
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.file import write_transfer
from tests.transfer import meshes


class Tripping:
    """Rays that fail after some calls, as an interruption would have it."""

    def __init__(self, mesh, most=10**9):
        self.rays, self.calls, self.most = Rays(mesh), 0, most

    def count(self):
        self.calls += 1
        if self.calls > self.most:
            raise KeyboardInterrupt

    def occluded(self, *bundle):
        self.count()
        return self.rays.occluded(*bundle)

    def first_hits(self, *bundle):
        self.count()
        return self.rays.first_hits(*bundle)


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(bake_module, "_RAYS_AT_ONCE", 64 * 16)
    with settings.using(threads=1):
        yield


@pytest.fixture
def plan():
    return Plan(meshes.bumps(12), order=2, samples=64, bounces=1, glossy=True)


def baked_file(plan, path, rays=None):
    bake(plan, rays=rays, keep=path, use=lambda found: write_transfer(path, found))
    return path.read_bytes()


def test_an_interrupted_run_goes_on(tmp_path, small_blocks, plan):
    whole = baked_file(plan, tmp_path / "whole.npz")
    path, part = tmp_path / "t.npz", tmp_path / "t.npz.part"
    blocks = 2 * -(-len(plan.mesh.vertices) // plan.step)
    first = Tripping(plan.mesh, 13)
    with pytest.raises(KeyboardInterrupt):
        baked_file(plan, path, first)
    assert part.exists()
    assert not path.exists()
    rest = Tripping(plan.mesh)
    assert baked_file(plan, path, rest) == whole
    assert rest.calls == blocks - 13
    assert not part.exists()


def test_unfinished_work_of_another_plan_is_begun_anew(tmp_path, small_blocks, plan):
    path = tmp_path / "t.npz"
    with pytest.raises(KeyboardInterrupt):
        baked_file(plan, path, Tripping(plan.mesh, 13))
    other = Plan(plan.mesh, order=2, samples=64, bounces=1, glossy=True, albedo=0.9)
    everything = Tripping(plan.mesh)
    baked_file(other, path, everything)
    assert everything.calls == 2 * -(-len(plan.mesh.vertices) // plan.step)


def test_unfinished_work_of_another_program_is_begun_anew(
    tmp_path, small_blocks, plan, monkeypatch
):
    path = tmp_path / "t.npz"
    with pytest.raises(KeyboardInterrupt):
        baked_file(plan, path, Tripping(plan.mesh, 13))
    monkeypatch.setattr(
        import_module("shrm_cli.transfer.bake"), "fingerprint", lambda folders: "another"
    )
    everything = Tripping(plan.mesh)
    baked_file(plan, path, everything)
    assert everything.calls == 2 * -(-len(plan.mesh.vertices) // plan.step)


@pytest.mark.parametrize("damage", ["values", "length", "header"])
def test_damaged_work_is_done_again(tmp_path, small_blocks, plan, damage):
    whole = baked_file(plan, tmp_path / "whole.npz")
    path, part = tmp_path / "t.npz", tmp_path / "t.npz.part"
    with pytest.raises(KeyboardInterrupt):
        baked_file(plan, path, Tripping(plan.mesh, 13))
    data = bytearray(part.read_bytes())
    if damage == "values":
        data[-plan.shapes()["matrices1"][0] * 9 * 9 * 4 - 40] ^= 1  # of the last bounce's vectors
        data[128 + 9 * 8 + 20] ^= 255  # and a mark
    elif damage == "length":
        data = data[:-1]
    else:
        data[3] ^= 1
    part.write_bytes(data)
    assert baked_file(plan, path) == whole


def test_threads_and_files_change_nothing(tmp_path, plan):
    one = bake(plan)
    with settings.using(threads=3):
        other = bake(plan)
    np.testing.assert_array_equal(one.vectors, other.vectors)
    np.testing.assert_array_equal(one.matrices, other.matrices)
    assert baked_file(plan, tmp_path / "a.npz") == baked_file(plan, tmp_path / "b.npz")


def test_progress_rises_to_all_of_it(tmp_path, small_blocks, plan):
    told = []
    bake(plan, progress=lambda done, total: told.append((done, total)))
    assert [done for done, _ in told] == list(range(1, told[-1][1] + 1))
    path = tmp_path / "t.npz"
    with pytest.raises(KeyboardInterrupt):
        baked_file(plan, path, Tripping(plan.mesh, 4))
    rest = []
    bake(plan, keep=path, progress=lambda done, total: rest.append(done))
    assert rest == list(range(5, told[-1][1] + 1))


class Meeting:
    """Rays before which something else happens once."""

    def __init__(self, mesh, meet):
        self.rays, self.meet = Rays(mesh), meet

    def occluded(self, *bundle):
        meet, self.meet = self.meet, lambda: None
        meet()
        return self.rays.occluded(*bundle)

    def first_hits(self, *bundle):
        return self.rays.first_hits(*bundle)


@pytest.mark.parametrize("albedo", [0.5, 0.9])
def test_two_runs_at_once_to_one_output(tmp_path, small_blocks, plan, albedo):
    """The second begins and ends while the first is at work, of the same plan or of another."""
    other = Plan(plan.mesh, order=2, samples=64, bounces=1, glossy=True, albedo=albedo)
    expected = [baked_file(each, tmp_path / "alone.npz") for each in (plan, other)]
    path, found = tmp_path / "t.npz", []
    rays = Meeting(plan.mesh, lambda: found.append(baked_file(other, path)))
    found.insert(0, baked_file(plan, path, rays))
    assert found == expected
    assert sorted(each.name for each in tmp_path.iterdir()) == ["alone.npz", "t.npz"]


def test_unfinished_work_is_not_written_through_links(tmp_path, plan):
    (tmp_path / "precious").write_text("data")
    (tmp_path / "t.npz.part").symlink_to("precious")
    baked_file(plan, tmp_path / "t.npz")
    assert (tmp_path / "precious").read_text() == "data"


def test_a_place_that_cannot_be_written(tmp_path, plan):
    (tmp_path / "t.npz.part").mkdir()
    with pytest.raises(OutputError, match=r"t\.npz\.part: cannot be written"):
        bake(plan, keep=tmp_path / "t.npz")


@pytest.mark.parametrize(
    ("options", "argument"),
    [
        ({"order": 17}, "order"),
        ({"order": 9, "glossy": True}, "order"),
        ({"bounces": -1}, "bounces"),
        ({"samples": 0}, "samples"),
        ({"albedo": 1.5}, "albedo"),
        ({"albedo": float("nan")}, "albedo"),
        ({"albedo": (0.1, 0.2)}, "albedo"),
        ({"albedo": np.ones((5, 3))}, "albedo"),
    ],
)
def test_options_out_of_range(options, argument):
    with pytest.raises(ArgumentError) as caught:
        Plan(meshes.sphere(1), **options)
    assert caught.value.argument == argument


def test_colours_of_vertices_are_sent():
    """Red walls light only red."""
    mesh = meshes.bumps(10)
    colors = np.tile([1.0, 0.0, 0.0], (len(mesh.vertices), 1))
    found = bake(Plan(mesh, order=1, samples=64, bounces=1, albedo=colors)).vectors
    direct = bake(Plan(mesh, order=1, samples=64)).vectors[..., 0]
    np.testing.assert_allclose(found[..., 1], direct, atol=1e-6)
    np.testing.assert_array_equal(found[..., 1], found[..., 2])
    assert (found[:, 0, 0] > direct[:, 0] + 1e-3).any()
