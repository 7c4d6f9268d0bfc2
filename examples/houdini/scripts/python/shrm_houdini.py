"""The tool of the shelf: light of a probe by shrm, as the texture of an environment light.

It runs the command `shrm`, which may belong to another Python: Houdini's own needs no packages.
The variable SHRM names it, with its path, where it is not called so: in houdini.env, for example,
SHRM = "/path/to/python -m shrm_cli".
"""

import json
import os
import shlex
import subprocess
import tempfile
from pathlib import Path

import hou

TEXTURES = "env_map", "xn__inputstexturefile_r3ah"
"""The texture of environment lights of objects, and of dome lights of stages."""
CONTROL = "xn__inputstexturefile_control_shbh"
"""What a dome light does with it."""
EVALUATED = "$`"
"""What Houdini takes for expressions in the names of files."""
OF_PYTHON = "PYTHONHOME", "PYTHONPATH"
"""Variables by which Houdini's own Python would disturb the one that shrm belongs to."""


def light():
    """Ask for a probe and a BRDF, and set the texture; whatever is wrong is one line."""
    probe = hou.text.expandString(hou.ui.selectFile(title="Probe", file_type=hou.fileType.Image))
    if not probe:
        return
    button, brdf = hou.ui.readInput(
        "BRDF of a mirror picture, such as ggx:roughness=0.4; none for the light itself",
        buttons=("Make", "Cancel"), close_choice=1, title="shrm",
    )  # fmt: skip
    if button:
        return
    try:
        path = made(Path(probe), brdf.strip(), Path(hou.text.expandString("$HIP")) / "shrm")
    except (RuntimeError, OSError, ValueError) as error:
        said = f"shrm: {' '.join(str(error).split())}"
        hou.ui.displayMessage(said, severity=hou.severityType.Error)
        return
    lights = [node for node in hou.selectedNodes() if texture_of(node) is not None]
    if not lights:
        lights = [hou.node("/obj").createNode("envlight", "shrm_light")]
        lights[0].moveToGoodPosition()
    for node in lights:
        texture_of(node).set(path)
        if node.parm(CONTROL) is not None:
            node.parm(CONTROL).set("set")


def texture_of(node):
    """Return the parameter of a node that holds the texture; None of what is no such light."""
    found = map(node.parm, TEXTURES)
    return next((parameter for parameter in found if parameter is not None), None)


def made(probe, brdf, folder):
    """Make a lat-long of the light, or of what a material reflects of it; return its name."""
    found = sorted(set(EVALUATED).intersection(str(folder / probe.stem)))
    if found:
        raise RuntimeError(f"{probe}: Houdini reads {' '.join(found)} as no name; rename it")
    folder.mkdir(parents=True, exist_ok=True)
    if not brdf:
        place = folder / probe.stem
        told = json.loads(run("export", probe, "--for", "usd", "--force", "--json", "-o", place))
        (name,) = (each["name"] for each in told["files"] if each["name"].endswith(".exr"))
        return (place / name).as_posix()
    target = folder / f"{probe.stem}.latlong.exr"
    with tempfile.TemporaryDirectory() as scratch:
        of_brdf = Path(scratch) / "map.exr"
        run("prefilter", probe, "--brdf", brdf, "-o", of_brdf)
        seen = "--view", "0,0", "--by", "reflection"
        run("convert", of_brdf, "--to", "latlong", *seen, "--force", "-o", target)
    return target.as_posix()


def words_of(command):
    """The words of a command, in which Windows' backslashes are parts of paths."""
    found = shlex.shlex(command, posix=True)
    found.whitespace_split, found.commenters = True, ""
    if os.sep == "\\":
        found.escape = ""
    return list(found)


def run(*arguments):
    """Run the command, and return what it prints; RuntimeError has the line of what is wrong."""
    line = [*words_of(os.environ.get("SHRM", "shrm")), *map(str, arguments)]
    own = {name: each for name, each in os.environ.items() if name not in OF_PYTHON}
    try:
        done = subprocess.run(line, capture_output=True, text=True, encoding="utf-8", env=own)
    except FileNotFoundError:
        raise RuntimeError(f"there is no command {line[0]}; name it in SHRM") from None
    if done.returncode:
        said = (done.stderr.strip() or "it failed").splitlines()[-1]
        raise RuntimeError(said.removeprefix("Error: "))
    return done.stdout
