"""What an engine is, and what it is given: light as it wants it, and back come files.

An engine is a subclass of `Engine`, one in a module of `shrm_cli.export.engines`, and a row in
`vocabulary.ENGINES`. Nothing else knows it. An installed package offers one by an entry point of
the group `plugins.ENGINES`, which names the subclass.
"""

import importlib
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from shrm_cli import __release__
from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError, PluginError
from shrm_cli.export.asset import Asset
from shrm_cli.export.pixels import Clipped, Loss, TexelFormat, clip_warning, sentence
from shrm_cli.export.quoting import code_span, comment, markdown
from shrm_cli.export.tamed import Sampler
from shrm_cli.files.whole import write_bytes
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.splitsum.roughness import level_roughnesses
from shrm_cli.messages import explained
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.proxy import ProxyBox
from shrm_cli.records import record
from shrm_cli.vocabulary import ENGINES, TEXEL_FORMATS, LevelMapping


@record
class Light:
    """Light as an engine asked for it, in world axes. What is not known is None."""

    name: str
    """What the names of the files begin with."""
    source: str
    """The names of the files that it comes from, for the README."""
    levels: tuple[Array, ...] = ()
    """OpenEXR cubes of the split sum, of the engine's own sizes and roughnesses, of shape (6 N_k,
    N_k, 3) each."""
    roughness: tuple[float, ...] = ()
    """The perceptual roughness of each level."""
    lobe: str = "ggx"
    """The BRDF whose lobes the levels are of."""
    irradiance: Irradiance | None = None
    """Nine coefficients of the light at most, windowed as was asked for: for harmonics."""
    diffuse: Irradiance | None = None
    """Irradiance of as many coefficients as are known: for cubes of E."""
    skybox: Array | None = None
    """The light itself, averaged over texels, shape (6 N, N, 3)."""
    latlong: Array | None = None
    """The same light as a lat-long, centre +Z, the left quarter +X, shape (N, 2 N, 3)."""
    table: Array | None = None
    """The environment BRDF: scale and bias of f0, N.V across, roughness down from 0, shape (N, N,
    2)."""
    chromaticities: tuple[float, ...] | None = None
    """The primaries of the light."""
    asset: Asset | None = None
    """A glTF file that the light is to be in."""
    discs: tuple[Disc, ...] = ()
    """Lamps that all else is without."""

    def nine(self) -> Array | None:
        """Return the lighting coefficients L_lm of degrees 0 to 2, shape (9, 3), if known."""
        return None if self.irradiance is None else self.irradiance.nine()


@record
class OutputFile:
    """A file of an export: its name in the folder, and what writes it to a path.

    `write` writes by `files.whole.replacing`, directly or by a writer of ours, so that the file
    appears whole.
    """

    name: str
    write: Callable[[Path], object]


@dataclass
class Package:
    """The files of an export, and what is said about them."""

    files: list[OutputFile] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    """What was turned, scaled or packed, one sentence each, for the terminal and the README."""
    loading: list[str] = field(default_factory=list)
    """Lines of the engine's code that load the files."""
    warnings: list[str] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)
    """More for ``--json``."""
    losses: list[Loss] = field(default_factory=list)
    """What packing loses of the levels of all files."""
    limit: float = math.inf
    """The least brightness at which texels were clipped; infinite where none were."""

    def add_bytes(self, name: str, data: bytes) -> None:
        """Add a file of some bytes."""
        self.files.append(OutputFile(name, partial(write_bytes, data=data)))

    def add_text(self, name: str, text: str) -> None:
        """Add a file of text, in UTF-8 and with Unix's ends of lines."""
        self.add_bytes(name, text.encode())

    def tell_clipped(self, name: str, chosen: TexelFormat, found: Sequence[Clipped]) -> None:
        """Add one warning about everything that was clipped in a file, if anything was."""
        warning = clip_warning(name, chosen, found)
        if warning is not None:
            self.warnings.append(warning)
        if any(each.above for each in found):
            self.limit = min(self.limit, *chosen.largest)

    def tell_lost(self, name: str, losses: Sequence[Loss]) -> None:
        """Add a sentence about what packing loses of a file's levels, and the numbers."""
        self.told.append(sentence(comment(name), losses))
        self.losses += losses
        self.facts.setdefault("losses", {})[name] = [each.facts() for each in losses]


class Engine(ABC):
    """An engine or viewer that light is exported for."""

    name: ClassVar[str]
    title: ClassVar[str]
    """`name` and `title`: as ``--for`` takes it, and as it is called."""
    default_size: ClassVar[int] = 256
    """Texels along an edge of level 0; for engines without levels, rows of the lat-long, where 0 is
    as many as the light has."""
    formats: ClassVar[tuple[str, ...]] = ()
    """The names of the texel formats that it reads, the default first; empty where there is no
    choice."""
    spare: ClassVar[str | None] = None
    """Texels for light whose lamps its default changes by more than `packing.MAX_LAMP`, or its
    diffuse light in the last level by more than `packing.MAX_DIFFUSE`."""
    is_last_diffuse: ClassVar[bool] = False
    """Whether diffuse surfaces take the last level of its cube."""
    auto: ClassVar[tuple[str, ...]] = ("bc6h", "rgb9e5", "r11g11b10", "rgba16f")
    """Those of its formats that ``auto`` chooses from, the smallest first: what every machine that
    it runs on reads, which for desktops is not ASTC."""
    mapping: ClassVar[LevelMapping | None] = None
    """The `shrm_cli.maps.splitsum.roughness` law of its levels; None for a law of its own."""
    lobes: ClassVar[tuple[str, ...]] = ("ggx",)
    """The BRDFs whose split sums it reads."""
    least: ClassVar[int] = 1
    """Texels along an edge of its last level."""
    wants_levels: ClassVar[bool] = True
    wants_irradiance: ClassVar[bool] = True
    wants_diffuse: ClassVar[bool] = False
    wants_latlong: ClassVar[bool] = False
    """`wants_levels`, `wants_irradiance`, `wants_diffuse` and `wants_latlong`: which attributes of
    `Light` it is given: levels of a split sum, nine coefficients, the irradiance for cubes, the
    light as a lat-long."""
    latlong_rows: ClassVar[int | None] = None
    """The most rows of a lat-long of which it skips no pixel, where it is given no more."""
    default_skybox: ClassVar[int] = 0
    """Texels along an edge of the sharp cube that it is given by default, at most; 0 for none."""
    takes_skybox: ClassVar[bool] = False
    takes_table: ClassVar[bool] = False
    takes_asset: ClassVar[bool] = False
    """`takes_skybox`, `takes_table` and `takes_asset`: whether ``--skybox``, ``--dfg`` and
    ``--into`` apply."""
    lamps: ClassVar[int] = 0
    """The most directional lights that it shades with, where ``--sun split`` has lines for it."""
    sampler: ClassVar[Sampler | None] = None
    """How it filters a panorama, where that is known; ``--firefly-safe`` applies then."""

    def boxed(self, box: ProxyBox) -> list[str]:
        """Return lines of code by which the engine looks light up in a box; none if it cannot."""
        return []

    def sizes(self, size: int) -> tuple[int, ...]:
        """Return the texels along an edge of each level, for a level 0 of `size`.

        Raises ArgumentError if the engine reads no such size.
        """
        return halving(size, self.least)

    def roughness(self, sizes: Sequence[int]) -> tuple[float, ...]:
        """Return the perceptual roughness of each level, by which the engine looks it up."""
        if self.mapping is None:
            raise NotImplementedError(f"{self.name} has a law of its own")
        return level_roughnesses(len(sizes), self.mapping)

    @abstractmethod
    def pack(self, light: Light, texels: TexelFormat) -> Package:
        """Make the files of an engine.

        Parameters
        ----------
        light : Light
            All that the engine wants of it, as far as the source knows it. Where a split sum or
            an irradiance map is exported, the rest is missing; the engine leaves out the files
            that need it.
        texels : TexelFormat
            Of cubes; RGBA16F for engines that leave no choice.

        Raises MapError if a value is not finite.
        """


class PanoramaEngine(Engine):
    """An engine that filters a lat-long itself, and wants no more unless it says so."""

    default_size = 0
    wants_levels = False
    wants_irradiance = False
    wants_latlong = True

    def pack(self, light: Light, texels: TexelFormat) -> Package:
        made = Package()
        if light.latlong is not None:
            self.add_panorama(made, light.latlong, light)
        if (nine := light.nine()) is not None:
            self.add_nine(made, nine, light)
        return made

    @abstractmethod
    def add_panorama(self, made: Package, image: Array, light: Light) -> None:
        """Add the file of a lat-long, which lies as ours do, and what is said of it."""

    def add_nine(self, made: Package, nine: Array, light: Light) -> None:
        """Add the file of nine coefficients, shape (9, 3), if the engine wants them."""


def engine(name: str) -> Engine:
    """Return the engine of a name of `vocabulary.ENGINES`, or of an installed package.

    Raises ArgumentError if there is none. Raises PluginError if the one of an installed package
    cannot be used.
    """
    if name not in ENGINES:
        return _foreign(name)
    here = importlib.import_module(f"shrm_cli.export.engines.{ENGINES[name]}")
    classes = [each for each in vars(here).values() if isinstance(each, type)]
    (found,) = (c for c in classes if issubclass(c, Engine) and c.__module__ == here.__name__)
    return found()


def _foreign(name: str) -> Engine:
    from shrm_cli import plugins  # rarely needed

    installed = plugins.installed(plugins.ENGINES)
    if name not in installed:
        known = dict.fromkeys([*ENGINES, *sorted(installed)])
        raise ArgumentError("engine", f"{name!r} is none of {', '.join(known)}")
    found, where = plugins.load(installed[name]), plugins.where(installed[name])
    if not (isinstance(found, type) and issubclass(found, Engine)):
        raise PluginError(f"{where} is not a subclass of Engine; make it one")
    if found.__abstractmethods__:
        raise PluginError(f"{where} has no method pack(self, light, texels); write one")
    if not isinstance(getattr(found, "title", None), str):
        raise PluginError(f"{where} has no title; give it one")
    if getattr(found, "name", None) != name:
        raise PluginError(f"{where} calls itself something else; make its name {name!r}")
    if not set(found.formats) <= set(TEXEL_FORMATS[1:]):
        raise PluginError(f"{where} has other formats than {', '.join(TEXEL_FORMATS[1:])}")
    if found.wants_levels and found.mapping is None and found.roughness is Engine.roughness:
        raise PluginError(f"{where} wants levels, and has neither a mapping nor roughness()")
    try:
        return found()
    except Exception as error:
        raise PluginError(f"{where} cannot be made: {explained(error)}") from error


def halving(size: int, least: int, count: int | None = None) -> tuple[int, ...]:
    """Return sizes that halve from level to level, down to the least.

    Parameters
    ----------
    size : int
        A power of two.
    least : int
        The least size of a level.
    count : int, optional
        The number of levels; all down to the least by default, which are two at least, since a
        single level would be shown at every roughness.

    Raises ArgumentError if the size is no power of two, or too small for so many levels.
    """
    if size < 1 or size & (size - 1):
        raise ArgumentError("size", f"{size} is no power of two, which the mips of a cube need")
    needed = 2 * least if count is None else least << (count - 1)
    if size < needed:
        raise ArgumentError("size", f"must be {needed} at least")
    sizes = [size]
    while sizes[-1] >= 2 * least and len(sizes) != count:
        sizes.append(sizes[-1] // 2)
    return tuple(sizes)


# ---- the README of an export, which says what was done, and how it is loaded ---------------------

_PLAIN = re.compile(r"[^\W_][\w.-]*")
"""Names of files that Markdown shows as they are, also outside of spans of code."""


def title_line(engine: Engine, source: str) -> str:
    """Return the first line, which is known before there is any light."""
    return f"Light of {markdown(source)} for {engine.title}, by shrm {__release__}. Linear RGB."


def readme(engine: Engine, light: Light, package: Package) -> str:
    """Return the README: a line each of title, files, what was done, and loading, with the code.

    File names stand in it without folders, so that the same light makes the same text anywhere.
    """
    spans = [code_span(file.name) for file in package.files]
    told = []
    for line in package.told:
        name, colon, rest = line.partition(": ")
        is_hard = code_span(name) in spans and not _PLAIN.fullmatch(name)
        told.append(f"{code_span(name)}{colon}{rest}" if is_hard else line)
    lines = [
        title_line(engine, light.source),
        f"Files: {', '.join(spans)}.",
        f"What was done: {'; '.join(told) or 'nothing was turned or scaled'}.",
    ]
    if package.loading:
        code = (f"    {line}" for line in package.loading)
        lines += [f"Load it in {engine.title}:", "", *code]
    return "\n".join(lines) + "\n"
