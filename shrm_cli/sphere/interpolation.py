"""Matrices that interpolate functions of the polar angle from one set of nodes to another."""

import numpy as np

from shrm_cli.arrays import Array


def interpolation_matrix(nodes: Array, targets: Array, odd: bool) -> Array:
    """Return the matrix that leads from values at nodes to cubic interpolation at other angles.

    Parameters
    ----------
    nodes : ndarray, shape (n,)
        Angles in 0 .. pi, ascending, four at least.
    targets : ndarray, shape (m,)
        Angles in 0 .. pi. Beyond the last node the polynomial of the last four goes on.
    odd : bool
        Whether the function is odd about angle 0; otherwise it is even.

    Returns
    -------
    ndarray, shape (m, n)
    """
    count = len(nodes)
    mirrored = min(3, count)
    wide = np.concatenate([-nodes[:mirrored][::-1], nodes])
    first = np.clip(np.searchsorted(wide, targets) - 2, 0, len(wide) - 4)
    matrix = np.zeros((len(targets), len(wide)))
    rows = np.arange(len(targets))
    for i in range(4):
        weight = np.ones(len(targets))
        for j in range(4):
            if j != i:
                near, far = wide[first + i], wide[first + j]
                weight *= (targets - far) / (near - far)
        matrix[rows, first + i] += weight
    folded = matrix[:, mirrored:].copy()
    folded[:, :mirrored] += (-1 if odd else 1) * matrix[:, :mirrored][:, ::-1]
    return folded


def linear_matrix(nodes: Array, targets: Array) -> Array:
    """Return the matrix of linear interpolation between even nodes, clamped to their ends.

    Parameters
    ----------
    nodes : ndarray, shape (n,)
        Evenly spaced, ascending, two at least.
    targets : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (m, n)
    """
    position = (targets - nodes[0]) / (nodes[1] - nodes[0])
    position = np.clip(position, 0, len(nodes) - 1)
    low = np.minimum(position.astype(np.intp), len(nodes) - 2)
    matrix = np.zeros((len(targets), len(nodes)))
    rows = np.arange(len(targets))
    matrix[rows, low] = 1 - (position - low)
    matrix[rows, low + 1] += position - low
    return matrix
