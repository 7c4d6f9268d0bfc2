"""The options of `shrm prefilter --to product`. This module loads no numpy."""

from shrm_cli.maps.options import SHADER, TEXTURES, WINDOW, Option, Representation
from shrm_cli.vocabulary import (
    DEFAULT_PRODUCT_ORDER,
    DEFAULT_PRODUCT_SIZE,
    MAX_PRODUCT_ORDER,
    MAX_PRODUCT_SIZE,
)

DESCRIPTIONS = {
    "product": Representation(
        "product",
        "product texture",
        frozenset(("brdf", "error")),
        (
            Option(
                "order",
                "product: largest degree of the light's harmonics.  "
                f"[default: {DEFAULT_PRODUCT_ORDER}]",
                "integer",
                limits=(0, MAX_PRODUCT_ORDER),
                default=DEFAULT_PRODUCT_ORDER,
            ),
            Option(
                "texels",
                "product: texels along the edge of the parabolic map of views.  "
                f"[default: {DEFAULT_PRODUCT_SIZE}]",
                "integer",
                limits=(8, MAX_PRODUCT_SIZE),
                default=DEFAULT_PRODUCT_SIZE,
            ),
            WINDOW,
            SHADER,
            TEXTURES,
        ),
        steps=tuple({"order": order} for order in (2, 4, 6, 8, 10, 14)),
    )
}
