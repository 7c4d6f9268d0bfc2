"""The types of arrays that most modules name in annotations."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
"""Floating-point numbers, of 64 bits unless a docstring says otherwise."""
Indices = NDArray[np.intp]
