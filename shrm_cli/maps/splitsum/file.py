"""Writing split sums to files with a part for each level, and reading them again."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, StoredFile, StoredPart
from shrm_cli.maps import stored
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.vocabulary import LEVEL_MAPPINGS, MAX_CUBE_SIZE, MAX_LEVELS, LevelMapping

_AGAIN = "make it again with shrm prefilter --to splitsum"


def level_names(roughness: Sequence[float]) -> list[str]:
    """Name the parts, as in ``roughness0.14``, with more decimals where two would be the same."""
    decimals = 2
    while True:
        names = [f"roughness{value:.{decimals}f}" for value in roughness]
        if len(set(names)) == len(names):
            return names
        decimals += 1


def encode(split_sum: SplitSum) -> list[Part]:
    """Make a part of a file for each level, the sharpest level first."""
    parts = []
    # Files hold 32-bit floats, so the names are those of the numbers that readers will get.
    names = level_names([stored.shortest(value) for value in split_sum.roughness])
    levels = zip(names, split_sum.roughness, split_sum.levels, split_sum.level_info, strict=True)
    for name, roughness, level, level_info in levels:
        # The options, and what came to them later, are those of the whole file.
        info = level_info.read_as(split_sum.info)
        header = {
            "name": name,
            **stored.common_header(replace(split_sum, info=info), 0),
            "shrm:mapping": split_sum.mapping,
            "shrm:roughness": float(roughness),
        }
        parts.append(Part(stored.image_channels(level), header))
    return parts


def decode(file: StoredFile) -> SplitSum:
    """Return the split sum that a file holds."""
    path, count = file.path, len(file.parts)
    if not 1 <= count <= MAX_LEVELS:
        raise MapError(f"{path}: {count} levels are not a split sum; {_AGAIN}")
    parts = sorted(file.parts, key=_roughness)
    attributes = [stored.read_attributes(part) for part in parts]
    roughness = [_roughness(part) for part in parts]
    is_rising = len(set(roughness)) == count
    if not is_rising or (count > 1 and [part.name for part in parts] != level_names(roughness)):
        raise MapError(f"{path}: its parts are not the levels of a split sum; {_AGAIN}")
    for each in attributes:
        is_ggx = each["brdf"].get("name") in (None, GgxLobe.name)
        centers = ("reflection",) if is_ggx else ("reflection", "normal")
        if each["representation"] != SplitSum.representation or each["center"] not in centers:
            raise MapError(f"{path}: its parts are not the levels of a split sum; {_AGAIN}")
        if (each["frame"], each["layout"], each["orientation"]) != ("global", "openexr", "openexr"):
            raise MapError(f"{path}: a split sum is OpenEXR's cube in global axes; {_AGAIN}")
    samplings = {part.border_sampled for part in parts}
    if len(samplings) > 1:
        raise MapError(f"{path}: its parts are sampled differently; {_AGAIN}")
    _check_sizes(parts)
    made = SplitSum.of_levels(
        [part.read(stored.COLORS) for part in parts],
        roughness,
        _mapping(parts, roughness[0]),
        "border" if samplings.pop() else "center",
        [stored.map_info(each, part) for each, part in zip(attributes, parts, strict=True)],
        attributes[-1]["center"],
    )
    return replace(made, path=str(path))


def _roughness(part: StoredPart) -> float:
    value = part.attribute("shrm:roughness")
    if type(value) is not float or not 0 <= value <= 1:
        raise MapError.of_attribute(part.path, "roughness")
    return stored.shortest(value)


def _mapping(parts: Sequence[StoredPart], first: float) -> LevelMapping:
    """Read how levels are mixed, which all parts must agree on; `first` is the least roughness."""
    named = {part.text("shrm:mapping") for part in parts}
    mapping = named.pop()
    if named or mapping not in LEVEL_MAPPINGS or (mapping == "unreal" and first == 0):
        raise MapError.of_attribute(parts[0].path, "mapping")
    return cast(LevelMapping, mapping)


def _check_sizes(parts: Sequence[StoredPart]) -> None:
    """Check that the parts are RGB cubes, and that none is larger than the one before it."""
    last = MAX_CUBE_SIZE
    for part in parts:
        if not (part.height == 6 * part.width and 1 <= part.width <= last):
            raise MapError(
                f"{part.path}: a level of {part.width} x {part.height} is not a cube, or larger "
                f"than the one before it; {_AGAIN}"
            )
        if not part.holds(stored.COLORS):
            raise MapError(f"{part.path}: the channels of a level are not R, G and B; {_AGAIN}")
        last = part.width
