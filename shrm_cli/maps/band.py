"""The degrees of the light and of the view that a map carries, and how they end.

A series that ends where light is still visible rings: beside a lamp its ripples are far brighter
than dark places, and negative. Where a map can carry no more, its last degrees therefore fall
smoothly to nothing, by half a wave of a cosine, as a tapered cosine (or Tukey) window does. That
costs a part of what they would have shown, which predicted errors count.
"""

from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.records import record
from shrm_cli.reflected import last_visible

_RINGS = 0.02
"""The RMS of what a series loses at its end, relative to the mean reflected light, above which its
rings are seen. Lobes that their texels resolve lose up to a hundredth, sharper ones a twentieth or
more."""
_WHOLE = 0.8
"""The part of the degrees before the fall. A longer fall was measured to remove hardly more rings,
and to blur lamps more."""

_FEW_VIEWS = 20
"""The least P of maps whose last degrees of the view are weakened. With P = 28 and 32 that was
measured to take from the 95th percentile of what is seen as well as from the median; with P = 13
the percentile rose as often as it fell."""


@record
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
    def of(cls, beyond: Array, limit: int, furthest: int, known: int, least: int = 0) -> "Band":
        """Choose the degrees of a map.

        Parameters
        ----------
        beyond : ndarray, shape (> known,)
            The RMS of the reflected light after each degree, as `visible_beyond` returns it.
        limit : int
            The largest degree that a map may end with at once.
        furthest : int
            The largest degree of a map that fades out.
        known : int
            The largest degree that is known.
        least : int
            Where nothing visible is left out, the degrees up to this one are kept in any case.

        Returns
        -------
        Band
            It is exact where no rings are seen.
        """
        visible = last_visible(beyond)
        # What is visible at the last known degree goes on beyond it.
        if visible <= limit and visible < known:
            return cls.exact(max(visible, least))
        end = min(limit, known)
        if beyond[int(_WHOLE * end)] <= _RINGS:
            return cls.exact(end)
        last = min(furthest, known)
        return cls(int(_WHOLE * last), last)

    @classmethod
    def of_views(cls, beyond: float, order_p: int) -> "Band":
        """Choose how the degrees of the view end.

        Parameters
        ----------
        beyond : float
            The RMS of the reflected light after the last degree, as `visible_beyond_p` returns it.
        order_p : int
            The last degree.

        Returns
        -------
        Band
            It is exact where no rings are seen, and where degrees are too few to lose one.
        """
        if order_p < _FEW_VIEWS or beyond <= _RINGS:
            return cls.exact(order_p)
        return cls(int(_WHOLE * order_p), order_p)

    @property
    def fades(self) -> bool:
        """Whether the last degrees are weakened."""
        return self.whole < self.last

    @cached_property
    def factors(self) -> Array:
        """What each degree is multiplied with, shape (last + 1,), falling from 1 towards 0."""
        beyond = np.maximum(np.arange(self.last + 1) - self.whole, 0)
        return np.asarray(np.cos(np.pi / 2 * beyond / (self.last + 1 - self.whole)) ** 2)
