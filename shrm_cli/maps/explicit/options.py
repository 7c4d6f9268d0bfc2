"""The options of `shrm prefilter --to cabral` and of the other explicit maps.

All explicit maps of the vocabulary share one description, to which each adds options of its own.
This module loads no numpy.
"""

from shrm_cli.maps.options import (
    BRDF_ARGUMENTS,
    CUBE_ARGUMENTS,
    SHADER,
    TEXTURES,
    Option,
    Representation,
)
from shrm_cli.vocabulary import REPRESENTATIONS

_TAKES = (BRDF_ARGUMENTS | CUBE_ARGUMENTS) - {"frame"}
_SLICES = Option(
    "slices",
    "Angles theta_o of a kautz-mccool map.  [default: 10 P]",
    "integer",
    limits=(1, 1024),
    metavar="T",
    converts=True,
)
_VIEWS = Option(
    "views",
    "A lightfield has T x T views.  [default: 10 P]",
    "integer",
    limits=(1, 128),
    metavar="T",
    converts=True,
)

_TITLES = {"cabral": "Cabral", "kautz-mccool": "Kautz-McCool", "lightfield": "light field"}
_OWN = {"kautz-mccool": (_SLICES,), "lightfield": (_VIEWS,)}

_STEPS = tuple({"eps": eps} for eps in (0.3, 0.1, 0.03, 0.01, 0.003))

DESCRIPTIONS = {
    name: Representation(
        name,
        _TITLES.get(name, name),
        _TAKES,
        (*_OWN.get(name, ()), SHADER, TEXTURES),
        steps=_STEPS,
    )
    for name, module in REPRESENTATIONS.items()
    if module.startswith("explicit.")
}
