"""What the worker calls: pixels of a panorama become the files of an engine.

The packages need neither OpenImageIO nor OpenEXR for that: the page read the file.
"""

import json
import tempfile
from pathlib import Path

import numpy as np

from shrm_cli.errors import ShrmError
from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import ENGINES

NEED_OPENEXR = ("blender", "godot", "realitykit", "unity", "unreal", "usd")
"""Engines that get a panorama in OpenEXR, which OpenEXR's own library writes."""


TEXELS = {"three": "rgba16f"}
"""The texels of engines whose own choice is blocks: what these lose is found by OpenImageIO."""


def engines():
    """JSON of the names and titles of the engines whose files can be made here."""
    found = [(name, engine(name).title) for name in ENGINES if name not in NEED_OPENEXR]
    return json.dumps(found)


def made(name, image, width, height, target, size, report):
    """Return the files as pairs of name and bytes, what is said of them, and an error or None."""
    try:
        pixels = np.asarray(image.to_py(), dtype=np.float32).reshape(height, width, -1)[..., :3]
        probe = Probe.from_array(pixels, name=name)
        source = Source(Path(name).stem, name, probe)
        package = packaged(
            source, engine(target), Asked(size=size, texels=TEXELS.get(target)), report
        )
        with tempfile.TemporaryDirectory() as folder:
            paths = write(package, Path(folder) / "made")
            files = [(path.name, path.read_bytes()) for path in paths]
        return files, [*package.told, *probe.report.warnings(), *package.warnings], None
    except ShrmError as error:
        return [], [], str(error)
