"""What a report tells of maps: they are made, written, read and set beside the truth."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from shrm_cli.batch.entry import Entry
from shrm_cli.batch.job import Recipe
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import named_files, parse_spec
from shrm_cli.errors import ArgumentError, ShrmError
from shrm_cli.files.whole import scratch_folder
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import common_brdf, record_of, same_brdf, spec_of
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.stored import store
from shrm_cli.naming import brdf_label, probe_stem
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import Comparison, compare_spheres, mean_flip
from shrm_cli.render.lit import ggx_surface, outside_range
from shrm_cli.render.seen import FlipError, can_flip
from shrm_cli.vocabulary import AUTO


@record
class Plan:
    """What is made and how it is measured."""

    brdfs: tuple[str, ...]
    """Specifications."""
    forms: tuple[str, ...]
    """Representations, or ``auto``."""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Arguments of `shrm_cli.prefilter.prefilter` for all forms that obey them."""
    views: tuple[tuple[float, float], ...] = ((0.0, 0.0), (120.0, 20.0), (240.0, -20.0))
    """Azimuth and elevation of the viewers, degrees."""
    size: int = 256
    rows: int | None = None
    """Rows that the probe is averaged down to for the truth; by default it is not averaged."""
    exact: bool = False
    """Whether the truth is the full sum over the pixels of the probe."""
    flips: bool = True
    """Whether HDR-FLIP is measured, where it is installed."""

    def recipes(self) -> list[Recipe]:
        """Return the maps to be made of any probe."""
        entry = Entry((), self.brdfs, self.forms, arguments=self.arguments, runs_code=True)
        return entry.recipes()


@record
class Made:
    """A map that was made, as it was read from its file."""

    form: str
    """The representation, and that it was chosen where it was."""
    file: str
    """The name that `shrm prefilter` would give its file."""
    map: Map
    summary: dict[str, Any]
    """What `shrm prefilter --json` says, with ``bytes`` and ``precision`` of the file."""
    notes: tuple[tuple[str, str], ...]
    """What was chosen automatically."""
    warnings: tuple[str, ...]
    seconds: float
    """How long it took to make, without reading the probe's file for the first time or writing."""


@dataclass
class Material:
    """A BRDF, its truth, and the maps that show it."""

    brdf: Brdf
    spec: str
    """Its specification."""
    maps: list[Made] = field(default_factory=list)
    shown: list[ReflectedLight] = field(default_factory=list)
    """The maps; those of light alone on the surface."""
    truth: str = ""
    """How the truth was summed, in words."""
    truth_error: float | None = None
    """What it may be wrong by, see `Reference.error`."""
    comparison: Comparison | None = None
    """Truth and maps, in all views."""
    flips: list[list[FlipError | None]] = field(default_factory=list)
    """The error of each map and, in that, of each view; empty where it was not measured."""
    seconds: float = 0.0
    """How long the truth took."""

    @cached_property
    def name(self) -> str:
        """Its specification for a page, on which folders of files are nobody's business."""
        text = self.spec
        for file in named_files(self.spec):
            text = text.replace(str(file), file.name)
        return text

    @property
    def surface(self) -> tuple[float, Color] | None:
        """Roughness and f0 where the BRDF is GGX, so that maps of light alone can show it."""
        return self.brdf.surface if isinstance(self.brdf, Ggx) else None

    def numbers(self, index: int) -> dict[str, float | None]:
        """Return how far a map is from the truth, as the summary of `shrm compare` has it."""
        assert self.comparison is not None
        flip = mean_flip(self.flips[index]) if self.flips else None
        return {**self.comparison.difference(index).summary(), "hdr_flip": flip}


@dataclass
class Measured:
    """What was made of a probe."""

    probe: Probe
    plan: Plan
    materials: list[Material] = field(default_factory=list)
    failures: list[tuple[str, str]] = field(default_factory=list)
    """What could not be made, and why."""
    warnings: list[str] = field(default_factory=list)

    def summary(self) -> list[dict[str, Any]]:
        """Return the numbers of all maps, for JSON."""
        return [
            {
                "file": made.file,
                "truth_rows": self.plan.rows,
                "truth_error": material.truth_error,
                **made.summary,
                "seconds": made.seconds,
                "measured": material.numbers(index),
                "warnings": list(made.warnings),
            }
            for material in self.materials
            for index, made in enumerate(material.maps)
        ]


def measure_maps(probe: Probe, plan: Plan, progress: Progress | None = None) -> Measured:
    """Make all maps, and compare each with the truth.

    A BRDF or a form that fails is among the failures of the result, and does not stop the others.
    """
    recipes = plan.recipes()
    if not recipes:
        raise ArgumentError("brdf", f"is missing; `to` {plan.forms[0]} needs one")
    found = Measured(probe, plan)
    halves = Stages(progress, 2)
    stages = Stages(halves.within, len(recipes))
    alone = []
    with scratch_folder() as folder:
        for count, recipe in enumerate(recipes, start=1):
            try:
                made = _made(probe, recipe, folder / "map.exr", stages.within)
                if recipe.brdf is None:
                    alone.append(made)
                else:
                    _joined(found, probe, recipe.brdf, made)
            except ShrmError as error:
                name = recipe.to if recipe.brdf is None else f"{recipe.brdf}, {recipe.to}"
                found.failures.append((name, str(error)))
            stages.done(count, 0)
    for made in alone:
        _add_light(found, made)
    halves.done(1, 2)
    stages = Stages(halves.within, len(found.materials))
    for count, material in enumerate(found.materials, start=1):
        _compare(material, probe, plan, stages.within)
        stages.done(count, 0)
    return found


def _made(probe: Probe, recipe: Recipe, path: Path, progress: Progress) -> Made:
    """Make a map, write it, and read it as everybody will who uses the file."""
    given: dict[str, Any] = dict(recipe.arguments)
    if recipe.brdf is not None:
        given["brdf"] = parse_spec(recipe.brdf, primaries=probe.chromaticities)
    start = time.perf_counter()
    made = prefilter_with_facts(probe, recipe.to, given, progress)
    seconds = time.perf_counter() - start
    stored = store(path, made.map, recipe.precision)
    summary = {
        **made.summary(),
        "storage_error": stored.error,
        "bytes": path.stat().st_size,
        "precision": stored.pixel_type,
    }
    label = [] if recipe.brdf is None else [brdf_label(recipe.brdf)]
    form = made.map.representation
    file = ".".join([probe_stem(probe.name), *label, form, "exr"])
    shown = f"{form} ({AUTO})" if recipe.to == AUTO else form
    return Made(shown, file, open_map(path), summary, made.notes, made.warnings, seconds)


def _joined(found: Measured, probe: Probe, spec: str, made: Made) -> None:
    """Add a map to its material, the first one with a material of its own."""
    material = next((each for each in found.materials if each.spec == spec), None)
    if material is None:
        material = Material(parse_spec(spec, primaries=probe.chromaticities), spec)
        found.materials.append(material)
    material.maps.append(made)
    material.shown.append(made.map.shaded())


def _add_light(found: Measured, made: Made) -> None:
    """Add a map of light alone to the materials that it can show, or to one of its own."""
    if isinstance(made.map, LightMap):
        surfaces = [each for each in found.materials if each.surface is not None]
        if not surfaces:
            brdf: Brdf = ggx_surface()
            surfaces = [Material(brdf, spec_of(record_of(brdf)))]
            found.materials += surfaces
    else:
        brdf = common_brdf({made.file: made.map.info})
        record = record_of(brdf)
        surfaces = [each for each in found.materials if same_brdf(record_of(each.brdf), record)]
        if not surfaces:
            surfaces = [Material(brdf, spec_of(record))]
            found.materials += surfaces
    for material in surfaces:
        material.maps.append(made)
        if material.surface is None:
            material.shown.append(made.map.shaded())
            continue
        roughness, f0 = material.surface
        material.shown.append(made.map.shaded(roughness, f0))
        found.warnings += outside_range({made.file: made.map}, roughness)


def _compare(material: Material, probe: Probe, plan: Plan, progress: Progress) -> None:
    """Draw the truth and the maps of a material, and measure HDR-FLIP between them."""
    # The first pictures are those of the truth, so that the time between them is its own.
    start = time.perf_counter()
    stages = Stages(progress, len(plan.views))

    def drawn(done: int, total: int) -> None:
        stages.done(done, total)
        if done == len(plan.views):
            material.seconds = time.perf_counter() - start

    truth = Reference(probe, material.brdf, plan.rows, progress=stages.within, exact=plan.exact)
    viewers = [Viewer(*view) for view in plan.views]
    material.comparison = compare_spheres(truth, material.shown, viewers, plan.size, drawn)
    material.truth, material.truth_error = truth.statement, truth.error
    if plan.flips and can_flip():
        views = range(len(viewers))
        material.flips = [
            [material.comparison.flip(other, view) for view in views]
            for other in range(len(material.shown))
        ]


def names_of(materials: Sequence[Material]) -> Iterator[tuple[Material, int, Made]]:
    """Yield every map with its material and its place in that."""
    for material in materials:
        for index, made in enumerate(material.maps):
            yield material, index, made
