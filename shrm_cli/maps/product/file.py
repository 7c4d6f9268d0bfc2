"""Writing product textures to files of one part, and reading them again.

The part is the parabolic map. Its channels are ``sh000``, ``sh001`` ... for a grey BRDF, and
``sh000.R``, ``sh000.G``, ``sh000.B``, ``sh001.R`` ... for a coloured one, by index l(l+1)+m.
"""

import json

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, StoredFile
from shrm_cli.maps.attributes import common_header, map_info, read_attributes, read_numbers
from shrm_cli.maps.product.product import ProductTexture
from shrm_cli.maps.size import MAX_VALUES
from shrm_cli.maps.stored import COLORS
from shrm_cli.vocabulary import MAX_PRODUCT_ORDER, MAX_PRODUCT_SIZE

_LIGHTING = "lighting_coefficients"


def channel_names(order: int, channels: int) -> list[str]:
    """Return the names of a texture's channels, in the order of its coefficients."""
    names = [f"sh{index:03d}" for index in range((order + 1) ** 2)]
    return names if channels == 1 else [f"{name}.{c}" for name in names for c in COLORS]


def encode(texture: ProductTexture) -> list[Part]:
    """Return the part of a file; the light, where there is any, is the JSON of an attribute."""
    header = common_header(texture, 0)
    if texture.lighting is not None:
        header[f"shrm:{_LIGHTING}"] = json.dumps(texture.lighting.tolist())
    planes = texture.table.reshape(texture.size, texture.size, -1)
    names = channel_names(texture.order, texture.table.shape[3])
    return [Part({name: planes[..., k] for k, name in enumerate(names)}, header)]


def decode(file: StoredFile) -> ProductTexture:
    """Return the texture that a file holds.

    Raises
    ------
    MapError
        If the file is not what `encode` makes.
    """
    path, part = file.path, file.first
    attributes = read_attributes(part)
    if len(file.parts) != 1:
        raise MapError(f"{path}: a product texture is one part, not {len(file.parts)} parts")
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
    if len(names) * size**2 > MAX_VALUES:
        raise MapError(f"{path}: its coefficients are too many to load")
    lighting = None
    if part.attribute(f"shrm:{_LIGHTING}") is not None:
        lighting = read_numbers(part, _LIGHTING, ((order + 1) ** 2, 3))
        if lighting is None:
            raise MapError(
                f"{path}: its attribute shrm:{_LIGHTING} is not {(order + 1) ** 2} x 3 finite "
                "numbers; make it again"
            )
    table = part.read(names).reshape(size, size, (order + 1) ** 2, channels)
    return ProductTexture(np.ascontiguousarray(table), map_info(attributes, part), lighting)
