"""The options of `shrm prefilter --to shrm`. This module loads no numpy."""

from shrm_cli.maps.options import (
    BRDF_ARGUMENTS,
    CUBE_ARGUMENTS,
    SHADER,
    TEXTURES,
    Option,
    Representation,
)

DESCRIPTIONS = {
    "shrm": Representation(
        "shrm",
        "SHRM",
        BRDF_ARGUMENTS | CUBE_ARGUMENTS | {"error", "seen"},
        (
            Option(
                "split",
                "Prefilter diffuse and glossy terms each about its own centre.  "
                "[default: by count]",
                "switch",
            ),
            Option(
                "compress",
                "Keep K principal components of an SHRM, or as many as an error X needs. From a "
                "probe, --to principal is better.",
                "components",
                converts=True,
            ),
            SHADER,
            TEXTURES,
        ),
    )
}
