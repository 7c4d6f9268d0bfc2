"""docs/torch.md: its code runs as it stands, and finds what it says."""

import re

import pytest

from tests.conftest import ROOT
from tests.torch import setup

torch = setup.torch  # or the tests are skipped
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "torch.md").read_text(), re.S)


def test_the_first_lines_give_gradients():
    names = {}
    exec(compile(BLOCKS[0], "torch.md", "exec"), names)
    assert names["cubes"].shape == (3, 192, 32, 3)
    for leaf in (names["image"], names["roughness"]):
        assert torch.isfinite(leaf.grad).all()
        assert leaf.grad.abs().max() > 0


@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_a_roughness_is_found_in_a_picture(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    _, block = BLOCKS
    exec(compile(block, "torch.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(0.33, abs=3e-3)
