"""The options of `shrm prefilter --to irradiance`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, SHADER, Option, Representation

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
            SHADER,
        ),
        why_no_brdf="irradiance is that of a white Lambertian surface",
    )
}
