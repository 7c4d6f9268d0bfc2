"""What is left of the names of probes and BRDFs in the names of the files that are made of them."""

import os
from pathlib import Path

_LONGEST_STEM, _LONGEST_LABEL = 100, 80
"""The most bytes of a probe's and of a BRDF's part of a default name.

File systems take names of 255 bytes, and names of pictures and conversions are longer ones yet.
"""


def probe_stem(probe: str) -> str:
    """Return what the names of a probe's outputs begin with, without the ``%`` of six files."""
    stem = Path(probe).stem.replace("%", "").rstrip("_-.") or "probe"
    return shortened(stem, _LONGEST_STEM)


def brdf_label(spec: str) -> str:
    """Return a BRDF's specification as a part of a file's name; sums may be long, and are cut."""
    from shrm_cli.brdf.spec import file_label

    return shortened(file_label(spec), _LONGEST_LABEL)


def shortened(text: str, most: int) -> str:
    """Return a text of at most so many bytes: a longer one ends in eight digits of its SHA-256.

    So texts that begin alike are told apart.
    """
    from hashlib import sha256

    data = os.fsencode(text)
    if len(data) <= most:
        return text
    digits = sha256(data).hexdigest()[:8]
    return f"{data[: most - 9].decode(errors='ignore')}-{digits}"
