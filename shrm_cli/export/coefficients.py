"""Nine coefficients as JSON that names its convention."""

import json

import numpy as np
from numpy.typing import NDArray

from shrm_cli.export.engine import Package

Array = NDArray[np.floating]


def add_coefficients(made: Package, name: str, values: Array, meaning: str, axes: str) -> None:
    """Add coefficients, shape (9, 3), to a package: a list for each channel.

    Parameters
    ----------
    made : Package
    name : str
        The name of the file.
    values : ndarray, shape (9, 3)
    meaning, axes : str
        What the numbers are, and the axes that they are in, for people.
    """
    red, green, blue = (values[:, channel].tolist() for channel in range(3))
    found = {"meaning": meaning, "axes": axes, "red": red, "green": green, "blue": blue}
    made.add_text(name, json.dumps(found, indent=1) + "\n")
