"""Writing product textures to files, and reading them again.

A part is a parabolic map. Its channels are ``sh000``, ``sh001`` ... for a grey BRDF, and
``sh000.R``, ``sh000.G``, ``sh000.B``, ``sh001.R`` ... for a coloured one, by index l(l+1)+m.
Where parameters vary there are several parts, ``value00``, ``value01`` ... Of one parameter there
is one for each of its values; of two, each part says its weight for each of their combinations.
"""

import json
import math
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, StoredFile, StoredPart
from shrm_cli.maps.product.product import LitProduct, ProductMap, ProductTexture, VaryingProduct
from shrm_cli.maps.product.steps import Steps
from shrm_cli.maps.stored import (
    color_channels,
    common_header,
    image_channels,
    map_info,
    read_attributes,
    read_numbers,
)
from shrm_cli.vocabulary import MAX_PRODUCT_ORDER, MAX_PRODUCT_PARAMETERS, MAX_PRODUCT_SIZE

_LIGHTING = "lighting_coefficients"
_VARYING, _WEIGHTS = "varying", "weights"
_MOST_NAME = 64
"""The most characters of a parameter's name."""


def channel_names(order: int, channels: int) -> list[str]:
    """Return the names of a texture's channels, in the order of its coefficients."""
    count = (order + 1) ** 2
    return color_channels("sh", count) if channels > 1 else [f"sh{k:03d}" for k in range(count)]


def encode(made: ProductMap | LitProduct) -> list[Part]:
    """Return the parts of a file: one, or one for each texture where parameters vary.

    The light, where there is any, is the JSON of an attribute, and so are the parameters, their
    values, and the weights of each texture.
    """
    product = made.product if isinstance(made, LitProduct) else made
    parts = [_part(each) for each in product.textures]
    if isinstance(made, LitProduct):
        lighting = json.dumps(made.lighting.tolist())
        for part in parts:
            part.header[f"shrm:{_LIGHTING}"] = lighting
    if isinstance(product, VaryingProduct):
        steps, varying = product.steps, json.dumps(product.steps.summary())
        for index, (name, part) in enumerate(zip(_names(len(parts)), parts, strict=True)):
            part.header.update({"name": name, f"shrm:{_VARYING}": varying})
            if product.varies > 1:
                part.header[f"shrm:{_WEIGHTS}"] = json.dumps(steps.weights[..., index].tolist())
    return parts


def _part(texture: ProductTexture) -> Part:
    header = common_header(texture, 0)
    planes = texture.table.reshape(texture.size, texture.size, -1)
    return Part(image_channels(planes, channel_names(texture.order, texture.channels)), header)


def _names(count: int) -> list[str]:
    return [f"value{k:02d}" for k in range(count)]


def decode(file: StoredFile) -> ProductMap | LitProduct:
    """Return the texture, or the textures, that a file holds."""
    varies = len(file.parts) > 1 or file.first.attribute(f"shrm:{_VARYING}") is not None
    product = _several(file) if varies else _texture(file.first)
    lights = [_lighting(part, product.order) for part in file.parts]
    if not all(np.array_equal(each, lights[0]) for each in lights):  # type: ignore[arg-type]
        raise MapError(f"{file.path}: its parts are under several lights; make it again")
    return product if lights[0] is None else product.lit(lights[0])


def _several(file: StoredFile) -> VaryingProduct:
    """Return the textures of a file whose parameters vary."""
    parts = {part.name: part for part in file.parts}
    names = _names(len(file.parts))
    if sorted(parts) != names:
        raise MapError(f"{file.path}: its parts are not the values of a parameter; make it again")
    steps = _steps([parts[name] for name in names])
    textures = [_texture(parts[name]) for name in names]
    if len({each.table.shape for each in textures}) > 1:
        raise MapError(f"{file.path}: its parts are of several shapes; make it again")
    return VaryingProduct.of(textures, steps)


def _steps(parts: list[StoredPart]) -> Steps:
    """Read which parameters vary, their values, the weights of each part, and the error between.

    Files from before that error was measured do not tell it.
    """
    try:
        found = parse_json(parts[0].text(f"shrm:{_VARYING}"))
        is_one = "parameter" in found
        names = [found["parameter"]] if is_one else found["parameters"]
        axes = [found["values"]] if is_one else found["values"]
        values = dict(zip(names, (tuple(map(_number, own)) for own in axes), strict=True))
        error = _number(found.get("step_error", 0.0))
        is_known = all(isinstance(name, str) and 0 < len(name) <= _MOST_NAME for name in values)
        if not is_known or list(values) != names or error < 0:
            raise ValueError
        if is_one:
            return Steps(values, np.eye(len(parts)), error)
        shape = tuple(map(len, axes))
        weights = [w for part in parts if (w := read_numbers(part, _WEIGHTS, shape)) is not None]
        if len(weights) < len(parts) or not 1 < len(shape) <= MAX_PRODUCT_PARAMETERS:
            raise ValueError
        return Steps(values, np.stack(weights, axis=-1), error)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
        raise MapError.of_attribute(parts[0].path, _VARYING) from None


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _texture(part: StoredPart) -> ProductTexture:
    path, attributes = part.path, read_attributes(part)
    if (attributes["frame"], attributes["center"]) != ("local", "normal"):
        raise MapError(f"{path}: a product texture is local, about the normal; make it again")
    order, size = attributes["F"], part.width
    if order > MAX_PRODUCT_ORDER or part.height != size or size > MAX_PRODUCT_SIZE:
        raise MapError(
            f"{path}: {size} x {part.height} pixels of order {order} are no product texture of "
            f"up to {MAX_PRODUCT_SIZE} texels and order {MAX_PRODUCT_ORDER}; make it again"
        )
    channels = 1 if len(part.channel_names) == (order + 1) ** 2 else 3
    names = channel_names(order, channels)
    if not part.holds(names):
        raise MapError(f"{path}: its channels are not those of a product texture of order {order}")
    table = part.read(names).reshape(size, size, (order + 1) ** 2, channels)
    return ProductTexture(np.ascontiguousarray(table), map_info(attributes, part))


def _lighting(part: StoredPart, order: int) -> Array | None:
    """Read the coefficients of the light; None if there is none."""
    if part.attribute(f"shrm:{_LIGHTING}") is None:
        return None
    count = (order + 1) ** 2
    lighting = read_numbers(part, _LIGHTING, (count, 3))
    if lighting is None:
        raise MapError.of_attribute(part.path, _LIGHTING, f"is not {count} x 3 finite numbers")
    return lighting
