"""How long it takes to make an SHRM once its orders are known, for those who wait for it."""

# Seconds of one processor for each series, that is a coefficient map of one colour, measured from
# F = 36 to 320 and P = 2 to 28. The time of the series and of their texels grows with the cube of
# the order F + P, and that of packing with the number of values.
_COUPLING, _MOST_TERMS = 6e-10, 10  # for each term of order P; sums over rings replace many
_SYNTHESIS = 3e-9
_STORED_VALUE = 1.5e-7


def making_seconds(order_f: int, order_p: int, size: int) -> float:
    """Estimate the seconds until an SHRM is made and written.

    Parameters
    ----------
    order_f : int
        The order F to which the light is carried.
    order_p : int
        The order P.
    size : int
        Texels along a face's edge.

    Returns
    -------
    float
        Within a factor of 2 where the rates were measured, if no other work is going on there.
    """
    series = 3 * (order_p + 1) ** 2
    coupling = _COUPLING * min(order_p, _MOST_TERMS)
    made = series * (order_f + order_p) ** 3 * (coupling + _SYNTHESIS)
    return made + series * 6 * size**2 * _STORED_VALUE
