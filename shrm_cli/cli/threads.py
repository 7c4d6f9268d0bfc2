"""Limits for the threads of libraries that only environment variables can limit.

The variables must be set before numpy is imported. They hold for the whole process, so the command
line sets them and the library does not. The threads that the package starts itself obey
`shrm_cli.settings`.
"""

import os

_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that limit the threads of the BLAS library that numpy uses."""
_IMAGES = ("OPENIMAGEIO_THREADS",)
"""Variables that limit the threads of OpenImageIO."""


def limit_libraries(count: int) -> None:
    """Give OpenImageIO at most `count` threads, and BLAS one.

    BLAS gets one thread whatever the count is, because a product that several threads share
    rounds differently, and the same inputs must give the same bytes.
    """
    for name in _BLAS:
        os.environ[name] = "1"
    for name in _IMAGES:
        os.environ[name] = str(count)


def limit_small_products() -> None:
    """Give BLAS one thread, unless the user's environment says otherwise.

    The matrix products of one map take milliseconds. In that time a second thread gains less
    than its waiting costs: on a busy machine a whole run took 0.42 s with two threads and 0.25 s
    with one. Batches run one process for each processor anyway.
    """
    for name in _BLAS:
        os.environ.setdefault(name, "1")
