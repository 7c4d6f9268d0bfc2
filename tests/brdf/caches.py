"""An empty cache of coefficients for a test, and a count of what is computed in spite of it."""

from shrm_cli.arrays import Memo
from shrm_cli.brdf import cache


def new_cache(tmp_path, monkeypatch):
    """Return the folder of a cache that keeps everything, as a new process finds it."""
    monkeypatch.setenv("SHRM_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_SLOW", -1.0)
    monkeypatch.setattr(cache, "_in_memory", Memo(0))
    return tmp_path / "cache"


class Counted:
    """Computes, and counts how often."""

    def __init__(self, compute):
        self.compute, self.calls, self.__name__ = compute, 0, compute.__name__

    def __call__(self, *arguments):
        self.calls += 1
        return self.compute(*arguments)
