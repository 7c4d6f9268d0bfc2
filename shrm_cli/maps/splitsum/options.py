"""The options of `shrm prefilter --to splitsum`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, SHADER, TEXTURES, Option, Representation
from shrm_cli.vocabulary import LEVEL_MAPPINGS

DESCRIPTIONS = {
    "splitsum": Representation(
        "splitsum",
        "split sum",
        CUBE_ARGUMENTS | {"brdf", "error"},
        (
            Option("levels", "splitsum: how many, or the roughness of each.", "levels"),
            Option(
                "mapping",
                "splitsum: how roughness rises with the level.  [default: linear]",
                "choice",
                choices=LEVEL_MAPPINGS,
                default="linear",
            ),
            SHADER,
            TEXTURES,
            Option(
                "mips",
                "splitsum: sizes that halve from level to level, down to one texel.  "
                "[default: from the orders]",
                "switch",
                default=False,
            ),
        ),
        why_no_brdf="a split sum is of GGX, unless a BRDF is given",
    )
}
