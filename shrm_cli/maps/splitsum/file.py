"""Split sums <-> the parts of a file: a cube for each roughness, of decreasing size."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.files.exr import Part, has_channels, read_channels
from shrm_cli.maps.attributes import common_header, map_info, read_attributes, shortest
from shrm_cli.maps.names import COLOURS
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.vocabulary import LEVEL_MAPPINGS, MAX_CUBE_SIZE, MAX_LEVELS

Array = NDArray[np.floating]

_AGAIN = "make it again with shrm prefilter --to splitsum"


def level_names(roughness: Sequence[float]) -> list[str]:
    """Of the parts: ``roughness0.14``, with more decimals where two would be the same."""
    decimals = 2
    while True:
        names = [f"roughness{value:.{decimals}f}" for value in roughness]
        if len(set(names)) == len(names):
            return names
        decimals += 1


def encode(split_sum: SplitSum) -> list[Part]:
    """A part for each level, the sharpest first."""
    size = split_sum.size
    window = np.array([0, 0], np.int32), np.array([size - 1, 6 * size - 1], np.int32)
    parts = []
    names = level_names([shortest(value) for value in split_sum.roughness])  # as readers have them
    levels = zip(
        names, split_sum.roughness, split_sum.levels,
        split_sum.level_info, strict=True,
    )  # fmt: skip
    for name, roughness, level, info in levels:
        header = {
            "name": name,
            **common_header(replace(split_sum, info=info), 0),
            "shrm:mapping": split_sum.mapping,
            "shrm:roughness": float(roughness),
            "displayWindow": window,
        }
        parts.append(Part({c: level[..., k] for k, c in enumerate(COLOURS)}, header))
    return parts


def decode(path: str | os.PathLike[str], source: Any, specs: list[Any]) -> SplitSum:
    """The split sum that the parts of a file are.

    Parameters
    ----------
    path : path-like
    source : ImageInput
        The opened file.
    specs : list of ImageSpec
        Of its parts.

    Raises
    ------
    MapError
        If parts or attributes are missing, or contradict each other.
    """
    if not 1 <= len(specs) <= MAX_LEVELS:
        raise MapError(f"{path}: {len(specs)} levels are not a split sum; {_AGAIN}")
    attributes = [read_attributes(path, spec) for spec in specs]
    found = [_roughness(path, spec) for spec in specs]
    order = sorted(range(len(specs)), key=found.__getitem__)
    roughness = [found[part] for part in order]
    names = [specs[part].get_string_attribute("oiio:subimagename") for part in order]
    if len(set(roughness)) < len(roughness) or (len(specs) > 1 and names != level_names(roughness)):
        raise MapError(f"{path}: its parts are not the levels of a split sum; {_AGAIN}")
    mappings = {spec.get_string_attribute("shrm:mapping") for spec in specs}
    mapping = mappings.pop()
    if mappings or mapping not in LEVEL_MAPPINGS or (mapping == "unreal" and roughness[0] == 0):
        raise MapError(f"{path}: its attribute shrm:mapping is missing or wrong; {_AGAIN}")
    for each in attributes:
        if (each["representation"], each["center"]) != (SplitSum.representation, SplitSum.center):
            raise MapError(f"{path}: its parts are not the levels of a split sum; {_AGAIN}")
        if (each["frame"], each["layout"], each["orientation"]) != ("global", "openexr", "openexr"):
            raise MapError(f"{path}: a split sum is OpenEXR's cube in global axes; {_AGAIN}")
    samplings = {bool(spec.get_int_attribute("oiio:sampleborder")) for spec in specs}
    if len(samplings) > 1:
        raise MapError(f"{path}: its parts are sampled differently; {_AGAIN}")
    _check_sizes(path, [specs[part] for part in order])
    infos = [map_info(attributes[part], specs[part]) for part in order]
    return SplitSum.of_levels(
        [read_channels(path, source, part, COLOURS) for part in order],
        roughness,
        mapping,
        "border" if samplings.pop() else "center",
        infos,
    )


def _roughness(path: str | os.PathLike[str], spec: Any) -> float:
    value = spec.getattribute("shrm:roughness")
    if type(value) is not float or not 0 <= value <= 1:
        raise MapError(f"{path}: its attribute shrm:roughness is missing or wrong; {_AGAIN}")
    return shortest(value)


def _check_sizes(path: str | os.PathLike[str], specs: list[Any]) -> None:
    """Check that the parts are cubes of RGB that do not grow."""
    last = MAX_CUBE_SIZE
    for spec in specs:
        if not (spec.height == 6 * spec.width and 1 <= spec.width <= last):
            raise MapError(
                f"{path}: a level of {spec.width} x {spec.height} is not a cube, or larger than "
                f"the one before it; {_AGAIN}"
            )
        if not has_channels(spec, COLOURS):
            raise MapError(f"{path}: the channels of a level are not R, G and B; {_AGAIN}")
        last = spec.width
