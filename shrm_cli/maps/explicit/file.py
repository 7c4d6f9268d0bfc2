"""Encoding explicit maps as parts of a file, one for each sample of the view, and decoding them."""

from typing import Any, cast

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, StoredFile
from shrm_cli.maps import registry
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.stored import COLORS, StoredImage, common_header, image_channels


def encode(explicit: ExplicitMap) -> list[Part]:
    """Return a part for each image, whose attributes say which view the image belongs to."""
    header = common_header(explicit, explicit.info.order_p)
    count = explicit.count
    named = zip(
        explicit.part_names(count), explicit.view_attributes(count), explicit.images, strict=True
    )
    return [
        Part(image_channels(image), {"name": name, **header, **view}) for name, view, image in named
    ]


def decode(file: StoredFile) -> ExplicitMap:
    """Read the map that a file holds."""
    first = StoredImage.of(file.first)
    kind = cast(type[ExplicitMap], registry.map_class(first.attributes["representation"]))
    if any(
        (part.width, part.height) != (first.part.width, first.part.height) for part in file.parts
    ):
        raise MapError(f"{file.path}: its parts differ in size; make it again")
    parts = {part.name: part for part in file.parts}
    count = len(file.parts)
    wanted = kind.part_names(count) if kind.can_have(count) else []
    if sorted(part.name for part in file.parts) != sorted(wanted):
        raise MapError(
            f"{file.path}: its parts are not those of a {kind.representation} map; make it again"
        )
    if first.attributes["frame"] != kind.frame:
        raise MapError(f"{file.path}: a {kind.representation} map is {kind.frame}; make it again")
    images = np.empty((count, 3, 6 * first.size, first.size), dtype=np.float32)
    for index, (name, view) in enumerate(zip(wanted, kind.view_attributes(count), strict=True)):
        image = StoredImage(parts[name], first.attributes, first.arrangement, first.size)
        for attribute, expected in view.items():
            if not _is_near(image.part.attribute(attribute), expected):
                raise MapError(f"{file.path}: the {attribute} of its part {name} is wrong")
        image.check_channels(COLORS, f"a {kind.representation} map")
        images[index] = np.moveaxis(image.stack(COLORS), -1, 0)
    return kind(images.transpose(0, 2, 3, 1), **first.common())


def _is_near(found: Any, expected: Any) -> bool:
    """Whether an attribute holds the expected numbers, but for rounding."""
    expected, found = np.atleast_1d(expected), np.atleast_1d(found)
    is_number = np.issubdtype(found.dtype, np.floating) and found.shape == expected.shape
    return bool(is_number and np.allclose(found, expected, atol=1e-5))
