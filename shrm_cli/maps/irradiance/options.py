"""The options of `shrm prefilter --to irradiance`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, SHADER, WINDOW, Representation

DESCRIPTIONS = {
    "irradiance": Representation(
        "irradiance",
        "irradiance",
        CUBE_ARGUMENTS | {"order_f"},
        (
            WINDOW,
            SHADER,
        ),
        why_no_brdf="irradiance is that of a white Lambertian surface",
    )
}
