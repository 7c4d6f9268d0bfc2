"""The degrees of the light that a map carries, and how they end.

A series that ends where light is still visible rings: beside a lamp its ripples are far brighter
than dark places, and negative. Where a map can carry no more, its last degrees therefore fall
smoothly to nothing, by half a wave of a cosine, as a tapered cosine (or Tukey) window does. That
costs a part of what they would have shown, which predicted errors count.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

_WHOLE = 0.8
"""The part of the degrees that is kept whole where a series has to end within visible light. Ending
at once rings; a longer fall was measured to remove hardly more rings, and to blur lamps more."""


@dataclass(frozen=True)
class Band:
    """Degrees from 0 on, of which the last may be weakened.

    Attributes
    ----------
    whole : int
        The largest degree that is kept as it is.
    last : int
        The largest degree that is kept at all.
    """

    whole: int
    last: int

    @classmethod
    def exact(cls, order: int) -> "Band":
        """Return the degrees up to an order, none of which is weakened."""
        return cls(order, order)

    @classmethod
    def of(cls, visible: int, limit: int, known: int, least: int = 0) -> "Band":
        """Choose the degrees of a map.

        Parameters
        ----------
        visible : int
            The degree beyond which nothing of the known degrees is visible.
        limit : int
            The largest degree that the map may carry.
        known : int
            The largest degree that is known.
        least : int
            Where nothing visible is left out, the degrees up to this one are kept in any case.

        Returns
        -------
        Band
            It is exact where nothing visible is left out.
        """
        # What is visible at the last known degree goes on beyond it.
        if visible <= limit and visible < known:
            return cls.exact(max(visible, least))
        end = min(limit, known)
        return cls(int(_WHOLE * end), end)

    @cached_property
    def factors(self) -> Array:
        """What each degree is multiplied with, shape (last + 1,), falling from 1 towards 0."""
        beyond = np.maximum(np.arange(self.last + 1) - self.whole, 0)
        return np.asarray(np.cos(np.pi / 2 * beyond / (self.last + 1 - self.whole)) ** 2)
