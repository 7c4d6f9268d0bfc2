"""The options of `shrm prefilter --to irradiance`. This module loads no numpy."""

from shrm_cli.maps.options import CUBE_ARGUMENTS, SHADER, WINDOW, Option, Representation

FORM = Option(
    "form",
    "irradiance: all coefficients (sh), or linear ones and a zonal one of degree 2, about their "
    "luminance's axis (zh3), each channel's own, or guessed.  [default: sh]",
    "choice",
    choices=("sh", "zh3", "zh3-channel", "zh3-hallucinated"),
    converts=True,
    default="sh",
)

DESCRIPTIONS = {
    "irradiance": Representation(
        "irradiance",
        "irradiance",
        CUBE_ARGUMENTS | {"order_f", "error"},
        (
            WINDOW,
            FORM,
            SHADER,
        ),
        why_no_brdf="irradiance is that of a white Lambertian surface",
        own_defaults={"order_f": 2},  # nine coefficients
        steps=tuple({"order_f": order} for order in (1, 2, 4, 6, 8)),  # cosines lack odd degrees
    )
}
