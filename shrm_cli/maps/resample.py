"""Maps on cubes of another size or sampling."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.representations import BrdfMap
from shrm_cli.maps.shrm.compressed import CompressedShrm
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import check_size
from shrm_cli.sphere.cube import cube_directions, cube_solid_angles
from shrm_cli.sphere.sampling import CubeSampler
from shrm_cli.vocabulary import MAX_CUBE_SIZE, Sampling

Array = NDArray[np.floating]


def resample(reflection_map: BrdfMap, size: int | None, sampling: Sampling | None) -> BrdfMap:
    """A map on a cube of another size or sampling, filtered as `radiance` filters it.

    Parameters
    ----------
    reflection_map : BrdfMap
    size : int, optional
        Texels along a face's edge.
    sampling : {"center", "border"}, optional

    Raises
    ------
    MapError
        If the result would be too large.
    """
    if isinstance(reflection_map, SummedShrm):
        terms = tuple(resample(term, size, sampling) for term in reflection_map.terms)
        return replace(reflection_map, terms=terms)  # type: ignore[arg-type]
    size = reflection_map.size if size is None else size
    if size > MAX_CUBE_SIZE:
        raise MapError(f"a map of size {size} is larger than {MAX_CUBE_SIZE}; lower --size")
    sampling = sampling or reflection_map.sampling
    if (size, sampling) == (reflection_map.size, reflection_map.sampling):
        return reflection_map
    if isinstance(reflection_map, ExplicitMap):
        reflection_map.check_memory(size, reflection_map.count)
        directions = cube_directions(size, sampling)
        images = np.stack(
            [
                CubeSampler(image, reflection_map.sampling)(directions)
                for image in reflection_map.images
            ]
        )
        error = _lost(reflection_map.images[0], images[0], reflection_map.sampling, sampling)
        info = _with_error(reflection_map.info, error)
        return replace(reflection_map, images=images, sampling=sampling, info=info)
    if isinstance(reflection_map, CompressedShrm):
        whole = resample(reflection_map.expand(), size, sampling)
        assert isinstance(whole, Shrm)
        again = CompressedShrm.from_shrm(whole, reflection_map.count)
        return replace(again, info=whole.info)
    check_size(reflection_map.info.order_f, reflection_map.order_p, size)
    # Local frames turn from texel to texel; only global coefficients can be filtered.
    source = reflection_map.to_frame("global").coefficients
    flat = source.reshape(*source.shape[:2], -1)
    moved = CubeSampler(flat, reflection_map.sampling)(cube_directions(size, sampling))
    shaped = moved.reshape(*moved.shape[:2], *source.shape[2:])
    info = _with_error(reflection_map.info, _lost(flat, moved, reflection_map.sampling, sampling))
    result = replace(
        reflection_map, coefficients=shaped, frame="global", sampling=sampling, info=info
    )
    return result.to_frame(reflection_map.frame)


def _lost(before: Array, after: Array, old: Sampling, new: Sampling) -> float:
    """Relative RMS by which cubes, shape (6N, N, channels), differ where the first has texels."""
    size = before.shape[1]
    weights = np.tile(cube_solid_angles(size, old), (6, 1))[..., None]
    again = CubeSampler(after, new)(cube_directions(size, old))
    whole = np.sum(weights * before.astype(float) ** 2)
    return float(np.sqrt(np.sum(weights * (again - before) ** 2) / whole)) if whole > 0 else 0.0


def _with_error(info: MapInfo, error: float) -> MapInfo:
    return replace(info, added_error=float(np.hypot(info.added_error, error)))
