"""Which module encodes and decodes a map for engines."""

from importlib import import_module
from typing import Any


def codec(representation: str) -> Any:
    """The module with `encode` and `decode` of a representation; no other one is loaded."""
    return import_module(f"shrm_cli.maps.{representation}.file")
