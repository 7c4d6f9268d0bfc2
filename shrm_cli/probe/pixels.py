"""What is done about pixels that cannot be radiance, and what was done."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.records import record


@dataclass
class PixelReport:
    """What the pixels of a probe needed, gathered while they are read.

    Attributes
    ----------
    nonfinite : int
        Pixels with a NaN or infinite channel.
    first_nonfinite : tuple of int, optional
        Column and row of the first.
    negative, minimum : int, float
        Pixels with a negative channel, and the least value.
    clamped : int
        Pixels that `clamp` dimmed.
    energy_removed, energy : float
        The integral of radiance over the sphere, channels added: what clamping took, and
        what there was before.
    """

    nonfinite: int = 0
    first_nonfinite: tuple[int, int] | None = None
    negative: int = 0
    minimum: float = 0.0
    clamped: int = 0
    energy_removed: float = 0.0
    energy: float = 0.0
    notes: tuple[str, ...] = ()

    def clear(self) -> None:
        """Start again, as before the first pixel; the notes stay."""
        for field in fields(self):
            if field.name != "notes":
                setattr(self, field.name, field.default)

    def warnings(self) -> list[str]:
        """One line for each thing that a user should know."""
        lines = list(self.notes)
        if self.nonfinite:
            lines.append(f"{self.nonfinite} NaN or infinite pixels were filled from neighbours")
        if self.negative:
            lines.append(
                f"{self.negative} pixels with negative radiance were clamped to 0 (minimum "
                f"{self.minimum:.6g})"
            )
        if self.clamped:
            share = self.energy_removed / self.energy if self.energy else 0.0
            lines.append(
                f"{self.clamped} pixels were clamped, which removed {share:.3%} of the energy"
            )
        if self.energy == 0:
            lines.append("the probe is black")
        return lines


@record
class PixelPolicy:
    """How pixels are checked and changed.

    Attributes
    ----------
    fix_nonfinite : bool
        Replace NaN and infinite pixels by the mean of their finite neighbors.
    clamp : float, optional
        Largest radiance of a channel. Brighter pixels are scaled down as a whole, which keeps
        their hue.
    """

    fix_nonfinite: bool = False
    clamp: float | None = None

    def apply(self, pixels: Array, weights: Array, report: PixelReport) -> Array:
        """Finite pixels without negative radiance, clamped if asked.

        Parameters
        ----------
        pixels : ndarray, shape (rows, columns, 3)
            They are left as they are.
        weights : ndarray, shape (rows, columns) or (rows, 1)
            Solid angles.
        report : PixelReport
            What is added to.

        Returns
        -------
        ndarray, shape (rows, columns, 3)
        """
        if pixels.size and pixels.min() < 0:
            below = pixels < 0
            report.negative += int(np.count_nonzero(below.any(axis=-1)))
            report.minimum = min(report.minimum, float(pixels.min()))
            pixels = np.where(below, np.float32(0), pixels)
        energy = _energy(pixels, weights)
        report.energy += energy
        if self.clamp is not None:
            brightest = pixels.max(axis=-1)
            over = brightest > self.clamp
            if over.any():
                report.clamped += int(np.count_nonzero(over))
                scale = np.where(over, self.clamp / np.where(over, brightest, 1), 1)
                pixels = (pixels * scale[..., None]).astype(pixels.dtype)
                report.energy_removed += energy - _energy(pixels, weights)
        return pixels


def find_nonfinite(pixels: Array, first_row: int, report: PixelReport) -> NDArray[np.bool_] | None:
    """Find the pixels of a block that are NaN or infinite, and count them in the report.

    Parameters
    ----------
    pixels : ndarray, shape (rows, columns, 3)
    first_row : int
        Where the block begins in its image.
    report : PixelReport
        What is added to.

    Returns
    -------
    ndarray of bool, shape (rows, columns), or None
        None where all pixels are finite.
    """
    # One pass in the common case: a sum is finite if every term is, short of overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(pixels.sum()):
            return None
    bad = ~_finite(pixels)
    if not bad.any():
        return None
    report.nonfinite += int(np.count_nonzero(bad))
    if report.first_nonfinite is None:
        row, column = (int(k[0]) for k in np.nonzero(bad))
        report.first_nonfinite = column, row + first_row
    return bad


def refuse_nonfinite(name: str, report: PixelReport) -> None:
    """Raise if any pixel was found to be NaN or infinite.

    Raises
    ------
    ProbeError
    """
    if report.first_nonfinite is not None:
        column, row = report.first_nonfinite
        raise ProbeError(
            f"{name}: {report.nonfinite} pixels are NaN or infinite, the first at column "
            f"{column}, row {row}; give `fix_nonfinite` to fill them"
        )


def refuse_overflow(name: str, numbers: Array) -> None:
    """Raise if numbers that follow from the light of a probe are beyond 32-bit floats.

    Raises
    ------
    ProbeError
    """
    if not (np.abs(numbers) <= np.finfo(np.float32).max).all():  # which no NaN is, either
        raise ProbeError(f"{name}: its light is beyond 32-bit floats; dim it, or give `clamp`")


def fill_nonfinite(
    pixels: Array,
    wraps: bool = False,
    used: NDArray[np.bool_] | None = None,
    rounds: int | None = None,
) -> Array:
    """Replace each NaN or infinite pixel by the mean of its finite neighbors.

    Larger holes are filled from their rim inwards, one pixel in each round.

    Parameters
    ----------
    pixels : ndarray, shape (H, W, 3)
    wraps : bool
        Whether the left and right edges are beside each other, as in a lat-long.
    used : ndarray of bool, shape (H, W), optional
        The pixels that hold radiance; no others are filled or filled from.
    rounds : int, optional
        How deep to fill; what lies deeper stays as it is. By default no depth is too great.

    Returns
    -------
    ndarray
        A copy. If no used pixel is finite, nothing can be filled.
    """
    pixels = pixels.copy()
    good = _finite(pixels)
    bad = ~good
    if used is not None:
        good &= used
        bad &= used
    height, width = bad.shape
    while bad.any() and good.any() and rounds != 0:
        rows, columns = np.nonzero(bad)
        total, count = np.zeros((len(rows), 3)), np.zeros(len(rows))
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                y, x = rows + dy, columns + dx
                if wraps:
                    x = x % width
                inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
                y, x = np.where(inside, y, 0), np.where(inside, x, 0)
                known = inside & good[y, x]
                total[known] += pixels[y[known], x[known]]
                count[known] += 1
        filled = count > 0
        if not filled.any():  # out of reach of the good ones
            break
        at = rows[filled], columns[filled]
        pixels[at] = total[filled] / count[filled, None]
        good[at], bad[at] = True, False
        if rounds is not None:
            rounds -= 1
    return pixels


def _finite(pixels: Array) -> NDArray[np.bool_]:
    """Which pixels are finite in every channel."""
    return np.asarray(np.isfinite(pixels).all(axis=-1))


def _energy(pixels: Array, weights: Array) -> float:
    """Integral of the radiance, channels added."""
    if weights.shape[1] == 1:
        return float(pixels.sum(axis=(1, 2), dtype=float) @ weights[:, 0])
    # Whole faces of a cube arrive at once; a few rows at a time they need no memory beside them.
    rows = zip(pixels, weights, strict=True)
    return float(sum(row.sum(axis=1, dtype=float) @ own for row, own in rows))
