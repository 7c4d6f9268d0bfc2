"""The scripts of examples/ that tell in a line what they lack; others have tests of their own."""

import subprocess
import sys

from tests.cli.helpers import ROOT, environment

EXAMPLE = ROOT / "examples" / "recover_light.py"


def test_an_example_without_pytorch_says_what_to_install(tmp_path):
    code = (
        "import importlib.util as u, runpy; find = u.find_spec\n"
        "u.find_spec = lambda name, *more: None if name == 'torch' else find(name, *more)\n"
        f"runpy.run_path({str(EXAMPLE)!r}, run_name='__main__')"
    )
    found = subprocess.run(
        [sys.executable, "-c", code],
        env=environment(), cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    told = "Error: gradients need the package torch; pip install torch\n"
    assert (found.returncode, found.stdout, found.stderr) == (1, "", told)
