"""Which module encodes and decodes a map for engines."""

from importlib import import_module
from typing import Any

_MODULES = {"irradiance": "irradiance", "splitsum": "split_sum", "she": "exponential"}


def codec(representation: str) -> Any:
    """The module with `encode` and `decode` of a representation; no other one is loaded."""
    return import_module(f"shrm_cli.exr.{_MODULES[representation]}")
