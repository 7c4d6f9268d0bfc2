"""From the name of a grid to its class."""

from importlib import import_module

from shrm_cli.layouts import GRIDS
from shrm_cli.sphere.grid.base import Grid


def grid_class(name: str) -> type[Grid]:
    """The class of a grid, by a name out of `shrm_cli.layouts.GRIDS`."""
    module, _, member = GRIDS[name].partition(":")
    found: type[Grid] = getattr(import_module(module), member)
    return found
