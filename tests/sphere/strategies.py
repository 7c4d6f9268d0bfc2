"""Hypothesis strategies of the sphere: directions and rotations, with the awkward ones."""

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

_component = st.one_of(st.floats(-1, 1), st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-9, -1e-9, 0.5]))


def _unit(values: list[float]) -> NDArray[np.floating]:
    return np.array(values) / np.linalg.norm(values)


def _tuple(count: int) -> st.SearchStrategy[list[float]]:
    values = st.lists(_component, min_size=count, max_size=count)
    return values.filter(lambda v: np.linalg.norm(v) > 1e-3)


def directions() -> st.SearchStrategy[NDArray[np.floating]]:
    """Unit vectors, among them the axes, edges of a cube, and neighbours of the poles."""
    return _tuple(3).map(_unit)


def rotations() -> st.SearchStrategy[NDArray[np.floating]]:
    """Rotation matrices, among them the identity, half turns and tiny turns."""
    return _tuple(4).map(lambda q: Rotation.from_quat(_unit(q)).as_matrix())
