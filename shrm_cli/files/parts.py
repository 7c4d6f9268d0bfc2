"""Files of images in any container format: their parts, with channels and attributes.

Each container format has a module in this folder; `vocabulary.CONTAINERS` names it by the suffix of
the files. The module writes a file with ``write(path, parts, pixel_type)``. It opens a file with
``open_file(path)``, which returns a `StoredFile`, or None if the file is of another format.
"""

import importlib
import math
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array, relative_rms, slices
from shrm_cli.errors import MapError, OutputError
from shrm_cli.files.whole import check_regular, note
from shrm_cli.progress import in_order
from shrm_cli.records import record
from shrm_cli.vocabulary import CONTAINERS, LARGEST_HALF, PixelType, Precision

_FLOAT_MAX = float(np.finfo(np.float32).max)
_HALF_OVERFLOW = LARGEST_HALF + 16  # values from here on round to infinity
HALF_ROUNDING = 2.0**-11
"""The most that half costs values which it has all its digits for, relative to them."""
_VALUES_AT_ONCE = 2**18
"""Values that are rounded at a time."""
LARGE = 2**20
"""The values of planes above which several threads are worth their start."""


@record(eq=False)
class Part:
    """One part of a file to write."""

    channels: dict[str, Array]
    """Channels by name."""
    header: dict[str, Any] = field(default_factory=dict)
    """Attributes by name: numbers, text or tuples of numbers. ``name`` is the name of the part,
    which every part of a file with several parts must have. ``envmap`` says that the image is a
    border-sampled environment map, and is its layout: ``"openexr"`` or ``"latlong"``."""
    is_table: bool = False
    """Whether it holds numbers of about 1 that images are multiplied with, which half always holds
    well enough, instead of an image."""


@record
class Storage:
    """How values are stored."""

    pixel_type: PixelType
    half_error: float
    """The relative RMS error that half makes, or would make; infinite where it would overflow."""

    @property
    def error(self) -> float:
        """The relative RMS error that storing makes, beyond ordinary rounding; else 0."""
        is_worth_telling = self.pixel_type == "half" and self.half_error > HALF_ROUNDING
        return self.half_error if is_worth_telling else 0.0


class StoredPart(ABC):
    """One part of an opened file."""

    path: str
    """Name of the file, for messages."""
    name: str
    """Name of the part; empty if it has none."""
    width: int
    height: int
    """`width` and `height`: pixels."""
    channel_names: tuple[str, ...]
    border_sampled: bool
    """Whether the file says that the pixels at the edge of the image lie on the poles, the seam or
    the cube's edges."""

    @abstractmethod
    def attribute(self, name: str) -> Any:
        """Return the value of an attribute, or None if the part has no such attribute."""

    @abstractmethod
    def holds(self, names: Sequence[str]) -> bool:
        """Return whether the part has exactly these channels, all half or 32-bit float."""

    @abstractmethod
    def read(self, names: Sequence[str]) -> Array:
        """Read the named channels as float32, shape (H, W, len(names)).

        Raises MapError if the file is damaged, or a value is not finite.
        """

    def text(self, name: str) -> str:
        """Return the value of a text attribute, or an empty string if there is none."""
        value = self.attribute(name)
        return value if isinstance(value, str) else ""


def sound_primaries(value: Any) -> tuple[float, ...] | None:
    """Return the primaries and white of an attribute, if it is eight finite numbers, or None."""
    if not isinstance(value, tuple) or len(value) != 8:
        return None
    is_sound = all(isinstance(each, float) and math.isfinite(each) for each in value)
    return value if is_sound else None


class StoredFile(ABC):
    """An opened file."""

    path: str
    part_count: int
    """The number of parts according to the beginning of the file. It is known before the parts
    themselves are read."""
    first: StoredPart
    """The first part."""

    @cached_property
    @abstractmethod
    def parts(self) -> tuple[StoredPart, ...]:
        """All parts, in the file's order."""


class WithoutLast(StoredFile):
    """A file as it would be without its last part."""

    def __init__(self, file: StoredFile) -> None:
        self.path, self.first = file.path, file.first
        self.part_count = file.part_count - 1
        self._parts = file.parts[:-1]

    @property
    def parts(self) -> tuple[StoredPart, ...]:
        return self._parts


def write_parts(
    path: str | os.PathLike[str], parts: Sequence[Part], precision: Precision = "auto"
) -> PixelType:
    """Write a file, whole or not at all, as its suffix says, and return the pixel type.

    The `precision` ``auto`` is half unless a value exceeds its range, or light is so dim that it
    loses digits.
    """
    storage, parts = prepared(path, parts, precision)
    write_chosen(path, parts, storage.pixel_type)
    return storage.pixel_type


def prepared(
    path: str | os.PathLike[str], parts: Sequence[Part], precision: Precision, allowed: float = 0.0
) -> tuple[Storage, list[Part]]:
    """Choose how to store parts, as `choose_storage` does, and round them where half is chosen.

    To round values takes about as long as all else here, so that it is done once. `allowed` is the
    relative RMS error that half may make; ordinary rounding, it always may.

    Returns `storage`; and `parts`, the parts to give to `write_chosen`.
    """
    images = [part for part in parts if not part.is_table]
    planes = [plane for part in images for plane in part.channels.values()]
    storage, halves = _examined(path, planes, precision, allowed)
    if storage.pixel_type == "float":
        return storage, list(parts)
    tables = [plane for part in parts if part.is_table for plane in part.channels.values()]
    halves += [plane.astype(np.float16) for plane in tables]
    # Tables come behind all images.
    parts = sorted(parts, key=lambda part: part.is_table)
    rounded = iter(halves)
    return storage, [
        replace(part, channels=dict(zip(part.channels, rounded, strict=False))) for part in parts
    ]


def write_chosen(
    path: str | os.PathLike[str], parts: Sequence[Part], pixel_type: PixelType
) -> None:
    """Write a file as `write_parts` does, of values that `choose_storage` has looked at already."""
    suffix = Path(path).suffix.lower()
    if suffix not in CONTAINERS:
        raise OutputError(f"{path}: what is written is {' or '.join(CONTAINERS)}; name it so")
    container = importlib.import_module(f"shrm_cli.files.{CONTAINERS[suffix]}")
    container.write(path, parts, pixel_type)


def choose_storage(
    path: str | os.PathLike[str], planes: Iterable[Array], precision: Precision
) -> Storage:
    """Choose how to store values, and tell what half costs them.

    The `precision` ``auto`` is half, but float where half would overflow, or make a larger error
    than ordinary rounding, `HALF_ROUNDING`: below 6e-5 it has fewer digits, and below 3e-8 none.
    """
    return _examined(path, list(planes), precision, 0.0)[0]


def _examined(
    path: str | os.PathLike[str], planes: Sequence[Array], precision: Precision, allowed: float
) -> tuple[Storage, list[Array]]:
    """Return what `choose_storage` does, and the planes in half precision if that is chosen."""
    largest = whole = lost = 0.0
    halves = []

    def measured(plane: Array) -> tuple[float, Array, float, float]:
        high = float(max(plane.max(), -plane.min())) if plane.size else 0.0
        fits = high < _HALF_OVERFLOW and precision != "float"
        return high, *(_rounded(plane) if fits else (plane, 0.0, 0.0))

    is_large = sum(plane.size for plane in planes) > LARGE
    for high, half, *squares in in_order(measured, planes, is_large):
        # A NaN fails this comparison, so it becomes the largest value, which is then refused.
        largest = largest if high <= largest else high
        if not largest <= _FLOAT_MAX:
            raise OutputError(f"{path}: a value is not finite in 32-bit float; dim the light")
        whole, lost = whole + squares[0], lost + squares[1]
        halves.append(half)
    overflows = largest >= _HALF_OVERFLOW
    if precision == "half" and overflows:
        raise OutputError(
            f"{path}: the value {largest:.6g} overflows half ({LARGEST_HALF:.0f}); use `precision` "
            "auto or float"
        )
    error = relative_rms(lost, whole)
    too_dim = precision == "auto" and error > max(allowed, HALF_ROUNDING)
    takes_float = precision == "float" or overflows or too_dim
    storage = Storage("float" if takes_float else "half", np.inf if overflows else error)
    return storage, [] if takes_float else halves


def _rounded(plane: Array) -> tuple[Array, float, float]:
    """Return values in half precision, and the sums of squares of them and of what that loses."""
    flat = plane.reshape(-1)
    half = np.empty(flat.shape, np.float16)
    whole = lost = 0.0
    for part in slices(flat.size, _VALUES_AT_ONCE):
        half[part] = flat[part]
        values = flat[part].astype(float)
        rest = values - half[part]
        whole, lost = whole + float(values @ values), lost + float(rest @ rest)
    return half.reshape(plane.shape), whole, lost


def open_file(path: str | os.PathLike[str]) -> StoredFile:
    """Open a file of parts."""
    check_regular(path, MapError, "a map")
    found = peek(path)
    note(path)
    if found is None:
        raise MapError(f"{path}: not an OpenEXR file, or a damaged one; shrm prefilter makes maps")
    return found


def peek(path: str | os.PathLike[str]) -> StoredFile | None:
    """Open a file of parts; return None if it is missing or of no known format.

    Raises MapError if it may not be read.
    """
    if not Path(path).is_file():
        return None
    if not os.access(path, os.R_OK):
        raise MapError(f"{path}: no permission to read it; change its mode")
    for name in CONTAINERS.values():
        module = importlib.import_module(f"shrm_cli.files.{name}")
        found: StoredFile | None = module.open_file(path)
        if found is not None:
            return found
    return None
