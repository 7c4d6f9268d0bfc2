"""Writing irradiance maps to files of one part, and reading them again.

The lighting coefficients among the part's attributes are the map. The pixels are a cube that shows
the irradiance that they make. Eq. 4.15 is one of chapter 4 of Ramamoorthi's thesis, "A
Signal-Processing Framework for Forward and Inverse Rendering" (2002).
"""

import json
import math

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, StoredFile, StoredPart
from shrm_cli.maps.irradiance.irradiance import (
    FORMS,
    POLYNOMIAL_ORDER,
    Irradiance,
    Zh3,
    zonal_harmonics,
)
from shrm_cli.maps.irradiance.window import FAMILIES, Window, window_factors
from shrm_cli.maps.stored import COLORS, StoredImage, common_header, image_channels, read_numbers
from shrm_cli.sphere.cube import cube_coordinates, texel_directions
from shrm_cli.sphere.quadrature import nodes, spiral_directions

_CHECKED_TEXELS = 256
"""The number of texels all over the cube that are compared with the coefficients."""
_PIXEL_TOLERANCE = 2e-3, 1e-7
"""How far a pixel may be from what the coefficients make: a part of the largest irradiance, plus an
absolute irradiance. The part is four times the rounding of 16-bit floats, which have 11 bits; the
absolute part is their smallest step."""


def encode(irradiance: Irradiance) -> list[Part]:
    """Make the part of a file: the RGB cube of E(N), with the coefficients as attributes.

    ``shrm:lighting_coefficients`` is JSON, ``[[r, g, b], ...]`` by index l(l+1)+m, in double
    precision. ``shrm:irradiance_matrices``, which is there up to order 2, holds the 4 x 4 matrices
    of R, G and B (eq. 4.15). ``shrm:window`` says what the coefficients were multiplied with.
    """
    window = irradiance.window
    header = {
        **common_header(irradiance, 0),
        "shrm:lighting_coefficients": _json(irradiance.coefficients),
        "shrm:window": json.dumps({**window.summary(0), "factors": list(window.factors)}),
    }
    if isinstance(irradiance, Zh3):
        header["shrm:form"] = irradiance.form
        header["shrm:zh3"] = json.dumps(irradiance.numbers()["zh3"])
    if irradiance.order_f <= POLYNOMIAL_ORDER:
        header["shrm:irradiance_matrices"] = _json(irradiance.matrices())
    cube = irradiance.cube()
    return [Part(image_channels(cube), header)]


def decode(file: StoredFile) -> Irradiance:
    """Return the map that a file holds, if the pixels are those of its coefficients."""
    path, count = file.path, len(file.parts)
    if count != 1:
        raise MapError(f"{path}: an irradiance map has one part, not {count}; make it again")
    image = StoredImage.of(file.first)
    for name, only in (("frame", "global"), ("center", "normal"), ("P", 0)):
        if image.attributes[name] != only:
            raise MapError(f"{path}: the shrm:{name} of an irradiance map is {only}; make it again")
    image.check_channels(COLORS, "an irradiance map")
    order_f = image.attributes["F"]
    coefficients = read_numbers(image.part, "lighting_coefficients", ((order_f + 1) ** 2, 3))
    if coefficients is None:
        raise _wrong(path, f"lighting_coefficients is not {(order_f + 1) ** 2} x 3 finite numbers")
    common = image.common()
    made = Irradiance(
        coefficients, common["info"], image.size, common["sampling"], _window(image.part, order_f)
    )
    _check_matrices(image.part, made)
    _check_pixels(image, made)
    return made if image.part.attribute("shrm:form") is None else _zh3(image.part, made)


def _zh3(part: StoredPart, made: Irradiance) -> Zh3:
    """Read the axes and the zonal coefficients, and check that they make the degree 2."""
    path, form = part.path, part.attribute("shrm:form")
    try:
        held = parse_json(part.attribute("shrm:zh3"))
        axes, zonal = (np.array(held[name], dtype=float) for name in ("axes", "zonal"))
    except (ValueError, TypeError, KeyError, OverflowError):
        raise _wrong(path, "zh3 is missing or wrong") from None
    shapes = form in FORMS, axes.shape == (3, 3), zonal.shape == (3,), made.order_f == 2
    if not all(shapes) or not (np.isfinite(axes).all() and np.isfinite(zonal).all()):
        raise _wrong(path, "form or shrm:zh3 is wrong")
    expected = (zonal[:, None] * zonal_harmonics(axes)).T
    scale = np.abs(made.coefficients).max()
    if not np.allclose(made.coefficients[4:], expected, rtol=0, atol=1e-9 * scale):
        raise _wrong(path, "zh3 does not belong to the coefficients")
    held_fields = made.coefficients, made.info, made.size, made.sampling, made.window
    return Zh3(*held_fields, form, axes, zonal)


def _json(values: Array) -> str:
    """Write nested lists of numbers with so many digits that readers get the same doubles."""
    return json.dumps(values.tolist())


def _wrong(path: str, what: str) -> MapError:
    return MapError(f"{path}: its attribute shrm:{what}; make it again")


def _window(part: StoredPart, order_f: int) -> Window:
    """Read the window, and check that its factors are those of its name and width, if any."""
    path = part.path
    try:
        found = parse_json(part.attribute("shrm:window"))
        name, width, factors = found["name"], found["width"], found["factors"]
        costs = float(found["energy_lost"]), float(found["change"])
        is_width = type(width) in (int, float) and math.isfinite(width) and width > 0
    except (ValueError, TypeError, KeyError, OverflowError):
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


def _factors(found: object, order_f: int) -> Array | None:
    """Turn a list of one number for each degree into an array; None if it is anything else."""
    if not isinstance(found, list) or len(found) != order_f + 1:
        return None
    if any(type(factor) not in (int, float) for factor in found):
        return None
    try:
        return np.array(found, dtype=float)
    except OverflowError:
        return None


def _check_matrices(part: StoredPart, made: Irradiance) -> None:
    """Refuse matrices that are not those of the coefficients, and any matrices above order 2."""
    path = part.path
    if made.order_f > POLYNOMIAL_ORDER:
        if part.attribute("shrm:irradiance_matrices") is not None:
            raise _wrong(path, f"irradiance_matrices has no meaning at order F = {made.order_f}")
        return
    found, expected = read_numbers(part, "irradiance_matrices", (3, 4, 4)), made.matrices()
    if found is None:
        raise _wrong(path, "irradiance_matrices is not 3 x 4 x 4 finite numbers")
    if not np.allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max()):
        raise _wrong(path, "irradiance_matrices does not belong to the coefficients")


def _check_pixels(image: StoredImage, made: Irradiance) -> None:
    """Refuse a cube that does not show its coefficients, because one of them was edited.

    The pixels of a lat-long were resampled, so they are only read, which refuses damaged ones.
    """
    cube = image.stack(COLORS)
    if image.arrangement.layout == "latlong":
        return
    rows, columns, normals = _some_texels(made)
    expected = made.irradiance(normals)
    relative, absolute = _PIXEL_TOLERANCE
    tolerance = relative * float(np.abs(expected).max()) + absolute
    if not np.allclose(cube[rows, columns], expected, rtol=0, atol=tolerance):
        raise MapError(
            f"{image.path}: its pixels are not those of its shrm:lighting_coefficients; "
            "make it again"
        )


def _some_texels(made: Irradiance) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Choose texels all over the cube: their rows, columns and normals, shape (n, 3)."""
    at = nodes(made.size, made.sampling)
    face, s, t = cube_coordinates(spiral_directions(_CHECKED_TEXELS))
    column, row = (np.abs(at[:, None] - x).argmin(axis=0) for x in (s, t))
    row += face * made.size
    return row, column, texel_directions(row, column, made.size, made.sampling)
