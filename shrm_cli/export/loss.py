"""What packing loses of the light of a cube's level."""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.messages import percent
from shrm_cli.records import record

_TILE = 16
"""Texels along an edge of the tiles in which lamps are sought."""
_LAMP = 0.01
"""A tile with this part of a level's light holds a lamp."""


@record
class Loss:
    """The differences between a level and what is read of it again, as parts of 1."""

    what: str
    """The level, such as ``"level 0"``."""
    rms: float
    """Root mean square of the differences, relative to that of the light."""
    p95: float
    """95 % of the texels differ by less, relative to their own light."""
    lamp: float
    """The largest change of the energy of a lamp; 0 without lamps."""

    @property
    def worst(self) -> float:
        """The largest of the three."""
        return max(self.rms, self.p95, self.lamp)

    def facts(self) -> dict[str, object]:
        """Return the numbers for ``--json``."""
        return {"image": self.what, "rms": self.rms, "p95": self.p95, "lamp": self.lamp}


def loss(what: str, light: Array, read: Array) -> Loss:
    """Compare what is read with the light, shape (6, N, N, 3) both."""
    off = np.sqrt(((read - light) ** 2).sum(axis=-1))
    norm = np.sqrt((light**2).sum(axis=-1))
    whole = float(np.sqrt((norm**2).mean()))
    if whole == 0:
        return Loss(what, 0.0 if not off.any() else np.inf, 0.0, 0.0)
    # The darkest texels beside a lamp are black, to within what its glare hides.
    relative = off / np.maximum(norm, 1e-6 * float(norm.mean()))
    rms = float(np.sqrt((off**2).mean())) / whole
    return Loss(what, rms, float(np.percentile(relative, 95)), _lamps(light, read))


def _lamps(light: Array, read: Array) -> float:
    """Return the largest relative change of a tile's energy, among those that hold lamps."""
    edge = light.shape[1]
    starts = np.arange(0, edge, _TILE)
    before, after = (
        np.add.reduceat(np.add.reduceat(each.sum(axis=-1), starts, axis=1), starts, axis=2)
        for each in (light, read)
    )
    # Of few tiles many hold that much light, and no lamp.
    is_lamp = before > max(_LAMP, 10 / before.size) * before.sum()
    if not is_lamp.any():
        return 0.0
    return float(np.abs(after[is_lamp] / before[is_lamp] - 1).max())


def sentence(file: str, losses: Sequence[Loss]) -> str:
    """Return a sentence about what is lost in a file."""
    levels = ", ".join(f"{percent(each.rms)}/{percent(each.p95)}" for each in losses)
    lamp = max(each.lamp for each in losses)
    lamps = f"; lamps keep their energy within {percent(lamp)} %" if lamp else ""
    return f"{file}: packing changes its levels by {levels} % (RMS/95th percentile){lamps}"
