"""The thresholds are those that docs/conventions.md promises, and one place has them."""

import ast
import re

import pytest

from shrm_cli import vocabulary
from shrm_cli.plan import policy
from tests.cli.helpers import ROOT

PAGE = (ROOT / "docs" / "conventions.md").read_text()
SECTION = re.search(r"## The form that is chosen\n(.*?)\n## ", PAGE, re.DOTALL)[1]
PROMISES = {
    "DEFAULT_ERROR": (r"RMS error of the light of at\s+most (\d+) %", 100),
    "DEFAULT_SEEN": (r"at most (\d+) % of\s+\[wrong pixels\]", 100),
    "NEGATIVE_SHARE": (r"at most a (thousandth) of what is visible negative", 1),
    "NEGATIVE_FROM_A_SIDE": (r"(five thousandths) of what is\s+visible from any side", 1),
    "SIMPLE_TIMES": (r"at most\s+(four) times the bytes", 1),
    "SIMPLE_ORDER_P": (r"25 coefficients \(P = (\d+)\)", 1),
    "FINER": (r"steps of a factor of ([\d.]+)", 1),
    "LEAST_ERROR": (r"down to ([\d.]+) %", 100),
    "TRIED_DARK": (r"(three) maps at\s+most", 1),
    "MISSED": (r"within (\d+) % of the least", 100),
    "WORTH_LAMPS": (r"in at most (half) of the bytes", 1),
    "FAR_LESS_WRONG": (r"or (half) as much", 1),
    "FAR_SMALLER": (r"hardly more in a (tenth) of the\s+bytes", 1),
    "BESIDE": (r"at most (nine tenths) of the error", 1),
    "WRONG_BESIDE": (r"at most (half) of the wrong pixels", 1),
    "LARGE": (r"map of more than ([\d.]+) MB keeps", 1e-6),
    "SPARED": (r"the last has more than (\d+) kB", 1e-3),
    "LEAST_BYTES": (r"or (\d+) kB where the tolerance", 1e-3),
}
HELD = {
    "CLOSE": "plan/test_search.py",
    "NEARLY_AS_GOOD": "maps/principal/test_nearly.py",
    "NEARLY_BEST": "maps/principal/test_nearly.py",
    "NEAR": "plan/test_search.py",
    "NEARLY_KEPT": "plan/test_search.py",
    "TRIES": "maps/principal/test_nearly.py",
    "FAIRLY": "maps/principal/test_tolerance.py",
    "LOOSER": "maps/shrm/test_terms.py",
    "LARGEST_TOLERANCE": "maps/shrm/test_terms.py",
    "NO_ERROR": "maps/shrm/test_terms.py",
}
"""What no user sees, and the tests that notice when it changes."""
WORDS = {
    "thousandth": 1e-3, "five thousandths": 5e-3, "tenth": 0.1, "nine tenths": 0.9, "half": 0.5,
    "three": 3, "four": 4,
}  # fmt: skip


@pytest.mark.parametrize("name", PROMISES)
def test_the_page_says_what_is_kept(name):
    pattern, unit = PROMISES[name]
    said = re.search(pattern, SECTION)[1]
    number = WORDS.get(said) or float(said) / unit
    found = getattr(vocabulary if hasattr(vocabulary, name) else policy, name)
    assert (found - 1 if name == "MISSED" else found) == pytest.approx(number, rel=0.02)


def test_every_threshold_says_why_and_is_held():
    """Those of the second list are held by other tests."""
    tree = ast.parse((ROOT / "shrm_cli" / "plan" / "policy.py").read_text())
    names = [node.targets[0].id for node in tree.body if isinstance(node, ast.Assign)]
    described = [node for node in tree.body[1:] if isinstance(node, ast.Expr)]
    assert len(described) == len(names)
    elsewhere = {each for each in PROMISES if hasattr(vocabulary, each)}
    assert {*names, *elsewhere} == {*PROMISES, *HELD}
