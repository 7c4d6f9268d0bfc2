"""What `make batch` does: it has `shrm batch` bake the lists of the makefile, and draws the maps.

What is up to date is decided by `shrm batch`. A picture of each map of a BRDF is drawn anew when
the map or RENDER_FLAGS changed, or the picture itself, and the page over all maps likewise; what
they were drawn of stands in ``build/.pictures``.

The lists PROBES, BRDFS and FORMS are words as in a shell, so that quotes keep a name with spaces
together. Make hands them over in the environment, as it does its own options: with ``-n`` the
commands are printed, and nothing is done. It runs with any Python, and needs no packages.
"""

import glob
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

BUILD = Path("build")
DRAWN = BUILD / ".pictures"
NAMES = f"{BUILD}/{{probe}}.{{brdf}}.{{to}}.exr"
PAGE = ["contact", str(BUILD), "--quiet", "--title", "make batch"]
SHRM = os.environ["BATCH_SHRM"]


def words(name: str) -> list[str]:
    """Split a variable of the makefile into words, as a shell does."""
    try:
        return shlex.split(os.environ.get(f"BATCH_{name}", ""))
    except ValueError as error:
        sys.exit(f"Error: {name}: {error}; quote names as in a shell")


def commands(letters: str, jobs: list[str]) -> list[list[str]]:
    """Return the commands that bake all BRDFs, and then each form, of all probes."""
    shared = ["-o", NAMES, "--log", f"{BUILD}/batch.jsonl", *jobs]
    shared += ["--force"] if "B" in letters else []
    brdfs = [word for spec in words("BRDFS") for word in ("--brdf", spec)]
    eps = ["--eps", *words("EPS")] if words("EPS") else []
    asked = [[*brdfs, *eps, *words("PREFILTER_FLAGS")]] if brdfs else []
    asked += [["--to", form, *words(f"FLAGS_{form}")] for form in dict.fromkeys(words("FORMS"))]
    return [[SHRM, "batch", *each, *shared, "--", *words("PROBES")] for each in asked]


def say(text: str) -> None:
    """Print lines, whatever the names in them are."""
    sys.stdout.buffer.write(os.fsencode(f"{text}\n"))


def carry_out(command: list[str]) -> bool:
    """Run a command, which ends with this process, and return whether it succeeded."""
    with subprocess.Popen(command) as child:
        try:
            return child.wait() == 0
        except KeyboardInterrupt:  # which a terminal has sent it, too
            child.wait()
            raise
        except BaseException:
            child.terminate()
            raise


def state(path: str) -> object:
    """Return what changes when a file changes."""
    status = os.stat(path) if os.path.exists(path) else None
    return status and [status.st_mtime_ns, status.st_size]


def draw(jobs: int) -> bool:
    """Draw maps whose pictures are out of date, and the page; return whether all could be."""
    flags, page = words("RENDER_FLAGS"), f"{BUILD}/index.html"
    before = json.loads(DRAWN.read_text()) if DRAWN.exists() else {}
    known = dict(before)

    def renew(target: str, command: list[str], made_of: object) -> bool:
        """Run a command if its target is not what it made last, or was made of something else."""
        if known.get(target) == [made_of, state(target)]:
            return True
        succeeded = carry_out([SHRM, *command, "-o", target])
        if succeeded:
            known[target] = [made_of, state(target)]
        return succeeded

    def draw_one(path: str) -> bool:
        return renew(f"{path[:-4]}.png", ["render", path, *flags], [flags, state(path)])

    pool = ThreadPoolExecutor(jobs)
    try:
        drawn = sorted(path for to in ("auto", "shrm") for path in glob.glob(f"{BUILD}/*.{to}.exr"))
        succeeded = list(pool.map(draw_one, drawn))
        maps = sorted(glob.glob(f"{BUILD}/*.exr"))
        return all(succeeded) & (not maps or renew(page, PAGE, [*map(state, maps)]))
    finally:
        pool.shutdown(cancel_futures=True)
        if known != before:
            whole = DRAWN.with_name(f"{DRAWN.name}-{os.getpid()}")
            whole.write_text(json.dumps(known))
            whole.replace(DRAWN)


def main() -> None:
    """Bake every pair, or say what that would be."""
    make = os.environ.get("MAKEFLAGS", "").split(" ")
    letters = "" if make[0].startswith("-") or "=" in make[0] else make[0]
    counts = [found[1] for found in (re.fullmatch(r"-j(\d+)", each) for each in make) if found]
    baking = commands(letters, ["--jobs", counts[0]] if counts else [])
    if not words("PROBES") or not baking:
        sys.exit("Error: nothing to bake: name one of PROBES and one of BRDFS or FORMS at least")
    if set("nqt") & set(letters):  # of which lines that begin with + know nothing
        say("\n".join(map(shlex.join, [*baking, [SHRM, *PAGE, "-o", f"{BUILD}/index.html"]])))
        return
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    BUILD.mkdir(exist_ok=True)
    succeeded = [carry_out(command) for command in baking]
    succeeded.append(draw(int(counts[0]) if counts else os.cpu_count() or 1))
    if not all(succeeded):
        say("Some jobs failed, see above; the others are in build/")
        sys.exit(1)
    say(f"Maps and pictures are in {Path.cwd() / BUILD}/, and index.html shows all of them")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
    except OSError as error:
        sys.exit(f"Error: {error.filename or BUILD}: {error.strerror}; nothing can be made there")
