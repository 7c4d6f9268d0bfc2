"""What the button of the node runs.

It runs the command `shrm`, which may belong to another Python: Nuke's own needs no packages.
"""

import os
import shlex
import subprocess
import tempfile
from pathlib import Path

import nuke

EVALUATED = "[]{}$\\%#"
"""What Nuke takes for expressions and frames in the names of files."""
OF_PYTHON = "PYTHONHOME", "PYTHONPATH"
"""Variables by which Nuke's own Python would disturb the one that shrm belongs to."""


def make(node):
    """Make what the knobs of the node say, and read it; whatever is wrong is one line."""
    try:
        path = written(node)
    except (RuntimeError, OSError, ValueError) as error:
        nuke.message(f"shrm: {' '.join(str(error).split())}")
        return
    with node.parent():
        read = next((e for e in nuke.allNodes("Read") if e["file"].value() == path), None)
        if read is None:
            read = nuke.nodes.Read()
            read["file"].fromUserText(path)
            read.setXYpos(node.xpos(), node.ypos() + 100)
        else:
            read["reload"].execute()
        read["raw"].setValue(True)  # linear, in the primaries of the probe


def written(node):
    """Write the file, and return its name as Nuke has it."""
    probe, output = (node[name].evaluate() or "" for name in ("probe", "output"))
    if not (probe and output):
        raise RuntimeError("name a probe and an output")
    found = sorted(set(EVALUATED).intersection(output))
    if found:
        raise RuntimeError(f"{output}: Nuke reads {' '.join(found)} as no name; name it otherwise")
    target, view = Path(output), node["view"].value()
    target.parent.mkdir(parents=True, exist_ok=True)
    asked = ["--brdf", node["brdf"].value(), "--error", f"{node['error'].value():g}", "--force"]
    if not view:
        run(node, "prefilter", probe, *asked, "-o", target)
        return target.as_posix()
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "map.exr"
        run(node, "prefilter", probe, *asked, "-o", made)
        seen = "--view", view, "--by", node["by"].value()
        run(node, "convert", made, "--to", "latlong", *seen, "--force", "-o", target)
    return target.as_posix()


def words_of(command):
    """The words of a command, in which Windows' backslashes are parts of paths."""
    found = shlex.shlex(command, posix=True)
    found.whitespace_split, found.commenters = True, ""
    if os.sep == "\\":
        found.escape = ""
    return list(found)


def run(node, *arguments):
    """Run the command; RuntimeError has the line that says what is wrong."""
    line = [*words_of(node["command"].value()), *map(str, arguments)]
    own = {name: each for name, each in os.environ.items() if name not in OF_PYTHON}
    try:
        done = subprocess.run(line, capture_output=True, text=True, encoding="utf-8", env=own)
    except FileNotFoundError:
        raise RuntimeError(f"there is no command {line[0]}; name it in Command") from None
    if done.returncode:
        said = (done.stderr.strip() or "it failed").splitlines()[-1]
        raise RuntimeError(said.removeprefix("Error: "))
    for warning in done.stderr.strip().splitlines():
        nuke.tprint(f"shrm: {warning}")
