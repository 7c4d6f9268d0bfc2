"""Files ``.env`` of Babylon.js: prefiltered light as RGBD pictures, and its irradiance.

A mark of eight bytes is followed by JSON in ASCII, a zero byte, and the pictures: for each level
the six faces +X -X +Y -Y +Z -Z, from the largest level down to that of one texel.

References
----------
Babylon.js, ``Misc/environmentTextureTools``: ``GetEnvInfo``, ``CreateEnvTextureAsync``.
"""

import json
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.export.rgbd import encode_rgbd, rgba_png

Array = NDArray[np.floating]

_MARK = bytes([0x86, 0x16, 0x87, 0x96, 0xF6, 0xD6, 0x96, 0x36])
LOD_SCALE = 0.8
"""How many levels further twice the ggx_alpha lies: level k holds ``2^(k / 0.8) / size``."""


def env_file(levels: Sequence[Array], irradiance: Mapping[str, Sequence[float]]) -> bytes:
    """Return the bytes of a file.

    Parameters
    ----------
    levels : sequence of ndarray, shape (6, N, N, 3)
        Radiance within 0 .. 255, each level half as wide as the one before, down to N = 1.
    irradiance : mapping of str to sequence of 3 float
        RGB of the polynomials x, y, z, xx, yy, zz, yz, zx and xy.

    Raises
    ------
    ValueError
        If the levels are no such chain, or a value does not fit.
    """
    sizes = [level.shape[1] for level in levels]
    if sizes != [2**k for k in reversed(range(len(sizes)))]:
        raise ValueError(f"levels of {sizes} texels do not halve down to 1")
    pictures = [rgba_png(encode_rgbd(face)) for level in levels for face in level]
    places, position = [], 0
    for picture in pictures:
        places.append({"length": len(picture), "position": position})
        position += len(picture)
    head = {
        "version": 2,
        "width": sizes[0],
        "imageType": "image/png",
        "irradiance": {name: list(values) for name, values in irradiance.items()},
        "specular": {"mipmaps": places, "lodGenerationScale": LOD_SCALE},
    }
    return _MARK + json.dumps(head, allow_nan=False).encode("ascii") + b"\0" + b"".join(pictures)
