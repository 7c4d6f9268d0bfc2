"""The syntax that names a BRDF on the command line: ``NAME`` or ``NAME:key=value,key=value``."""

import math

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lambertian import Lambertian
from shrm_cli.brdf.microfacet import Microfacet
from shrm_cli.brdf.phong import Phong
from shrm_cli.errors import BrdfError

MODELS: dict[str, type[Brdf]] = {model.name: model for model in (Lambertian, Phong, Microfacet)}


def find_model(name: str) -> type[Brdf]:
    """The model of that name.

    Raises
    ------
    BrdfError
        If there is none; names that look like it are suggested.
    """
    if name in MODELS:
        return MODELS[name]
    import difflib  # slow to load, and rarely needed

    near = difflib.get_close_matches(name.lower(), MODELS, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(MODELS)}"
    raise BrdfError(f"no BRDF is called {name!r}; {hint}")


def parse_spec(spec: str) -> Brdf:
    """The BRDF that a specification such as ``microfacet:sigma=0.1`` names.

    Raises
    ------
    BrdfError
        If the model or a parameter is unknown, malformed, repeated or out of its range.
    """
    name, colon, rest = spec.strip().partition(":")
    model = find_model(name)
    values: dict[str, float] = {}
    for part in rest.split(",") if colon else []:
        key, equals, text = (piece.strip() for piece in part.partition("="))
        if not equals or not key:
            raise BrdfError(f"{spec!r}: expected key=value, got {part!r}")
        if key in values:
            raise BrdfError(f"{spec!r}: {key} is given twice")
        values[key] = _number(spec, key, text)
    return model(**values)


def _number(spec: str, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BrdfError(f"{spec!r}: {key}={text} is not a number")
    return value


def file_label(spec: str) -> str:
    """A specification within a file name: ``phong:exponent=32`` is ``phong-exponent-32``."""
    return "".join(c if c.isalnum() or c in "._+" else "-" for c in spec.strip())
