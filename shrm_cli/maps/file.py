"""What the file of a map holds, whatever its representation: the map, and how it was made."""

import os
from collections.abc import Callable

from shrm_cli.errors import MapError
from shrm_cli.files.parts import StoredFile, WithoutLast, open_file, peek
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.size import MAX_VALUES
from shrm_cli.maps.stored import has_map_attributes, map_info, read_attributes
from shrm_cli.records import record


def open_map(path: str | os.PathLike[str]) -> Map:
    """Read a map that `Map.save` wrote.

    Raises
    ------
    MapError
        If the file is missing, damaged or too large, or is not a map.

    Examples
    --------
    >>> shrm.prefilter("probes/studio.exr", to="irradiance").save("white.exr")
    'half'
    >>> shrm.open_map("white.exr").representation
    'irradiance'
    """
    file = open_file(os.fspath(path))
    attributes = read_attributes(file.first)
    check_amount(file)
    name = attributes["representation"]
    is_plain = (attributes["layout"], attributes["orientation"]) == ("openexr", "openexr")
    if not (is_plain or registry.map_class(name).is_rearrangeable):
        raise MapError(
            f"{path}: a {name} map is never laid out as {attributes['layout']}; make it again"
        )
    decode: Callable[[StoredFile], Map] = registry.module(name, "file").decode
    if file.first.attribute("shrm:lamps") is None:
        return decode(file)
    # Few maps have lamps beside them; others are spared these modules.
    from shrm_cli.maps.lamps.lobe import LobeTable, lobe_part
    from shrm_cli.maps.lamps.map import LampMap, read_lamps

    lamps, table = read_lamps(file.first), lobe_part(file.parts)
    if table is None:
        return LampMap(decode(file), *lamps, path=os.fspath(path))
    return LampMap(decode(WithoutLast(file)), *lamps, LobeTable.read(table))


@record
class Recorded:
    """What the beginning of a map's file tells of how it was made."""

    representation: str
    info: MapInfo
    """That of the first part. The probe, the BRDF and the options are those of the whole file."""
    sources: str
    """The fingerprint of the program that wrote the file, see `shrm_cli.sources`; empty in files
    from before this was recorded."""


def recorded(path: str | os.PathLike[str]) -> Recorded | None:
    """Read how a map was made, without its pixels; None if it is no map that can be read.

    The file is only looked at, and does not count as an input.
    """
    file = peek(path)
    if file is None:
        return None
    try:
        attributes = read_attributes(file.first)
    except MapError:
        return None
    info = map_info(attributes, file.first)
    return Recorded(attributes["representation"], info, attributes["sources"])


def is_map(path: str | os.PathLike[str]) -> bool:
    """Whether a readable file carries the attributes of a map.

    Examples
    --------
    >>> shrm.is_map("probes/studio.exr")
    False
    """
    file = peek(path)
    return file is not None and has_map_attributes(file.first)


def check_amount(file: StoredFile) -> None:
    """Refuse a file of too many values to load.

    The number is estimated from the first part, so that a huge file is refused before its other
    parts are looked at.
    """
    first = file.first
    values = file.part_count * len(first.channel_names) * first.width * first.height
    if values <= MAX_VALUES:
        found = (len(part.channel_names) * part.width * part.height for part in file.parts)
        values = max(values, sum(found))
    if values > MAX_VALUES:
        raise MapError(f"{file.path}: {values:,} values are too many to load")
