"""`export`: from a probe, or from maps that were made of it, to the files that an engine loads."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from shrm_cli.brdf.environment.environment_brdf import environment_table
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.color import REC709, same_primaries, title_of
from shrm_cli.errors import ArgumentError, MapError, OutputError
from shrm_cli.export.asset import open_asset
from shrm_cli.export.cubes import levels_of_map
from shrm_cli.export.engine import Engine, Light, Package, readme, title_line
from shrm_cli.export.engine import engine as engine_of
from shrm_cli.export.lamps import add_lamps, better_cures, without_lamps
from shrm_cli.export.packing import packed, refuse_missing
from shrm_cli.export.pixels import CURE
from shrm_cli.export.tamed import tamed
from shrm_cli.files.whole import exists_error, keeping, note, together
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.info import in_primaries, provenance
from shrm_cli.maps.irradiance.irradiance import POLYNOMIAL_ORDER, Irradiance
from shrm_cli.maps.irradiance.prefilter import prefilter as prefilter_irradiance
from shrm_cli.maps.irradiance.window import Window
from shrm_cli.maps.request import Request
from shrm_cli.maps.splitsum.prefilter import make_levels
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.messages import check_fields, several
from shrm_cli.naming import probe_stem
from shrm_cli.orders import Orders
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.proxy import ProxyBox
from shrm_cli.probe.resample import default_size, to_grid
from shrm_cli.probe.shared import SharedProbe, shared
from shrm_cli.progress import Progress, Rising, using
from shrm_cli.records import record
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong

DIFFUSE_ORDER = 64
"""The order of the irradiance that cubes are made of. What is beyond rounds off the edge where the
irradiance becomes 0, 90 degrees from a lamp: by a hundredth of its peak under a lamp alone."""
TABLE_SIZE = 128
"""Texels along both edges of the environment-BRDF table."""
_README = "README.md"
"""How the name of the file ends that says what was done."""


@record
class Source:
    """What is exported: a probe, or a split sum, an irradiance map, or both."""

    name: str
    """What the names of the files begin with."""
    title: str
    """The names of the files it comes from, for the README."""
    probe: Probe | None = None
    split: SplitSum | None = None
    irradiance: Irradiance | None = None
    path: str = ""
    """The file of the probe or of the split sum, for messages."""

    @classmethod
    def of_maps(cls, name: str, maps: Sequence[tuple[str, Map]]) -> "Source":
        """Return the source that some maps are, by the paths of their files."""
        split = [(path, each) for path, each in maps if isinstance(each, SplitSum)]
        irradiance = [each for _, each in maps if isinstance(each, Irradiance)]
        for path, each in maps:
            if not isinstance(each, SplitSum | Irradiance):
                raise MapError(
                    f"{path}: {each.representation} is not what engines read; export its probe, a "
                    "split sum or an irradiance map"
                )
        if len(split) > 1 or len(irradiance) > 1:
            raise MapError(
                f"{maps[-1][0]}: a second map of a kind; give one split sum and one irradiance map"
            )
        title = " and ".join(Path(path).name for path, _ in maps)
        path, made = split[0] if split else ("", None)
        diffuse = irradiance[0] if irradiance else None
        return cls(name, title, split=made, irradiance=diffuse, path=path)

    @classmethod
    def open(
        cls, given: Sequence[str | Probe], name: str = "", reading: ReadOptions | None = None
    ) -> "Source":
        """Open a probe, or some maps.

        `given` are one probe or its file, or the files of maps. `name` is what the names of the
        files begin with; by default the name of the first. `reading` is how a probe is read.
        """
        paths = [each.name if isinstance(each, Probe) else each for each in given]
        name = name or probe_stem(paths[0])
        if not isinstance(given[0], Probe) and is_map(paths[0]):
            note(*paths)
            return cls.of_maps(name, [(path, open_map(path)) for path in paths])
        if len(given) > 1:
            raise ArgumentError("sources", f"begin with a probe, {paths[0]}; export it alone")
        return cls(name, Path(paths[0]).name, as_probe(given[0], reading), path=paths[0])

    def for_several(self) -> "Source":
        """Return the same source for several engines, which get the bytes that each gets alone.

        A probe is decoded, projected and resampled once for all of them, unless it has too many
        pixels to be held, or its colours are converted for each engine.
        """
        if self.probe is None or not same_primaries(self.probe.chromaticities, REC709):
            return self
        known = shared(self.probe)
        is_held = isinstance(known, SharedProbe) and known.is_held
        return replace(self, probe=known) if is_held else self

    @property
    def primaries(self) -> list[tuple[float, ...] | None]:
        """The primaries of all that it holds; None of what states none."""
        maps = [each.info.chromaticities for each in (self.split, self.irradiance) if each]
        return maps if self.probe is None else [self.probe.chromaticities]

    @property
    def proxy(self) -> ProxyBox | None:
        """The box of the probe, or that of the first map."""
        if self.probe is not None:
            return self.probe.proxy
        found = [each.info.proxy for each in (self.split, self.irradiance) if each]
        return found[0]

    def in_rec709(self) -> "Source":
        """Return the same source in the primaries that engines have."""
        split, irradiance = self.split, self.irradiance
        return replace(
            self,
            probe=None if self.probe is None else self.probe.in_primaries(REC709),
            split=None if split is None else cast(SplitSum, in_primaries(split, REC709)),
            irradiance=None
            if irradiance is None
            else cast(Irradiance, in_primaries(irradiance, REC709)),
        )

    def light(self) -> Probe | None:
        """Return the light itself: the probe, or a split sum's level of roughness 0."""
        if self.probe is not None or self.split is None or self.split.roughness[0] > 0:
            return self.probe
        if not self.split.is_ggx:  # such as cloth, which has no mirror
            return None
        return Probe.from_array(
            np.maximum(self.split.levels[0], 0),
            "openexr",
            name=self.path,
            sampling=self.split.sampling,
            chromaticities=self.split.info.chromaticities,
        )


@record
class Asked:
    """What the user asked for; what is None is the engine's to choose.

    Attributes
    ----------
    size : int, optional
        Texels along an edge of level 0, or rows of a lat-long.
    texels : str, optional
        The name of a texel format; ``auto`` is the smallest that keeps `max_error`, where
        the engine reads several.
    max_error : float, optional
        The most that packing may change a level: its RMS, 95 % of its texels and its lamps, as
        parts of 1.
    skybox : int, optional
        Texels along an edge of the sharp cube; 0 for none.
    window : str, optional
        The window of the nine coefficients, as `shrm_cli.maps.irradiance.window` has it; by default
        ``auto``, which changes nothing where nothing is negative.
    table : bool
        Whether the environment-BRDF table is wanted.
    keeps_primaries : bool
        Whether numbers stay in the primaries of the source; engines have those of Rec.709.
    into : str, optional
        The path of a glTF file that the light is put into.
    safe : bool
        Whether lamps of a panorama are spread over discs that the engine's filter resolves.
    sun : str, optional
        ``"split"`` takes the lamps out of all else, and makes lights of the engine of them.

    Examples
    --------
    >>> asked = shrm.Asked(size=64, skybox=0)
    >>> made = shrm.export("probes/studio.exr", "bevy", asked=asked)
    >>> sorted(file.name for file in made.files)
    ['studio_README.md', 'studio_diffuse.ktx2', 'studio_specular.ktx2']
    """

    size: int | None = None
    texels: str | None = None
    skybox: int | None = None
    window: str | None = None
    table: bool = False
    keeps_primaries: bool = False
    max_error: float | None = None
    into: str | None = None
    safe: bool = False
    sun: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def of_several(self, engines: Sequence[Engine]) -> list["Asked"]:
        """Return what is asked of each of some engines: what one has not, it is not asked for.

        Raises ArgumentError for what none of them has.
        """
        missing = [{why.argument: why for why in refusals(each, self)} for each in engines]
        for name, why in missing[0].items() if missing else ():
            if all(name in each for each in missing):
                raise why
        usual = Asked()
        return [replace(self, **{name: getattr(usual, name) for name in each}) for each in missing]


def export(
    sources: AnyProbe | Sequence[Probe | str | os.PathLike[str]],
    engine: str,
    folder: str | os.PathLike[str] | None = None,
    *,
    asked: Asked | None = None,
    reading: ReadOptions | None = None,
    progress: Progress | None = None,
) -> Package:
    """Make the files that an engine loads, and a README with the code that loads them.

    Parameters
    ----------
    sources : Probe, path-like, array or sequence of path-like
        A light probe, or the files of a split sum, an irradiance map, or both.
    engine : str
        One of `vocabulary.ENGINES`, or that of an installed package.
    folder : path-like, optional
        Where the files are written, all or none of them; by default they are not.
    asked : Asked, optional
        Sizes, texels and more that the engine would choose itself.
    reading : ReadOptions, optional
        How a probe is read.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Package
        Its `files`, and what was `told` of them.

    Raises
    ------
    ArgumentError, ProbeError, MapError, OutputError, PluginError

    Examples
    --------
    >>> made = shrm.export("probes/studio.exr", "unity")
    >>> any(file.name.endswith("_README.md") for file in made.files)
    True
    """
    if isinstance(sources, np.ndarray):  # which `several` would take for a list of its rows
        sources = as_probe(sources)
    given = several(sources, "sources")
    given = [each if isinstance(each, Probe) else os.fspath(each) for each in given]
    source = Source.open(given, reading=reading)
    if folder is not None:
        keep_other_export(source, engine_of(engine), Path(folder))
    made = packaged(source, engine_of(engine), asked or Asked(), progress)
    if folder is not None:
        write(made, Path(folder))
    return made


def packaged(
    source: Source, engine: Engine, asked: Asked, progress: Progress | None = None
) -> Package:
    """Make the files of an engine."""
    check(engine, asked)
    asset = None if asked.into is None else open_asset(asked.into)
    work = Rising(progress)
    with using(work):
        light, told, warnings = gather(source, engine, asked)
    work.end()
    light = replace(light, asset=asset)
    try:
        made = packed(engine, light, asked.texels, asked.max_error)
    except MapError as error:  # which names the level or the file that it was to be in
        raise MapError(f"{source.title}: {error}") from None
    if not made.files:
        raise MapError(f"{source.title}: nothing in it is what {engine.title} reads")
    if source.proxy is not None:
        _tell_box(engine, source.proxy, made)
    if source.probe is None:
        again = f"make the map anew, and {CURE} there"
        made.warnings = [line.replace(CURE, again) for line in made.warnings]
    elif asked.sun is None:
        clipped = source if asked.keeps_primaries else source.in_rec709()
        made.warnings = better_cures(made, cast(Probe, clipped.probe), engine)
    made.told[:0] = told
    made.warnings[:0] = warnings
    add_lamps(made, light, engine)
    made.add_text(f"{light.name}_{_README}", readme(engine, light, made))
    return made


def keep_other_export(source: Source, engine: Engine, folder: Path) -> None:
    """Refuse, before work begins, a folder that `write` would refuse for its README.

    The first line of that tells the probe, the engine and the release. Other options may change
    what follows, which is known at the end. A README that is cut off is no other's.
    """
    path = folder / f"{source.name}_{_README}"
    if path.is_file():
        line = f"{title_line(engine, source.title)}\n".encode()
        with suppress(OSError), path.open("rb") as file:
            found = file.read(len(line)).rstrip(b"\0")
            if not line.startswith(found):
                raise exists_error(path, "other inputs or options made it")


def _tell_box(engine: Engine, box: ProxyBox, made: Package) -> None:
    """Say where the probe was captured, and how the engine looks it up in its room."""
    low, high, at = (", ".join(f"{each:g}" for each in p) for p in (box.low, box.high, box.at))
    lines = engine.boxed(box)
    how = "" if lines else f"; {engine.title} looks it up as if all of it were far away"
    made.told.append(f"captured at ({at}) in the box from ({low}) to ({high}), world axes{how}")
    made.loading += lines
    made.facts["proxy"] = box.record()


def check(engine: Engine, asked: Asked) -> None:
    """Refuse what an engine has not, before work begins."""
    for why in refusals(engine, asked):
        raise why
    refuse_missing(asked.texels)
    if asked.size is not None and engine.wants_levels:
        engine.roughness(engine.sizes(asked.size))


def refusals(engine: Engine, asked: Asked) -> list[ArgumentError]:
    """Return why an engine has not what is asked for, one for each attribute that it lacks."""
    title, formats = engine.title, engine.formats
    one = f"{title} has one format"
    reads = f"{title} reads {', '.join([*formats, 'auto'])}" if formats else one
    known = (
        ("max_error", bool(formats), one),
        ("texels", asked.texels in ("auto", *formats), reads),
        ("skybox", engine.takes_skybox, f"{title} gets no sharp cube"),
        ("window", engine.wants_irradiance, f"{title} gets no coefficients"),
        ("table", engine.takes_table, f"{title} has a table of its own"),
        ("safe", engine.sampler is not None, f"{title} has no sampler that is known"),
        ("sun", engine.lamps > 0, f"lamps are not made for {title}; export what shrm sun leaves"),
        ("into", engine.takes_asset, f"{title} gets files of its own"),
    )
    return [
        ArgumentError(name, f"{asked.texels} " * (name == "texels") + f"does not apply; {why}")
        for name, has_it, why in known
        if getattr(asked, name) and not has_it
    ]


def gather(source: Source, engine: Engine, asked: Asked) -> tuple[Light, list[str], list[str]]:
    """Make the light that an engine wants, as far as the source knows it.

    Returns `light` and `told`, `warnings`.
    """
    told: list[str] = []
    warnings: list[str] = []
    others = [each for each in source.primaries if not same_primaries(each, REC709)]
    colors = []
    if others and asked.keeps_primaries:
        colors = [f"colours: in {title_of(others[0])}; engines take numbers for Rec.709"]
    elif others:
        source = source.in_rec709()
        colors = [f"colours: from {title_of(others[0])} to linear Rec.709, as engines have it"]
    discs: tuple[Disc, ...] = ()
    if asked.sun is not None:
        if source.probe is None:
            raise ArgumentError("sun", "applies to probes; this is a map")
        rest, discs, lines, warnings = without_lamps(source.probe, engine)
        source = replace(source, probe=rest)
        colors += lines
    itself = source.light()
    light = Light(source.name, source.title, chromaticities=source.primaries[0], discs=discs)
    if engine.wants_levels and source.split is not None:
        lobe = source.split.lobe
        if lobe not in engine.lobes:
            raise MapError(f"{source.path}: is of {lobe}; {engine.title} reads split sums of GGX")
        if asked.table and lobe != "ggx":
            raise ArgumentError("table", f"is that of GGX; make yours by shrm dfg --brdf {lobe}")
        levels, roughness, told = levels_of_map(source.split, source.path, engine, asked.size)
        light = replace(light, levels=levels, roughness=roughness, lobe=lobe)
    elif engine.wants_levels and source.probe is not None:
        size = asked.size or engine.default_size
        sizes = engine.sizes(size)
        roughness = engine.roughness(sizes)
        cubes, _ = make_levels(source.probe, roughness, size, sizes=sizes)
        light = replace(light, levels=tuple(cubes), roughness=roughness)
    if engine.wants_irradiance or engine.wants_diffuse:
        irradiance, diffuse, lines = _irradiance(source, itself, engine, asked)
        light = replace(light, irradiance=irradiance, diffuse=diffuse)
        warnings += lines
        if irradiance is not None and (window := irradiance.window).factors:
            change = f"({window.name}), which changes it by {window.change:.1%} RMS"
            told = [*told, f"irradiance: windowed {change}"]
    if itself is not None:
        light = _with_images(light, itself, engine, asked)
    if asked.safe and engine.sampler is not None and light.latlong is not None:
        image, lines = tamed(light.latlong, engine.sampler)
        light = replace(light, latlong=image)
        told = [*told, *lines]
    if asked.table:
        light = replace(light, table=environment_table(TABLE_SIZE))
    return light, [*colors, *told], warnings


def _irradiance(
    source: Source, light: Probe | None, engine: Engine, asked: Asked
) -> tuple[Irradiance | None, Irradiance | None, list[str]]:
    """Return nine coefficients, those for cubes, and warnings; None where nothing is known."""
    if source.irradiance is not None:
        if asked.window is not None:
            raise ArgumentError("window", "applies to probes; this irradiance map is finished")
        return _nine(source.irradiance), source.irradiance, []
    if light is None:
        return None, None, []
    nine = diffuse = None
    warnings: list[str] = []
    if engine.wants_irradiance:
        request = Request.of("irradiance", {"window": asked.window}, light)
        made = prefilter_irradiance(light, request)
        nine, warnings = made.map, list(made.warnings)
    if engine.wants_diffuse:
        coefficients = project(light, DIFFUSE_ORDER).coefficients
        known = provenance(light, Lambertian(), Orders(DIFFUSE_ORDER, 0, 0.0, 1.0))
        diffuse = Irradiance(coefficients, known)
    return cast(Irradiance | None, nine), diffuse, warnings


def _nine(irradiance: Irradiance) -> Irradiance:
    """Return an irradiance map without the degrees above 2, of which engines know nothing."""
    if irradiance.order_f <= POLYNOMIAL_ORDER:
        return irradiance
    count = (POLYNOMIAL_ORDER + 1) ** 2
    return replace(irradiance, coefficients=irradiance.coefficients[:count], window=Window())


def _with_images(light: Light, probe: Probe, engine: Engine, asked: Asked) -> Light:
    """Add the sharp cube and the lat-long that an engine wants."""
    edge = engine.default_skybox if asked.skybox is None else asked.skybox
    if asked.skybox is None:
        edge = min(edge, default_size(probe, Cube))
    if engine.takes_skybox and edge:
        light = replace(light, skybox=to_grid(probe, Cube(edge)))
    if engine.wants_latlong:
        # Where there are levels, the size is theirs, and the lat-long is as fine as the light.
        rows = 0 if engine.wants_levels else asked.size or engine.default_size
        rows = rows or min(default_size(probe, LatLong), engine.latlong_rows or LatLong.largest)
        if asked.safe and engine.sampler is not None and asked.size is None:
            rows = min(rows, engine.sampler.rows)
        light = replace(light, latlong=to_grid(probe, LatLong(rows)))
    return light


def write(package: Package, folder: Path, kept: bool = True) -> list[Path]:
    """Write all files of an export into a folder, or none of them.

    `folder` is made if it does not exist; the folder that it lies in must. `kept` tells whether
    files that exist are replaced by files of the same bytes only.
    """
    paths = [folder / file.name for file in package.files]
    with made_folder(folder), keeping(*map(str, paths if kept else [])), together():
        for file, path in zip(package.files, paths, strict=True):
            file.write(path)
    return paths


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Make a folder, and remove it again if it is made and nothing comes into it."""
    is_new = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made ({error.strerror}); name another") from error
    try:
        yield
    finally:
        if is_new:
            with suppress(OSError):  # it holds what was written
                folder.rmdir()
