"""What `make batch` has to do: this writes the jobs as a makefile of their own.

Make cannot handle spaces, quotes, ``$`` and ``%`` in the names of its targets. So the jobs have
numbers for names, and stamps in ``build/.batch`` for targets; the names of probes, BRDFs and maps
stand in the commands alone, quoted for the shell. Make still decides what is out of date, and runs
the jobs side by side.

The lists PROBES, BRDFS and FORMS are words as in a shell, so that quotes keep a name with spaces
together. Make hands them over in the environment. It runs with any Python, and needs no packages.
"""

from __future__ import annotations

import glob
import hashlib
import json
import os
import shlex
import sys
from pathlib import Path

BUILD = Path("build")
JOBS = BUILD / ".batch"
FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
LONGEST = 80
"""The most bytes of a probe's or a BRDF's part of a file's name."""


def words(name: str) -> list[str]:
    """Split a variable of the makefile into words, each once."""
    try:
        found = shlex.split(os.environ.get(f"BATCH_{name}", ""))
    except ValueError as error:
        sys.exit(f"Error: {name}: {error}; quote names as in a shell")
    if any(ord(letter) < 32 for word in found for letter in word):
        sys.exit(f"Error: {name}: names with control characters cannot be baked")
    return list(dict.fromkeys(found))


def probes() -> list[str]:
    """Return the probes: files, patterns such as ``hdr/*.exr``, and ``%`` for six faces.

    What matches no file keeps its name, and fails by it.
    """
    found: dict[str, None] = {}
    for word in words("PROBES"):
        matching = [word] if os.path.exists(word) else sorted(glob.glob(word))
        found.update(dict.fromkeys(matching or [word]))
    return [f"./{name}" if name.startswith("-") else name for name in found]


def label(text: str) -> str:
    """Return a text as a part of a file's name; long ones are cut, and end in a digest."""
    plain = "".join(c if c.isalnum() or c in "._+" else "-" for c in text)
    data = os.fsencode(plain)
    if len(data) <= LONGEST:
        return plain
    digits = hashlib.sha256(os.fsencode(text)).hexdigest()[:8]
    return f"{data[: LONGEST - 9].decode(errors='ignore')}-{digits}"


def brdf_label(spec: str) -> str:
    """Return the label of a BRDF: that of its specification, or of its file's name."""
    return label(Path(spec).stem if os.path.isfile(spec) else spec)


def probe_files(probe: str) -> list[str]:
    """Return the files of a probe, six where ``%`` stands for the faces."""
    if "%" in os.path.basename(probe) and not os.path.exists(probe):
        folder, name = os.path.split(probe)
        return [os.path.join(folder, name.replace("%", face)) for face in FACES]
    return [probe]


def brdf_files(spec: str) -> list[str]:
    """Return the files that a specification may name: measured ones and Python's."""
    terms = [spec, *(term.split("*", 1)[-1].strip() for term in spec.split("+"))]
    names = [*terms, *(f"{term.split('.py')[0]}.py" for term in terms if ".py" in term)]
    return sorted({name for name in names if os.path.isfile(name)})


def stamp(files: list[str]) -> list[list[object]]:
    """Return what changes when files change: their names, times and sizes."""
    stats = [(name, os.stat(name)) for name in files]
    return [[name, status.st_mtime_ns, status.st_size] for name, status in stats]


class Jobs:
    """The rules of the makefile, in their order, and the outputs that they make."""

    def __init__(self) -> None:
        self.rules: list[str] = []
        self.made: dict[str, str] = {}

    def add(self, output: Path, command: list[str], inputs: object, after: str = "") -> str:
        """Add a job, and return the name of its stamp.

        Parameters
        ----------
        output : Path
            The file that the command makes.
        command : list of str
        inputs : JSON value
            What else the output depends on; the job is done again when it changes.
        after : str
            The stamp of a job that has to be done before.
        """
        name = str(output)
        if name in self.made:
            sys.exit(
                f"Error: {name} would be made of {self.made[name]} and of {command[2]}: names of "
                "probes, and of BRDFs, must differ; rename one of the same name"
            )
        self.made[name] = command[2]
        base = JOBS / hashlib.sha256(os.fsencode(name)).hexdigest()[:16]
        done, wanted = base.with_suffix(".done"), base.with_suffix(".in")
        if not output.exists():
            done.unlink(missing_ok=True)
        write(wanted, json.dumps([command, inputs]))
        line = shlex.join(command).replace("$", "$$")
        self.rules.append(f"{done}: {wanted} {after}\n\t{line}\n\t@touch $@")
        return str(done)

    def fail(self, what: str) -> None:
        """Add a job that says what is wrong, and fails."""
        text = shlex.quote(f"Error: {what}").replace("$", "$$")
        name = f"missing-{len(self.rules)}"
        self.rules.append(f"{name}:\n\t@echo {text} >&2; false")

    def text(self) -> str:
        """Return the makefile."""
        targets = " ".join(rule.partition(":")[0] for rule in self.rules)
        return "\n".join([f"all: {targets}", ".PHONY: all", *self.rules, ""])


def write(path: Path, text: str) -> None:
    """Write a file if it does not hold this text yet; its time says when it changed."""
    data = os.fsencode(text)  # names may be no UTF-8
    if not path.exists() or path.read_bytes() != data:
        path.write_bytes(data)


def variable(name: str) -> list[str]:
    """Return the options in a variable of the makefile, which may repeat themselves."""
    return shlex.split(os.environ.get(f"BATCH_{name}", ""))


def bake(shrm: str, probe: str, jobs: Jobs) -> None:
    """Add the jobs of a probe: a map and its picture for each BRDF, and a file for each form."""
    missing = [name for name in probe_files(probe) if not os.path.isfile(name)]
    if missing:
        jobs.fail(f"{missing[0]}: no such file; check PROBES")
        return
    light, stem = stamp(probe_files(probe)), Path(probe).stem
    stem = stem if len(os.fsencode(stem)) <= LONGEST else label(stem)
    for spec in words("BRDFS"):
        baked = BUILD / f"{stem}.{brdf_label(spec)}.shrm.exr"
        options = ["--brdf", spec, "--eps", *variable("EPS"), *variable("PREFILTER_FLAGS")]
        command = [shrm, "prefilter", probe, *options, "-o", str(baked)]
        done = jobs.add(baked, command, [light, stamp(brdf_files(spec))])
        picture = baked.with_suffix(".png")
        options = [*variable("RENDER_FLAGS"), "-o", str(picture)]
        jobs.add(picture, [shrm, "render", str(baked), *options], [], done)
    for form in words("FORMS"):
        formed = BUILD / f"{stem}.{label(form)}.exr"
        options = ["--to", form, *variable(f"FLAGS_{form}"), "-o", str(formed)]
        jobs.add(formed, [shrm, "prefilter", probe, *options], light)


def main() -> None:
    """Write ``build/.batch/jobs.mk``."""
    JOBS.mkdir(parents=True, exist_ok=True)
    jobs = Jobs()
    for probe in probes():
        bake(os.environ["BATCH_SHRM"], probe, jobs)
    if not jobs.rules:
        sys.exit("Error: nothing to bake: name one of PROBES and one of BRDFS or FORMS at least")
    write(JOBS / "jobs.mk", jobs.text())


if __name__ == "__main__":
    main()
