"""What is left of the names of probes and BRDFs in the names of the files that are made of them."""

import os
import re
from pathlib import Path

_LONGEST_STEM, _LONGEST_LABEL = 100, 80
"""The most bytes of a probe's and of a BRDF's part of a default name.

File systems take names of 255 bytes, and names of pictures and conversions are longer ones yet.
"""
# These are compiled where they are used, because most runs use none of them.
_DRIVE = r"[A-Za-z]:"
_CONTROL = r"[\x00-\x1f\x7f-\x9f]"
_ON_WINDOWS = r'(?i)^(con|prn|aux|nul|com[0-9]|lpt[0-9])(\.|$)|[<>:"|?*]|[. ]$'
"""Names of devices, and those that files cannot have there."""
_MOST_CODED = 8
"""How often a name may be percent-encoded upon itself."""


def probe_stem(probe: str) -> str:
    """Return what the names of a probe's outputs begin with, without the ``%`` of six files."""
    if ":/" in probe:
        from shrm_cli.messages import without_query

        probe = without_query(probe)
    stem = Path(probe).stem.replace("%", "").rstrip("_-.") or "probe"
    return shortened(stem, _LONGEST_STEM)


def map_stem(path: str) -> str:
    """Return the name of a map's file, or a grid's, without its folder and ``.exr`` or ``.npz``."""
    name = Path(path).name
    return name[:-4] if name.lower().endswith((".exr", ".npz")) else name


def brdf_label(spec: str) -> str:
    """Return a BRDF's specification as a part of a file's name; sums may be long, and are cut."""
    from shrm_cli.brdf.spec import file_label

    return shortened(file_label(spec), _LONGEST_LABEL)


def unsound(part: str) -> str:
    """Say why a text may be no part of an output's name; the empty text where it may.

    Names of folders and files that a listing gives come from whoever keeps it: a web server, or
    whoever may write into a store. None of them may lead out of the folder that the user names, on
    any system, also where the slashes are written as ``%2f``.

    `part` is one name, or some folders joined by ``/``.
    """
    for text in _decoded(part):
        folders = re.split(r"[/\\]", text)
        if {".", ".."} & {folder.strip(" ") for folder in folders}:
            return "it leads out of its folder"
        if text.startswith("/") or re.match(_DRIVE, text):
            return "it begins at a root or a drive"
        if "\\" in text:
            return "it holds a backslash"
        if re.search(_CONTROL, text):
            return "it holds a control character"
        if os.name == "nt" and any(re.search(_ON_WINDOWS, folder) for folder in folders):
            return "Windows keeps that name to itself"
    return ""


def _decoded(text: str) -> list[str]:
    """Return a text, and what it is after its percent signs are decoded, once and again."""
    found = [text]
    if "%" in text:
        from urllib.parse import unquote

        while len(found) <= _MOST_CODED and (plain := unquote(found[-1])) != found[-1]:
            found.append(plain)
    return found


def shortened(text: str, most: int) -> str:
    """Return a text of at most so many bytes: a longer one ends in eight digits of its SHA-256."""
    from hashlib import sha256

    data = os.fsencode(text)
    if len(data) <= most:
        return text
    digits = sha256(data).hexdigest()[:8]
    return f"{data[: most - 9].decode(errors='ignore')}-{digits}"
