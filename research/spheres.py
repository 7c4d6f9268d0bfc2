"""A picture of the methods that `exponentials` compares: spheres of three alphas and two f0."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from research.exponentials import F0, Scene, exact_split_sum, exponentials
from research.glossy_truth import sphere
from shrm_cli.files.image import Picture, write_picture
from shrm_cli.probe.probe import Probe
from shrm_cli.render.image import expose
from shrm_cli.render.sheet import arrange, draw_sheet

Array = NDArray[np.floating]

ALPHAS = 0.25, 0.5, 1.0
_FILE = "exponentials.png"


def spheres(probes: Sequence[Probe], folder: Path, size: int) -> str:
    """Draw a sheet of spheres of `size` x `size` pixels, and return its file's name.

    Each probe has a row for every method. Labels give alpha and f0, or the relative RMS error.
    Pictures of one probe and f0 have the same exposure.
    """
    scene = Scene.of(probes, np.sqrt(ALPHAS).tolist(), [sphere((0, 0, 1), size)])
    methods = {
        "truth": scene.exact,
        "split sum": exact_split_sum(scene),
        "SHE, paper": exponentials(scene, law="paper"),
        "SHE, ours": exponentials(scene),
    }
    tiles: list[Picture] = []
    labels: list[str] = []
    for p in range(len(probes)):
        own = slice(3 * p, 3 * p + 3)
        for name, method in methods.items():
            for f0 in F0:
                peak = max(
                    np.percentile(scene.exact(k, f0)[:, own], 97) for k in range(len(ALPHAS))
                )
                for k, alpha in enumerate(ALPHAS):
                    found, truth = method(k, f0)[:, own], scene.exact(k, f0)[:, own]
                    tile = np.zeros((size, size, 3))
                    tile[scene.spheres[0].inside] = found
                    tiles.append(expose(tile, float(-np.log2(max(peak, 1e-6)))))
                    error = float(np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)))
                    case = f"alpha {alpha:g}, F0 {f0:g}" if name == "truth" else f"{error:.1%}"
                    labels.append(f"{name}: {case}")
    layout = arrange(len(tiles), size, len(F0) * len(ALPHAS))
    write_picture(folder / _FILE, draw_sheet(layout, tiles, labels))
    return _FILE
