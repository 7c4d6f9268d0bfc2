"""Full disks: every command says so in a line, exits with 1, and leaves nothing behind.

With FAULTS=50 in the environment, each command fails at as many places of its output.
"""

import json
import shutil
import subprocess
import sys

import pytest

from tests.cli.helpers import (
    FAULTS,
    NO_MODULES,
    assert_refused,
    environment,
    mounted,
    process,
    run,
    snapshot,
    write_scene,
)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no such limits")

BALLS = ("--brdf", "lambertian", "--size", "16")
WRITERS = {
    "shrm": ("prefilter", "probe.exr", "--brdf", "phong", "-o", "out.exr"),
    "cabral": ("prefilter", "probe.exr", "--brdf", "phong", "--to", "cabral", "-o", "out.exr"),
    "irradiance": ("prefilter", "probe.exr", "--to", "irradiance", "-o", "out.exr"),
    "splitsum": ("prefilter", "probe.exr", "--to", "splitsum", "--size", "8", "-o", "out.exr"),
    "she": ("prefilter", "probe.exr", "--to", "she", "-o", "out.exr"),
    "render": ("render", "m.exr", "--size", "64", "-o", "out.png"),
    "linear": ("render", "m.exr", "--size", "64", "-o", "out.exr"),
    "frames": ("render", "m.exr", "--size", "16", "--frames", "3", "-o", "out.%02d.png"),
    "mesh": ("render", "m.exr", "--mesh", "mesh.obj", "--size", "32", "-o", "out.png"),
    "compare": ("compare", "m.exr", "m.exr", "--size", "64", "--no-flip", "-o", "out.png"),
    "differences": ("compare", "m.exr", "m.exr", "--size", "64", "--no-flip", "-o", "out.exr"),
    "convert": ("convert", "m.exr", "--to", "lightfield", "--views", "4", "-o", "out.exr"),
    "faces": ("convert", "probe.exr", "--to", "faces", "--size", "32", "-o", "out_%.exr"),
    "mips": ("convert", "s.exr", "--to", "latlong", "--mips", "--size", "32", "-o", "out.exr"),
    "reference": ("reference", "probe.exr", "--brdf", "phong", "--size", "32", "-o", "out.png"),
    "analyze": ("analyze", "--brdf", "phong", "-o", "out.png"),
    "brdf npz": ("brdf", "ggx", "--save", "out.npz"),
    "brdf exr": ("brdf", "ggx", "--save", "out.exr"),
    "dfg": ("dfg", "--size", "32", "-o", "out.exr"),
    "product": ("product", "phong", "-o", "out.exr"),
    "probe": ("probe", "studio", "--size", "32", "-o", "out.exr"),
    "sun": ("sun", "lamp.exr", "-o", "out.exr", "--light-file", "out.toml", "--usd", "out.usda"),
    "filament": ("export", "probe.exr", "--for", "filament", "--size", "32", "-o", "out"),
    "directx": ("export", "probe.exr", "--for", "directx", "--size", "16", "-o", "out"),
    "sheet": ("lookdev", "probe.exr", *BALLS, "-o", "out.html"),
    "gif": ("lookdev", "probe.exr", *BALLS, "--frames", "3", "-o", "out.gif"),
    "view": ("view", "m.exr", "-o", "out.html"),
    "contact": ("contact", "m.exr", "-o", "out.html"),
    "report": ("report", "probe.exr", "--to", "irradiance", "--picture-size", "16", "--no-flip",
               "--truth-height", "8", "--no-view", "--view", "0,0", "-o", "out.html"),
}  # fmt: skip
"""Commands of every kind of file that is written; names of outputs begin with `out`."""

# Runs a command without limits, then with files that cannot grow beyond so many bytes, and prints
# what came of it. The process stays the same, so that modules are loaded once.
LIMITED = f"""
{NO_MODULES}
import json, random, resource, shutil
import OpenImageIO  # finds its font by a variable that it sets, which run() would take back
from pathlib import Path
from tests.cli.helpers import run, snapshot
for name, command in json.loads(sys.argv[1]).items():
    before = snapshot(".")
    whole = run(*command)
    expected = snapshot(".").items() - before.items()
    made = [Path(each) for each, _ in expected]
    sizes = [each.stat().st_size for each in made if each.is_file()] or [1]
    for each in made:
        shutil.rmtree(each) if each.is_dir() else each.unlink(missing_ok=True)
    # A report tells how long its maps took, in as many digits as that needs.
    rng, limits = random.Random(name), [0, max(sizes) - (100 if name == "report" else 1)]
    for limit in limits + [rng.randrange(max(sizes)) for _ in range(int(sys.argv[2]))]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        found = run(*command)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        left = snapshot(".").items() ^ before.items()
        # Frames are kept as they come, each of them whole.
        left = sorted(left - expected if name == "frames" else left)
        print(json.dumps([name, limit, whole.err, found.code, found.out, found.err, left]))
"""


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with a probe, one with a lamp, an SHRM, a split sum and a mesh."""
    folder = tmp_path_factory.mktemp("disk")
    write_scene(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run("prefilter", "probe.exr", "--brdf", "phong", "-o", "m.exr").code == 0
        assert run("prefilter", "probe.exr", "--to", "splitsum", "--mips", "-o", "s.exr").code == 0
    return folder


@pytest.mark.proof
@pytest.mark.parametrize("part", range(4))
def test_no_command_takes_what_was_cut_off_for_whole(prepared, tmp_path, part):
    """At the first byte, at the last one, and in between."""
    folder = tmp_path / "full"
    shutil.copytree(prepared, folder)
    names = sorted(WRITERS)[part::4]
    commands = json.dumps({name: WRITERS[name] for name in names})
    found = subprocess.run(
        [sys.executable, "-c", LIMITED, commands, str(FAULTS)],
        cwd=folder, env=environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert (found.returncode, found.stderr) == (0, "")
    told = [json.loads(line) for line in found.stdout.splitlines()]
    assert {name for name, *_ in told} == set(names)
    for name, limit, whole, code, out, err, left in told:
        where = f"{name}, {limit} bytes: {err}"
        assert "Error" not in whole, where
        assert (code, left) == (1, []), where
        (line,) = (each for each in err.splitlines() if not each.startswith("Warning: "))
        assert line.startswith("Error: out"), where
        assert "cannot be written (" in line, where
        assert "name another" in line, where
        assert "is 8-bit" not in out, where


def test_a_disk_that_is_too_small_for_unfinished_work(tmp_path):
    """It is a mapped file: without room for all of it the process would die of SIGBUS."""
    rows = range(1, 200)
    corners = [f"v {x} {y % 3} {y}" for y in range(200) for x in (0, 1)]
    faces = [f"f {2 * y - 1} {2 * y} {2 * y + 2}" for y in rows]
    (tmp_path / "mesh.obj").write_text("\n".join([*corners, *faces]))
    with mounted(tmp_path / "small", "size=16k") as small:
        found = process(
            "transfer", tmp_path / "mesh.obj", "--samples", "4", "-o", small / "out.npz"
        )
        reason = "cannot be written (No space left on device); make room"
        assert_refused(found, 1, f"out.npz.part: {reason}")
        assert snapshot(small) == {}
