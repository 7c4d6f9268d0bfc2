"""What files for engines say of themselves: those that shrm writes, and reads no light from."""

import os
from pathlib import Path
from typing import Any

from shrm_cli.export.asset import read_light_facts
from shrm_cli.export.dds import read_dds_facts
from shrm_cli.export.engines.babylon import MARK
from shrm_cli.export.ktx import damaged, read_ktx1_facts
from shrm_cli.files.json_text import parse_json
from shrm_cli.probe.series import for_engines

_MOST_HEADER, _MOST_JSON = 2**16, 2**25
_USE = "for engines; shrm reads the probe or the map that it was made of"


def read_engine_facts(path: str) -> dict[str, Any] | None:
    """Return what a file for engines is, and what is known of it; None of another file.

    Raises MapError if it is damaged.
    """
    if not os.path.isfile(path) or not os.access(path, os.R_OK):
        return None
    every = (read_ktx1_facts, read_dds_facts, _babylon, read_light_facts, _json)
    facts = next(filter(None, (read(path) for read in every)), None)
    return None if facts is None else {**facts, "use": _USE}


def _babylon(path: str) -> dict[str, Any] | None:
    """Facts of Babylon.js's ``.env``."""
    with open(path, "rb") as file:
        start = file.read(_MOST_HEADER)
    if not start.startswith(MARK):
        return None
    text, end, _ = start[len(MARK) :].partition(b"\0")
    try:
        head = parse_json(text.decode())
        pictures = head["specular"]["mipmaps"]
        last = max(each["position"] + each["length"] for each in pictures)
        if not end or len(MARK) + len(text) + 1 + last > os.path.getsize(path):
            raise ValueError("truncated")
        width = int(head["width"])
    except (ValueError, TypeError, LookupError):
        raise damaged(path) from None
    return {
        "kind": "environment of Babylon.js",
        "width": width,
        "levels": len(pictures) // 6,
        "bytes": os.path.getsize(path),
    }


def _json(path: str) -> dict[str, Any] | None:
    """Facts of what is no light by itself, or in the axes of an engine."""
    if Path(path).suffix.lower() != ".json" or os.path.getsize(path) > _MOST_JSON:
        return None
    try:
        tree = parse_json(Path(path).read_bytes().decode())
    except ValueError:
        return None
    if (kind := for_engines(tree)) is None:
        return None
    told = {key: str(tree[key])[:200] for key in ("meaning", "axes") if key in tree}
    return {"kind": kind, **told, "bytes": os.path.getsize(path)}
