"""Compiled modules, kept in the user's cache where Python keeps none.

With ``PYTHONDONTWRITEBYTECODE``, as in many containers, Python compiles a hundred modules again at
each start, which takes a third of a short run. Where the modules were not compiled as they were
installed, what they are compiled to is kept beside the tables of BRDFs, in a folder that is
this user's alone, because it is code. Python itself checks it against the modules.
"""

import contextlib
import os
import stat
import sys
from collections.abc import Iterator
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader
from types import CodeType

_FOLDER = "bytecode"
_PRIVATE = 0o700


def keep(package: str, compiled: str | None, cache: str) -> None:
    """Keep what the modules of a package are compiled to, from now on.

    Nothing is done where Python keeps it itself, where it came with the package, or where other
    users could put code into the folder.

    `package` is the folder of the package. `compiled` is where Python would look for what a module
    of it, that was imported, was compiled to. `cache` is the folder of the cache. It need not be
    there.
    """
    if not sys.dont_write_bytecode or sys.pycache_prefix or os.path.exists(compiled or ""):
        return
    folder = os.path.join(cache, _FOLDER)
    if not (os.path.isdir(package) and _is_private(folder)):
        return

    class Keeping(SourceFileLoader):
        """Loads modules as Python does, with another folder for what they are compiled to."""

        def get_code(self, fullname: str) -> CodeType | None:
            sys.pycache_prefix, sys.dont_write_bytecode = folder, False
            try:
                return super().get_code(fullname)
            except (EOFError, ValueError, TypeError):
                # Python keeps what a full disk cut off, and would fail to load it ever after.
                from importlib.util import cache_from_source

                with contextlib.suppress(OSError):
                    os.unlink(cache_from_source(self.path))
                return super().get_code(fullname)
            finally:
                sys.pycache_prefix, sys.dont_write_bytecode = None, True

    def find(path: str) -> FileFinder:
        if path != package and not path.startswith(package + os.sep):
            raise ImportError("of another package")
        return FileFinder(path, (Keeping, SOURCE_SUFFIXES))

    sys.path_hooks.insert(0, find)
    sys.path_importer_cache.pop(package, None)


def kept_files(cache: str) -> Iterator[tuple[str, int]]:
    """Yield the path and the size of each file that is kept in the folder of a cache."""
    for folder, _, names in os.walk(os.path.join(cache, _FOLDER)):
        for name in names:
            path = os.path.join(folder, name)
            yield path, os.lstat(path).st_size


def clear(cache: str) -> None:
    """Remove all that is kept, and its folder; what cannot be removed stays."""
    import shutil

    shutil.rmtree(os.path.join(cache, _FOLDER), ignore_errors=True)


def _is_private(folder: str) -> bool:
    """Whether a folder is this user's alone; it is made if need be."""
    if not hasattr(os, "geteuid"):  # as on Windows, where modes say nothing
        return False
    try:
        os.makedirs(os.path.dirname(folder), exist_ok=True)
        if not os.path.lexists(folder):
            os.mkdir(folder, _PRIVATE)
        found = os.lstat(folder)
    except OSError:
        return False
    is_own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
    return is_own and not stat.S_IMODE(found.st_mode) & ~_PRIVATE
