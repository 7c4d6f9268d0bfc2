"""The names of files that commands choose, and when they replace what is there."""

import numpy as np
import pytest

from shrm_cli.cli.outputs import brdf_label, probe_stem
from tests.cli.helpers import done, write_exr

LONG = "+".join(["lambertian", *(f"0.1*phong:exponent={n}" for n in range(1, 21))])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a probe."""
    write_exr(tmp_path / "probe.exr", np.ones((8, 16, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("command", "suffixes"),
    [
        (["prefilter", "probe.exr", "--size", "4"], [".shrm.exr"]),
        (["reference", "probe.exr", "--size", "16", "--source-height", "4"], [".reference.exr"]),
        (["analyze", "--order-f", "2", "--eps", "0.5"], [".energy.png"]),
    ],
)
def test_sums_of_any_length_have_a_name(folder, command, suffixes):
    before = set(folder.iterdir())
    done(*command, "--brdf", LONG)
    made = sorted(path.name for path in set(folder.iterdir()) - before)
    assert len(made) == len(suffixes)
    for name, suffix in zip(made, suffixes, strict=True):
        assert name.endswith(suffix)
        assert "lambertian+0.1-phong-exponent-1+" in name
        assert len(name) < 200


def test_probes_with_the_longest_names_have_maps_and_pictures(folder):
    name = f"{'ü' * 120}.exr"
    write_exr(folder / name, np.ones((8, 16, 3), np.float32))
    done("prefilter", name, "--brdf", LONG, "--size", "4", "--quiet")
    (made,) = folder.glob("*.shrm.exr")
    done("render", made.name, "--size", "16", "--quiet")
    assert made.with_suffix(".png").exists()


def test_long_names_that_begin_alike_are_told_apart():
    assert brdf_label(LONG) != brdf_label(LONG + "+phong")
    assert brdf_label("phong:exponent=32") == "phong-exponent-32"
    assert probe_stem("x" * 200 + "1.exr") != probe_stem("x" * 200 + "2.exr")
    assert probe_stem("folder/sky_%.exr") == "sky"
