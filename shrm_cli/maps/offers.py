"""What `choose` wants to know of forms whose errors no planner predicts: what could be made for a
material, and what a shader reads and computes to look that up.

The module ``offers`` of a form has ``settings(brdf)``, which returns settings, and
``look_up(made, brdf, taps)``, which returns a `LookUp`.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from shrm_cli.maps.shader.cost import Cost
from shrm_cli.records import record

FLOATS = 12
"""The bytes of three 32-bit floats."""


@record
class Setting:
    """A map that could be made."""

    arguments: Mapping[str, Any]
    """What `shrm_cli.prefilter.prefilter` is given, besides the form and the BRDF."""
    taps: Sequence[int] = ()
    """How often a split sum is looked up, as `Map.shaded` takes it: each number is an offer of its
    own."""


@record
class LookUp:
    """What a shader reads of a map, and computes with it."""

    what: str
    """The map's orders, cubes and texels, in words."""
    bytes: int
    """What is read: cubes in half precision, and coefficients as 32-bit floats."""
    cost: Cost
