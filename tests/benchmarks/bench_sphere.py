"""Times of the analysis of lat-longs and the synthesis of cubes, compared with ducc0.

ducc0 takes one scalar map per call, so its work is spread either over the threads within a call or
over as many Python threads as there are processors, whichever is faster here. It gets its input in
its own layout and axes, so that only the transform itself is timed.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

import ducc0
import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Memo
from shrm_cli.sphere import double_fourier, rotation
from shrm_cli.sphere.grid.latlong import LatLongAnalysis
from shrm_cli.sphere.synthesis import synthesize_cube
from tests.benchmarks.table import Row, fastest, measure
from tests.oracles import alm_from_real, angles, cube_texels, real_from_alm

Array = NDArray[np.floating]

THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def rows() -> Iterable[Row]:
    """Yield the rows of the table that are about transforms."""
    yield from _analysis_rows()
    yield from _synthesis_rows()


def _forget_tables() -> None:
    for module in (rotation, double_fourier):
        for value in vars(module).values():
            if isinstance(value, Memo):
                value.clear()


def _each(
    function: Callable[[int, int], Array], count: int, pool: ThreadPoolExecutor
) -> Callable[[], list[Array]]:
    """Return a function that applies ``function(map, threads)`` to all maps in the fastest way."""
    return fastest(
        [
            lambda: [function(at, THREADS) for at in range(count)],
            lambda: [function(at, 1) for at in range(count)],
            lambda: list(pool.map(lambda at: function(at, 1), range(count))),
        ]
    )


def _difference(ours: Array, reference: Array) -> str:
    error = np.abs(ours - reference).max() / np.abs(reference).max()
    return f"max difference {error:.1e}"


def _probe(width: int, height: int) -> Array:
    """Make a random image of order 24, shape (height, width, 3), float32.

    ducc0's `analysis_2d` is exact only for images without degrees above those asked for. Our
    analysis is exact for others too (`test_images_of_higher_order`), but here both must give the
    same result.
    """
    rng, order = np.random.default_rng(1), 24
    planes = []
    for _ in range(3):
        planes.append(
            ducc0.sht.synthesis_2d(
                alm=alm_from_real(rng.standard_normal((order + 1) ** 2), order)[None],
                spin=0,
                lmax=order,
                ntheta=height,
                nphi=width,
                geometry="F1",
                phi0=-np.pi + np.pi / width,
                nthreads=THREADS,
            )[0, :, ::-1]
        )
    return np.stack(planes, axis=-1).astype(np.float32)


def _analysis_rows() -> Iterable[Row]:
    width, height = 1024, 512
    image = _probe(width, height)
    planes = [np.ascontiguousarray(image[:, ::-1, channel])[None] for channel in range(3)]
    with ThreadPoolExecutor(THREADS) as pool:
        for order in (24, 60):

            def ours(order: int = order) -> LatLongAnalysis:
                analysis = LatLongAnalysis(width, height, order)
                analysis.add(0, image)
                analysis.coefficients()
                return analysis

            def one(channel: int, threads: int, order: int = order) -> Array:
                return ducc0.sht.analysis_2d(
                    map=planes[channel],
                    spin=0,
                    lmax=order,
                    geometry="F1",
                    phi0=-np.pi + np.pi / width,
                    nthreads=threads,
                )[0]

            reference = _each(one, 3, pool)
            expected = np.stack([real_from_alm(alm, order) for alm in reference()], axis=-1)
            note = f"float32, {_difference(ours().polar_coefficients(), expected)}"
            name = f"analysis {width}x{height}x3, F {order}"
            yield measure(f"{name}, warm", ours, reference, bar=2, note=note)
            yield measure(
                f"{name}, cold", ours, reference, bar=2, note=note, prepare=_forget_tables
            )


def _synthesis_rows() -> Iterable[Row]:
    maps = 48
    with ThreadPoolExecutor(THREADS) as pool:
        for order_f, size, bar in ((24, 64, 1), (24, 128, 1), (60, 128, 2), (60, 256, 2)):
            order = order_f + 3
            coefficients = np.random.default_rng(2).standard_normal(((order + 1) ** 2, maps))
            theta, phi = angles(cube_texels(size).reshape(-1, 3))
            location = np.stack([theta, phi % (2 * np.pi)], axis=-1)
            alm = np.stack([alm_from_real(column, order)[None] for column in coefficients.T])
            alm = alm.astype(np.complex64)
            result = np.empty((maps, 1, len(location)), dtype=np.float32)

            def ours(coefficients: Array = coefficients, size: int = size) -> Array:
                return synthesize_cube(coefficients, size, dtype=np.float32)

            def one(
                at: int,
                threads: int,
                alm: NDArray[np.complexfloating] = alm,
                location: Array = location,
                result: Array = result,
                order: int = order,
            ) -> Array:
                return ducc0.sht.synthesis_general(
                    alm=alm[at],
                    spin=0,
                    lmax=order,
                    loc=location,
                    epsilon=1e-6,
                    nthreads=threads,
                    map=result[at],
                )

            reference = _each(one, maps, pool)
            reference()
            note = f"float32, {_difference(ours().reshape(maps, 1, -1), result)}"
            yield measure(
                f"synthesis {maps} maps, cube {size}, F {order_f}, cold",
                ours,
                reference,
                bar=bar,
                note=note,
                prepare=_forget_tables,
            )
