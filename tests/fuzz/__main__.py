"""`python -m tests.fuzz --minutes 10`: cases by kind of file, findings, and how to repeat them.

A finding is a crash, a signal, too much time or memory, an internal error or a traceback, more or
less than one line of error, characters that a terminal obeys, invalid JSON, a damaged output, or a
file that stays where none should be. Each is kept with its input.
"""

import argparse
import gc
import importlib
import json
import os
import pkgutil
import random
import re
import shlex
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests.fuzz import judge
from tests.fuzz.child import Outcome, as_report, run_batch, run_command
from tests.fuzz.mutations import damage, word
from tests.fuzz.seeds import Seed, copy_sound, make_seeds

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS")
"""Variables that libraries obey when they are loaded. Threads do not survive a fork."""
_REPORT = 60.0  # seconds between lines of progress
_BATCH = 40  # cases of one process
_OUTPUTS = ("-o", "--light-file", "--usd", "--map")


def main() -> None:
    """Parse the arguments, run cases until the time is over, and print what was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1, help="decides on all cases")
    parser.add_argument("--case", type=int, help="run this case alone, and keep its files")
    parser.add_argument("--first", type=int, default=0, help="the number of the first case")
    parser.add_argument("--kind", help="only kinds of files whose names contain this")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="findings go there")
    options = parser.parse_args()
    if any(os.environ.get(name) != "1" for name in _THREADS):
        environment = {**os.environ, **dict.fromkeys(_THREADS, "1")}
        os.execve(sys.executable, [sys.executable, "-m", "tests.fuzz", *sys.argv[1:]], environment)
    with tempfile.TemporaryDirectory(prefix="shrm-fuzz-") as work:
        os.environ["SHRM_CACHE_DIR"] = str(Path(work, "cache"))
        findings = Harness(Path(work), options).run()
    sys.stdout.flush()
    # What was frozen is not collected at the end, which OpenImageIO's bindings would complain of.
    os._exit(1 if findings else 0)


@dataclass(frozen=True)
class Case:
    """A damaged file, and the words of the command that reads it."""

    kind: str
    name: str
    data: bytes
    words: list[str]

    @property
    def outputs(self) -> list[str]:
        """The names of the outputs, files and folders; that of ``-o`` first."""
        return [self.words[self.words.index(each) + 1] for each in _OUTPUTS if each in self.words]

    @property
    def probe_or_map(self) -> str:
        """The name of an output that is a probe or a map, or may be; empty if none is."""
        is_texture = "layers" in self.words
        return next((each for each in self.outputs if each.endswith(".exr") and not is_texture), "")


class Harness:
    """The seeds, and what was found so far."""

    def __init__(self, work: Path, options: argparse.Namespace) -> None:
        self.work, self.options = work, options
        self.sound, self.folder, self.log = work / "sound", work / "case", work / "log"
        for each in (self.sound, self.folder, self.log):
            each.mkdir()
        seeds = _seeds(self.sound)
        self.seeds = [seed for seed in seeds if (options.kind or "") in seed.kind]
        self.data = {seed.name: (self.sound / seed.name).read_bytes() for seed in seeds}
        self.kinds = sorted({seed.kind for seed in self.seeds})
        self.cases: Counter[str] = Counter()
        self.codes: Counter[int] = Counter()
        self.findings: Counter[str] = Counter()
        self.examples: dict[str, int] = {}
        self.seconds = 0.0

    def run(self) -> int:
        """Run the cases, print the report, and return the number of findings."""
        _load_everything()
        if self.options.case is not None:
            self._run([self.options.case])
        else:
            self._run_for(60 * self.options.minutes)
        self.report()
        return self.findings.total()

    def _run_for(self, seconds: float) -> None:
        start = told = time.monotonic()
        first = self.options.first
        while time.monotonic() < start + seconds:
            self._run(range(first, first + _BATCH))
            first += _BATCH
            if time.monotonic() > told + _REPORT:
                told = time.monotonic()
                rate = self.cases.total() / (told - start)
                found = f"{self.findings.total()} findings of {len(self.examples)} sorts"
                print(f"{self.cases.total():,} cases, {rate:.1f} a second, {found}", flush=True)

    def _run(self, cases: Sequence[int]) -> None:
        for number, report in run_batch(cases, self._try, self.log):
            if isinstance(report, int):
                self._count(number, {"outcome": as_report(Outcome(report))})
                self._note(number, judge.of_signal(report), "")
                continue
            self._count(number, report)
            for what in report["findings"]:
                self._note(number, what, report["outcome"]["err"])
        if (log := self.log / "harness").exists():
            raise SystemExit(log.read_text())

    def _try(self, number: int) -> dict[str, Any]:
        """Damage a file, run a command on it, and judge how that ended."""
        case = self._case(number)
        before = self._lay_out(case, self.folder)
        outcome = run_command(case.words, self.folder, self.log)
        found = judge.of_outcome(outcome, "--json" in case.words)
        files = judge.of_files(before, judge.listing(self.folder), case.outputs, outcome.code)
        found += [files] if files else []
        if outcome.code == 0 and case.probe_or_map and not files:
            read = run_command(["info", "--", case.probe_or_map], self.folder, self.log)
            is_picture = "square image" in read.err or "known layout" in read.err
            found += [] if read.code == 0 or is_picture else ["an output that cannot be read"]
        return {"outcome": as_report(outcome), "findings": found}

    def _case(self, number: int) -> "Case":
        """Return a case, which its number and the seed decide on alone."""
        rng = random.Random(f"{self.options.seed}:{number}")
        kind = rng.choice(self.kinds)
        seed = rng.choice([each for each in self.seeds if each.kind == kind])
        name = "bad" + Path(seed.name).suffix
        command = rng.choice(seed.commands).replace("FILE", name).replace("OUT", "out")
        if "WORD" in command:
            data, argument = self.data[seed.name], word(rng)
        else:
            data, argument = damage(self.data[seed.name], list(self.data.values()), rng), ""
        argument = argument.replace("/", "") if "-o WORD" in command else argument
        words = [each.replace("WORD", argument) for each in command.split()]
        return Case(seed.kind, name, data, words)

    def _lay_out(self, case: "Case", folder: Path) -> dict[str, int]:
        """Make the folder of a case, and return what is in it."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        copy_sound(self.sound, folder)
        (folder / case.name).write_bytes(case.data)
        return judge.listing(folder)

    def _count(self, number: int, report: dict[str, Any]) -> None:
        self.cases[self._case(number).kind] += 1
        self.codes[report["outcome"]["code"]] += 1
        self.seconds += report["outcome"]["seconds"]
        if self.options.case is not None:
            print(json.dumps(report, indent=2))

    def _note(self, number: int, what: str, err: str) -> None:
        """Note a finding; the first one of a sort is printed, and its input is kept."""
        case = self._case(number)
        line = re.sub(r"'.*'|\(.*\)|\d+", "~", ascii((err.strip().splitlines() or [""])[-1])[1:-1])
        sort = f"{what} [{case.words[0]}, {case.kind}] {line[:120]}"
        self.findings[sort] += 1
        if sort in self.examples:
            return
        self.examples[sort] = number
        kept = self.options.keep / f"{self.options.seed}-{number}"
        self._lay_out(case, kept)
        line = "shrm " + shlex.join(case.words) + "\n"
        (kept / "command").write_text(line, errors="surrogateescape")
        print(f"finding: case {number}: {sort}", flush=True)

    def report(self) -> None:
        """Print how many cases there were, and every sort of findings."""
        print(f"\n{self.cases.total():,} cases, seed {self.options.seed}")
        for kind, count in sorted(self.cases.items()):
            print(f"  {count:>8,}  {kind}")
        codes = ", ".join(f"{count:,} with {code}" for code, count in self.codes.most_common())
        print(f"ended: {codes}; {self.seconds:.0f} seconds of processor time")
        print(f"{self.findings.total():,} findings")
        for sort, count in self.findings.most_common():
            again = f"--seed {self.options.seed} --case {self.examples[sort]}"
            print(f"  {count:>6,}  {sort}\n          python -m tests.fuzz {again}")


def _seeds(folder: Path) -> list[Seed]:
    """Make the seeds in a process of its own, because image libraries start threads."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            made = [asdict(seed) for seed in make_seeds(folder)]
            (folder / "seeds.json").write_text(json.dumps(made))
            status = 0
        except BaseException:  # nothing else would tell why, as the process ends at once
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(status)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        raise SystemExit("the seeds could not be made")
    made = json.loads((folder / "seeds.json").read_text())
    return [Seed(each["kind"], each["name"], tuple(each["commands"])) for each in made]


def _load_everything() -> None:
    """Import all modules once, before the processes are forked that need them."""
    import shrm_cli
    from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb

    for module in pkgutil.walk_packages(shrm_cli.__path__, "shrm_cli."):
        # No command imports PyTorch, which few have.
        if not module.name.endswith("__main__") and not module.name.startswith("shrm_cli.torch"):
            importlib.import_module(module.name)
    for name in ("trimesh.exchange.load", "embreex.mesh_construction"):
        importlib.import_module(name)
    to_linear_srgb([400.0, 700.0], [1.0, 1.0])  # reads its table
    gc.collect()
    gc.freeze()  # or the collector would touch, and so copy, every page in every child


if __name__ == "__main__":
    main()
