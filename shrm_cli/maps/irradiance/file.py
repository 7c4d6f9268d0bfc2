"""Irradiance maps <-> the one part of a file: the coefficients are the map, the cube shows it."""

import json
import math
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.files.exr import Part, has_channels, read_channels
from shrm_cli.maps.arrangement import Arrangement, stored_arrangement
from shrm_cli.maps.attributes import common_header, map_info, read_attributes
from shrm_cli.maps.irradiance.irradiance import POLYNOMIAL_ORDER, Irradiance
from shrm_cli.maps.irradiance.window import FAMILIES, Window, window_factors
from shrm_cli.maps.names import COLOURS
from shrm_cli.sphere.cube import cube_coordinates, face_axes
from shrm_cli.sphere.quadrature import nodes, spiral_directions

Array = NDArray[np.floating]

_CHECKED_TEXELS = 256
_PIXEL_TOLERANCE = 2e-3, 1e-7
"""Of the largest irradiance, four times what half's 11 bits leave; and half's smallest step."""


def encode(irradiance: Irradiance) -> list[Part]:
    """One part: the RGB cube of E(N), and what it was made from as attributes.

    ``shrm:lighting_coefficients`` is JSON, ``[[r, g, b], ...]`` by index l(l+1)+m, in double
    precision; ``shrm:irradiance_matrices``, up to order 2, the 4 x 4 matrices of R, G and B
    (eq. 4.15); ``shrm:window`` what the coefficients were multiplied with.
    """
    window = irradiance.window
    header = common_header(irradiance, irradiance.order_p)
    header |= {
        "shrm:lighting_coefficients": _json(irradiance.coefficients),
        "shrm:window": json.dumps({
            "name": window.name,
            "width": window.width,
            "factors": list(window.factors),
            "energy_lost": window.energy_lost,
            "change": window.change,
        }),
    }  # fmt: skip
    if irradiance.order_f <= POLYNOMIAL_ORDER:
        header["shrm:irradiance_matrices"] = _json(irradiance.matrices())
    cube = irradiance.cube()
    return [Part({name: cube[..., k] for k, name in enumerate(COLOURS)}, header)]


def decode(path: str | os.PathLike[str], source: Any, specs: list[Any]) -> Irradiance:
    """The map of an opened file.

    Parameters
    ----------
    path : path-like
        For messages.
    source
        OpenImageIO's ImageInput.
    specs : list
        Specifications of its parts.

    Raises
    ------
    MapError
        If an attribute is missing or wrong, they contradict each other, or the pixels are not
        those of the coefficients.
    """
    spec = specs[0]
    attributes = read_attributes(path, spec)
    if len(specs) != 1:
        raise MapError(f"{path}: an irradiance map has one part, not {len(specs)}; make it again")
    for name, only in (("frame", "global"), ("center", "normal"), ("P", 0)):
        if attributes[name] != only:
            raise MapError(f"{path}: the shrm:{name} of an irradiance map is {only}; make it again")
    arrangement, size = _arrangement(path, spec, attributes)
    order_f = attributes["F"]
    coefficients = _numbers(spec, "lighting_coefficients", ((order_f + 1) ** 2, 3))
    if coefficients is None:
        raise _wrong(path, f"lighting_coefficients is not {(order_f + 1) ** 2} x 3 finite numbers")
    made = Irradiance(
        coefficients, map_info(attributes, spec), size, arrangement.sampling,
        _window(path, spec, order_f),
    )  # fmt: skip
    _check_matrices(path, spec, made)
    _check_pixels(path, source, arrangement, made)
    return made


def _json(values: Array) -> str:
    """Nested lists of numbers, each as many digits as make the same double again."""
    return json.dumps(values.tolist())


def _wrong(path: str | os.PathLike[str], what: str) -> MapError:
    return MapError(f"{path}: its attribute shrm:{what}; make it again")


def _arrangement(
    path: str | os.PathLike[str], spec: Any, attributes: dict[str, Any]
) -> tuple[Arrangement, int]:
    """How the image is laid out, and the texels along an edge of its cube."""
    arrangement, size = stored_arrangement(path, spec, attributes)
    if not has_channels(spec, COLOURS):
        raise MapError(f"{path}: its channels are not those of an irradiance map")
    return arrangement, size


def _numbers(spec: Any, name: str, shape: tuple[int, ...]) -> Array | None:
    """An attribute of nested lists of finite numbers; None if it is anything else."""
    text = spec.getattribute(f"shrm:{name}")
    try:
        values = np.array(json.loads(text))
    except (ValueError, TypeError, RecursionError, OverflowError):
        return None
    if values.shape != shape or values.dtype.kind not in "fiu":
        return None
    return values.astype(float) if np.isfinite(values).all() else None


def _window(path: str | os.PathLike[str], spec: Any, order_f: int) -> Window:
    """The window, whose factors are those of its name and width, where it has one."""
    try:
        found = json.loads(spec.getattribute("shrm:window"))
        name, width, factors = found["name"], found["width"], found["factors"]
        costs = float(found["energy_lost"]), float(found["change"])
        is_width = type(width) in (int, float) and math.isfinite(width) and width > 0
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
        raise _wrong(path, "window is missing or wrong") from None
    if not all(math.isfinite(cost) for cost in costs):
        raise _wrong(path, "window has costs that are not finite")
    if (name, width, factors) == ("none", None, []):
        return Window()
    held = _factors(factors, order_f)
    if (name, width) == ("least", None):
        if held is None or held[0] != 1 or not np.all((held >= 0) & (held <= 1)):
            raise _wrong(path, "window has factors that are not 1, and within 0 .. 1")
        return Window("least", None, tuple(held.tolist()), *costs)
    if not isinstance(name, str) or name not in FAMILIES or not is_width:
        raise _wrong(path, "window is missing or wrong")
    expected = window_factors(name, float(width), order_f)
    if held is None or not np.allclose(held, expected, rtol=0, atol=1e-9):
        raise _wrong(path, f"window has other factors than {name} of width {width:g}")
    return Window(name, float(width), tuple(expected.tolist()), *costs)


def _factors(found: Any, order_f: int) -> Array | None:
    """A list of a number for each degree; None if it is anything else."""
    is_list = isinstance(found, list) and len(found) == order_f + 1
    if not is_list or any(type(factor) not in (int, float) for factor in found):
        return None
    try:
        return np.array(found, dtype=float)
    except OverflowError:
        return None


def _check_matrices(path: str | os.PathLike[str], spec: Any, made: Irradiance) -> None:
    """Refuse matrices that are not those of the coefficients, or that there can be none of."""
    if made.order_f > POLYNOMIAL_ORDER:
        if spec.getattribute("shrm:irradiance_matrices") is not None:
            raise _wrong(path, f"irradiance_matrices has no meaning at order F = {made.order_f}")
        return
    found, expected = _numbers(spec, "irradiance_matrices", (3, 4, 4)), made.matrices()
    if found is None:
        raise _wrong(path, "irradiance_matrices is not 3 x 4 x 4 finite numbers")
    if not np.allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max()):
        raise _wrong(path, "irradiance_matrices does not belong to the coefficients")


def _check_pixels(
    path: str | os.PathLike[str], source: Any, arrangement: Arrangement, made: Irradiance
) -> None:
    """Refuse a cube that shows something else than its coefficients, as after an edit of either.

    A lat-long is resampled, and only checked to be whole.
    """
    pixels = read_channels(path, source, 0, COLOURS)
    if arrangement.layout == "latlong":
        return
    cube = arrangement.undo(pixels)
    rows, columns, normals = _some_texels(made)
    expected = made.irradiance(normals)
    relative, absolute = _PIXEL_TOLERANCE
    tolerance = relative * float(np.abs(expected).max()) + absolute
    if not np.allclose(cube[rows, columns], expected, rtol=0, atol=tolerance):
        raise MapError(
            f"{path}: its pixels are not those of its shrm:lighting_coefficients; make it again"
        )


def _some_texels(made: Irradiance) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows and columns of texels all over the cube, and their normals, (n, 3)."""
    at = nodes(made.size, made.sampling)
    face, s, t = cube_coordinates(spiral_directions(_CHECKED_TEXELS))
    column, row = (np.abs(at[:, None] - x).argmin(axis=0) for x in (s, t))
    right, down, forward = np.moveaxis(face_axes(), 1, 0)
    points = forward[face] + at[column][:, None] * right[face] + at[row][:, None] * down[face]
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    return face * made.size + row, column, normals
