"""Files ``.env`` of Babylon.js: prefiltered light as RGBD pictures, and its irradiance.

A mark of eight bytes is followed by JSON in ASCII, a zero byte, and the pictures: for each level
the six faces +X -X +Y -Y +Z -Z, from the largest level down to that of one texel.

References
----------
Babylon.js, ``Misc/environmentTextureTools``: ``GetEnvInfo``, ``CreateEnvTextureAsync``.
"""

import json
from collections.abc import Mapping, Sequence

_MARK = bytes([0x86, 0x16, 0x87, 0x96, 0xF6, 0xD6, 0x96, 0x36])
LOD_SCALE = 0.8
"""How many levels further twice the ggx_alpha lies: level k holds ``2^(k / 0.8) / size``."""


def env_file(
    levels: Sequence[Sequence[bytes]], irradiance: Mapping[str, Sequence[float]] | None
) -> bytes:
    """Return the bytes of a file.

    Parameters
    ----------
    levels : sequence of sequence of bytes
        PNG pictures of the six faces of each level, from `rgbd.rgbd_pictures`. The last has one
        texel, each other one twice as many along an edge as the next.
    irradiance : mapping of str to sequence of 3 float, optional
        RGB of the polynomials x, y, z, xx, yy, zz, yz, zx and xy. Without it Babylon.js makes its
        own from the pictures.
    """
    pictures = [picture for level in levels for picture in level]
    places, position = [], 0
    for picture in pictures:
        places.append({"length": len(picture), "position": position})
        position += len(picture)
    head: dict[str, object] = {
        "version": 2,
        "width": 2 ** (len(levels) - 1),
        "imageType": "image/png",
        "specular": {"mipmaps": places, "lodGenerationScale": LOD_SCALE},
    }
    if irradiance is not None:
        head["irradiance"] = {name: list(values) for name, values in irradiance.items()}
    return _MARK + json.dumps(head, allow_nan=False).encode("ascii") + b"\0" + b"".join(pictures)
