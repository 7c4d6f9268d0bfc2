"""What every test shares: reproducible random numbers and Hypothesis settings."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("shrm", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("shrm")


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory) -> Iterator[None]:
    """A cache of coefficients for the tests alone, in this process and those that it starts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHRM_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20020701)


ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real probes, BRDFs and meshes beside the project."""
    folder = ROOT.parent / "shared"
    if not (folder / "probes").is_dir():
        pytest.skip(f"OpenEXR's sample images are in {folder.name}/ beside the project: not here")
    return folder


@pytest.fixture(scope="session")
def real_probes() -> Path:
    """A folder with real lat-longs: beside the project, or fetched by `make probes`."""
    for folder in (ROOT.parent / "shared" / "probes", ROOT / "probes" / "real"):
        if (folder / "city.exr").exists():
            return folder
    pytest.skip("no real probes; `make probes` fetches them")
