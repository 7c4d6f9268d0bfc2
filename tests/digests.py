"""Digests of outputs without what every change of the source changes: `python -m tests.digests`.

Maps record the source that made them (`shrm:sources`) and a digest of all of their bytes
(`shrm:digest`), so that their bytes tell any two states of the program apart. Whoever changes code
that should leave outputs as they are makes the same files before and after, and compares what this
prints of them.
"""

import hashlib
import sys
from pathlib import Path

import OpenEXR

LEFT_OUT = {"shrm:program", "shrm:sources", "shrm:digest"}


def digest(path):
    """The digest of a file: of an EXR's attributes and pixels, and of the bytes of any other."""
    if Path(path).suffix != ".exr":
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    found = hashlib.sha256()
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            kept = {name: each for name, each in part.header.items() if name not in LEFT_OUT}
            found.update(repr(sorted((name, shown(each)) for name, each in kept.items())).encode())
            for name, channel in sorted(part.channels.items()):
                found.update(f"{name} {channel.pixels.dtype} {channel.pixels.shape}".encode())
                found.update(channel.pixels.tobytes())
    return found.hexdigest()


def shown(value):
    """An attribute as text that does not depend on where objects lie in memory."""
    if isinstance(value, list):  # of channels, which are told with their pixels
        return len(value)
    return value.tolist() if hasattr(value, "tolist") else repr(value)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print(digest(name), name)
