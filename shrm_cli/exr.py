"""Map <-> EXR file: the only place that knows channel names and attributes."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO as oiio
from numpy.typing import NDArray

from shrm_cli import threads
from shrm_cli.errors import MapError, OutputError
from shrm_cli.files import replacing
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm import MAX_SIZE, Shrm

Array = NDArray[np.floating]

VERSION = 1
PRECISIONS = ("auto", "half", "float")

_HALF_MAX = float(np.finfo(np.float16).max)
_HALF_OVERFLOW = _HALF_MAX + 16  # from here on rounding to the nearest half gives infinity
_MAX_ORDER_P = 32
_MAX_VALUES = 2**31


def write_map(path: str | os.PathLike[str], reflection_map: Shrm, precision: str = "auto") -> str:
    """Write a map, whole or not at all.

    Parameters
    ----------
    path : path-like
    reflection_map : Shrm
    precision : {"auto", "half", "float"}
        ``auto`` is half unless a value exceeds its range.

    Returns
    -------
    str
        The pixel type written, ``"half"`` or ``"float"``.

    Raises
    ------
    OutputError
        If half would overflow, or the file cannot be written.
    """
    planes = np.moveaxis(reflection_map.coefficients, (2, 3), (0, 1))
    chosen = _choose_precision(path, planes, precision)
    azimuth_free = reflection_map.azimuth_free
    kept = [
        index
        for index, (_, q) in enumerate(_order(reflection_map.order_p))
        if q == 0 or not azimuth_free
    ]
    channels = {
        f"sh{index:03d}.{colour}": _stored(planes[index, k], chosen)
        for index in kept
        for k, colour in enumerate("RGB")
    }
    _write(path, _header(reflection_map), channels)
    return chosen


def read_map(path: str | os.PathLike[str]) -> Shrm:
    """Read a map that `write_map` wrote.

    Raises
    ------
    MapError
        If the file is missing, damaged, or no map.
    """
    source = _open(path)
    spec = source.spec()
    attributes = _attributes(path, spec)
    order_p, size = attributes["P"], spec.width
    if spec.height != 6 * size or size > MAX_SIZE:
        raise MapError(f"{path}: {spec.width} x {spec.height} is not a cube of 1:6")
    if spec.nchannels * spec.width * spec.height > _MAX_VALUES:
        raise MapError(f"{path}: {spec.nchannels} channels of {size} texels are too many to load")
    names = {name: k for k, name in enumerate(spec.channelnames)}
    wanted = [f"sh{k:03d}.{c}" for k in range((order_p + 1) ** 2) for c in "RGB"]
    if not {"sh000.R", "sh000.G", "sh000.B"} <= names.keys() or not names.keys() <= set(wanted):
        raise MapError(f"{path}: its channels are not those of an SHRM of order P = {order_p}")
    pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    if pixels is None:
        raise MapError(f"{path}: damaged or truncated; make it again with shrm prefilter")
    coefficients = np.zeros((6 * size, size, len(wanted)), dtype=np.float32)
    stored = [k for k, name in enumerate(wanted) if name in names]
    coefficients[..., stored] = pixels[..., [names[wanted[k]] for k in stored]]
    if not np.isfinite(coefficients).all():
        raise MapError(f"{path}: holds NaN or infinite coefficients; make it again")
    return Shrm(
        coefficients.reshape(6 * size, size, -1, 3),
        attributes["frame"],
        attributes["center"],
        MapInfo(
            attributes["F"],
            order_p,
            attributes["epsilon"],
            attributes["brdf_energy_captured"],
            attributes["predicted_error"],
            attributes["brdf"],
            attributes["probe"],
            attributes["probe_sha256"],
            _chromaticities(spec),
        ),
        "border" if spec.get_int_attribute("oiio:sampleborder") else "center",
    )


def is_map(path: str | os.PathLike[str]) -> bool:
    """Whether a readable image carries the attributes of a map."""
    source = oiio.ImageInput.open(str(path))
    return source is not None and bool(source.spec().get_string_attribute("shrm:representation"))


def write_image(
    path: str | os.PathLike[str],
    pixels: Array,
    precision: str = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> str:
    """Write an RGB image, whole or not at all.

    Parameters
    ----------
    path : path-like
    pixels : ndarray, shape (H, W, 3)
        Scene-linear.
    precision : {"auto", "half", "float"}
    attributes : mapping, optional

    Returns
    -------
    str
        ``"half"`` or ``"float"``, as written.

    Raises
    ------
    OutputError
        If half would overflow, or the file cannot be written.
    """
    chosen = _choose_precision(path, pixels, precision)
    channels = {c: _stored(pixels[..., k], chosen) for k, c in enumerate("RGB")}
    _write(path, dict(attributes or {}), channels)
    return chosen


def _choose_precision(path: str | os.PathLike[str], values: Array, precision: str) -> str:
    largest = float(max(values.max(), -values.min())) if values.size else 0.0
    if not np.isfinite(largest) or largest > np.finfo(np.float32).max:
        raise OutputError(f"{path}: a value is not finite; nothing was written")
    overflows = largest >= _HALF_OVERFLOW
    if precision == "half" and overflows:
        raise OutputError(
            f"{path}: the value {largest:.6g} overflows half ({_HALF_MAX:.0f}); use --precision "
            "auto or float"
        )
    return "float" if precision == "float" or overflows else "half"


def _stored(plane: Array, precision: str) -> Array:
    # OpenEXR ignores strides: planes must be contiguous.
    return np.ascontiguousarray(plane, dtype=np.float32 if precision == "float" else np.float16)


def _order(order_p: int) -> list[tuple[int, int]]:
    return [(p, q) for p in range(order_p + 1) for q in range(-p, p + 1)]


def _header(reflection_map: Shrm) -> dict[str, Any]:
    info = reflection_map.info
    header: dict[str, Any] = {
        "shrm:representation": reflection_map.representation,
        "shrm:version": VERSION,
        "shrm:frame": reflection_map.frame,
        "shrm:center": reflection_map.center,
        "shrm:F": info.order_f,
        "shrm:P": reflection_map.order_p,
        "shrm:epsilon": float(info.tolerance),
        "shrm:brdf_energy_captured": float(info.captured),
        "shrm:predicted_error": float(info.predicted_error),
        "shrm:brdf": json.dumps(info.brdf, sort_keys=True),
        "shrm:probe": info.probe,
        "shrm:probe_sha256": info.probe_sha256,
    }
    if info.chromaticities is not None:
        header["chromaticities"] = tuple(info.chromaticities)
    if reflection_map.sampling == "border":
        header["envmap"] = OpenEXR.ENVMAP_CUBE
    return header


def _write(
    path: str | os.PathLike[str], header: dict[str, Any], channels: dict[str, Array]
) -> None:
    full = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    with replacing(path) as temporary:
        try:
            with OpenEXR.File(full, channels, num_threads=threads.count() or -1) as file:
                file.write(str(temporary))
        except RuntimeError as error:  # the library's words for a failed system call
            raise OSError(0, str(error).replace(str(temporary), str(path)).rstrip(".")) from error


def _open(path: str | os.PathLike[str]) -> Any:
    if not Path(path).exists():
        raise MapError(f"{path}: no such file")
    if Path(path).is_dir():
        raise MapError(f"{path}: a directory, not a map")
    source = oiio.ImageInput.open(str(path))
    if source is None or source.format_name() != "openexr":
        oiio.geterror()
        raise MapError(f"{path}: not an OpenEXR file, or a damaged one; shrm prefilter makes maps")
    return source


def _attributes(path: str | os.PathLike[str], spec: Any) -> dict[str, Any]:
    """The shrm: attributes, each of its type and within its range."""
    kind = spec.get_string_attribute("shrm:representation")
    if not kind:
        raise MapError(f"{path}: an image, but not a map; shrm prefilter makes maps")
    if kind != Shrm.representation:
        raise MapError(f"{path}: a map of representation {kind!r}, which this version cannot read")
    version = spec.get_int_attribute("shrm:version")
    if not 1 <= version <= VERSION:
        raise MapError(f"{path}: written by a newer shrm (format {version}); update shrm")
    result: dict[str, Any] = {
        "frame": spec.get_string_attribute("shrm:frame"),
        "center": spec.get_string_attribute("shrm:center"),
        "F": spec.get_int_attribute("shrm:F", -1),
        "P": spec.get_int_attribute("shrm:P", -1),
        "probe": spec.get_string_attribute("shrm:probe"),
        "probe_sha256": spec.get_string_attribute("shrm:probe_sha256"),
    }
    for name in ("epsilon", "brdf_energy_captured", "predicted_error"):
        result[name] = spec.get_float_attribute(f"shrm:{name}")
    try:
        result["brdf"] = json.loads(spec.get_string_attribute("shrm:brdf") or "{}")
    except json.JSONDecodeError:
        result["brdf"] = None
    sane = (
        result["frame"] in ("global", "local")
        and result["center"] in ("reflection", "normal")
        and result["F"] >= 0
        and 0 <= result["P"] <= _MAX_ORDER_P
        and isinstance(result["brdf"], dict)
    )
    if not sane:
        raise MapError(f"{path}: its shrm: attributes are damaged; make it again")
    return result


def _chromaticities(spec: Any) -> tuple[float, ...] | None:
    value = spec.getattribute("chromaticities")
    return tuple(value) if value is not None and len(value) == 8 else None
