"""`compare`: how far maps are from the truth, or from the first of them, over a sphere."""

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import common_brdf, differing_origins, record_of
from shrm_cli.messages import check_names, several, whole_number
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.progress import Progress, Stages, tell
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.comparison import Comparison, compare_spheres, mean_flip
from shrm_cli.render.lit import (
    in_same_primaries,
    lit_maps,
    refuse_surface,
    shaded_maps,
    with_classes,
)
from shrm_cli.render.seen import FlipError
from shrm_cli.vocabulary import MAX_PICTURE_SIZE


@record(eq=False)
class Compared:
    """Maps beside the truth, or beside the first of them."""

    comparison: Comparison
    """The pictures, and the numbers of each."""
    names: tuple[str, ...]
    """The maps that are compared with the truth or the first map."""
    truth: Reference | None
    """None where there is no truth."""
    brdf: dict[str, Any]
    """The BRDF of the truth, or of the first map, as files record it."""
    surface: dict[str, Any]
    """The surface that maps of light alone are shown as; empty where there are none."""
    warnings: list[str]
    """About the probe, the maps, and whether these were made alike."""

    def flips(self, progress: Progress | None = None) -> list[list[FlipError | None]]:
        """Return HDR-FLIP of each view and, in that, of each map."""
        views, maps = len(self.comparison.viewers), len(self.names)
        found: list[list[FlipError | None]] = [[] for _ in range(views)]
        for view, of_view in enumerate(found):
            for other in range(maps):
                of_view.append(self.comparison.flip(other, view))
                tell(progress, view * maps + other + 1, views * maps)
        return found

    def numbers(self, flips: Sequence[Sequence[FlipError | None]] | None = None) -> dict[str, Any]:
        """Return the differences in each view and in all views together, as JSON has them."""
        viewers = self.comparison.viewers
        per_view = flips or [[None] * len(self.names)] * len(viewers)

        def row(index: int, view: int | None) -> dict[str, Any]:
            of_views = [each[index] for each in (per_view if view is None else [per_view[view]])]
            return {
                "file": self.names[index],
                **self.comparison.difference(index, view).summary(),
                "hdr_flip": mean_flip(of_views),
            }

        each = []
        for index, viewer in enumerate(viewers):
            # The exposures come from the baseline, so that those of all maps are the same.
            known = [found.exposures for found in per_view[index] if found is not None]
            maps = [row(other, index) for other in range(len(self.names))]
            exposures = asdict(known[0]) if known else None
            view = [viewer.azimuth, viewer.elevation]
            each.append({"view": view, "flip_exposures": exposures, "maps": maps})
        return {"views": each, "summary": [row(other, None) for other in range(len(self.names))]}


def compare(
    maps: Sequence[Map | str | os.PathLike[str]] | Map | str | os.PathLike[str],
    probe: AnyProbe | None = None,
    brdf: AnyBrdf | None = None,
    *,
    names: Sequence[str] | None = None,
    views: Sequence[tuple[float, float]] = ((0.0, 0.0),),
    size: int = 256,
    roughness: float | None = None,
    f0: str | float | Sequence[float] | None = None,
    anisotropy: float | None = None,
    taps: int | None = None,
    window: str | None = None,
    source_height: int | None = None,
    exact: bool = False,
    begin: Callable[[], object] | None = None,
    progress: Progress | None = None,
) -> Compared:
    """Measure how far maps are from the truth under a probe; without one, from the first map.

    Parameters
    ----------
    maps : sequence of Map or path-like, or one of them
    probe : Probe, path-like or array, optional
        The light of the truth, and of product textures that hold none.
    brdf : Brdf, str or path-like, optional
        That of the truth; by default the one that all maps were made for. Split sums of a class of
        yours are shown by it, with the values that they record.
    names : sequence of str, optional
        What messages call the maps; by default their files, or their representations.
    views : sequence of 2 float
        Azimuth and elevation of distant viewers, degrees.
    size : int
        Width and height of a sphere's picture, pixels.
    roughness, f0, anisotropy, taps
        The surface that maps of light alone are shown as, see `shrm_cli.render.lit.shaded_maps`.
    window : str, optional
        That of the light of product textures that hold none.
    source_height, exact
        Of the truth, as `reference` takes them.
    begin : callable, optional
        Called when all files are read, before the work begins.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Compared

    Raises
    ------
    ArgumentError, MapError, ProbeError, BrdfError

    Examples
    --------
    >>> light = shrm.open_probe("probes/studio.exr")
    >>> white = shrm.prefilter(light, "lambertian")
    >>> found = shrm.compare([white], light, size=32).numbers()["summary"][0]
    >>> found["relative_rmse"] < 0.05
    True
    """
    source, maps = None if probe is None else as_probe(probe), several(maps, "maps")
    size, viewers = (
        whole_number("size", size, 1, MAX_PICTURE_SIZE),
        [Viewer(*view) for view in views],
    )
    if not viewers:
        raise ArgumentError("views", "are none; give one at least")
    if source is None and len(maps) == 1:
        raise ArgumentError("maps", "are one, which has nothing to be compared with; name another")
    if names is None:
        names = [each.what if isinstance(each, Map) else os.fspath(each) for each in maps]
    check_names(names, maps)
    opened = [each if isinstance(each, Map) else open_map(each) for each in maps]
    if brdf is not None:
        brdf = as_brdf(brdf, None if source is None else source.chromaticities)
    opened = with_classes(opened, brdf)
    opened, warnings = lit_maps(opened, names, source, window, {})
    refuse_surface(opened, roughness=roughness, f0=f0, anisotropy=anisotropy, taps=taps)
    loaded, surface, outside = shaded_maps(opened, names, roughness, f0, anisotropy, taps)
    infos = {name: each.info for name, each in zip(names, loaded, strict=True)}
    if source is not None and brdf is None:  # whose numbers are those of the maps' primaries
        source = source.in_primaries(loaded[0].info.chromaticities)
    primaries = loaded[0].info.chromaticities if source is None else source.chromaticities
    loaded = in_same_primaries(loaded, primaries)
    baseline: Any = loaded[0]
    label, digest, made_for = f"that of {names[0]}", baseline.info.probe_sha256, baseline.info.brdf
    stages = Stages(progress, len(views))
    truth = None
    if source is not None:
        if brdf is None:
            surfaced = ", or another `roughness` and `f0`" if surface else ""
            brdf = common_brdf(infos, f"give `brdf`{surfaced}")
        label, digest, made_for = source.name, source.digest(), record_of(brdf)
        truth = Reference(source, brdf, source_height, progress=stages.within, exact=exact)
    if begin is not None:
        begin()
    others = loaded if truth is not None else loaded[1:]
    comparison = compare_spheres(truth or baseline, others, viewers, size, stages.done, primaries)
    warnings += outside
    warnings += [] if source is None else source.warnings()
    reading = None if source is None else source.reading()
    warnings += differing_origins(infos, label, digest, made_for, reading)
    compared = tuple(names[len(names) - len(others) :])
    return Compared(comparison, compared, truth, made_for, surface, warnings)
