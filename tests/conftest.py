"""Fixtures that tests share: reproducible random numbers, a cache of their own and sample files."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("shrm", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("shrm")


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory) -> Iterator[None]:
    """Give this run, and the processes that it starts, a cache of coefficients of its own.

    Workers that share a run share its cache as users' processes do, so that what takes seconds to
    compute is computed once.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    cache = folder / "cache"
    cache.mkdir(mode=0o700, exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHRM_CACHE_DIR", str(cache))
        yield


@pytest.fixture(scope="session", autouse=True)
def obeyed_ctrl_c() -> None:
    """Let the processes that tests start obey Ctrl-C, also where the tests themselves ignore it.

    Shells start what runs in the background so, and processes inherit it.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20020701)


@pytest.fixture(scope="session")
def colour() -> ModuleType:
    """Return colour-science, or skip the test. It takes seconds to load, which few tests need."""
    module: ModuleType = pytest.importorskip("colour", reason="colour-science is not installed")
    return module


ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """Return the folder of real probes, BRDFs and meshes beside the project, or skip the test."""
    folder = ROOT.parent / "shared"
    if not (folder / "probes").is_dir():
        pytest.skip(f"OpenEXR's sample images are in {folder.name}/ beside the project: not here")
    return folder


@pytest.fixture(scope="session")
def real_probes() -> Path:
    """Return a folder with real lat-longs, or skip the test.

    The folder is beside the project, or was fetched by `make probes`.
    """
    for folder in (ROOT.parent / "shared" / "probes", ROOT / "probes" / "real"):
        if (folder / "city.exr").exists():
            return folder
    pytest.skip("no real probes; `make probes` fetches them")
