"""Measured BRDFs. Each module of this package is one file format, and holds one `MeasuredBrdf`.

A format is known by being here: a new one is a new module, whose name is that of its class. What
formats have in common, and readers of containers that a format needs, are in ``reading``.
"""

import os
from abc import abstractmethod
from typing import ClassVar, Self, cast

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.library import load_class, module_names
from shrm_cli.brdf.measured.reading.file import check_file, first_bytes
from shrm_cli.errors import BrdfError
from shrm_cli.files.whole import note

_HEAD = 4096
_PAIRS_AT_ONCE = 2**14
"""Arrays of so many pairs of directions stay in the processor's cache."""


class MeasuredBrdf(Brdf):
    """A BRDF that interpolates the samples of a file."""

    reads: ClassVar[str]
    """What the format's files are, in one line."""
    suffixes: ClassVar[tuple[str, ...]]
    """What the names of its files usually end with, in lower case."""
    own_suffixes: ClassVar[tuple[str, ...]] = ()
    """Those suffixes that mean this format even if the content means none: the file is damaged
    then, and the format's error says how."""

    @staticmethod
    @abstractmethod
    def recognizes(head: bytes) -> bool:
        """Whether a file is of this format, by its first 4096 bytes.

        At most one format may recognize a file, so that their order does not matter.
        """

    @classmethod
    @abstractmethod
    def open(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file.

        Raises BrdfError if it cannot be read, is damaged, or is of another format.
        """

    def evaluate(self, light: Array, view: Array) -> Array:
        dtype = np.result_type(light, view, np.float32)
        above = (light[..., 2] > 0) & (view[..., 2] > 0)
        shape = above.shape
        lights, views = (
            [np.broadcast_to(v[..., k], shape).reshape(-1) for k in range(3)] for v in (light, view)
        )
        values = np.zeros((above.size, 3), dtype=dtype)
        found = np.flatnonzero(above)
        for some in slices(len(found), _PAIRS_AT_ONCE):
            part = found[some]
            # Kernels compute with whole components, so that each of them is gathered on its own.
            pair = (np.stack([x.take(part) for x in xyz]).astype(dtype) for xyz in (lights, views))
            values[part] = self.above(*(xyz.T for xyz in pair))
        return values.reshape(*shape, 3)

    def above(self, light: Array, view: Array) -> Array:
        """Values for directions above the horizon, (n, 3) each; below it they are 0.

        They may have any precision, and become that of the directions.
        """
        raise NotImplementedError

    def __repr__(self) -> str:
        return str(self.values["file"])


def formats() -> list[type[MeasuredBrdf]]:
    """The formats in the order of the alphabet; this loads the modules of all."""
    return [cast(type[MeasuredBrdf], load_class(__name__, name)) for name in module_names(__name__)]


def open_measured(path: str | os.PathLike[str]) -> Brdf:
    """The measured BRDF in a file, whose format its content tells.

    Raises BrdfError if it is missing, no regular file, of no known format, or damaged.
    """
    path = check_file(path)
    note(path)
    head = first_bytes(path, _HEAD)
    if not head:
        raise BrdfError(f"{path}: an empty file; copy it again")
    known = formats()
    suffix = path.suffix.lower()
    recognizing = [each for each in known if each.recognizes(head)]
    for each in recognizing or [each for each in known if suffix in each.own_suffixes]:
        return each.open(path)
    listed = "; ".join(each.reads for each in known)
    raise BrdfError(f"{path}: not a measured BRDF; known: {listed}")
