"""The options of `shrm prefilter --to she`. This module loads no numpy."""

from shrm_cli.maps.options import SHADER, TEXTURES, Option, Representation
from shrm_cli.vocabulary import (
    DEFAULT_FACTOR_ORDERS,
    DEFAULT_FITTED_ROUGHNESS,
    LAWS,
    MAX_EXPONENTIAL_ORDER,
    MIN_ROUGHNESS,
)

_P, _Q = DEFAULT_FACTOR_ORDERS
_LOW, _HIGH = DEFAULT_FITTED_ROUGHNESS
_ORDERS = (0, MAX_EXPONENTIAL_ORDER)

DESCRIPTIONS = {
    "she": Representation(
        "she",
        "SH exponential",
        frozenset(("error",)),
        (
            Option(
                "p_order",
                f"she: order of P, over R.  [default: {_P}]",
                "integer",
                limits=_ORDERS,
                default=_P,
            ),
            Option(
                "q_order",
                f"she: order of Q, over (R + N) / |R + N|.  [default: {_Q}]",
                "integer",
                limits=_ORDERS,
                default=_Q,
            ),
            Option(
                "roughness",
                f"she: perceptual roughness to fit it to.  [default: {_LOW:g}..{_HIGH:g}]",
                "interval",
                limits=(MIN_ROUGHNESS, 1),
                default=DEFAULT_FITTED_ROUGHNESS,
            ),
            Option(
                "law",
                "she: attenuation after GGX's lobe, or as published.  [default: lobe]",
                "choice",
                choices=LAWS,
                default="lobe",
            ),
            SHADER,
            TEXTURES,
        ),
        why_no_brdf="an SH exponential is of GGX",
        steps=tuple({"p_order": p, "q_order": q} for p, q in ((2, 1), (4, 2), (6, 4), (8, 6))),
    )
}
