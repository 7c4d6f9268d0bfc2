"""Names of channels and parts, and what says which view a part is."""

from math import isqrt
from typing import Any

from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.kautz_mccool import KautzMcCool
from shrm_cli.maps.explicit.light_field import LightField

COLOURS = "RGB"


def shrm_channels(order_p: int, zonal: bool = False) -> list[str]:
    """Of an SHRM: ``sh000.R sh000.G sh000.B sh001.R ...``; the zonal ones have q = 0."""
    order = [(p, q) for p in range(order_p + 1) for q in range(-p, p + 1)]
    return [
        f"sh{index:03d}.{c}"
        for index, (_, q) in enumerate(order)
        if q == 0 or not zonal
        for c in COLOURS
    ]


def component_channels(count: int) -> list[str]:
    """Of a compressed SHRM: ``pc000.R pc000.G ...``."""
    return [f"pc{k:03d}.{c}" for k in range(count) for c in COLOURS]


def term_names(count: int) -> list[str]:
    """Of the parts of a sum: ``term00`` and so on."""
    return [f"term{k:02d}" for k in range(count)]


def part_names(kind: type[ExplicitMap], count: int) -> list[str]:
    """Of an explicit map: ``view00``, ``slice00`` or ``view00_00`` and so on."""
    if issubclass(kind, LightField):
        side = range(isqrt(count))
        return [f"view{j:02d}_{k:02d}" for j in side for k in side]
    word = "slice" if issubclass(kind, KautzMcCool) else "view"
    return [f"{word}{k:02d}" for k in range(count)]


def view_attributes(kind: type[ExplicitMap], count: int) -> list[dict[str, Any]]:
    """Of an explicit map: the sample of the view that each part belongs to."""
    if issubclass(kind, KautzMcCool):
        return [{"shrm:theta_o": float(theta)} for theta in kind.view_angles(count)]
    return [{"shrm:view": tuple(map(float, view))} for view in kind.sample_views(count)]
