"""What look-ups in small cubes miss, against look-ups with code of their own at many directions."""

import numpy as np
import pytest

from research.bilinear import bilinear
from shrm_cli.sphere.bilinear import lost_between_texels
from shrm_cli.sphere.quadrature import spiral_directions
from tests.oracles import real_harmonics

TOWARDS = np.array([[1, 0.05, 0.1], [0.3, -1, 0.2], [-0.9, 0.85, 1]])
"""Near the middle of a face, near an edge, and near a corner."""
DIRECTIONS = 60000


@pytest.mark.parametrize(
    ("size", "order", "sampling"),
    [(16, 20, "center"), (16, 32, "center"), (15, 18, "border"), (24, 30, "center"),
     (33, 40, "border"), (48, 60, "center"), (6, 7, "center"), (2, 3, "center"),
     (2, 3, "border"), (1, 1, "center")],
)  # fmt: skip
def test_loss_is_that_of_look_ups_everywhere(size, order, sampling):
    """Lobes of a lamp at three places, which fall towards their last degrees as maps do."""
    axes = TOWARDS / np.linalg.norm(TOWARDS, axis=1)[:, None]
    degree = np.arange(order + 1)
    fall = np.exp(-2 * (degree / order) ** 2)
    series = real_harmonics(order, axes).T * np.repeat(fall, 2 * degree + 1)[:, None]

    def function(directions):
        """The lobes by the addition theorem."""
        legendre = np.polynomial.legendre.legvander(directions @ axes.T, order)
        return legendre @ ((2 * degree + 1) / (4 * np.pi) * fall)

    points = spiral_directions(DIRECTIONS)
    missed = bilinear(function, size, points, sampling) - function(points)
    measured = 4 * np.pi * np.mean(missed**2, axis=0)
    # The roots are the errors that are stated.
    found = lost_between_texels(series, size, sampling)
    assert np.sqrt(found) == pytest.approx(np.sqrt(measured), rel=0.02 if size < 48 else 0.06)


def test_nothing_is_lost_of_constants_and_of_none():
    series = np.zeros((16, 2))
    assert (lost_between_texels(series, 8) == 0).all()
    series[0] = 1, -2
    assert lost_between_texels(series, 8) == pytest.approx(0, abs=1e-10)
