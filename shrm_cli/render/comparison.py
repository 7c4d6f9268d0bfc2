"""The same views of several maps side by side, and how far they are from the first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.files.picture import Picture
from shrm_cli.render.camera import Viewer, pixel_centers, sphere_coverage
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import SheetLayout, arrange, draw_sheet
from shrm_cli.render.sphere import ReflectionMap, render_sphere

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Difference:
    """How far pictures of a sphere are from those of the baseline.

    Attributes
    ----------
    rmse : float
        Root mean square difference over the sphere and the colour channels, in radiance.
    relative_rmse : float
        The same over the root mean square of the baseline; infinite where that alone is black.
    maximum : float
        Largest absolute difference of a pixel, in radiance.
    psnr : float
        The largest value of the baseline over `rmse`, in decibels; infinite for equal pictures,
        minus infinity where nothing in the baseline is above 0.
    """

    rmse: float
    relative_rmse: float
    maximum: float
    psnr: float


def measure(pictures: Picture, baselines: Picture) -> Difference:
    """Compare pictures of one or more views.

    Only the sphere counts, each pixel as much as the sphere covers it.

    Parameters
    ----------
    pictures, baselines : ndarray, shape (..., S, S, 3)
        As `render_sphere` draws them on black: linear, premultiplied by the coverage.
    """
    size = pictures.shape[-2]
    coverage = sphere_coverage(size, *pixel_centers(size, 0, size))
    seen = coverage > 0
    weights = coverage[seen][:, None]
    expected = baselines[..., seen, :].astype(float) / weights
    error = pictures[..., seen, :].astype(float) / weights - expected
    rmse = _root_mean_square(error, weights)
    return Difference(
        rmse,
        _ratio(rmse, _root_mean_square(expected, weights)),
        float(np.abs(error).max()),
        _decibels(float(expected.max()), rmse),
    )


@dataclass(frozen=True)
class Comparison:
    """Pictures of a baseline, and of others from the same views.

    Attributes
    ----------
    viewers : sequence of V Viewer
    baseline : ndarray, shape (V, S, S, 3)
        Linear, premultiplied by the coverage of the sphere.
    others : ndarray, shape (M, V, S, S, 3)
    """

    viewers: Sequence[Viewer]
    baseline: Picture
    others: Picture

    def difference(self, other: int, view: int | None = None) -> Difference:
        """Of one of the others from the baseline, in one view or over all of them."""
        views = slice(None) if view is None else slice(view, view + 1)
        return measure(self.others[other, views], self.baseline[views])

    def picture(
        self,
        baseline_name: str,
        names: Sequence[str],
        exposure: float = 0.0,
        amplification: float = 1.0,
    ) -> Picture:
        """A labelled sheet, a view in each row.

        The baseline comes first, then each other followed by its absolute difference from the
        baseline.

        Parameters
        ----------
        baseline_name : str
        names : sequence of M str
        exposure : float
            Stops, the same for all pictures and differences.
        amplification : float
            Of the differences alone.

        Returns
        -------
        ndarray of float32, shape (*sheet_layout(M, V, S).shape, 3)
            Linear and exposed; the paper and the labels are not.

        Raises
        ------
        OutputError
            If the sheet would be too large.
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
                labels += [name, f"{share:.3g}% difference{amplified}"]
        return draw_sheet(sheet_layout(many, views, size), tiles, labels)


def sheet_layout(others: int, views: int, size: int) -> SheetLayout:
    """Where the tiles of a comparison's picture lie.

    Raises
    ------
    OutputError
        If the sheet would be too large.
    """
    columns = 1 + 2 * others
    return arrange(columns * views, size, columns)


def compare_spheres(
    baseline: ReflectionMap,
    others: Sequence[ReflectionMap],
    viewers: Sequence[Viewer],
    size: int,
    progress: Callable[[int], object] | None = None,
) -> Comparison:
    """Draw a sphere of each map, the same views of all.

    Parameters
    ----------
    baseline : ReflectionMap
        What the others are compared with: the truth, or a map.
    others : sequence of M ReflectionMap
    viewers : sequence of V Viewer
    size : int
        Width and height of each picture, pixels.
    progress : callable, optional
        Called with the rows done since the last call, (1 + M) V size in all.
    """

    def draw(thing: ReflectionMap) -> Picture:
        return np.stack([render_sphere(thing, each, size, None, progress) for each in viewers])

    return Comparison(viewers, draw(baseline), np.stack([draw(other) for other in others]))


def _root_mean_square(values: Array, weights: Array) -> float:
    """Over values of shape (..., N, 3) with weights of shape (N, 1)."""
    return float(np.sqrt(np.average(values**2, weights=np.broadcast_to(weights, values.shape))))


def _ratio(error: float, scale: float) -> float:
    if error == 0:
        return 0.0
    return error / scale if scale > 0 else np.inf


def _decibels(peak: float, error: float) -> float:
    if error == 0:
        return np.inf
    return float(20 * np.log10(peak / error)) if peak > 0 else -np.inf
