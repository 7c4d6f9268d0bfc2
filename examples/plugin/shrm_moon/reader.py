"""``shrm info dome.scan``: luminances of a sky scanner, a line of numbers for each elevation."""

from pathlib import Path

import numpy as np


def read_scan(path: Path) -> tuple[np.ndarray, dict[str, object]]:
    """Pixels of shape (rows, columns) or (rows, columns, 3), and what they are."""
    return np.loadtxt(path, ndmin=2), {"layout": "latlong", "sampling": "center"}
