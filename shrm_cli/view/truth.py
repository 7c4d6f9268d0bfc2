"""Pictures of the truth, by angular integration, for the views that a page begins with."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.progress import Progress
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer, sphere_normals

Array = NDArray[np.floating]

_INSIDE = 0.25
"""Points on the silhouette are moved inside by half this part of the distance between two of
them, because BRDFs have no value there."""


def truth_pictures(
    source: Reference,
    views: Sequence[tuple[float, float]],
    size: int,
    progress: Progress | None = None,
) -> list[Array]:
    """Integrate what a distant viewer sees on a sphere.

    The points of a picture are at equal angles between the normal and the view: a point as far from
    the middle as a share s of half the picture's width is seen at ``sin(s pi / 2)`` radii from the
    centre of the sphere. They are close together at the silhouette, where reflections are, too.

    Parameters
    ----------
    source : Reference
    views : sequence of (float, float)
        Azimuth and elevation of each viewer, degrees.
    size : int
        Pixels along the square around the sphere.
    progress : callable, optional
        Called with the points done and the points of all pictures.

    Returns
    -------
    list of ndarray of float32, shape (size, size, 3)
        Linear radiance, rows from the highest. Pixels beside the silhouette hold what is on it, so
        that pictures can be interpolated; others off the sphere are 0.
    """
    across = (np.arange(size) + 0.5) * (2 / size) - 1
    x, y = np.meshgrid(across, -across)
    share = np.hypot(x, y)  # of a right angle between the normal and the view
    needed = share < 1 + 3 / size
    x, y, share = x[needed], y[needed], share[needed]
    radius = np.sin(np.minimum(share, 1 - _INSIDE / size) * np.pi / 2) / np.maximum(share, 1e-9)
    x, y = x * radius, y * radius
    pictures: list[Array] = []

    def counted(done: int, total: int) -> None:
        if progress is not None:
            progress(len(pictures) * total + done, len(views) * total)

    source.progress = counted
    for azimuth, elevation in views:
        viewer = Viewer(azimuth, elevation)
        picture = np.zeros((size, size, 3), dtype=np.float32)
        picture[needed] = source.radiance(sphere_normals(viewer, x, y), viewer.direction)
        pictures.append(picture)
    return pictures


def truth_facts(probe: str, brdf: str, size: int, source: Reference) -> list[tuple[str, Any]]:
    """Return what the page says of the truth, as pairs of a word and a value."""
    return [
        ("what", f"integral over the probe, {source.statement}"),
        ("BRDF", brdf),
        ("probe", f"{probe}, {source.source.pixels:,} pixels"),
        ("picture", f"{size} \u00d7 {size} points on the sphere"),
    ]
