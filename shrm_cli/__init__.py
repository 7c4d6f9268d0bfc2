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
from types import FunctionType, ModuleType

# Type checkers know this name and take it for true. The module `typing` is not loaded for it:
# Ctrl-C prints a traceback of Python's own until `shrm_cli.__main__` listens to it.
TYPE_CHECKING = False

__release__ = "0.2.0"
"""The release that this is, or will be. Files say it rather than `__version__`, so that two builds
that compute the same write the same bytes.
"""

_NAMES = {
    "prefilter": "prefilter",
    "analysis.analyze": "analyze",
    "render.basis": "basis_maps",
    "batch.batch": "batch",
    "choose.choose": "choose",
    "analysis.compare": "compare",
    "report.contact": "contact_page draw_contacts",
    "convert.convert": "convert",
    "analysis.describe": "describe",
    "brdf.environment.dfg": "dfg",
    "lights.edit": "edit_light Edit Dimming",
    "brdf.examine": "examine",
    "export.make": "export Asked",
    "rooms.make": "capture grid",
    "photo.brackets": "merge_brackets",
    "photo.ball": "unwrap_balls",
    "photo.unclip": "unclip",
    "lookdev.sheet": "lookdev",
    "maps.product.make": "product",
    "reference": "reference",
    "render.render": "render",
    "report.report": "report Look",
    "lights.split": "split_lamps",
    "probe.resample": "to_layout",
    "transfer.bake": "transfer",
    "view.show": "view",
    "probe.make": "furnace impulse studio",
    "probe.sky": "sky",
    "analysis.probe_statistics": "probe_statistics",
    "cli.bar": "progress_bar",
    "brdf.cache": "cache_usage clear_cache",
    "choose.offer": "Choice Offer",
    "batch.entry": "Entry",
    "batch.work": "Terms",
    "render.camera": "Viewer",
    "maps.file": "open_map is_map",
    "maps.base": "Map",
    "maps.info": "MapInfo",
    "probe.open": "open_probe",
    "probe.probe": "Probe",
    "probe.options": "ReadOptions",
    "probe.lighting": "project",
    "brdf.base": "Brdf Parameter",
    "brdf.spec": "parse_spec",
    "render.seen": "hdr_flip seen_errors SeenErrors",
    "settings": "using",
    "errors": "ShrmError ProbeError BrdfError OrderError "
    "MapError OutputError ArgumentError ShrmWarning",
}
"""The modules of this package that define public names, and the names of each."""

_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}

__all__ = [*_HOMES, "__release__", "__version__"]

if TYPE_CHECKING:
    from typing import Any

    from shrm_cli._version import version as __version__
    from shrm_cli.analysis.analyze import analyze as analyze
    from shrm_cli.analysis.compare import compare as compare
    from shrm_cli.analysis.describe import describe as describe
    from shrm_cli.analysis.probe_statistics import probe_statistics as probe_statistics
    from shrm_cli.batch.batch import batch as batch
    from shrm_cli.batch.entry import Entry as Entry
    from shrm_cli.batch.work import Terms as Terms
    from shrm_cli.brdf.base import Brdf as Brdf
    from shrm_cli.brdf.base import Parameter as Parameter
    from shrm_cli.brdf.cache import cache_usage as cache_usage
    from shrm_cli.brdf.cache import clear_cache as clear_cache
    from shrm_cli.brdf.environment.dfg import dfg as dfg
    from shrm_cli.brdf.examine import examine as examine
    from shrm_cli.brdf.spec import parse_spec as parse_spec
    from shrm_cli.choose.choose import choose as choose
    from shrm_cli.choose.offer import Choice as Choice
    from shrm_cli.choose.offer import Offer as Offer
    from shrm_cli.cli.bar import progress_bar as progress_bar
    from shrm_cli.convert.convert import convert as convert
    from shrm_cli.errors import ArgumentError as ArgumentError
    from shrm_cli.errors import BrdfError as BrdfError
    from shrm_cli.errors import MapError as MapError
    from shrm_cli.errors import OrderError as OrderError
    from shrm_cli.errors import OutputError as OutputError
    from shrm_cli.errors import ProbeError as ProbeError
    from shrm_cli.errors import ShrmError as ShrmError
    from shrm_cli.errors import ShrmWarning as ShrmWarning
    from shrm_cli.export.make import Asked as Asked
    from shrm_cli.export.make import export as export
    from shrm_cli.lights.edit import Dimming as Dimming
    from shrm_cli.lights.edit import Edit as Edit
    from shrm_cli.lights.edit import edit_light as edit_light
    from shrm_cli.lights.split import split_lamps as split_lamps
    from shrm_cli.lookdev.sheet import lookdev as lookdev
    from shrm_cli.maps.base import Map as Map
    from shrm_cli.maps.file import is_map as is_map
    from shrm_cli.maps.file import open_map as open_map
    from shrm_cli.maps.info import MapInfo as MapInfo
    from shrm_cli.maps.product.make import product as product
    from shrm_cli.photo.ball import unwrap_balls as unwrap_balls
    from shrm_cli.photo.brackets import merge_brackets as merge_brackets
    from shrm_cli.photo.unclip import unclip as unclip
    from shrm_cli.prefilter import prefilter as prefilter
    from shrm_cli.probe.lighting import project as project
    from shrm_cli.probe.make import furnace as furnace
    from shrm_cli.probe.make import impulse as impulse
    from shrm_cli.probe.make import studio as studio
    from shrm_cli.probe.open import open_probe as open_probe
    from shrm_cli.probe.options import ReadOptions as ReadOptions
    from shrm_cli.probe.probe import Probe as Probe
    from shrm_cli.probe.resample import to_layout as to_layout
    from shrm_cli.probe.sky import sky as sky
    from shrm_cli.reference import reference as reference
    from shrm_cli.render.basis import basis_maps as basis_maps
    from shrm_cli.render.camera import Viewer as Viewer
    from shrm_cli.render.render import render as render
    from shrm_cli.render.seen import SeenErrors as SeenErrors
    from shrm_cli.render.seen import hdr_flip as hdr_flip
    from shrm_cli.render.seen import seen_errors as seen_errors
    from shrm_cli.report.contact import contact_page as contact_page
    from shrm_cli.report.contact import draw_contacts as draw_contacts
    from shrm_cli.report.report import Look as Look
    from shrm_cli.report.report import report as report
    from shrm_cli.rooms.make import capture as capture
    from shrm_cli.rooms.make import grid as grid
    from shrm_cli.settings import using as using
    from shrm_cli.transfer.bake import transfer as transfer
    from shrm_cli.view.show import view as view


def __getattr__(name: str) -> "Any":
    if name == "__version__":
        value: Any = _built_version()
    elif name in _HOMES:
        value = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
        if isinstance(value, FunctionType):
            from shrm_cli.messages import strict

            value = strict(value)
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
    """List the public names, and not what this module itself needs."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


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
