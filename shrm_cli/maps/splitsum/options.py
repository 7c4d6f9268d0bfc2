"""The options of `shrm prefilter --to splitsum`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, SHADER, TEXTURES, Option, Representation
from shrm_cli.vocabulary import DEFAULT_TAPS, LEVEL_MAPPINGS, TAP_COUNTS

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
                "anisotropy",
                "splitsum, with --shader: print shrm_brushed(n, t, v, roughness, anisotropy, f0) "
                "too, of brushed GGX.",
                "switch",
                prints=True,
            ),
            Option(
                "taps",
                f"splitsum, with --anisotropy: look-ups it takes.  [default: {DEFAULT_TAPS}]",
                "choice",
                choices=tuple(str(each) for each in TAP_COUNTS),
                prints=True,
            ),
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
