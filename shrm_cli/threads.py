"""One limit for every pool of threads: BLAS, OpenImageIO and OpenEXR."""

import os

_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_IMAGES = ("OPENIMAGEIO_THREADS",)

_limit: int | None = None


def limit(count: int) -> None:
    """Use at most `count` threads in every pool; call it before numpy is imported.

    BLAS uses one, whatever the count: a product that is shared out rounds differently, and the
    same inputs are to give the same bytes.
    """
    global _limit
    _limit = count
    for name in _BLAS:
        os.environ[name] = "1"
    for name in _IMAGES:
        os.environ[name] = str(count)


def limit_small_products() -> None:
    """Leave BLAS one thread, unless the user has said otherwise; call it before numpy is imported.

    The matrix products of one map take milliseconds, in which a second thread gains less than
    its waiting costs (a busy machine took 0.42 s for a whole run, 0.25 s with one thread), and
    batches run one process for each processor.
    """
    for name in _BLAS:
        os.environ.setdefault(name, "1")


def count() -> int | None:
    """The limit, or None where there is none."""
    return _limit
