"""What `make batch` does: it finds what is out of date, and has make run those jobs side by side.

Make cannot handle spaces, quotes, ``$`` and ``%`` in the names of its targets. So the jobs have
digests for names, and stamps in ``build/.batch`` for targets; the names of probes, BRDFs and maps
stand in the commands alone, quoted for the shell. A stamp tells what its output was made of, the
program included, and the sum by which damage of the output is noticed.

The lists PROBES, BRDFS and FORMS are words as in a shell, so that quotes keep a name with spaces
together. Make hands them over in the environment, as it does its own options: with ``-n`` the
commands are printed, and nothing is done. It runs with any Python, and needs no packages.
"""

from __future__ import annotations

import functools
import glob
import hashlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

BUILD = Path("build")
STAMPS = BUILD / ".batch"
PAGE = BUILD / "index.html"
FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
ROOT = Path(__file__).resolve().parents[1]
MARK = re.compile(rb"shrm:representation\0|shrm:recipe\0string\0.{4}(?!\{\"probe\":)", re.DOTALL)
"""What stands in the headers of OpenEXR files that are maps or pictures, and no probes."""
MOST_HEADER = 2**18
LONGEST = 80
"""The most bytes of a probe's or a BRDF's part of a file's name."""
ENDING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
"""The signals that end a process; Windows has no SIGHUP."""


def options_of_make() -> str:
    """Return make's options of one letter, such as ``n``; they stand before all others."""
    first = os.environ.get("MAKEFLAGS", "").split(" ")[0]
    return "" if first.startswith("-") or "=" in first else first


def words(name: str) -> list[str]:
    """Split a variable of the makefile into words, as a shell does."""
    try:
        found = shlex.split(os.environ.get(f"BATCH_{name}", ""))
    except ValueError as error:
        sys.exit(f"Error: {name}: {error}; quote names as in a shell")
    if any(map(has_controls, found)):
        sys.exit(f"Error: {name}: names with control characters cannot be baked")
    return found


def has_controls(name: str) -> bool:
    """Whether a name has control characters, of which some end the lines of a makefile."""
    return any(ord(letter) < 32 for letter in name)


def probes() -> list[str]:
    """Return the probes: files, patterns such as ``hdr/*.exr``, and ``%`` for six faces.

    What matches no file keeps its name, and fails by it. Maps and pictures that a pattern matches
    are left out.
    """
    found: dict[str, None] = {}
    for word in words("PROBES"):
        matching = [word] if os.path.exists(word) else sorted(glob.glob(word))
        made = {name for name in matching if name != word and is_output(name)}
        if made and made == set(matching):
            sys.exit(f"Error: PROBES: {word!a} matches maps and pictures alone; correct it")
        matching = [name for name in matching if name not in made]
        found.update(dict.fromkeys(matching or [word]))
    return [f"./{name}" if name.startswith("-") else name for name in found]


def is_output(name: str) -> bool:
    """Whether a file is a map or a picture that shrm wrote, by its header."""
    try:
        with open(name, "rb") as stream:
            header = stream.read(MOST_HEADER)
    except OSError:
        return False
    return header.startswith(b"\x76\x2f\x31\x01") and MARK.search(header) is not None


def program(*more: str) -> str:
    """Return the fingerprint of the program that makes maps, and of more folders of it.

    It is empty where the package cannot be imported by this Python, or is not there.
    """
    sys.path.insert(0, str(ROOT))
    try:
        from shrm_cli.sources import MAPS, fingerprint

        return fingerprint((*MAPS, *more), str(ROOT / "shrm_cli"))
    except (ImportError, SyntaxError, OSError):
        return ""
    finally:
        sys.path.remove(str(ROOT))


def checksums(files: list[str]) -> dict[str, list[str]]:
    """Return the sum and the size of each file, as the command `cksum` of POSIX tells them."""
    if not files:
        return {}
    found = subprocess.run(["cksum", *files], stdout=subprocess.PIPE, check=False).stdout
    lines = [line.split()[:2] for line in os.fsdecode(found).splitlines()]
    return dict(zip(files, lines, strict=True)) if len(lines) == len(files) else {}


def label(text: str) -> str:
    """Return a text as a part of a file's name; long ones are cut, and end in a digest."""
    plain = "".join(c if c.isalnum() or c in "._+" else "-" for c in text)
    data = os.fsencode(plain)
    if len(data) <= LONGEST:
        return plain
    return f"{data[: LONGEST - 9].decode(errors='ignore')}-{digest(text)[:8]}"


def digest(text: str) -> str:
    """Return 64 digits that stand for a text."""
    return hashlib.sha256(os.fsencode(text)).hexdigest()


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


def state(files: list[str]) -> list[list[object]]:
    """Return what changes when files change: their names, times and sizes."""
    stats = [(name, os.stat(name)) for name in files]
    return [[name, status.st_mtime_ns, status.st_size] for name, status in stats]


class Job(NamedTuple):
    """A command that makes a file.

    Attributes
    ----------
    command : list of str
    output : pathlib.Path
    stamp : pathlib.Path
        The file that tells what the output was made of, and its sum.
    made_of : str
        What this stamp says where the output is there and up to date.
    is_due : bool
        Whether it is not.
    """

    command: list[str]
    output: Path
    stamp: Path
    made_of: str
    is_due: bool

    def rule(self, after: Job | None) -> str:
        """Return the rule of a makefile that does the job, after another one if that is due.

        The stamp is not there while the command runs: if that is killed, the job is due again.
        """
        before = after.stamp if after and after.is_due else ""
        line = shlex.join(self.command).replace("$", "$$")
        output = shlex.quote(str(self.output)).replace("$", "$$")
        said = f"echo {self.made_of} `cksum <{output}` >$@"
        return f"{self.stamp}: {before}\n\t@rm -f $@\n\t{line}\n\t@{said}"


def job(output: Path, command: list[str], inputs: object, after: Job | None = None) -> Job:
    """Return the job that makes a file.

    Parameters
    ----------
    output : pathlib.Path
    command : list of str
    inputs : JSON value
        What else the output depends on; the job is due again when it changes, and when the output
        is not as it was made.
    after : Job, optional
        A job whose output this one reads.
    """
    stamp = STAMPS / f"{digest(str(output))[:16]}.done"
    made_of = digest(json.dumps([command, inputs, after and after.made_of]))
    says = stamp.read_text().split() if stamp.exists() else None
    is_made = says == [made_of, *sums().get(str(output), ["gone"])]
    is_due = not is_made or "B" in options_of_make() or bool(after and after.is_due)
    return Job(command, output, stamp, made_of, is_due)


@functools.cache
def sums() -> dict[str, list[str]]:
    """Return the checksums of all outputs that were there when this process began."""
    return checksums(sorted(name for name in glob.glob(f"{BUILD}/*") if os.path.isfile(name)))


class Jobs:
    """All jobs, by their outputs in their order, and what cannot be done."""

    def __init__(self) -> None:
        self.made: dict[Path, Job] = {}
        self.rules: list[str] = []
        self.missing: list[str] = []

    def add(
        self, output: Path, command: list[str], inputs: object, after: Job | None = None
    ) -> Job:
        """Add the job that `job` returns, if no other one makes this output."""
        if output in self.made:
            sys.exit(
                f"Error: {output} would be made of {self.made[output].command[2]} and of "
                f"{command[2]}: names of probes, and of BRDFs, must differ; rename one of the same "
                "name"
            )
        self.made[output] = added = job(output, command, inputs, after)
        if added.is_due:
            self.rules.append(added.rule(after))
        return added

    def text(self) -> str:
        """Return the makefile of the jobs that are due."""
        due = " ".join(str(each.stamp) for each in self.made.values() if each.is_due)
        return "\n".join([f"all: {due}", f".PHONY: all {due}", *self.rules, ""])


def maps() -> list[str]:
    """Return all maps that are there, but what a killed process has left, whose name is hidden."""
    return sorted(glob.glob(f"{BUILD}/*.exr"))


def page_of(shrm: str, shown: list[str]) -> Job:
    """Return the job that puts maps onto one page; it is due again when one has changed."""
    command = [shrm, "contact", *shown, "--quiet", "--title", "make batch", "-o", str(PAGE)]
    there = state([name for name in shown if os.path.exists(name)])
    return job(PAGE, command, [there, program("render", "report")])


def bake(shrm: str, probe: str, jobs: Jobs) -> None:
    """Add the jobs of a probe: a map and its picture for each BRDF, and a file for each form."""
    if has_controls(probe):
        jobs.missing.append(f"{probe!a}: names with control characters cannot be baked; rename it")
        return
    missing = [name for name in probe_files(probe) if not os.path.isfile(name)]
    if missing:
        jobs.missing.append(f"{missing[0]}: no such file; check PROBES")
        return
    light, stem = state(probe_files(probe)), Path(probe).stem
    stem = stem if len(os.fsencode(stem)) <= LONGEST else label(stem)
    for spec in dict.fromkeys(words("BRDFS")):
        baked = BUILD / f"{stem}.{brdf_label(spec)}.shrm.exr"
        options = ["--brdf", spec, "--eps", *words("EPS"), *words("PREFILTER_FLAGS")]
        command = [shrm, "prefilter", probe, *options, "-o", str(baked)]
        done = jobs.add(baked, command, [light, state(brdf_files(spec)), program()])
        picture = baked.with_suffix(".png")
        options = [*words("RENDER_FLAGS"), "-o", str(picture)]
        jobs.add(picture, [shrm, "render", str(baked), *options], [program("render")], done)
    for form in dict.fromkeys(words("FORMS")):
        formed = BUILD / f"{stem}.{label(form)}.exr"
        options = ["--to", form, *words(f"FLAGS_{form}"), "-o", str(formed)]
        jobs.add(formed, [shrm, "prefilter", probe, *options], [light, program()])


def carry_out(command: list[str], **options: Any) -> bool:
    """Run a command, and return whether it succeeded.

    A signal that would end this process ends it after the command, which a terminal has sent it
    too. SIGTERM comes to one process alone, and is passed on.
    """
    received: list[int] = []
    children: list[subprocess.Popen[bytes]] = []

    def pass_on() -> None:
        if signal.SIGTERM in received:
            for child in children:
                child.terminate()

    def receive(number: int, frame: object) -> None:
        received.append(number)
        pass_on()

    # Those that are ignored stay so, as under nohup.
    heard = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, receive) for number in heard}
    children.append(subprocess.Popen(command, **options))
    pass_on()  # what came before there was a child
    code = children[0].wait()
    for number, handler in before.items():
        signal.signal(number, handler)
    if received:
        sys.exit(128 + received[0])
    return code == 0


def run(jobs: Jobs) -> bool:
    """Have make run the jobs that are due, and return whether all succeeded.

    A job that fails does not stop the others. The makefile has no name, so that several runs at
    once have one each, and nothing stays of them. Make's own descriptors, by which it shares its
    number of jobs, stay open for the one that is started here. It gets no ``-i``, because a job
    that failed would be taken for done.
    """
    if not jobs.rules:
        return True
    letters = options_of_make()
    flags = letters.replace("i", "") + os.environ.get("MAKEFLAGS", "")[len(letters) :]
    with tempfile.TemporaryFile(dir=STAMPS) as makefile:
        makefile.write(os.fsencode(jobs.text()))  # names may be no UTF-8
        makefile.seek(0)
        os.set_inheritable(makefile.fileno(), True)
        name = f"/dev/fd/{makefile.fileno()}"
        options = ["--no-print-directory", "--no-builtin-rules", "-k", "-f", name]
        own = {**os.environ, "MAKEFLAGS": flags}
        return carry_out([os.environ["BATCH_MAKE"], *options], close_fds=False, env=own)


def say(text: str) -> None:
    """Print a line, whatever the names in it are."""
    sys.stdout.buffer.write(os.fsencode(f"{text}\n"))


def say_what_is_due(shrm: str, jobs: Jobs) -> None:
    """Print the commands that would be run, in their order."""
    due = [each.command for each in jobs.made.values() if each.is_due]
    wanted = [str(output) for output in jobs.made if output.suffix == ".exr"]
    page = page_of(shrm, sorted({*maps(), *wanted}))
    for command in [*due, *([page.command] if due or page.is_due else [])]:
        say(shlex.join(command))


def make_all(shrm: str, jobs: Jobs) -> bool:
    """Do the jobs that are due, then the page, and return whether all succeeded."""
    STAMPS.mkdir(parents=True, exist_ok=True)
    succeeded = run(jobs)
    page = page_of(shrm, maps())
    if maps() and page.is_due:
        if not carry_out(page.command):
            return False
        page.stamp.write_text(" ".join([page.made_of, *checksums([str(PAGE)]).get(str(PAGE), [])]))
    return succeeded


def main() -> None:
    """Bake every pair, or say what that would be."""
    shrm, jobs = os.environ["BATCH_SHRM"], Jobs()
    for probe in probes():
        bake(shrm, probe, jobs)
    for what in jobs.missing:
        sys.stderr.buffer.write(os.fsencode(f"Error: {what}\n"))
    if not jobs.made and not jobs.missing:
        sys.exit("Error: nothing to bake: name one of PROBES and one of BRDFS or FORMS at least")
    if set("nqt") & set(options_of_make()):  # of which lines that begin with + know nothing
        say_what_is_due(shrm, jobs)
        sys.exit(1 if jobs.missing else 0)
    try:
        succeeded = make_all(shrm, jobs) and not jobs.missing
    except OSError as error:
        sys.exit(f"Error: {error.filename or BUILD}: {error.strerror}; nothing can be made there")
    if not succeeded:
        say("Some jobs failed, see above; the others are in build/")
        sys.exit(1)
    say(f"Maps and pictures are in {Path.cwd() / BUILD}/, and index.html shows all of them")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:  # before there is a job to wait for
        sys.exit(130)
