"""What a split sum's ways of showing GGX, brushed or not, miss, on spheres under real probes.

The truth is a sum of the lobe over all pixels of a probe that is averaged down. Its samples are
computed once a material for all probes.
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum, SplitSum
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.source import Source
from shrm_cli.render.camera import Viewer
from shrm_cli.sphere.directions import surface_frames
from shrm_cli.vocabulary import EVEN_TAP_COUNTS, LUMINANCE, NO_TAPS, SEEN_FLOOR, TAP_COUNTS

ROUGHNESS = 0.3, 0.5, 0.7
ANISOTROPY = 0.3, 0.6, 0.9
EVEN_ROUGHNESS = 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0
FIELDS = "around", "radial", "flat"
WHITE = (1.0, 1.0, 1.0)
_POINTS = 500
_ROWS = 128


def points(viewer: Viewer) -> tuple[np.ndarray, np.ndarray]:
    """Return normals that are even over the picture of a sphere, and views."""
    x_axis, y_axis, view = np.asarray(viewer.axes())
    steps = np.arange(_POINTS) + 0.5
    radius, turn = 0.995 * np.sqrt(steps / _POINTS), steps * np.pi * (1 + np.sqrt(5))
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    normals = x[:, None] * x_axis + y[:, None] * y_axis + np.sqrt(1 - radius**2)[:, None] * view
    return normals, np.broadcast_to(view, normals.shape)


def tangents(normals: np.ndarray, viewer: Viewer) -> dict[str, np.ndarray]:
    """Return the axis across the brush marks: of a sphere brushed around +Y, of one whose marks run
    away from the middle of its picture, and of one whose marks are upright on it.
    """
    x_axis, _, view = np.asarray(viewer.axes())
    across = np.cross(np.cross([0.0, 1.0, 0.0], normals), normals)
    flat = x_axis - (normals @ x_axis)[:, None] * normals
    found = {"around": across, "radial": np.cross(view, normals), "flat": flat}
    return {k: v / np.linalg.norm(v, axis=1, keepdims=True) for k, v in found.items()}


def bent(normals: np.ndarray, along: np.ndarray, views: np.ndarray, share: float) -> np.ndarray:
    """Return normals bent towards the view about brush marks that run along directions."""
    towards = np.cross(np.cross(along, views), along)
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    found = normals + share * (towards - normals)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def errors(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return RMS, median and 95th percentile of the relative error, as `shrm compare` has them."""
    rms = np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2))
    ours, theirs = found @ LUMINANCE, truth @ LUMINANCE
    each = np.abs(ours - theirs) / np.maximum(theirs, SEEN_FLOOR * theirs.mean())
    return np.array([rms, np.median(each), np.percentile(each, 95)])


class Truth:
    """The light of all probes, and of brushed surfaces under it."""

    def __init__(self, files: Sequence[Path]) -> None:
        sources = [Source.of(open_probe(file), _ROWS, np.float32) for file in files]
        self._lights = np.moveaxis(sources[0].directions, 1, -1).reshape(-1, 3)
        light = [each.light.reshape(-1, 3) for each in sources]
        self._light = np.concatenate(light, axis=1)

    def radiance(
        self, brdf: Ggx, normals: np.ndarray, across: np.ndarray, views: np.ndarray
    ) -> np.ndarray:
        """Return the radiance under each probe, shape (probes, points, 3)."""
        frames = surface_frames(normals, across).astype(np.float32)
        found = np.empty((len(normals), self._light.shape[1]))
        for k, (frame, view) in enumerate(zip(frames, views.astype(np.float32), strict=True)):
            local = self._lights @ frame.T
            above = local[:, 2] > 0
            values = brdf.transfer(local[above], frame @ view)[:, 0]
            found[k] = values @ self._light[above]
        return np.moveaxis(found.reshape(len(normals), -1, 3), 1, 0)


def measured(
    files: Sequence[Path], told: Callable[[str], None] = print, **options: object
) -> Iterator[tuple[tuple[str, float, float, str], dict[str, np.ndarray]]]:
    """Yield probe, roughness, anisotropy and field, and the errors of each way.

    Parameters
    ----------
    files : sequence of Path
        Probes of the same height.
    told : callable
    **options
        Of `shrm_cli.prefilter` of split sums.
    """
    viewer = Viewer(30, 15)
    normals, views = points(viewer)
    fields = tangents(normals, viewer)
    truth = Truth(files)
    maps = [prefilter(open_probe(file), to="splitsum", **options) for file in files]
    for roughness in ROUGHNESS:
        own = truth.radiance(Ggx(roughness=roughness), normals, fields["flat"], views)
        for anisotropy in ANISOTROPY:
            told(f"roughness {roughness}, anisotropy {anisotropy}")
            brdf = Ggx(roughness=roughness, anisotropy=anisotropy)
            for field, across in fields.items():
                lit = truth.radiance(brdf, normals, across, views)
                marks = np.cross(normals, across)
                # Filament's share, and that of glTF's sample viewer and of three.js.
                shares = (
                    anisotropy * min(5 * roughness, 1),
                    1 - (1 - anisotropy * (1 - roughness)) ** 4,
                )
                for file, made, known, plain in zip(files, maps, lit, own, strict=True):
                    even = made.shaded(roughness, WHITE, taps=NO_TAPS)
                    bends = [
                        errors(even.radiance(bent(normals, marks, views, share), views), known)
                        for share in shares
                    ]
                    row = {
                        "even, own": errors(even.radiance(normals, views), plain),
                        "ignored": errors(even.radiance(normals, views), known),
                        "Filament": bends[0],
                        "glTF": bends[1],
                    }
                    for count in TAP_COUNTS:
                        shown = BrushedSplitSum(made, roughness, WHITE, anisotropy, count)
                        found = shown.brushed_radiance(normals, across, views)
                        row[f"{count} taps"] = errors(found, known)
                    yield (file.stem, roughness, anisotropy, field), row


def _leaned(light: SplitSum, roughness: float, normals: np.ndarray, views: np.ndarray) -> Array:
    """Return the light in the direction that Filament and three.js take, times the albedo."""
    cosines = np.sum(normals * views, axis=1)
    mirror = 2 * cosines[:, None] * normals - views
    taken = mirror + roughness**4 * (normals - mirror)
    taken /= np.linalg.norm(taken, axis=1, keepdims=True)
    return light.prefiltered(roughness, taken) * DirectionalAlbedo(roughness)(cosines, WHITE)


def even_table(files: Sequence[Path], **options: object) -> list[str]:
    """Return lines of Markdown: mean errors of even surfaces, by their roughness."""
    viewer = Viewer(30, 15)
    normals, views = points(viewer)
    across = tangents(normals, viewer)["flat"]
    truth = Truth(files)
    maps = [prefilter(open_probe(file), to="splitsum", **options) for file in files]
    names = ["mirror direction", "Filament, three.js", *(f"{n} taps" for n in EVEN_TAP_COUNTS)]
    lines = ["| roughness | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    means = []
    for roughness in EVEN_ROUGHNESS:
        lit = truth.radiance(Ggx(roughness=roughness), normals, across, views)
        rows = []
        for made, known in zip(maps, lit, strict=True):
            ways = [
                made.shaded(roughness, taps=NO_TAPS),
                *(made.shaded(roughness, taps=n) for n in EVEN_TAP_COUNTS),
            ]
            first, *others = (each.radiance(normals, views) for each in ways)
            found = [first, _leaned(made, roughness, normals, views), *others]
            rows.append([errors(each, known) for each in found])
        means.append(100 * np.mean(rows, axis=0))
    for name, mean in zip(("all", *EVEN_ROUGHNESS), (np.mean(means, axis=0), *means), strict=True):
        cells = " | ".join("/".join(f"{x:.0f}" for x in each) for each in mean)
        lines.append(f"| {name} | {cells} |")
    return lines


def table(files: Sequence[Path], **options: object) -> list[str]:
    """Return lines of Markdown: mean errors of materials, of fields and of probes, and the bars."""
    rows = list(measured(files, **options))
    ways = list(rows[0][1])
    lines = ["| | " + " | ".join(ways) + " |", "|---|" + "---|" * len(ways)]

    def add(name: str, chosen: list[dict[str, np.ndarray]]) -> None:
        means = (100 * np.mean([row[way] for row in chosen], axis=0) for way in ways)
        cells = ["/".join(f"{x:.0f}" for x in mean) for mean in means]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")

    add("all", [row for _, row in rows])
    for roughness in ROUGHNESS:
        for anisotropy in ANISOTROPY:
            name = f"roughness {roughness:g}, anisotropy {anisotropy:g}"
            add(name, [row for key, row in rows if key[1:3] == (roughness, anisotropy)])
    for place, names in ((3, FIELDS), (0, [file.stem for file in files])):
        for name in names:
            add(name, [row for key, row in rows if key[place] == name])
    lines.append("")
    lines += [
        "| taps | roughness | RMS | p95 | both | RMS of ignoring |",
        "|---|---|---|---|---|---|",
    ]
    for count in TAP_COUNTS:
        for some in (ROUGHNESS, *((each,) for each in ROUGHNESS)):
            chosen = [row for key, row in rows if key[1] in some]
            ours = np.array([row[f"{count} taps"] for row in chosen])
            own, ignored = (np.array([row[w] for row in chosen]) for w in ("even, own", "ignored"))
            kept = ours <= own
            parts = kept[:, 0], kept[:, 2], kept[:, 0] & kept[:, 2], ours[:, 0] <= ignored[:, 0]
            cells = " | ".join(f"{100 * np.mean(part):.0f} %" for part in parts)
            of = "all" if len(some) > 1 else f"{some[0]:g}"
            lines.append(f"| {count} | {of} | {cells} |")
    return lines
