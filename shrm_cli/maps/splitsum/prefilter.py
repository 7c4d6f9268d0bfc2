"""Prefiltering for the split sum: the lobe of GGX for N = V = R at some roughnesses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.environment.ggx_lobe import GgxLobe
from shrm_cli.errors import OrderError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.prefiltered import provenance
from shrm_cli.maps.splitsum.levels import LEAST_ORDER, expanded, integrated, level_lobe, mirror
from shrm_cli.maps.splitsum.roughness import DEFAULT_LEVELS, check_roughnesses, level_roughnesses
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import default_size
from shrm_cli.progress import Progress
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.vocabulary import LevelMapping, Sampling

Array = NDArray[np.floating]

LARGEST_SIZE = 256
"""Of the first level, if nothing else is asked for: what engines have."""


@dataclass(frozen=True)
class BakedSplitSum:
    """A split sum, and what is known of its levels.

    Attributes
    ----------
    map : SplitSum
    """

    map: SplitSum

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        split_sum, info = self.map, self.map.info
        return {
            "representation": split_sum.representation,
            "frame": split_sum.frame,
            "center": split_sum.center,
            "size": split_sum.size,
            "sampling": split_sum.sampling,
            "maps": len(split_sum.levels),
            "mapping": split_sum.mapping,
            "domain": info.domain,
            "order_f": info.order_f,
            "order_p": info.order_p,
            "epsilon": info.tolerance,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "levels": [
                {
                    "roughness": roughness,
                    "size": level.shape[1],
                    "order_f": each.order_f,
                    "domain": each.domain if roughness > 0 else "probe",
                    "predicted_error": each.predicted_error,
                    "minimum": float(level.min()),
                }
                for roughness, level, each in zip(
                    split_sum.roughness, split_sum.levels, split_sum.level_info, strict=True
                )
            ],
            "brdf": info.brdf,
            "probe": info.probe,
            "probe_sha256": info.probe_sha256,
        }


def bake_split_sum(
    probe: Probe,
    levels: int | Sequence[float] | None = None,
    mapping: LevelMapping = "linear",
    size: int | None = None,
    sampling: Sampling = "center",
    error: float = 0.0005,
    progress: Progress | None = None,
) -> BakedSplitSum:
    """Prefilter a probe for the split sum.

    The light is projected once. Each level is a product of its coefficients with those of the
    lobe, to the least order F whose predicted error is within `error`. Where the lobe asks for
    more than F = 512, or more than direct integration costs, its core is summed over the probe's
    pixels, and only what lies beyond an angle is expanded. Roughness 0 is the probe itself.

    Parameters
    ----------
    probe : Probe
    levels : int or sequence of float, optional
        How many, or their perceptual roughnesses; `DEFAULT_LEVELS` of the mapping if not given.
    mapping : {"linear", "filament", "unreal"}
        Where the roughnesses of a number of levels lie, and how levels are mixed.
    size : int, optional
        Texels along an edge of the first level; the others follow their orders and do not grow.
        256 at most if not given.
    sampling : {"center", "border"}
    error : float
        Relative RMS error that each level may have, in (0, 1).
    progress : callable, optional
        Called with rows read, or texels integrated, and their number.

    Raises
    ------
    MapError, OrderError, ProbeError
    """
    if not 0 < error < 1:
        raise OrderError(f"the error must lie between 0 and 1, not {error:g}")
    if levels is None:
        levels = DEFAULT_LEVELS[mapping]
    if isinstance(levels, int):
        roughness = level_roughnesses(levels, mapping)
    else:
        roughness = check_roughnesses([float(value) for value in levels], mapping)
    rows = min(default_size(probe, LatLong), LatLong.largest)
    largest = min(default_size(probe, Cube), LARGEST_SIZE) if size is None else size
    lobes = [level_lobe(value, error, rows, largest) if value > 0 else None for value in roughness]
    wanted = (lobe.order if lobe.in_frequency else LEAST_ORDER for lobe in lobes if lobe)
    lighting = project(probe, max(wanted, default=0), progress)
    known = provenance(probe, GgxLobe(), Orders(0, 0, error, 1.0))
    cubes: list[Array] = []
    infos: list[MapInfo] = []
    for lobe in lobes:
        if lobe is None:
            cube, info = mirror(probe, known, largest, sampling, progress)
        elif lobe.in_frequency:
            cube, info = expanded(lobe, lighting, known, largest, sampling)
        else:
            cube, info = integrated(probe, lobe, lighting, known, largest, sampling, rows, progress)
        largest = cube.shape[1]
        cubes.append(cube)
        infos.append(info)
    return BakedSplitSum(SplitSum.of_levels(cubes, roughness, mapping, sampling, infos))
