"""Arrays of numbers as deflated bytes that a page holds or a server sends.

Bytes of the same place in each number stand together, which deflates better; the page puts them
back into the formats of WebGL2.
"""

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import MapError
from shrm_cli.view.rounded import rounded

LARGEST_HALF = 65504.0
"""The largest finite number of 16 bits."""


@dataclass
class Blocks:
    """Blocks of bytes by their numbers.

    Attributes
    ----------
    is_rounded : bool
        Whether textures of half precision are rounded, so that a page is small.
    parts : list of bytes
        Deflated (zlib).
    widths : list of int
        The bytes of a number of each.
    rounding_error : float
        The largest RMS error of a rounded texture, relative.
    remarks : list of str
        What was changed so that numbers fit, a line each.
    """

    is_rounded: bool = False
    parts: list[bytes] = field(default_factory=list)
    widths: list[int] = field(default_factory=list)
    rounding_error: float = 0.0
    remarks: list[str] = field(default_factory=list)

    def add(self, values: NDArray[Any]) -> int:
        """Keep an array's bytes, little-endian, and return the number of the block."""
        ordered = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        width = ordered.itemsize
        planes = np.frombuffer(ordered.tobytes(), np.uint8).reshape(-1, width).T
        self.parts.append(zlib.compress(planes.tobytes()))
        self.widths.append(width)
        return len(self.parts) - 1

    def texture(
        self, values: ArrayLike, what: str, is_half: bool = True, shared: bool = False
    ) -> dict[str, Any]:
        """Keep an RGB texture, and return how the page finds it.

        Parameters
        ----------
        values : array_like, shape (H, W, 3) or (layers, H, W, 3)
            Row 0 is uploaded first.
        what : str
            What messages call the texture.
        is_half : bool
            Whether 16 bits a number will do.
        shared : bool
            Whether what is seen at a texel is a sum over its layers.

        Returns
        -------
        dict
            ``format``, ``width``, ``height``, ``depth`` (0 for a single picture), ``block``, and
            of a rounded one the block of ``exponents`` and its RMS ``error``.

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
        described = {
            "format": "rgb16f" if is_half else "rgb32f",
            "width": found.shape[-2],
            "height": found.shape[-3],
            "depth": depth,
        }
        if not (is_half and self.is_rounded):
            return {**described, "block": self.add(found.astype(np.float16) if is_half else found)}
        made = rounded(found.reshape(-1, *found.shape[-3:]), shared)
        self.rounding_error = max(self.rounding_error, made.error)
        steps, exponents = self.add(made.steps), self.add(made.exponents)
        return {**described, "block": steps, "exponents": exponents, "error": made.error}

    def encoded(self) -> list[str]:
        """Return the blocks in base64."""
        return [base64.b64encode(part).decode("ascii") for part in self.parts]

    @property
    def encoded_bytes(self) -> int:
        """The bytes of all blocks, deflated, in base64."""
        return sum(-(-len(part) // 3) * 4 for part in self.parts)
