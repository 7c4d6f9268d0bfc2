"""How large maps are, and how large they may be."""

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.vocabulary import MAX_CUBE_SIZE

MAX_VALUES = 2**30
"""Coefficients in a map: 4 GB as 32-bit floats."""
MAX_SERIES = 2**26
"""Coefficients of a map's harmonic series: 0.5 GB, several times over while they are made."""

_SMALLEST_CHOICE = 16


def choose_size(order_f: int) -> int:
    """Texels along a face's edge: 10 F around the equator (section 5.5.2), as a power of two."""
    needed = max(10 * order_f / 4, _SMALLEST_CHOICE)
    return int(min(2 ** int(np.ceil(np.log2(needed))), MAX_CUBE_SIZE))


def check_size(order_f: int, order_p: int, size: int | None = None) -> None:
    """Check that a map of these orders can be computed and kept in memory.

    Raises
    ------
    MapError
    """
    series = (order_f + order_p + 1) ** 2 * (order_p + 1) ** 2 * 3
    if series > MAX_SERIES:
        raise MapError(
            f"orders F = {order_f} and P = {order_p} make {series:,} coefficients, more than "
            f"{MAX_SERIES:,}; lower --order-f and --order-p, or raise --eps"
        )
    size = choose_size(order_f) if size is None else size
    values = 6 * size**2 * (order_p + 1) ** 2 * 3
    if values > MAX_VALUES:
        raise MapError(
            f"a map of size {size} and order P = {order_p} holds {values:,} coefficients, more "
            f"than {MAX_VALUES:,}; lower --size or the orders"
        )
