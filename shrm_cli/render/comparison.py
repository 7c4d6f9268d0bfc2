"""Maps compared with a baseline: pictures of the same views, and how far apart they are."""

import math
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import mix_channels, to_rec709
from shrm_cli.files.image import Picture
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer, whole_coverage
from shrm_cli.render.image import expose
from shrm_cli.render.seen import FlipError, hdr_flip, seen_errors
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import Reflecting, render_sphere


@record
class Difference:
    """How far pictures of a sphere are from pictures of the baseline."""

    rmse: float
    """Root mean square difference over the sphere and the colour channels, in radiance."""
    relative_rmse: float
    """`rmse` divided by the root mean square of the baseline; infinite if the baseline is black and
    the pictures are not."""
    maximum: float
    """Largest absolute difference in a channel of a pixel, in radiance."""
    psnr: float
    """The largest value of the baseline divided by `rmse`, in decibels; infinite for equal
    pictures, otherwise minus infinity if no value of the baseline is above 0."""
    median_relative_error: float
    p95_relative_error: float
    wrong_share: float
    negative_share: float
    """`median_relative_error`, `p95_relative_error`, `wrong_share` and `negative_share`: what is
    seen of it, pixel by pixel; see `SeenErrors`."""

    def summary(self) -> dict[str, float | None]:
        """The numbers by name, for JSON, which has no infinity: None stands for it."""
        return {key: v if math.isfinite(v) else None for key, v in asdict(self).items()}


def measure(pictures: Picture, baselines: Picture) -> Difference:
    """Compare pictures of one or more views.

    Only the sphere counts: the weight of a pixel is the fraction of it that the sphere covers, in
    means and in percentiles. Pixels on the silhouette are divided by that fraction first.

    `pictures` and `baselines`, each of shape (..., S, S, 3), are as `render_sphere` draws them on
    black: linear, premultiplied by the coverage.

    The difference is over all views together.
    """
    size = pictures.shape[-2]
    coverage = whole_coverage(size)
    seen = coverage > 0
    weights = coverage[seen][:, None]
    expected = baselines[..., seen, :].astype(float) / weights
    found = pictures[..., seen, :].astype(float) / weights
    error = found - expected
    what_is_seen = seen_errors(found, expected, coverage[seen])
    rmse = _root_mean_square(error, weights)
    return Difference(
        rmse, _ratio(rmse, _root_mean_square(expected, weights)), float(np.abs(error).max()),
        _decibels(float(expected.max()), rmse), what_is_seen.median_relative_error,
        what_is_seen.p95_relative_error, what_is_seen.wrong_share, what_is_seen.negative_share,
    )  # fmt: skip


@record
class Comparison:
    """Pictures of a baseline, and of other maps from the same views."""

    viewers: Sequence[Viewer]
    baseline: Picture
    """Linear, premultiplied by the coverage of the sphere, shape (V, S, S, 3)."""
    others: Picture
    """Pictures of M other maps, in the same form, shape (M, V, S, S, 3)."""
    primaries: tuple[float, ...] | None = None
    """The primaries of all pictures; None is Rec.709."""

    def difference(self, other: int, view: int | None = None) -> Difference:
        """Measure how far a map is from the baseline, in one view or by default in all."""
        views = slice(None) if view is None else slice(view, view + 1)
        return measure(self.others[other, views], self.baseline[views])

    def flip(self, other: int, view: int) -> FlipError | None:
        """Measure HDR-FLIP between a map and the baseline in one view.

        FLIP sees the pictures in Rec.709, with the sphere on black, and chooses its exposures
        from that of the baseline. The mean of its error is over the sphere alone.

        Returns None where FLIP is not defined: if the baseline is black or a pixel is not finite.
        Raises ModuleNotFoundError if `flip_evaluator` is not installed.
        """
        coverage = whole_coverage(self.baseline.shape[-2])
        matrix = to_rec709(self.primaries)
        pictures = self.others[other, view], self.baseline[view]
        if matrix is not None:
            pictures = mix_channels(pictures[0], matrix), mix_channels(pictures[1], matrix)
        return hdr_flip(*pictures, coverage)

    def picture(
        self,
        baseline_name: str,
        names: Sequence[str],
        exposure: float = 0.0,
        amplification: float = 1.0,
    ) -> Picture:
        """Draw a labelled sheet with a row for each view.

        The baseline comes first. Each other map follows, and then its absolute difference from
        the baseline.

        `exposure` is in stops, the same for all pictures and differences. `amplification` is the
        factor of the differences alone.

        Returns an array of float32 of shape (*comparison_layout(M, V, S).shape, 3): linear. The
        tiles are exposed; the paper and the labels are not.
        """
        many, views, size = self.others.shape[:3]
        tiles, labels = [], []
        amplified = "" if amplification == 1 else f", x{amplification:g}"
        for k, viewer in enumerate(self.viewers):
            tiles.append(expose(self.baseline[k], exposure))
            labels.append(f"{baseline_name} {viewer.azimuth:.4g},{viewer.elevation:.4g}")
            for index, name in enumerate(names):
                other = self.others[index, k]
                error = np.abs(other - self.baseline[k]) * np.float32(amplification)
                tiles += [expose(other, exposure), expose(error, exposure)]
                share = 100 * self.difference(index, k).relative_rmse
                labels += [name, f"{share:.3g}% apart{amplified}"]
        return draw_sheet(comparison_layout(many, views, size), tiles, labels)


def mean_flip(errors: Sequence[FlipError | None]) -> float | None:
    """Return the mean HDR-FLIP of views, which have as many pixels each; None if one has none."""
    means = [each.mean for each in errors if each is not None]
    return sum(means) / len(means) if means and len(means) == len(errors) else None


def comparison_layout(others: int, views: int, size: int) -> SheetLayout:
    """Lay out the tiles of a comparison's picture."""
    columns = 1 + 2 * others
    return arrange(columns * views, size, columns)


def compare_spheres(
    baseline: Reflecting,
    others: Sequence[Reflecting],
    viewers: Sequence[Viewer],
    size: int,
    progress: Progress | None = None,
    primaries: tuple[float, ...] | None = None,
) -> Comparison:
    """Draw a sphere of each map from the same views.

    `baseline` is the truth or the map that the others are compared with. `progress` is called with
    the pictures done and all, (1 + M) V; the first V are those of the baseline. `primaries` are
    those of the light of all of them; None is Rec.709.
    """
    drawn: list[Picture] = []
    total = (1 + len(others)) * len(viewers)
    for thing in (baseline, *others):
        for viewer in viewers:
            drawn.append(render_sphere(thing, viewer, size))
            tell(progress, len(drawn), total)
    pictures = np.stack(drawn).reshape(1 + len(others), len(viewers), size, size, 3)
    return Comparison(viewers, pictures[0], pictures[1:], primaries)


def _root_mean_square(values: Array, weights: Array) -> float:
    """Return the root mean square of values (..., N, 3) with weights (N, 1)."""
    return float(np.sqrt(np.average(values**2, weights=np.broadcast_to(weights, values.shape))))


def _ratio(error: float, scale: float) -> float:
    if error == 0:
        return 0.0
    return error / scale if scale > 0 else np.inf


def _decibels(peak: float, error: float) -> float:
    if error == 0:
        return np.inf
    return float(20 * np.log10(peak / error)) if peak > 0 else -np.inf
