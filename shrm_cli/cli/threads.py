"""Thread pools of libraries that only environment variables limit, before numpy is imported.

They belong to the process, and so to the command line. What the package starts itself obeys
`shrm_cli.settings`.
"""

import os

_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_IMAGES = ("OPENIMAGEIO_THREADS",)


def limit_libraries(count: int) -> None:
    """Give OpenImageIO at most `count` threads, and BLAS one.

    BLAS has one whatever the count is: a product that is shared out rounds differently, and the
    same inputs are to give the same bytes.
    """
    for name in _BLAS:
        os.environ[name] = "1"
    for name in _IMAGES:
        os.environ[name] = str(count)


def limit_small_products() -> None:
    """Give BLAS one thread, unless the user's environment says otherwise.

    The matrix products of one map take milliseconds, in which a second thread gains less than
    its waiting costs (on a busy machine a whole run took 0.42 s with two threads and 0.25 s with
    one), and batches run one process for each processor.
    """
    for name in _BLAS:
        os.environ.setdefault(name, "1")
