"""shrm: prefiltering of light probes for real materials in the frequency domain.

The library in a few lines::

    import shrm_cli as shrm

    map_ = shrm.prefilter("probe.exr", "ggx:roughness=0.4", eps=0.03)
    map_.save("out.exr")
    radiance = map_.radiance(normals, views)

Each name is imported when it is first used (PEP 562), so that ``import shrm_cli`` alone loads
nothing. docs/library.md documents the public names.
"""

import importlib
import sys
from types import ModuleType

# Type checkers know this name and take it for true. The module `typing` is not loaded for it:
# Ctrl-C prints a traceback of Python's own until `shrm_cli.__main__` listens to it.
TYPE_CHECKING = False

__release__ = "0.2.0"
"""The release that this is, or will be. Files say it rather than `__version__`, so that two builds
that compute the same write the same bytes.
"""

_HOMES = {
    "prefilter": "prefilter",
    "reference": "reference",
    "choose": "choose.choose",
    "Choice": "choose.offer",
    "Offer": "choose.offer",
    "open_map": "maps.file",
    "is_map": "maps.file",
    "Map": "maps.base",
    "MapInfo": "maps.info",
    "open_probe": "probe.probe",
    "Probe": "probe.probe",
    "Brdf": "brdf.base",
    "Parameter": "brdf.base",
    "parse_spec": "brdf.spec",
    "seen_errors": "render.seen",
    "SeenErrors": "render.seen",
    "using": "settings",
    "ShrmError": "errors",
    "ProbeError": "errors",
    "BrdfError": "errors",
    "OrderError": "errors",
    "MapError": "errors",
    "OutputError": "errors",
    "ArgumentError": "errors",
    "ShrmWarning": "errors",
}
"""Every public name, and the module of this package that defines it."""

__all__ = [*_HOMES, "__release__", "__version__"]

if TYPE_CHECKING:
    from typing import Any

    from shrm_cli._version import version as __version__
    from shrm_cli.brdf.base import Brdf as Brdf
    from shrm_cli.brdf.base import Parameter as Parameter
    from shrm_cli.brdf.spec import parse_spec as parse_spec
    from shrm_cli.choose.choose import choose as choose
    from shrm_cli.choose.offer import Choice as Choice
    from shrm_cli.choose.offer import Offer as Offer
    from shrm_cli.errors import ArgumentError as ArgumentError
    from shrm_cli.errors import BrdfError as BrdfError
    from shrm_cli.errors import MapError as MapError
    from shrm_cli.errors import OrderError as OrderError
    from shrm_cli.errors import OutputError as OutputError
    from shrm_cli.errors import ProbeError as ProbeError
    from shrm_cli.errors import ShrmError as ShrmError
    from shrm_cli.errors import ShrmWarning as ShrmWarning
    from shrm_cli.maps.base import Map as Map
    from shrm_cli.maps.file import is_map as is_map
    from shrm_cli.maps.file import open_map as open_map
    from shrm_cli.maps.info import MapInfo as MapInfo
    from shrm_cli.prefilter import prefilter as prefilter
    from shrm_cli.probe.probe import Probe as Probe
    from shrm_cli.probe.probe import open_probe as open_probe
    from shrm_cli.reference import reference as reference
    from shrm_cli.render.seen import SeenErrors as SeenErrors
    from shrm_cli.render.seen import seen_errors as seen_errors
    from shrm_cli.settings import using as using


def __getattr__(name: str) -> "Any":
    if name == "__version__":
        value: Any = _built_version()
    elif name in _HOMES:
        value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def _built_version() -> str:
    """Return what setuptools-scm wrote when this was built or installed; see docs/install.md."""
    try:
        from shrm_cli._version import version
    except ImportError:  # a tree that was never installed
        return f"{__release__}.dev0"
    return version


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES, "__version__"})


class _Library(ModuleType):
    """The class of this module, which keeps public names from being rebound to submodules.

    When the import system loads the submodule ``shrm_cli.prefilter``, it binds it to the package's
    attribute ``prefilter``, and it does the same for ``reference``. This class ignores that,
    because the public names `prefilter` and `reference` are functions.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Library
