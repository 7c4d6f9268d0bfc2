"""Spherical harmonic exponentials <-> the one part of their files."""

import os
from typing import Any, get_args

from shrm_cli.errors import MapError
from shrm_cli.files.exr import Part, has_channels, read_channels
from shrm_cli.maps.attributes import common_header, map_info, read_attributes, shortest
from shrm_cli.maps.names import COLOURS
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
from shrm_cli.vocabulary import MAX_EXPONENTIAL_ORDER, Law


def encode(exponential: SphericalHarmonicExponential) -> list[Part]:
    """One row of pixels: the (P+1)^2 coefficients of P, then those of Q without its constant.

    ``shrm:ggx_alpha`` is the range of the fit, ``shrm:law`` what attenuates the degrees; see
    `shrm_cli.maps.she.exponential`.
    """
    header = {
        **common_header(exponential, 0),
        "shrm:p_order": exponential.order_p,
        "shrm:q_order": exponential.order_q,
        "shrm:ggx_alpha": tuple(map(float, exponential.ggx_alpha)),
        "shrm:law": exponential.law,
    }
    row = exponential.coefficients
    return [Part({c: row[None, :, k] for k, c in enumerate(COLOURS)}, header)]


def decode(
    path: str | os.PathLike[str], source: Any, specs: list[Any]
) -> SphericalHarmonicExponential:
    """The map that a file holds.

    Parameters
    ----------
    path : path-like
    source, specs
        The open file, and the specifications of its parts.

    Raises
    ------
    MapError
        If it is not what `encode` makes.
    """
    spec, attributes = specs[0], read_attributes(path, specs[0])
    kind = SphericalHarmonicExponential
    if (attributes["frame"], attributes["center"]) != (kind.frame, kind.center):
        raise MapError(f"{path}: an SH exponential is {kind.frame}, about R; make it again")
    p, q = (_order(path, spec, f"{name}_order") for name in "pq")
    counts = (p + 1) ** 2, (q + 1) ** 2 - 1
    if len(specs) != 1:
        raise MapError(f"{path}: an SH exponential is one part, not {len(specs)} parts")
    if (spec.width, spec.height) != (sum(counts), 1):
        raise MapError(
            f"{path}: {spec.width} x {spec.height} pixels are not the {counts[0]} + {counts[1]} "
            f"coefficients of orders P = {p} and Q = {q}; make it again"
        )
    if not has_channels(spec, COLOURS):
        raise MapError(f"{path}: its channels are not those of an SH exponential")
    row = read_channels(path, source, 0, COLOURS)[0].astype(float)
    return kind(
        row[: counts[0]], row[counts[0] :], _ggx_alpha(path, spec), map_info(attributes, spec),
        _law(path, spec),
    )  # fmt: skip


def _order(path: str | os.PathLike[str], spec: Any, name: str) -> int:
    value = spec.getattribute(f"shrm:{name}")
    if type(value) is not int or not 0 <= value <= MAX_EXPONENTIAL_ORDER:
        raise _wrong(path, name)
    return value


def _ggx_alpha(path: str | os.PathLike[str], spec: Any) -> tuple[float, float]:
    """The range that it was fitted to."""
    value = spec.getattribute("shrm:ggx_alpha")
    is_pair = isinstance(value, tuple) and len(value) == 2
    if not is_pair or not all(isinstance(end, float) for end in value):
        raise _wrong(path, "ggx_alpha")
    if not 0 < value[0] <= value[1] <= 1:
        raise _wrong(path, "ggx_alpha")
    return shortest(value[0]), shortest(value[1])


def _law(path: str | os.PathLike[str], spec: Any) -> Law:
    value = spec.getattribute("shrm:law")
    if not isinstance(value, str) or value not in get_args(Law):
        raise _wrong(path, "law")
    return value  # type: ignore[return-value]


def _wrong(path: str | os.PathLike[str], name: str) -> MapError:
    return MapError(f"{path}: its attribute shrm:{name} is missing or wrong; make it again")
