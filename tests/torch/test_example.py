"""The example that finds light and roughness, in a short run."""

import re
import subprocess
import sys

from tests.conftest import ROOT
from tests.torch import setup

assert setup.torch  # or the test is skipped


def test_light_and_roughness_are_found(tmp_path, real_probes):
    """From pictures of a sphere, which is drawn where no mesh is given, under a real probe."""
    text = (ROOT / "examples" / "recover_light.py").read_text()
    assert text.count("SIZE, ROUGHNESS, F0 = 56,") == 1
    short = text.replace("SIZE, ROUGHNESS, F0 = 56,", "SIZE, ROUGHNESS, F0 = 32,")
    short = short.replace("Path(__file__).resolve().parents[1]", f"Path({str(ROOT)!r})")
    (tmp_path / "short.py").write_text(short)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "short.py", real_probes / "city.exr"],
        cwd=tmp_path, capture_output=True, text=True,
        env={"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    started = re.search(r"^step 0: .* roughness ([\d.]+)$", done.stdout, re.M)
    found = re.search(r"^roughness ([\d.]+) for 0.4$", done.stdout, re.M)
    assert float(started[1]) > 0.65
    assert abs(float(found[1]) - 0.4) < 0.03
    of_view, of_light = (float(each) for each in re.findall(r"([\d.]+) dB", done.stdout))
    assert of_view > 30
    assert of_light > 25
    assert (tmp_path / "recovered.png").exists()
