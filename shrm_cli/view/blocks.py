"""Arrays of numbers as deflated bytes that a page holds or a server sends.

Bytes of the same place in each number stand together, which deflates better; the page puts them
back into the formats of WebGL2.

Textures may be small integers times a power of two for each texel, which deflate makes smaller. A
texel's numbers are rounded to a share of their length, so that shadows keep as much as lamps do.
The coefficients of a map of harmonics at a texel have one length, because what is seen there is
their sum: high degrees, most of which are weak, become zeros.
"""

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import MapError
from shrm_cli.records import record
from shrm_cli.vocabulary import LARGEST_HALF

_BITS = {True: 9, False: 8}
"""Of the length of a texel, which is between 2^(bits - 1) and 2^bits steps; more bits where that is
the length of many layers."""
_LOWEST = -30
"""Exponent of the darkest texels; 16-bit floats end at 2^-24."""


@dataclass
class Blocks:
    """Blocks of bytes by their numbers."""

    is_rounded: bool = False
    """Whether textures of half precision are rounded, so that a page is small."""
    parts: list[bytes] = field(default_factory=list)
    """Deflated (zlib)."""
    widths: list[int] = field(default_factory=list)
    """The bytes of a number of each."""
    rounding_error: float = 0.0
    """The largest RMS error of a rounded texture, relative."""
    remarks: list[str] = field(default_factory=list)
    """What was changed so that numbers fit, a line each."""

    def add(self, values: NDArray[Any]) -> int:
        """Keep an array's bytes, little-endian, and return the number of the block."""
        ordered = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        width = ordered.itemsize
        planes = np.frombuffer(ordered.tobytes(), np.uint8).reshape(-1, width).T
        self.parts.append(zlib.compress(planes.tobytes()))
        self.widths.append(width)
        return len(self.parts) - 1

    def texture(
        self,
        values: ArrayLike,
        what: str,
        is_half: bool = True,
        series: bool = False,
        is_lit: bool = True,
    ) -> dict[str, Any]:
        """Keep an RGB texture, and return how the page finds it.

        `values` are of shape (H, W, 3) or (layers, H, W, 3); row 0 is uploaded first. `is_half`
        tells whether 16 bits a number will do, and `series` whether what is seen at a texel is a
        sum over all layers, not each by itself. `is_lit` tells whether texels hold light; those of
        product textures, whose large terms cancel where their sum with the light is dark, are not
        rounded: scratches covered what is darker than a sun, and deflate gained little.

        Returns ``format``, ``width``, ``height``, ``depth`` (0 for a single picture), ``block``,
        and of a rounded one the block of ``exponents`` and its RMS ``error``.
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
        if not (is_half and self.is_rounded and is_lit):
            return {**described, "block": self.add(found.astype(np.float16) if is_half else found)}
        made = rounded(found.reshape(-1, *found.shape[-3:]), series)
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


@record(eq=False)
class Rounded:
    """A texture in integers."""

    steps: NDArray[np.uint16]
    """Whole numbers of steps; 0, -1, 1, -2, .. are counted as 0, 1, 2, 3, ., shape (3, layers, H,
    W)."""
    exponents: NDArray[np.int8]
    """The step of a texel is ``2^exponent``, shape (1 or layers, H, W)."""
    error: float
    """RMS of what rounding changed, each texel relative to its length."""


def rounded(values: NDArray[np.float32], series: bool) -> Rounded:
    """Round a texture, shape (layers, H, W, 3).

    `values` are finite, and no larger than 16-bit floats are. `series` tells whether all layers
    have one length at a texel; else each has its own.
    """
    runs = values.reshape(1 if series else len(values), -1, *values.shape[1:])
    length = np.sqrt(np.einsum("slhwc,slhwc->shw", runs, runs, dtype=float))
    exponents = np.full(length.shape, _LOWEST)
    lit = length > 2.0**_LOWEST
    exponents[lit] = np.ceil(np.log2(length[lit]))
    exponents -= _BITS[series]
    step = np.exp2(exponents)[:, None, ..., None]
    whole = np.rint(runs / step)
    apart = np.einsum("slhwc->shw", (whole * step - runs) ** 2)
    relative = apart[lit] / length[lit] ** 2
    error = float(np.sqrt(relative.mean())) if lit.any() else 0.0
    signed = whole.astype(np.int16).reshape(values.shape)
    steps = ((signed << 1) ^ (signed >> 15)).astype(np.uint16)
    return Rounded(np.moveaxis(steps, -1, 0), exponents.astype(np.int8), error)
