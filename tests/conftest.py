"""What every test shares: reproducible random numbers and Hypothesis settings."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("shrm", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("shrm")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20020701)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real probes, BRDFs and meshes beside the project."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not (folder / "probes").is_dir():
        pytest.skip(f"no real probes: {folder.name}/ is not beside the project")
    return folder
