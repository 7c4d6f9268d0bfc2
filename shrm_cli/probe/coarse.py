"""Large probes averaged down while they are read, for work that needs fewer rows."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.base import Grid

LEAST_ROWS = 2048
"""A probe of no more rows is kept as it is: it takes 100 MB as float32. None becomes coarser."""


def coarse_probe(probe: Probe, rows: int) -> Probe:
    """A probe with fewer pixels, if it is large and fewer will do.

    Each pixel of the result is the mean of k x k pixels by solid angle, so that no light is lost.
    The image itself is never held as a whole.

    Parameters
    ----------
    probe : Probe
    rows : int
        The result has no fewer rows than this, and than `LEAST_ROWS`.

    Returns
    -------
    Probe
        The probe itself where no k suits its size, or its grid cannot be read by rows. Otherwise
        a probe in memory, without the files of the first one; what the pixels needed stands in
        the report of the first one.

    Raises
    ------
    ProbeError
        If the file is damaged, or has NaN or infinite pixels that are not to be filled.
    """
    found = probe.grid.area_ratios()
    for count in range(probe.height // max(rows, LEAST_ROWS), 1, -1):
        grid = probe.grid.joined(count)
        if grid is not None and found is not None:
            image = ArrayImage(_means(probe, grid, found[1]), probe.name)
            return replace(probe, grid=grid, images=(image,), report=replace(probe.report))
    return probe


def _means(probe: Probe, grid: Grid, areas: Array) -> NDArray[np.float32]:
    """Means over the pixels of a probe that are a pixel of the grid; `areas` are of its rows."""
    height, width = grid.shape
    count = len(areas) // height
    areas = areas.reshape(height, count)
    shares = (areas / areas.sum(axis=1, keepdims=True) / count).ravel().astype(np.float32)
    means = np.zeros((height, width, 3), dtype=np.float32)
    for start, pixels, _ in probe.blocks():
        # To add views of every k-th column is many times as fast as a mean over a short axis.
        across = sum(pixels[:, k::count] for k in range(count))
        across *= shares[start : start + len(pixels), None, None]
        # The sums of a block that begins or ends within a row of the grid go on in others.
        first = start // count
        begins = np.maximum(np.arange(first, (start + len(pixels) - 1) // count + 1) * count, start)
        means[first : first + len(begins)] += np.add.reduceat(across, begins - start, axis=0)
    return means
