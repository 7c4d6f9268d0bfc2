"""The fuzz harness itself, which must see what it is there for, and a short run of it."""

import random
import re
import subprocess
import sys

import pytest

from tests.cli.helpers import MAIN, ROOT, environment, noise, process, write_exr
from tests.fuzz import judge
from tests.fuzz.child import Outcome, run_batch
from tests.fuzz.exr_header import Attribute, parse
from tests.fuzz.mutations import damage

pytestmark = pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="it forks")

SECONDS = 12


@pytest.mark.proof
def test_a_short_run_finds_nothing(tmp_path):
    """The seed is fixed, so a finding can be repeated; `make fuzz` takes its time."""
    found = subprocess.run(
        [
            sys.executable, "-m", "tests.fuzz", "--minutes", str(SECONDS / 60), "--seed", "7",
            "--keep", str(tmp_path),
        ],
        env=environment(), cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr
    cases = int(re.search(r"^([\d,]+) cases", found.stdout, re.M)[1].replace(",", ""))
    assert cases >= 40
    assert "0 findings" in found.stdout


# What a command does instead of its work, and how the harness has to call it.
FAULTS = {
    "import os; os.abort()": "the process ended with -6",
    "import os; os.kill(os.getpid(), 11)": "the process ended with -11",
    "raise KeyError('x')": "internal error",
    "print('half'); raise ProbeError('a: b')": "an error after half the output",
    "print('libpng error', file=sys.stderr); raise ProbeError('a: b')": "2 lines of error",
    "print('noise', file=sys.stderr); return found": "noise on stderr",
    "print('\\x1b[31m'); return found": "control characters printed",
    "print('NaN'); return found": "invalid JSON",
    "open('left.tmp', 'w').close(); return found": "left ['left.tmp']",
    "import os; os.mkdir('half'); return found": "left ['half']",
    "open('bad.pfm', 'w').close(); return found": "an input was changed",
    "bytes(2**33)": "asks for too much memory",
    "while True: pass": "takes too long",
}


@pytest.mark.proof
@pytest.mark.slow
def test_what_goes_wrong_is_found(tmp_path):
    """The command `info` is replaced by each of the faults in turn."""
    code = f"""
import argparse, sys, types
from pathlib import Path
import shrm_cli.analysis.describe, tests.fuzz.child as child
from shrm_cli.errors import ProbeError
from tests.fuzz import __main__ as harness
child.MOST_SECONDS = 1
seed = harness.Seed("PFM", "a.pfm", ("info FILE --json",))
harness.make_seeds = lambda folder: (folder / "a.pfm").write_bytes(b"PF 1 1") and [seed]
harness.copy_sound = lambda source, target: None
for number, body in enumerate({list(FAULTS)!r}):
    found = shrm_cli.analysis.describe.Description("is a probe", {{"kind": "probe"}})
    scope = dict(ProbeError=ProbeError, sys=sys, found=found)
    exec("def fault(*_):\\n    " + body, scope)
    shrm_cli.analysis.describe._probe = scope["fault"]
    work = Path({str(tmp_path)!r}, str(number))
    work.mkdir()
    options = argparse.Namespace(minutes=0, seed=1, case=0, first=0, kind=None, keep=work / "kept")
    print("findings", harness.Harness(work, options).run())
"""
    result = process(code=code)
    assert result.code == 0, result.out + result.err
    for index, body in enumerate(FAULTS):
        kept = tmp_path / str(index) / "kept" / "1-0"
        assert (kept / "command").read_text() == "shrm info bad.pfm --json\n", body
        assert (kept / "bad.pfm").exists()
    for finding in FAULTS.values():
        assert finding in result.out


def test_the_rest_of_a_batch_goes_on_after_a_crash(tmp_path):
    import os

    def case(number):
        if number == 2:
            os._exit(3)
        return {"number": number}

    found = list(run_batch([1, 2, 3], case, tmp_path))
    assert found == [(1, {"number": 1}), (2, 3), (3, {"number": 3})]


def test_damage_is_the_same_each_time(tmp_path):
    data = write_exr(tmp_path / "a.exr", noise()).read_bytes()
    made = [damage(data, [data], random.Random(k)) for k in range(200)]
    assert made == [damage(data, [data], random.Random(k)) for k in range(200)]
    assert len(set(made)) > 150
    assert sum(each == data for each in made) < 20


def test_edited_headers_keep_their_pixels_in_reach(tmp_path):
    """So that what is read is the attribute, and not a file without pixels."""
    path = write_exr(tmp_path / "a.exr", noise())
    found = parse(path.read_bytes())
    assert found.packed() == path.read_bytes()
    found.parts[0].append(Attribute(b"comments", b"string", b"of some length"))
    path.write_bytes(found.packed())
    assert process("info", path, code=MAIN).code == 0


def test_sound_outcomes_have_no_finding():
    assert judge.of_outcome(Outcome(0, '{"a": null}\n', "Warning: a\nWarning: b\n"), True) == []
    assert judge.of_outcome(Outcome(1, "", "Error: a.exr: damaged; copy it\n"), True) == []
    assert judge.of_files({"a": 1}, {"a": 1, "out": 2}, ["out"], 0) == ""
    assert judge.of_files({"a": 1}, {"a": 1}, ["out"], 1) == ""
    assert judge.of_files({"a": 1}, {"a": 1, "out": 2}, ["out"], 1) != ""
    assert judge.of_files({"a": 1}, {"a": 1, "out.b": 2}, ["out.b", "out.a"], 0) != ""


def test_a_folder_that_stays_is_seen(tmp_path):
    before = judge.listing(tmp_path)
    (tmp_path / "out").mkdir()
    assert judge.of_files(before, judge.listing(tmp_path), [], 1) == "left ['out'] instead of []"
    before = judge.listing(tmp_path)
    (tmp_path / "out" / "part").write_bytes(b"half")
    assert judge.of_files(before, judge.listing(tmp_path), [], 1) == "an input was changed"
