"""Encoding plain SHRMs, compressed ones and sums of terms as parts of a file, and decoding them."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, StoredFile
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import MAX_VALUES
from shrm_cli.maps.stored import (
    StoredImage,
    color_channels,
    common_header,
    image_channels,
    options_text,
    read_numbers,
    shortest_values,
)

if TYPE_CHECKING:
    from shrm_cli.maps.shrm.shrm import CompressedShrm
    from shrm_cli.maps.shrm.summed import SummedShrm


def coefficient_channels(order_p: int, zonal: bool = False) -> list[str]:
    """Return the names of an SHRM's channels: ``sh000.R sh000.G sh000.B sh001.R ...``.

    A zonal SHRM has the channels of q = 0 only, under the same names.
    """
    every = color_channels("sh", (order_p + 1) ** 2)
    if not zonal:
        return every
    return [name for p in range(order_p + 1) for name in every[3 * p * (p + 1) :][:3]]


def term_names(count: int) -> list[str]:
    """Return the names of the parts of a sum: ``term00``, ``term01`` and so on."""
    return [f"term{k:02d}" for k in range(count)]


def encode(shrm: Shrm | CompressedShrm | SummedShrm) -> list[Part]:
    """Return the part of a file that holds a map, or one part for each term of a sum.

    Every part of a sum carries what is known of the whole sum.
    """
    if isinstance(shrm, Shrm):
        return [_encode_plain(shrm)]
    # Plain maps are most, and load none of the others' classes.
    from shrm_cli.maps.shrm.shrm import CompressedShrm

    return [_encode_compressed(shrm)] if isinstance(shrm, CompressedShrm) else _encode_sum(shrm)


def _encode_plain(shrm: Shrm) -> Part:
    (planes,) = shrm.planes()
    channels = image_channels(planes, coefficient_channels(shrm.order_p))
    if shrm.azimuth_free:
        zonal = coefficient_channels(shrm.order_p, zonal=True)
        channels = {name: channels[name] for name in zonal}
    return Part(channels, common_header(shrm, shrm.order_p))


def _encode_compressed(shrm: CompressedShrm) -> Part:
    rows = [shortest_values(row) for row in shrm.matrix]
    header = common_header(shrm, shrm.order_p) | {"shrm:pca_matrix": json.dumps(rows)}
    (planes,) = shrm.planes()
    return Part(image_channels(planes, color_channels("pc", shrm.cube_count)), header)


def _encode_sum(summed: SummedShrm) -> list[Part]:
    info = summed.info
    whole: dict[str, Any] = {
        "shrm:version": summed.format_version,
        "shrm:predicted_error": float(info.predicted_error),
        "shrm:brdf_energy_captured": float(info.captured),
        "shrm:epsilon": float(info.eps),
    }
    if info.added_error:
        whole["shrm:added_error"] = float(info.added_error)
    if info.options:
        whole["shrm:options"] = options_text(info.options)
    if info.filter_error:
        whole["shrm:filter_error"] = float(info.filter_error)
    parts = [part for term in summed.terms for part in encode(term)]
    return [
        Part(part.channels, {"name": name, **part.header, **whole})
        for name, part in zip(term_names(len(parts)), parts, strict=True)
    ]


def decode(file: StoredFile) -> Shrm | CompressedShrm | SummedShrm:
    """Read the SHRM that a file holds, if there are not too many coefficients to load."""
    from shrm_cli.maps.shrm.summed import SummedShrm

    if len(file.parts) == 1:
        return _decode_term(StoredImage.of(file.first))
    images = {part.name: StoredImage.of(part) for part in file.parts}
    names = term_names(len(file.parts))
    if sorted(images) != names:
        raise MapError(f"{file.path}: its parts are not the terms of an SHRM; make it again")
    terms = tuple(_decode_term(images[name]) for name in names)
    # Every part carries what is known of the sum, but the orders of its own term.
    info = replace(
        terms[0].info,
        order_f=max(term.info.order_f for term in terms),
        order_p=max(term.order_p for term in terms),
        carried=max(term.info.order_carried for term in terms),
    )
    return SummedShrm(terms, info)


def _decode_term(image: StoredImage) -> Shrm | CompressedShrm:
    if image.part.text("shrm:pca_matrix"):
        return _decode_compressed(image)
    return _decode_plain(image)


def _decode_plain(image: StoredImage) -> Shrm:
    order_p, size = image.attributes["P"], image.size
    every, zonal = coefficient_channels(order_p), coefficient_channels(order_p, zonal=True)
    stored = len(image.part.channel_names)
    is_zonal = image.attributes["frame"] == "local" and stored == len(zonal)
    names = zonal if is_zonal else every
    if stored * len(every) / len(names) * 6 * size**2 > MAX_VALUES:
        raise MapError(f"{image.path}: its coefficients are too many to load")
    image.check_channels(names, f"an SHRM of order P = {order_p}")
    coefficients = np.zeros((6 * size, size, len(every)), dtype=np.float32)
    coefficients[..., [every.index(name) for name in names]] = image.stack(names)
    shaped = coefficients.reshape(*coefficients.shape[:2], -1, 3)
    found = Shrm(shaped, image.attributes["frame"], **image.common())
    image.check_resampling(found.turns_with_texels)
    return found


def _decode_compressed(image: StoredImage) -> CompressedShrm:
    from shrm_cli.maps.shrm.shrm import CompressedShrm

    order_p, size = image.attributes["P"], image.size
    matrix, every = read_numbers(image.part, "pca_matrix"), (order_p + 1) ** 2
    if matrix is None or matrix.shape[1:] != (every,) or not 1 <= len(matrix) <= every:
        raise MapError.of_attribute(image.path, "pca_matrix", f"is not K x {every} numbers")
    names = color_channels("pc", len(matrix))
    image.check_channels(names, f"an SHRM compressed to {len(matrix)} components")
    if every * 18 * size**2 > MAX_VALUES:
        raise MapError(f"{image.path}: its coefficients are too many to load")
    image.check_resampling(image.attributes["frame"] == "local")
    components = image.stack(names).reshape(6 * size, size, -1, 3)
    return CompressedShrm(components, matrix, image.attributes["frame"], **image.common())
