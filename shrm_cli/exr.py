"""Map <-> EXR file: the only place that knows channel names and attributes."""

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import OpenEXR
import OpenImageIO as oiio
from numpy.typing import NDArray

from shrm_cli import threads
from shrm_cli.brdf.base import Center
from shrm_cli.errors import MapError, OutputError
from shrm_cli.files import replacing
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm import MAX_SIZE, MAX_VALUES, Frame, Shrm
from shrm_cli.orders import MAX_ORDER_F, MAX_ORDER_P

Array = NDArray[np.floating]

VERSION = 1

_HALF_MAX = float(np.finfo(np.float16).max)
_FLOAT_MAX = float(np.finfo(np.float32).max)
_HALF_OVERFLOW = _HALF_MAX + 16  # from here on rounding to the nearest half gives infinity


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
    if spec.nchannels * spec.width * spec.height > MAX_VALUES:
        raise MapError(f"{path}: {spec.nchannels} channels of {size} texels are too many to load")
    names = {name: k for k, name in enumerate(spec.channelnames)}
    wanted = [f"sh{k:03d}.{c}" for k in range((order_p + 1) ** 2) for c in "RGB"]
    zonal = [f"sh{p * (p + 1):03d}.{c}" for p in range(order_p + 1) for c in "RGB"]
    is_zonal = attributes["frame"] == "local" and names.keys() == set(zonal)
    numbers = {str(spec.channelformat(k)) for k in names.values()}
    if (names.keys() != set(wanted) and not is_zonal) or not numbers <= {"half", "float"}:
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
    source = _open_image(path) if Path(path).is_file() else None
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
    if not largest <= _FLOAT_MAX:
        raise OutputError(f"{path}: a value is not finite in 32-bit float; dim the light")
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
        except RuntimeError as error:  # the library's words end with the system's
            raise OSError(0, str(error).rpartition('". ')[2].rstrip(".")) from error


def _open(path: str | os.PathLike[str]) -> Any:
    if not Path(path).exists():
        raise MapError(f"{path}: no such file")
    if not Path(path).is_file():  # to open a pipe would block
        kind = "a directory" if Path(path).is_dir() else "not a regular file"
        raise MapError(f"{path}: {kind}; name a map")
    source = _open_image(path)
    if source is None or source.format_name() != "openexr":
        raise MapError(f"{path}: not an OpenEXR file, or a damaged one; shrm prefilter makes maps")
    return source


def _open_image(path: str | os.PathLike[str]) -> Any:
    """The image, or None; never an error left for the library to print at the end."""
    try:
        source = oiio.ImageInput.open(os.fspath(path))
    except TypeError:  # a name that is not UTF-8
        return None
    oiio.geterror()
    return source


def _attributes(path: str | os.PathLike[str], spec: Any) -> dict[str, Any]:
    """The shrm: attributes, each of its type and within its range."""
    found = spec.get_string_attribute("shrm:representation")
    if not found:
        raise MapError(f"{path}: an image, but not a map; shrm prefilter makes maps")
    if found != Shrm.representation:
        raise MapError(f"{path}: a map of representation {found!r}, which this version cannot read")
    version = spec.getattribute("shrm:version")
    if isinstance(version, int) and version > VERSION:
        raise MapError(f"{path}: written by a newer shrm (format {version}); update shrm")
    result: dict[str, Any] = {}
    for name, (kind, is_valid) in _ATTRIBUTES.items():
        value: Any = spec.getattribute(f"shrm:{name}")
        if value is None and kind is str:  # the library leaves empty ones out
            value = ""
        if isinstance(value, str):  # bytes that are no text could not be printed
            value = value.encode("utf-8", "replace").decode()
        is_sound = type(value) is kind and is_valid(value)
        if not is_sound:
            raise MapError(f"{path}: its attribute shrm:{name} is missing or wrong; make it again")
        # The shortest decimals that are this float32: 0.03, not 0.029999999329447746.
        result[name] = float(str(np.float32(value))) if kind is float else value
    return {**result, "brdf": json.loads(result["brdf"])}


def _is_json_object(text: str) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False


# Types of the attributes that a map must have, and what their values must hold.
_ATTRIBUTES: dict[str, tuple[type, Callable[[Any], bool]]] = {
    "version": (int, lambda value: value >= 1),
    "frame": (str, get_args(Frame).__contains__),
    "center": (str, get_args(Center).__contains__),
    "F": (int, lambda value: 0 <= value <= MAX_ORDER_F),
    "P": (int, lambda value: 0 <= value <= MAX_ORDER_P),
    "epsilon": (float, math.isfinite),
    "brdf_energy_captured": (float, math.isfinite),
    "predicted_error": (float, math.isfinite),
    "brdf": (str, _is_json_object),
    "probe": (str, lambda value: True),
    "probe_sha256": (str, lambda value: True),
}


def _chromaticities(spec: Any) -> tuple[float, ...] | None:
    value = spec.getattribute("chromaticities")
    return tuple(value) if isinstance(value, tuple) and len(value) == 8 else None
