"""Light that is given by its harmonic coefficients: files of several programs, and their bases.

A file holds one light of (order + 1)^2 coefficients, RGB or grey:

``.txt``
    Numbers, one or three a line, whatever separates them. Comments begin with # or //. Filament's
    ``sh.txt`` is recognised by its comments.
``.npy``
    An array of shape (n, 3) or (n,). PIFu's ``env_sh.npy`` holds many lights, (lights, 9, 3), of
    which `part` chooses one by its number from 0.
``.json``
    A `LightProbe` of three.js, or a scene that holds some, as their ``toJSON`` writes them,
    coefficients by the name "radiance", as `shrm export --for json` writes them, or a list.
``.exr``
    An irradiance map of ours, which holds the light to its order.

Three.js and PIFu have the basis "real", ours: see `BASES`.
"""

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.npz import read_npy
from shrm_cli.probe.options import ColorReading, ReadOptions
from shrm_cli.probe.reader import check_file
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import degrees, degrees_and_orders, order_of, polynomial_factors

if TYPE_CHECKING:
    from shrm_cli.probe.light_sum import LightSum

SUFFIXES = (".txt", ".npy", ".json")
"""The suffixes of files of coefficients, besides irradiance maps."""
BASES = {
    "real": "orthonormal, without Condon-Shortley phase, index l(l+1)+m: 1, y, z, x, xy, ...",
    "condon-shortley": "the same with the factor (-1)^m",
    "filament": "factors of the polynomials 1, y, z, x, xy, yz, 3zz-1, xz, xx-yy that make E / pi",
}
"""What coefficients may be of, all in world axes whose polar axis is +Z."""
MOST_ORDER = 32
_MOST_BYTES = 2**24
_MOST_COEFFICIENT = 1e30
_LAMBERT = np.pi * np.array([1, 2 / 3, 1 / 4])
"""The factors of the clamped cosine, to degree 2 (eq. 4.11 of Ramamoorthi 2002)."""
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_COMMENT = re.compile(r"(?://|#).*")
_BETWEEN = re.compile(r"[\s,;()\[\]]*")
_FILAMENT = "pre-scaled base"
"""What Filament's tools write behind every coefficient."""

_FOR_ENGINES = {
    "coefficients in the axes of an engine": {"meaning", "axes", "red", "green", "blue"},
    "lamps beside a map": {"about", "lamps"},
    "grid of probes": {"type", "version", "min", "max", "resolution", "coefficients"},
}
"""The keys of JSON that `shrm export` and `shrm grid` write, and that holds no light of ours."""


@record(eq=False)
class Series:
    """The coefficients of a light."""

    coefficients: Array
    """Radiance over the real harmonics of world axes, index l(l+1)+m, shape ((order+1)^2, 3)."""
    chromaticities: tuple[float, ...] | None = None
    """Their primaries, where the file tells them."""
    notes: tuple[str, ...] = ()
    """What a user should know, a line each."""


def holds_series(name: str) -> bool:
    """Whether a file is one of coefficients, by its suffix or as an irradiance map says it."""
    suffix = Path(name).suffix.lower()
    return suffix in SUFFIXES or (suffix == ".exr" and _irradiance_part(name) is not None)


def read_series(
    name: str, basis: str | None = None, of: str = "radiance", part: str | None = None
) -> Series:
    """Read the coefficients of a file.

    `basis` is one of `BASES`; by default what the file says, or "real". `of` is what the numbers
    are coefficients of; irradiance has degrees up to 2. `part` is the number of a light among
    several.
    """
    path, suffix = check_file(name), Path(name).suffix.lower()
    if suffix == ".exr":
        if basis is not None or of != "radiance":
            raise ProbeError(f"{name}: a map of ours says what its coefficients are; leave it out")
        return _of_map(name)
    if path.stat().st_size > _MOST_BYTES:
        raise ProbeError(f"{name}: more than {_MOST_BYTES:,} bytes are no coefficients of a light")
    content = path.read_bytes()
    notes: tuple[str, ...] = ()
    try:
        if suffix == ".npy":
            values = _chosen(read_npy(content), part)
        elif part is not None:
            raise ValueError("it holds one light; leave `part` out")
        elif suffix == ".json":
            values, notes = _of_json(parse_json(content.decode()))
        else:
            text = content.decode()
            basis = basis or ("filament" if _FILAMENT in text else None)
            values = _of_text(text)
        return Series(as_radiance(values, basis or "real", of), notes=notes)
    except UnicodeDecodeError:
        raise ProbeError(
            f"{name}: no text, so that it holds no coefficients; give an image the suffix of its "
            "format"
        ) from None
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        said = str(error) if isinstance(error, ValueError) else "no coefficients"
        raise ProbeError(f"{name}: {' '.join(said.split())[:200]}") from None


def as_radiance(values: Any, basis: str = "real", of: str = "radiance") -> Array:
    """Return coefficients of radiance in our basis, shape (n, 3).

    `values` are of shape (n, 3), (n, 1) or (n,), or flat, with n = 1, 4, 9, 16, ...

    Raises ValueError if they are something else.
    """
    found = _rows(_numbers(values))
    degree, m = degrees_and_orders(order_of(len(found)))
    if basis not in BASES:
        raise ValueError(f"{basis!r:.40} is no basis; name one of {', '.join(BASES)}")
    if of not in ("radiance", "irradiance"):
        raise ValueError(f"{of!r:.40} is neither radiance nor irradiance")
    if (of == "irradiance" or basis == "filament") and len(found) > len(degrees(2)):
        raise ValueError("irradiance above degree 2 does not tell its light; give 9 coefficients")
    if basis == "condon-shortley":
        found = found * np.where(m % 2, -1.0, 1.0)[:, None]
    if basis == "filament":
        found = np.pi * found / polynomial_factors()[: len(found), None]
    if of == "irradiance" or basis == "filament":
        found = found / _LAMBERT[degree][:, None]
    return found


def sum_of(lights: Sequence[Array]) -> Array | None:
    """Return the sum of lights of any orders, shape (n, 3); None of no light."""
    if not lights:
        return None
    total = np.zeros((max(len(each) for each in lights), 3))
    for each in lights:
        total[: len(each)] += each
    return total


def open_series(name: str, options: ReadOptions) -> "LightSum":
    """Open a file of coefficients as a probe."""
    from shrm_cli.probe.light_sum import LightSum, SumImage

    _check_options(name, options)
    found = read_series(name, part=options.part_name())
    colors = ColorReading.of(found.chromaticities, options)
    values = found.coefficients
    if colors.matrix is not None:
        values = values @ colors.matrix.T
    path = Path(name)
    image = SumImage(
        name, path, path.read_bytes(), (), (), (*found.notes, *colors.notes), values, "coefficients"
    )
    return LightSum.of(image, options.matrix(), colors.chromaticities, colors.record)


def _check_options(name: str, options: ReadOptions) -> None:
    """Refuse options that say nothing about coefficients."""
    plain = ReadOptions()
    for each in ("layout", "orientation", "sampling", "linearize", "layer", "pixels"):
        if getattr(options, each) != getattr(plain, each):
            said = "`clamp` and `fix_nonfinite` say" if each == "pixels" else f"`{each}` says"
            raise ProbeError(f"{name}: {said} nothing about coefficients; leave it out")


def _numbers(values: Any) -> Array:
    try:
        return np.asarray(values)
    except ValueError:
        raise ValueError("rows of different lengths; give three numbers a row, or one") from None


def _rows(values: Array) -> Array:
    """Numbers as rows of three."""
    if values.dtype.kind not in "fiu" or not np.isfinite(values).all():
        raise ValueError("not finite numbers alone; correct them")
    if values.size and np.abs(values).max() > _MOST_COEFFICIENT:
        raise ValueError(f"a coefficient is larger than {_MOST_COEFFICIENT:g}")
    values = values.astype(float)
    if values.ndim == 2 and values.shape[1] not in (1, 3):
        raise ValueError(f"an array of shape {values.shape}; give (n, 3) or (n,)")
    third, rest = divmod(values.size, 3)
    if not rest and _is_count(third) and values.shape != (values.size, 1):
        return values.reshape(third, 3)
    if _is_count(values.size) and not (values.ndim == 2 and values.shape[1] == 3):
        return np.repeat(values.reshape(-1, 1), 3, axis=1)
    raise ValueError(
        f"{values.size:,} numbers; give 1, 4, 9, 16, ... coefficients up to order {MOST_ORDER}, "
        "one or three numbers each"
    )


def _is_count(count: int) -> bool:
    return 0 < count <= (MOST_ORDER + 1) ** 2 and math.isqrt(count) ** 2 == count


def _chosen(values: Array, part: str | None) -> Array:
    """One light of an array of several."""
    if values.ndim != 3:
        if part is not None:
            raise ValueError("it holds one light; leave `part` out")
        return values
    count = len(values)
    if part is None and count == 1:
        return np.asarray(values[0])
    if part is None or not part.isdecimal() or int(part[:9]) >= count:
        raise ValueError(f"it holds {count:,} lights; choose one by `part`, 0 .. {count - 1}")
    return np.asarray(values[int(part)])


def _of_text(text: str) -> Array:
    numbers: list[float] = []
    for line in _COMMENT.sub("", text).splitlines():
        found = _NUMBER.findall(line)
        rest = _BETWEEN.sub("", _NUMBER.sub("", line))
        if rest:
            raise ValueError(f"{rest[:40]!r} is no number; give numbers and comments alone")
        numbers += map(float, found)
    return np.array(numbers)


def _of_json(tree: Any) -> tuple[Array, tuple[str, ...]]:
    """Coefficients of a list, of ours by their name, or of LightProbes of three.js; and notes."""
    if isinstance(tree, list):
        return _numbers(tree), ()
    if not isinstance(tree, Mapping):
        raise ValueError("no list of coefficients")
    if "radiance" in tree:
        return _numbers(tree["radiance"]), ()
    found = _visible(tree.get("object", tree))
    probes = [each for each in found if "sh" in each]
    if not probes and (kind := for_engines(tree)) is not None:
        raise ValueError(f"{kind}, for engines; name the probe or the map that it was made of")
    if not probes:
        raise ValueError('neither "radiance" nor the "sh" of a LightProbe is in it')
    total = np.zeros((9, 3))
    for each in probes:  # three.js adds them up, and turns none
        if len(each["sh"]) != 27:
            raise ValueError(f"the sh of a LightProbe has 27 numbers, not {len(each['sh'])}")
        total += _rows(_numbers(each["sh"])) * float(each.get("intensity", 1.0))
    kinds = {str(each.get("type")) for each in found}
    others = ", ".join(sorted(kind[:40] for kind in kinds if kind.endswith("Light")))
    return total, ((f"its LightProbes alone are its light, without {others}",) if others else ())


def for_engines(tree: Any) -> str | None:
    """Return what JSON for engines is, by the keys that we write; None of everything else."""
    kinds = (kind for kind, keys in _FOR_ENGINES.items() if keys <= tree.keys())
    return next(kinds, None) if isinstance(tree, Mapping) else None


def _visible(found: Any) -> list[Mapping[str, Any]]:
    """Return an object of three.js, and all that is below it, without what it does not show."""
    seen, waiting = [], [found]
    while waiting:
        each = waiting.pop()
        if isinstance(each, Mapping) and each.get("visible", True):
            seen.append(each)
            children = each.get("children", [])
            waiting += children if isinstance(children, list) else []
    return seen


def _irradiance_part(name: str) -> Any:
    """The part of an irradiance map of ours; None for any other file."""
    from shrm_cli.files.exr import open_file
    from shrm_cli.files.exr_header import says_map

    if not os.path.isfile(name) or not says_map(name):
        return None
    file = open_file(name)
    if file is None or file.first.attribute("shrm:representation") != "irradiance":
        return None
    return file.first


def _of_map(name: str) -> Series:
    part = _irradiance_part(name)
    try:
        values = as_radiance(np.array(parse_json(part.attribute("shrm:lighting_coefficients"))))
    except (ValueError, TypeError, OverflowError):
        raise ProbeError(
            f"{name}: its shrm:lighting_coefficients are wrong; make it again"
        ) from None
    order = order_of(len(values))
    notes = [f"an irradiance map: what is left of its light has degrees up to {order}"]
    try:
        window = parse_json(part.attribute("shrm:window"))["name"]
    except (ValueError, TypeError, KeyError):
        window = "none"
    if window != "none":
        notes.append(f"its light is windowed ({window!s:.20}); --window none leaves it as it is")
    colors = part.attribute("chromaticities")
    known = None if colors is None else tuple(float(each) for each in colors)
    return Series(values, known, tuple(notes))
