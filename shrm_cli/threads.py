"""One limit for every pool of threads: BLAS, OpenImageIO and OpenEXR."""

import os

_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS")

_limit: int | None = None


def limit(count: int) -> None:
    """Use at most `count` threads; takes effect if called before numpy is imported."""
    global _limit
    _limit = count
    for name in _VARIABLES:
        os.environ[name] = str(count)


def count() -> int | None:
    """The limit, or None where there is none."""
    return _limit
