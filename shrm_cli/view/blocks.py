"""Arrays of numbers as bytes that a page holds or a server sends, in the formats of WebGL2."""

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import MapError

LARGEST_HALF = 65504.0
"""The largest finite number of 16 bits."""


@dataclass
class Blocks:
    """Blocks of bytes by their numbers.

    Attributes
    ----------
    parts : list of bytes
    remarks : list of str
        What was changed so that numbers fit, a line each.
    """

    parts: list[bytes] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, values: NDArray[Any]) -> int:
        """Keep an array's bytes, little-endian, and return the number of the block."""
        ordered = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        self.parts.append(ordered.tobytes())
        return len(self.parts) - 1

    def texture(self, values: ArrayLike, what: str, is_half: bool = True) -> dict[str, Any]:
        """Keep an RGB texture, and return how the page finds it.

        Parameters
        ----------
        values : array_like, shape (H, W, 3) or (layers, H, W, 3)
            Row 0 is uploaded first.
        what : str
            What messages call the texture.
        is_half : bool
            Whether 16 bits a number will do.

        Returns
        -------
        dict
            ``format``, ``width``, ``height``, ``depth`` (0 for a single picture) and ``block``.

        Raises
        ------
        MapError
            If a value is not a number.
        """
        found = np.asarray(values, dtype=np.float32)
        if np.isnan(found).any():
            raise MapError(f"{what}: it holds values that are not numbers; make it again")
        largest = LARGEST_HALF if is_half else float(np.finfo(np.float32).max)
        beyond = np.abs(found) > largest
        if beyond.any():
            texels = int(beyond.any(axis=-1).sum())
            self.remarks.append(
                f"{what}: {texels} texels beyond {largest:g} were clipped; dim the light before "
                "they are made"
            )
            found = np.clip(found, -largest, largest)
        depth = len(found) if found.ndim == 4 else 0
        return {
            "format": "rgb16f" if is_half else "rgb32f",
            "width": found.shape[-2],
            "height": found.shape[-3],
            "depth": depth,
            "block": self.add(found.astype(np.float16) if is_half else found),
        }

    def encoded(self) -> list[str]:
        """Return the blocks in base64."""
        return [base64.b64encode(part).decode("ascii") for part in self.parts]

    @property
    def encoded_bytes(self) -> int:
        """The bytes of all blocks in base64."""
        return sum(-(-len(part) // 3) * 4 for part in self.parts)
