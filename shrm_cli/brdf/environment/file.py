"""The environment-BRDF tables of split sums and SH exponentials -> a file."""

import os
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.files.exr import Part, write_parts

Array = NDArray[np.floating]
Kind = Literal["scale-bias", "multiscatter", "moments"]


@dataclass(frozen=True)
class Meaning:
    """What a kind of table holds, as its attributes say it.

    Attributes
    ----------
    names : tuple of str
        Of the channels.
    channels : str
        What they are.
    reflectance : str
        What a surface reflects of a uniform environment of radiance 1.
    mean : str, optional
        The mean direction of what it reflects there.
    """

    names: tuple[str, ...]
    channels: str
    reflectance: str
    mean: str = ""


MEANINGS: dict[Kind, Meaning] = {
    "scale-bias": Meaning(("R", "G"), "R = scale, G = bias", "f0 * R + G"),
    "multiscatter": Meaning(
        ("R", "G"), "R = bias, G = scale + bias", "mix(R, G, f0) * (1 + f0 * (1 / G - 1))"
    ),
    "moments": Meaning(
        tuple(f"{kind}.{moment}" for kind in ("base", "tail") for moment in "ENT"),
        "E, N, T = integrals of 1, N.L, T.L over the lobe; base = without Fresnel's term, "
        "tail = with (1 - V.H)^5; T = normalize((N.V) N - V)",
        "mix(tail.E, base.E, f0)",
        "(mix(tail.N, base.N, f0) * N + mix(tail.T, base.T, f0) * T) / mix(tail.E, base.E, f0)",
    ),
}


def write_dfg(
    path: str | os.PathLike[str], table: Array, kind: Kind, precision: str = "auto"
) -> str:
    """Write a table of `environment_table` or `moments_table`, whole or not at all.

    It carries ``shrm:table``, and what its axes and channels are; it is no map. Where there are
    only R and G, B is 0, for readers that expect three channels.

    Parameters
    ----------
    path : path-like
    table : ndarray, shape (N, N, 2), or (N, N, 6) of moments
    kind : {"scale-bias", "multiscatter", "moments"}
        Which table it is.
    precision : {"auto", "half", "float"}

    Returns
    -------
    str
        The pixel type written, ``"half"`` or ``"float"``.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    meaning = MEANINGS[kind]
    header = {
        "shrm:table": "dfg",
        "shrm:brdf": "ggx",
        "shrm:multiscatter": int(kind == "multiscatter"),
        "shrm:moments": int(kind == "moments"),
        "shrm:axes": "x = N.V, y = perceptual roughness, 0 at the top; texel centres",
        "shrm:channels": meaning.channels,
        "shrm:reflectance": meaning.reflectance,
    }
    if meaning.mean:
        header["shrm:mean_direction"] = meaning.mean
    planes = {name: table[..., k] for k, name in enumerate(meaning.names)}
    if "R" in planes:
        planes["B"] = np.zeros(table.shape[:2])
    return write_parts(path, [Part(planes, header)], precision)
