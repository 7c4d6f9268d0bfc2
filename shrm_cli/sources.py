"""A fingerprint of the program's own source code, which tells one state of it from another.

The release of a checkout stays the same while its code changes. Files and cache entries record
this instead, so that what another state of the program made is noticed.
"""

import functools
import hashlib
import os
import sys
from contextlib import suppress

import shrm_cli

_ROOT = os.path.dirname(os.path.abspath(__file__))

MAPS = ("", "brdf", "files", "lights", "maps", "plan", "probe", "sphere")
"""The folders of the package whose code decides what maps hold. The empty name stands for the
modules that lie in no folder; with the others go all folders below them."""
EXPORTS = (*MAPS, "export")
"""The folders whose code decides the files of engines."""
COEFFICIENTS = ("brdf", "sphere")
"""The folders whose code decides the coefficients of BRDFs."""
TRANSFER = ("", "files", "geometry", "sphere", "transfer")
"""The folders whose code decides the transfer of meshes."""
_SUFFIXES = (".py", ".csv", ".js")
"""The suffixes of modules, and of tables and scripts that they read."""
_BUILT = ("_version.py",)
"""What is written when the package is built: two builds of the same code are the same program."""


@functools.cache
def fingerprint(folders: tuple[str, ...] = MAPS, root: str = _ROOT) -> str:
    """Return a digest of the modules in some folders of the package: their names and contents.

    Tables and scripts beside the modules, which they read, count as well.

    `root` is the folder of the package. Returns 16 hexadecimal digits. It takes about 2 ms, once a
    process. Where there are no files, as in a package that is run from an archive, it is a digest
    of the version.
    """
    digests = [_folder_digest(folder, root) for folder in sorted(set(folders))]
    if not any(digests):
        digests = [shrm_cli.__version__.encode()]
    return hashlib.sha256(b"".join(digests)).hexdigest()[:16]


@functools.cache
def fingerprint_with(module: str) -> str:
    """Return a digest of what decides maps, with the package or module of somebody else's in it."""
    return hashlib.sha256(fingerprint().encode() + package_digest(module)).hexdigest()[:16]


@functools.cache
def package_digest(module: str) -> bytes:
    """Return a digest of somebody else's package or module; empty where it is in no file.

    `module` is the full name of a module that is loaded. All modules and tables of the package that
    it lies in count; what these import of other packages does not.
    """
    parts = module.split(".")
    names = (".".join(parts[:end]) for end in range(1, len(parts) + 1))
    # Packages that share a name, such as that of a studio, have no file of their own.
    files = (getattr(sys.modules.get(name), "__file__", None) for name in names)
    place: str = next(filter(None, files), "")
    folder, file = os.path.split(place)
    if file.startswith("__init__."):
        return _folder_digest(os.path.basename(folder), os.path.dirname(folder))
    with suppress(OSError), open(place, "rb") as stream:  # it may lie in an archive
        return stream.read()
    return b""


@functools.cache
def _folder_digest(folder: str, root: str) -> bytes:
    """Return a digest of what lies in a folder of the package; empty where nothing does.

    It is kept, because the coefficients and the maps of a run share folders.
    """
    digest = hashlib.sha256()
    names = sorted(_modules(root, folder))
    for name in names:
        with open(os.path.join(root, name), "rb", buffering=0) as stream:
            content = stream.read()
        digest.update(f"{name.replace(os.sep, '/')}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.digest() if names else b""


def _modules(root: str, folder: str) -> list[str]:
    """Return the paths below the root of a folder's modules, and of those in folders below it.

    The one that setuptools-scm writes is left out: it changes with commits that change no code.
    """
    found, pending = [], [folder]
    while pending:
        here = pending.pop()
        try:
            entries = os.scandir(os.path.join(root, here))
        except OSError:
            continue
        with entries:
            for entry in entries:
                name = os.path.join(here, entry.name)
                if entry.is_dir():  # some packages of scripts are folders that end in .js
                    if folder and entry.name != "__pycache__":
                        pending.append(name)
                elif entry.name.endswith(_SUFFIXES):
                    found.append(name)
    return [name for name in found if name not in _BUILT]
