"""Tables of BRDFs that shaders have no code of, for lamps beside a map: they lie in its file.

A measured material is a file of its own, of megabytes, which neither shaders nor pages read. What
it reflects of a lamp is known from a table over half and difference angles, at the nodes that
`sample_table` takes. The file of the map holds it as its last part, as half-precision numbers.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.measured import table
from shrm_cli.brdf.vectors import from_half_angles
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.files.parts import Part, StoredPart
from shrm_cli.maps.lamps.models import has_code, refuse_unknown
from shrm_cli.maps.shader.language import Language, filled
from shrm_cli.maps.shader.source import Table as Texture

SHAPE = (128, 48, 32)
"""Nodes of theta_h, theta_d and phi_d. Four measured materials and three paints of a goniometer are
within .7 % to 4.7 % (RMS) of themselves, most of it at the horizon; (64, 24, 16) misses twice that.
The cosine, or more nodes of theta_d, gain nothing."""
TABLE_BYTES = 3 * 2 * math.prod(SHAPE)
"""The bytes of RGB in half precision, before they are packed."""
TABLE_EXACT = 1e-2
"""The part of the largest value for a view that sums over discs may miss, which is about as much as
tables miss. Steps of what is linear between nodes converge slowly."""
_EVERY = 1, 2, 1
"""Which cells tell how much a table misses. Most of it is near the horizon, at few phi_d."""
_NAME = "lobe"
_SCALE = "shrm:scale"
_LARGEST = 2.0**14
"""About the largest number that is stored: half precision holds as much, and nine digits less."""

_CELL = """\
    float x = l.x + v.x, y = l.y + v.y, z = l.z + v.z;
    float s = l.x - v.x, t = l.y - v.y, u = l.z - v.z;
    float across = sqrt(x * x + y * y), size = sqrt(x * x + y * y + z * z);
    float along = across > 0.0 ? z * (s * x + t * y) - across * across * u : s;
    float side = across > 0.0 ? (t * x - s * y) * size : t;
    float h = min(atan(across, z) / END, 1.0);
    float d = min(atan(sqrt(s * s + t * t + u * u), size) / QUARTER, 1.0);
    float p = abs(atan(side, abs(along) + abs(side) > 0.0 ? along : 1.0)) * TURNS;
    int i = int(min(sqrt(h) * ROWS, ROWS - 1.0));
    int j = int(min(shrm_asin(d) / QUARTER * RINGS, RINGS - 1.0));
    int k = int(min(p, LAST)), at = j * COLUMNS + k;
    float low = shrm_sin(QUARTER / RINGS * float(j));
    float f = (h * ROWS * ROWS - float(i * i)) / float(2 * i + 1);
    float g = (d - low) / (shrm_sin(QUARTER / RINGS * float(j + 1)) - low);"""
"""The cell of a table at half and difference angles, and where in it a light and a view are."""


class LobeTable(table.Table):
    """What a BRDF reflects of lamps, as shaders read it."""

    @classmethod
    def of(cls, brdf: Brdf) -> Self:
        """Sample a BRDF that is isotropic, and not about the tangent."""
        found = table.sample_table(brdf, SHAPE)
        axes = table.table_axes(SHAPE, cuts_horizon(brdf), brdf.center)
        return cls(found.table, axes, found.settings)

    @property
    def scale(self) -> float:
        """The power of two that the values are times in files and textures."""
        most = float(self.table.max())
        return 2.0 ** math.floor(math.log2(_LARGEST / most)) if most > 0 else 1.0

    @property
    def end(self) -> float:
        """The last angle theta_h, radians."""
        return float(self.axes[0][-1])

    def error(self, brdf: Brdf) -> float:
        """Return the RMS of what interpolation makes wrong of a BRDF, over that of the BRDF.

        Both are of the light that is reflected of a small lamp, uniformly over lights and views. It
        is told at a random place in every cell along theta_h, and every second one along the
        others, in which what is cut off by the horizon counts as the rest does.
        """
        random = np.random.default_rng(7)
        low = np.ix_(*(axis[:-1:step] for axis, step in zip(self.axes, _EVERY, strict=True)))
        wide = np.ix_(
            *(np.diff(axis)[::step] for axis, step in zip(self.axes, _EVERY, strict=True))
        )
        shape = np.broadcast_shapes(*(each.shape for each in low))
        theta_h, theta_d, phi_d = (
            start + random.random(shape) * width for start, width in zip(low, wide, strict=True)
        )
        # Solid angles of light and view, but for a factor.
        weights = np.sin(theta_h) * np.sin(2 * theta_d) * wide[0] * wide[1]
        light, view = from_half_angles(theta_h, theta_d, phi_d)
        if cuts_horizon(brdf):
            weights = weights * ((light[..., 2] > 0) & (view[..., 2] > 0))
        truth = brdf.transfer(light, view)
        wrong = self.transfer(light, view) - truth
        missed, whole = (
            float(np.einsum("hdp,hdpc->", weights, values**2)) for values in (wrong, truth)
        )
        return relative_rms(missed, whole)

    def texture(self) -> Texture:
        """Return it as shaders read it: a row for each theta_h, times the scale."""
        rows, *columns = self.table.shape[:3]
        shape = 1, rows, math.prod(columns)

        def make() -> Array:
            return np.broadcast_to(self.scale * self.table.reshape(*shape, -1), (*shape, 3))

        return Texture(shape, make, "what lamps' light is times, over half and difference angles")

    def part(self) -> Part:
        """Return it as a part of a map's file."""
        scaled = table.table_part(self, self.scale)
        header = {**scaled.header, "name": _NAME, _SCALE: self.scale}
        return replace(scaled, header=header, is_table=True)

    @classmethod
    def read(cls, part: StoredPart) -> Self:
        """Read what `part` wrote.

        Raises MapError if it is unsound, or is not over the nodes that the code of shaders knows.
        """
        scale = part.attribute(_SCALE)
        try:
            if not isinstance(scale, float) or not 2.0**-200 < scale < 2.0**200:
                raise ValueError("no scale")
            values, axes, settings = table.stored_table(part)
            found = cls(values / scale, axes, settings)
            known = table.table_axes(found.table.shape[:3], cuts_horizon(found), settings.center)
            if min(map(len, axes)) < 2 or settings.center == "tangent":
                raise ValueError("no lobe")
            if not all(np.allclose(*pair) for pair in zip(axes, known, strict=True)):
                raise ValueError("other nodes")
        except (BrdfError, ValueError):
            raise MapError(
                f"{part.path}: the table of what its lamps' BRDF reflects is wrong; make it again"
            ) from None
        return found

    def code(self, language: Language) -> list[str]:
        """Write the lines of a function of a light l and a view v that looks it up."""
        number, (rows, rings, columns) = language.number, self.table.shape[:3]
        words = {
            "END": number(self.end),
            "QUARTER": number(math.pi / 2),
            "TURNS": number((columns - 1) / math.pi),
            "ROWS": number(rows - 1),
            "RINGS": number(rings - 1),
            "LAST": number(columns - 2),
            "COLUMNS": str(columns),
        }
        cells = [
            f"shrm_of_lobe(at + {ring * columns + column}, i + {row}, 0)"
            for row in (0, 1)
            for ring in (0, 1)
            for column in (0, 1)
        ]
        for share in ("p - float(k)", "g", "f"):
            cells = [
                f"mix({low}, {high}, {share})"
                for low, high in zip(cells[::2], cells[1::2], strict=True)
            ]
        factor = "min(max(1e30 * v.z, 0.0), 1.0)"
        if not self.includes_cosine:
            factor += " * max(l.z, 0.0)"
        elif self.has_horizon:
            factor += " * min(max(1e30 * l.z, 0.0), 1.0)"
        else:
            factor = "1.0"
        value = language.scale(f"({number(1 / self.scale)} * {factor})", cells[0])
        return [*filled(_CELL, words), f"    return {value};"]


def table_bytes(brdf: Brdf | None) -> int:
    """Return the bytes that a map's file takes for what reflects its lamps."""
    return TABLE_BYTES if isinstance(brdf, LobeTable) else 0


def lobe_part(parts: Sequence[StoredPart]) -> StoredPart | None:
    """Return the part of a map's file that holds a table of its lamps' BRDF, if there is one."""
    last = parts[-1]
    return last if last.name == _NAME and last.attribute(table.ATTRIBUTE) is not None else None


def bytes_of_table(brdf: Brdf) -> int | None:
    """Return the bytes of the table by which shaders show what a BRDF reflects of lamps.

    It is 0 where there is code of it, and None where there is neither.
    """
    if has_code(brdf):
        return 0
    return TABLE_BYTES if brdf.isotropic and brdf.center != "tangent" else None


def check_has_code(brdf: Brdf) -> None:
    """Raise MapError if shaders show what a BRDF reflects of lamps neither by code nor a table."""
    if bytes_of_table(brdf) is None:
        refuse_unknown(brdf)
