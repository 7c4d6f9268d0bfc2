"""BRDFs in Python files of the user, as ``path/to/mine.py:Mine:key=value`` names them.

Such a file is code, and naming it runs it. So nothing but what the user wrote on the command line,
or passed to a function, may be read as such a term: not what a file says.
"""

import os
import re
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.library import brdf_classes, checked_model
from shrm_cli.errors import BrdfError
from shrm_cli.files.whole import note
from shrm_cli.messages import explained
from shrm_cli.records import record

_TERM = re.compile(r"(?P<path>.+?\.py)(:(?P<name>[^:]*))?(:(?P<values>.*))?")


@record
class FileTerm:
    """A term that names a class in a Python file."""

    path: Path
    """The file, which need not exist."""
    name: str
    """The class; empty if it is left out."""
    values: str | None
    """What follows the second colon; None if there is none."""

    @property
    def label(self) -> str:
        """The term without its file."""
        return self.name if self.values is None else f"{self.name}:{self.values}"

    @property
    def is_there(self) -> bool:
        """Whether the file exists."""
        return os.path.isfile(self.path)


def file_term(text: str) -> FileTerm | None:
    """The parts of a term that names a Python file, or None if it names none."""
    match = _TERM.fullmatch(text.strip())
    if match is None:
        return None
    return FileTerm(Path(match["path"]), (match["name"] or "").strip(), match["values"])


def load_model(term: FileTerm) -> type[Brdf]:
    """Run a Python file, and return the class that a term names."""
    if not term.is_there:
        raise BrdfError(f"{term.path}: no such file; give path/to/file.py:Class")
    module = _run(term.path)
    found = vars(module).get(term.name)
    if not isinstance(found, type):
        names = [each.__name__ for each in brdf_classes(module)]
        known = " or ".join(f"{term.path}:{name}" for name in names)
        remedy = f"give {known}" if names else "it defines no subclass of Brdf"
        missing = f"has no class {term.name!r}" if term.name else "a class is to be named"
        raise BrdfError(f"{term.path}: {missing}; {remedy}")
    return checked_model(found, f"{term.path}: {term.name}")


class _Loader(SourceFileLoader):
    """Runs a file as it is now, without reading or writing bytecode beside it."""

    def path_stats(self, path: str) -> dict[str, float]:
        raise OSError("bytecode is not used")


def _run(path: Path) -> ModuleType:
    note(path)
    # The name is such that nothing can import it, and it is registered, as dataclasses expect.
    name = f"shrm user file {path.resolve()}"
    spec = spec_from_loader(name, _Loader(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise BrdfError(f"{path}: running it fails: {explained(error, str(path))}") from error
    return module
