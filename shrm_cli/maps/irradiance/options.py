"""The options of `shrm prefilter --to irradiance`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, Option, Representation

DESCRIPTIONS = {
    "irradiance": Representation(
        "irradiance",
        "irradiance",
        CUBE_ARGUMENTS | {"order_f"},
        (
            Option(
                "window",
                "irradiance: none, hann, lanczos, or auto, the factors that change it least and "
                "leave nothing negative.  [default: none]",
                "text",
                metavar="NAME[:WIDTH]",
            ),
            Option(
                "shader",
                "irradiance: print code that holds the numbers.",
                "choice",
                choices=("glsl", "hlsl", "c"),
                prints=True,
            ),
        ),
        why_no_brdf="irradiance is that of a white Lambertian surface",
    )
}
