"""Files of the environment-BRDF tables that split sums and SH exponentials are used with."""

import os
from typing import Any, Literal

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.files.parts import Part, StoredPart, peek, write_parts
from shrm_cli.records import record
from shrm_cli.vocabulary import MAX_CUBE_SIZE, Precision

Kind = Literal[
    "scale-bias",
    "multiscatter",
    "moments",
    "fdez-aguera",
    "turquin",
    "gltf",
    "filament",
    "albedo",
    "brushed",
]


_AGAIN = "make it again with shrm dfg"
_TOLD_BY_FLAGS = "scale-bias", "multiscatter", "moments"
"""The kinds of tables that attributes of their own tell apart."""
_MOMENTS = 2
"""The value of ``shrm:moments`` of tables of moments. In those of 1, T was normalized."""


@record
class Meaning:
    """The texts that say in a file's attributes what a kind of table holds."""

    names: tuple[str, ...]
    """The names of the channels."""
    channels: str
    """What the channels hold."""
    reflectance: str
    """The formula of what a surface reflects of a uniform environment of radiance 1."""
    mean: str = ""
    """The formula of the mean direction that this reflected light comes from."""


MEANINGS: dict[Kind, Meaning] = {
    "scale-bias": Meaning(("R", "G"), "R = scale, G = bias", "f0 * R + G"),
    "multiscatter": Meaning(
        ("R", "G"), "R = bias, G = scale + bias", "mix(R, G, f0) * (1 + f0 * (1 / G - 1))"
    ),
    "moments": Meaning(
        tuple(f"{kind}.{moment}" for kind in ("base", "tail") for moment in "ENT"),
        "E, N, T = integrals of 1, N.L, T.L / T.T over the lobe; base = without Fresnel's term, "
        "tail = with (1 - V.H)^5; T = (N.V) N - V, which is not normalized",
        "mix(tail.E, base.E, f0)",
        "(mix(tail.N, base.N, f0) * N + mix(tail.T, base.T, f0) * T) / mix(tail.E, base.E, f0)",
    ),
    "fdez-aguera": Meaning(
        ("R", "G", "B"),
        "R = scale, G = bias, B = 1 - scale - bias",
        "(f0 * R + G) * (1 + F * B / (1 - F * B)) with F = f0 + (1 - f0) / 21",
    ),
    "turquin": Meaning(
        ("R", "G", "B"),
        "R = scale, G = bias, B = (1 - E) / E with E = scale + bias",
        "(f0 * R + G) * (1 + f0 * B)",
    ),
    "gltf": Meaning(
        ("R", "G", "B"),
        "R = scale, G = bias, B = albedo of charlie:visibility=neubelt",
        "f0 * R + G; cloth: color * B",
    ),
    "filament": Meaning(
        ("R", "G", "B"),
        "R = bias, G = scale + bias, B = albedo of charlie:visibility=neubelt",
        "mix(R, G, f0) * (1 + f0 * (1 / G - 1)); cloth: color * B",
    ),
    "albedo": Meaning(
        ("R", "G", "B"),
        "directional albedo",
        "(R, G, B), and lets max(0, 1 - max(R, G, B)) through to what lies below",
    ),
    "brushed": Meaning(
        tuple(f"{kind}.{part}" for kind in ("along", "between", "across") for part in "RG"),
        "R = scale, G = bias; along, between, across = views in the plane of the tangent, which "
        "runs across the brush marks, at 45 degrees and at 90 degrees to it",
        "f0 * R + G, where R and G are across * w * (w - 1) / 2 + between * (1 - w * w) + along * "
        "w * (w + 1) / 2 with w = cos(2 phi) of the view's azimuth phi from the tangent",
    ),
}


def write_dfg(
    path: str | os.PathLike[str],
    table: Array,
    kind: Kind,
    precision: Precision = "auto",
    brdf: str = "ggx",
) -> str:
    """Write a table of `environment_table` or `moments_table`, whole; return the pixel type.

    The file is an image with the attribute ``shrm:table`` and others that say what its axes and
    channels are; it is not a map. A table of the channels R and G gets a channel B of zeros, for
    readers that expect three channels.

    `table`, of shape (N, N, channels), is indexed [perceptual roughness, N.V, channel]; the
    channels are those of its `MEANINGS`. `kind` says which table it is, one of `MEANINGS`.
    """
    meaning = MEANINGS[kind]
    header = {
        "shrm:table": "dfg",
        "shrm:brdf": brdf,
        "shrm:multiscatter": int(kind == "multiscatter"),
        "shrm:moments": _MOMENTS if kind == "moments" else 0,
        "shrm:axes": "x = N.V, y = perceptual roughness, 0 at the top; texel centres",
        "shrm:channels": meaning.channels,
        "shrm:reflectance": meaning.reflectance,
    }
    if kind not in _TOLD_BY_FLAGS:
        header["shrm:columns"] = kind
    if meaning.mean:
        header["shrm:mean_direction"] = meaning.mean
    planes = {name: table[..., k] for k, name in enumerate(meaning.names)}
    if meaning.names == ("R", "G"):
        planes["B"] = np.zeros(table.shape[:2])
    return write_parts(path, [Part(planes, header)], precision)


def read_table_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what a file of `write_dfg` says about its table, once its numbers were read.

    Returns the items ``width``, ``height``, ``multiscatter``, ``moments``, ``channels`` and
    ``reflectance``, for moments ``mean_direction``, and ``columns`` and ``brdf`` where these are
    others. None if the file is anything else.
    """
    found = peek(path)
    if found is None or found.first.text("shrm:table") != "dfg":
        return None
    part = found.first
    multiscatter, moments = _flag(part, "shrm:multiscatter"), _flag(part, "shrm:moments")
    kind = part.text("shrm:columns")
    if kind and kind not in MEANINGS:
        raise BrdfError(f"{part.path}: its attribute shrm:columns is wrong; {_AGAIN}")
    flagged: Kind = "moments" if moments else "multiscatter" if multiscatter else "scale-bias"
    meaning = MEANINGS[kind or flagged]
    _check_numbers(part, meaning)
    facts = {
        "width": part.width,
        "height": part.height,
        "multiscatter": multiscatter,
        "moments": moments,
        "channels": meaning.channels,
        "reflectance": meaning.reflectance,
    }
    if kind:
        facts |= {"columns": kind, "brdf": part.text("shrm:brdf")}
    return {**facts, "mean_direction": meaning.mean} if moments else facts


def _flag(part: StoredPart, name: str) -> bool:
    """Read an attribute that is a number other than 0 where something is so."""
    value = part.attribute(name)
    if value is not None and type(value) is not int:
        raise BrdfError(f"{part.path}: its attribute {name} is wrong; {_AGAIN}")
    return bool(value)


def _check_numbers(part: StoredPart, meaning: Meaning) -> None:
    """Refuse a table whose numbers are not all there."""
    names = sorted({*meaning.names, "B"} if "R" in meaning.names else meaning.names)
    if not part.holds(names) or max(part.width, part.height) > MAX_CUBE_SIZE:
        raise BrdfError(f"{part.path}: its channels are not those of such a table; {_AGAIN}")
    try:
        part.read(names)
    except MapError:
        raise BrdfError(f"{part.path}: damaged or truncated; {_AGAIN}") from None
