"""The forms of maps: what each is called and takes, and the modules that make, write and read it.

Those of installed packages are looked for where a name is none of `shrm`; see `maps.installed`.

`shrm --help` reads the descriptions, so that this module loads no numpy. No module of a form is
loaded before it is needed. All explicit maps share one description, to which each adds options of
its own.
"""

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from shrm_cli import vocabulary
from shrm_cli.errors import ArgumentError, PluginError
from shrm_cli.maps.options import (
    AUTOMATIC,
    BRDF_ARGUMENTS,
    CUBE_ARGUMENTS,
    SHADER,
    SHARED,
    TEXTURES,
    WINDOW,
    Option,
    Representation,
)
from shrm_cli.messages import refuse_arguments

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map

_EXPLICIT_TAKES = (BRDF_ARGUMENTS | CUBE_ARGUMENTS) - {"frame"}
_SLICES = Option(
    "slices", kind="integer", limits=(1, 1024), metavar="T", converts=True,
    help="Angles theta_o of a kautz-mccool map.  [default: 10 P, as far as they fit]",
)  # fmt: skip
_VIEWS = Option(
    "views", kind="integer", limits=(1, 128), metavar="T", converts=True,
    help="A lightfield has T x T views.  [default: 10 P, as far as they fit]",
)  # fmt: skip
_TITLES = {"cabral": "Cabral", "kautz-mccool": "Kautz-McCool", "lightfield": "light field"}
_OFFERED = ("cabral",)
_OWN = {"kautz-mccool": (_SLICES,), "lightfield": (_VIEWS,)}
_STEPS = tuple({"eps": eps} for eps in (0.3, 0.1, 0.03, 0.01, 0.003))
_FORM = Option(
    "form", kind="choice", choices=("sh", "zh3", "zh3-channel", "zh3-hallucinated"), converts=True,
    default="sh",
    help="irradiance: all coefficients (sh), or linear ones and a zonal one of degree 2, about "
    "their luminance's axis (zh3), each channel's own, or guessed.  [default: sh]",
)  # fmt: skip
_P, _Q = vocabulary.DEFAULT_FACTOR_ORDERS
_LOW, _HIGH = vocabulary.DEFAULT_FITTED_ROUGHNESS
_ORDERS = (0, vocabulary.MAX_EXPONENTIAL_ORDER)

_TAPS = tuple(map(str, sorted({*vocabulary.EVEN_TAP_COUNTS, *vocabulary.TAP_COUNTS})))
DESCRIPTIONS = {
    "shrm": Representation(
        "shrm",
        "SHRM",
        (BRDF_ARGUMENTS - {"domain", "source_height"}) | CUBE_ARGUMENTS,
        (
            Option(
                "split", kind="switch",
                help="Prefilter diffuse and glossy terms each about its own centre.  "
                "[default: by count]",
            ),
            Option(
                "compress", kind="components", converts=True,
                help="Keep K principal components of an SHRM, or as many as an error X needs. From "
                "a probe, --to principal is better.",
            ),
            SHADER,
            TEXTURES,
        ),
        searched=frozenset(("eps", "order_f", "order_p", "split")),
        mark=("#0072b2", "s"),
    ),
    **{
        name: Representation(
            name,
            _TITLES.get(name, name),
            _EXPLICIT_TAKES,
            (*_OWN.get(name, ()), SHADER, TEXTURES),
            steps=_STEPS,
            searched=frozenset(("order_p",)),
            is_offered=name in _OFFERED,
            mark=("#e69f00", "v"),
        )
        for name, module in vocabulary.REPRESENTATIONS.items()
        if module.startswith("explicit.")
    },
    "irradiance": Representation(
        "irradiance",
        "irradiance",
        CUBE_ARGUMENTS | {"order_f", "error"},
        (WINDOW, _FORM, SHADER),
        why_no_brdf="irradiance is that of a white Lambertian surface",
        own_defaults={"order_f": 2},  # nine coefficients
        steps=tuple({"order_f": order} for order in (1, 2, 4, 6, 8)),  # cosines lack odd degrees
        is_offered=True,
        mark=("#56b4e9", "P"),
    ),
    "splitsum": Representation(
        "splitsum",
        "split sum",
        CUBE_ARGUMENTS | {"brdf", "error"},
        (
            Option("levels", "splitsum: how many, or the roughness of each.", "levels"),
            Option(
                "mapping", kind="choice", choices=vocabulary.LEVEL_MAPPINGS, default="linear",
                help="splitsum: how roughness rises with the level.  [default: linear]",
            ),
            SHADER,
            TEXTURES,
            Option(
                "anisotropy", kind="switch", prints=True,
                help="splitsum, with --shader: print shrm_brushed(n, t, v, roughness, anisotropy, "
                "f0) too, of brushed GGX.",
            ),
            Option(
                "taps", kind="choice", choices=_TAPS, prints=True,
                help="splitsum, with --shader: print shrm_even(n, v, roughness, f0) too, by 1, 2 "
                "or 3 look-ups where the lobe lies; or those of --anisotropy, 3, 5 or 8.  "
                f"[default with --anisotropy: {vocabulary.DEFAULT_TAPS}]",
            ),
            Option(
                "mips", kind="switch", default=False,
                help="splitsum: sizes that halve from level to level, down to one texel.  "
                "[default: from the orders]",
            ),
        ),
        why_no_brdf="a split sum is of GGX, unless a BRDF is given",
        is_offered=True,
        mark=("#009e73", "^"),
    ),
    "principal": Representation(
        "principal",
        "principal functions",
        (BRDF_ARGUMENTS - {"order_p", "order_f", "domain", "source_height", "frame"})
        | CUBE_ARGUMENTS
        | {"error", "seen"},
        (
            Option(
                "maps", kind="integer", limits=(1, vocabulary.MAX_PRINCIPAL_MAPS), metavar="K",
                help="principal: the K cubes that hold the most light.  [default: from --seen]",
            ),
            Option(
                "divide", kind="switch", default=False,
                help="principal: divide by the directional albedo, which the file then holds.",
            ),
            SHADER,
            TEXTURES,
        ),
        own_defaults={"max_size": vocabulary.DEFAULT_MAX_SIZE},
        instead_of_seen=frozenset(("eps", "error", "maps")),
        searched=frozenset(("eps", "maps")),
        mark=("#d55e00", "o"),
    ),
    "product": Representation(
        "product",
        "product texture",
        frozenset(("brdf", "error")),
        (
            Option(
                "order", kind="integer", limits=(0, vocabulary.MAX_PRODUCT_ORDER),
                default=vocabulary.DEFAULT_PRODUCT_ORDER,
                help="product: largest degree of the light's harmonics.  "
                f"[default: {vocabulary.DEFAULT_PRODUCT_ORDER}]",
            ),
            Option(
                "texels", kind="integer", limits=(8, vocabulary.MAX_PRODUCT_SIZE),
                default=vocabulary.DEFAULT_PRODUCT_SIZE,
                help="product: texels along the edge of the parabolic map of views.  "
                f"[default: {vocabulary.DEFAULT_PRODUCT_SIZE}]",
            ),
            WINDOW,
            SHADER,
            TEXTURES,
        ),
        steps=tuple({"order": order} for order in (2, 4, 6, 8, 10, 14)),
    ),
    "she": Representation(
        "she",
        "SH exponential",
        frozenset(("error",)),
        (
            Option(
                "p_order", kind="integer", limits=_ORDERS, default=_P,
                help=f"she: order of P, over R.  [default: {_P}]",
            ),
            Option(
                "q_order", kind="integer", limits=_ORDERS, default=_Q,
                help=f"she: order of Q, over (R + N) / |R + N|.  [default: {_Q}]",
            ),
            Option(
                "roughness", kind="interval", limits=(vocabulary.MIN_ROUGHNESS, 1),
                default=vocabulary.DEFAULT_FITTED_ROUGHNESS,
                help=f"she: perceptual roughness to fit it to.  [default: {_LOW:g}..{_HIGH:g}]",
            ),
            Option(
                "law", kind="choice", choices=vocabulary.LAWS, default="lobe",
                help="she: attenuation after GGX's lobe, or as published.  [default: lobe]",
            ),
            SHADER,
            TEXTURES,
        ),
        why_no_brdf="an SH exponential is of GGX",
        steps=tuple({"p_order": p, "q_order": q} for p, q in ((2, 1), (4, 2), (6, 4), (8, 6))),
        is_offered=True,
        mark=("#cc79a7", "D"),
    ),
}  # fmt: skip
"""The description of each representation."""


def _installed() -> Any:
    """Load the module of forms of installed packages, which few runs need."""
    from shrm_cli.maps import installed

    return installed


def module(representation: str, name: str) -> Any:
    """Load a module of a representation's folder, such as ``file``.

    `representation` is one of `vocabulary.REPRESENTATIONS`, or a form of an installed package.
    `name` is one of the names that the docstring of `shrm_cli.maps.base` lists.
    """
    if representation not in vocabulary.REPRESENTATIONS:
        return _installed().module(representation, name)
    folder = vocabulary.REPRESENTATIONS[representation].partition(".")[0]
    return importlib.import_module(f"shrm_cli.maps.{folder}.{name}")


def map_class(representation: str) -> "type[Map]":
    """Return the class of the maps of a representation."""
    if representation in vocabulary.REPRESENTATIONS:
        defining = importlib.import_module(
            f"shrm_cli.maps.{vocabulary.REPRESENTATIONS[representation]}"
        )
    else:
        defining = _installed().home(representation)
    for candidate in vars(defining).values():
        if isinstance(candidate, type) and candidate.__module__ == defining.__name__:
            named: type[Map] = candidate
            if getattr(named, "representation", None) == representation:
                return named
    raise PluginError(
        f"{defining.__name__} has no class of maps of representation {representation!r}; write one"
    )


def description(representation: str) -> Representation:
    """Return the description of a representation; ``auto`` has one too, though it is none."""
    if representation == vocabulary.AUTO:
        return AUTOMATIC
    if representation in DESCRIPTIONS:
        return DESCRIPTIONS[representation]
    return _installed().description(representation)


def checked(to: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments as the makers of a representation take them.

    One that is None, or that nobody knows, stays as it is.
    """
    known = {**SHARED, **{each.name: each for each in description(to).options}}
    return {
        name: value if value is None or name not in known else known[name].checked(value)
        for name, value in given.items()
    }


def is_known(representation: str) -> bool:
    """Tell whether there is such a representation, in `shrm` or in an installed package."""
    return representation in vocabulary.REPRESENTATIONS or representation in installed_names()


def installed_names() -> list[str]:
    """Return the names of forms of installed packages; none is loaded."""
    return _installed().names()


def names() -> list[str]:
    """Return the names of all representations, those of installed packages last."""
    return [*vocabulary.REPRESENTATIONS, *installed_names()]


def sources(representation: str) -> str:
    """Return the fingerprint of all code that makes the maps of a representation."""
    from shrm_cli.sources import fingerprint, fingerprint_with  # which --help does not need

    if representation in (vocabulary.AUTO, *vocabulary.REPRESENTATIONS):
        return fingerprint()
    return fingerprint_with(_installed().home(representation).__name__)


def descriptions(*more: str) -> dict[str, Representation]:
    """Return the descriptions of all representations of `shrm`, in the order of the vocabulary.

    `*more` holds representations whose descriptions come after them, such as those of installed
    packages.
    """
    return {name: description(name) for name in dict.fromkeys((*vocabulary.REPRESENTATIONS, *more))}


def unconverted(source: "Map", to: str, **options: Any) -> "Map":
    """Return a map of a form that nothing else becomes, which no option changes."""
    if source.representation != to:
        why = f"it is made from the probe, by shrm prefilter PROBE --to {to}"
        raise ArgumentError("to", f"{to} does not apply to {source.what}; {why}")
    refuse_arguments(f"a map of representation {to}", **options)
    return source
