"""The options of `shrm prefilter --to principal`. This module loads no numpy."""

from shrm_cli.maps.options import (
    BRDF_ARGUMENTS,
    CUBE_ARGUMENTS,
    SHADER,
    TEXTURES,
    Option,
    Representation,
)
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE, MAX_PRINCIPAL_MAPS

DESCRIPTIONS = {
    "principal": Representation(
        "principal",
        "principal functions",
        (BRDF_ARGUMENTS - {"order_p", "order_f", "domain", "source_height", "frame"})
        | CUBE_ARGUMENTS
        | {"error", "seen"},
        (
            Option(
                "maps",
                "principal: keep the K cubes that hold the most light.  [default: from --eps]",
                "integer",
                limits=(1, MAX_PRINCIPAL_MAPS),
                metavar="K",
            ),
            Option(
                "divide",
                "principal: divide by the directional albedo, which the file then holds.",
                "switch",
                default=False,
            ),
            SHADER,
            TEXTURES,
        ),
        own_defaults={"max_size": DEFAULT_MAX_SIZE},
    )
}
