"""The lobes of the views for which maps are judged, taken from transfer functions."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.brushed_transfer import azimuths_of
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.maps.lobes_lit import Lobes
from shrm_cli.maps.sphere_pixels import sample_tangents, sample_views, view_count
from shrm_cli.records import record
from shrm_cli.reflected import last_visible
from shrm_cli.vocabulary import Center

_SAME = 1e-9
"""How far lobes of all views that are the same may be apart, beside the largest value."""


@record(eq=False)
class BetweenNodes:
    """How what is known at the nodes of transfer functions is taken at the views of lobes.

    Values of isotropic BRDFs are taken between the nodes on both sides of each view. Those of
    anisotropic ones are so at the nearest azimuth, and complex.
    """

    nodes: NDArray[np.intp]
    """The nodes below all views, then those above them. Of anisotropic BRDFs the real parts of
    both, then the imaginary ones."""
    part: Array
    """How far each view is from the node below it to that above, in 0 .. 1, shape (views, 1)."""
    signs: Array | None
    """What the imaginary parts are multiplied with, shape (2 views,); None where there are none."""

    @classmethod
    def of(cls, transfer: TransferFunctions, center: Center) -> "BetweenNodes":
        """Prepare to take values about a central direction at the views of `sample_views`."""
        is_brushed = transfer.azimuths.size > 0
        angles, _ = sample_views(center, view_count(is_brushed))
        theta_o = transfer.theta_o
        if is_brushed:
            theta_o = theta_o[: len(theta_o) // (2 * len(azimuths_of(transfer).angles))]
        after = np.clip(np.searchsorted(theta_o, angles), 1, len(theta_o) - 1)
        low, high = theta_o[after - 1], theta_o[after]
        part = np.clip((angles - low) / (high - low), 0.0, 1.0)[:, None]
        nodes, signs = np.concatenate([after - 1, after]), None
        if is_brushed:
            nodes, signs = _parts_near(transfer, nodes, np.tile(sample_tangents(len(angles)), 2))
        return cls(nodes, part, signs)

    def __call__(self, values: Array) -> Array:
        """Return values at the views, (..., views, channels), from those at all `nodes`."""
        if self.signs is not None:
            real, imaginary = np.split(values, 2, axis=-2)
            values = real + 1j * self.signs[:, None] * imaginary
        low, high = np.split(values, 2, axis=-2)
        return np.asarray((1 - self.part) * low + self.part * high)


def _parts_near(
    transfer: TransferFunctions, nodes: NDArray[np.intp], azimuths: Array
) -> tuple[NDArray[np.intp], Array]:
    """Return the nodes of the nearest azimuths of the transfer functions of an anisotropic BRDF.

    `nodes`, of shape (n,), are those of theta_o. `azimuths`, of shape (n,), are radians in 0 ..
    2 pi.

    Returns `nodes` of shape (2n,), all real parts, then all imaginary ones; and `signs` of shape
    (n,), what the imaginary parts are multiplied with: -1 in mirror images.
    """
    known = azimuths_of(transfer)
    half = len(transfer.theta_o) // 2
    step, turn = np.round(azimuths / (np.pi / 2 / known.steps)), 4 * known.steps
    place, signs = step.astype(np.intp) % turn, np.ones(len(nodes))
    if known.is_mirrored:
        place = place % (turn // 2)
        is_image = place > known.steps
        place, signs = np.where(is_image, turn // 2 - place, place), np.where(is_image, -1.0, 1)
    first = place % len(known.angles) * (half // len(known.angles)) + nodes
    return np.append(first, first + half), signs


def whole_lobes(transfer: TransferFunctions, center: Center) -> Lobes:
    """Return the lobes of transfer functions about a central direction; no map misses any."""
    between = BetweenNodes.of(transfer, center)
    whole = between(transfer.values[:, :, between.nodes])
    return Lobes.of(whole, np.zeros_like(whole), center)


@record(eq=False)
class SeenLobes:
    """The visible part of the lobes of transfer functions, of which maps leave something out."""

    between: BetweenNodes
    whole: Array
    """The lobes themselves, as those of `Lobes`, for one view where all are the same."""
    beyond: Array
    """The RMS of what truncation after each degree leaves out, relative to the mean light."""

    @classmethod
    def of(cls, transfer: TransferFunctions, center: Center, beyond: Array) -> "SeenLobes":
        """Take the lobes about a central direction up to the last visible degree."""
        between = BetweenNodes.of(transfer, center)
        whole = between(transfer.values[:, : last_visible(beyond) + 1, between.nodes])
        if np.ptp(whole.real, axis=2).max() <= _SAME * np.abs(whole).max():
            whole = whole[:, :, :1]
        return cls(between, whole, beyond)
