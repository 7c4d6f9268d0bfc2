"""Copies of the project in which `make` runs, with a stand-in for `shrm` or the real command."""

import os
import shlex
import shutil
import subprocess
import sys
import time

from tests.cli.helpers import ROOT, WHOLE

BRDFS = "microfacet:sigma=0.3 phong:exponent=8"

# Writes down how it was called, and writes its last argument, but for `batch`; fails on files that
# say so.
STAND_IN = """#!/bin/sh
echo "$@" >>calls
for output; do :; done
for input in "$2" "$output"; do
    if grep -qs broken -- "$input"; then
        echo "Error: $input: broken; mend it" >&2
        exit 1
    fi
done
[ "$1" = batch ] || echo "$@" >"$output"
"""

REAL = f"""#!/bin/sh
PYTHONPATH={shlex.quote(str(ROOT))} exec {shlex.quote(sys.executable)} -c \
  {shlex.quote(WHOLE)} "$@"
"""


def free_environment():
    """The environment without what an outer make says in it, but with the tests' own cache."""
    ours = ("MAKE", "MFLAGS", "GNUMAKEFLAGS", "PROBES", "BRDFS", "EPS", "SHRM", "VENV", "PYTHON")
    return {
        name: value
        for name, value in os.environ.items()
        if name == "SHRM_CACHE_DIR" or not name.startswith(ours)
    }


class Project:
    """A copy of what `make` needs, set up without a network."""

    def __init__(self, folder):
        self.folder = folder
        shutil.copy(ROOT / "Makefile", folder)
        shutil.copy(ROOT / "pyproject.toml", folder)
        for name in ("examples", "probes", "research", "shrm_cli", "tests"):
            (folder / name).mkdir()
        shutil.copy(ROOT / "probes" / "batch.py", folder / "probes")
        (folder / ".venv" / "bin").mkdir(parents=True)
        self.install(STAND_IN)
        for name in "ab":
            self.write(f"probes/{name}.exr", "light")
        for stamp in (".made", ".installed"):
            (folder / ".venv" / stamp).touch()

    def install(self, script):
        command = self.folder / ".venv" / "bin" / "shrm"
        command.write_text(script)
        command.chmod(0o755)

    def write(self, name, text):
        # Files of the same tick of the clock would be as old as each other.
        time.sleep(0.02)
        (self.folder / name).write_text(text)

    def make(self, *arguments):
        """Run make to its end."""
        with self.begin(*arguments) as child:
            out, err = child.communicate(timeout=120)
        return subprocess.CompletedProcess(child.args, child.returncode, out, err)

    def begin(self, *arguments, **options):
        """Start make."""
        return subprocess.Popen(
            ["make", *arguments],
            cwd=self.folder,
            env={**free_environment(), "LC_ALL": "C"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )

    def batch(self, *arguments, probes="probes/a.exr probes/b.exr", brdfs=BRDFS, eps=""):
        asked = f"PROBES={probes}", f"BRDFS={brdfs}", f"EPS={eps}"
        return self.make("batch", *asked, *arguments)

    def calls(self):
        """How `shrm` was called since the last time, in alphabetical order."""
        log = self.folder / "calls"
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        return sorted(lines)

    def built(self):
        """The names of maps and pictures; the page over all of them and the log are left out."""
        names = {path.name for path in (self.folder / "build").glob("[!.]*")}
        return sorted(names - {"index.html", "batch.jsonl"})
