"""The syntax that names a BRDF on the command line.

``NAME``, ``NAME:key=value,key=value``, a sum such as ``0.5*lambertian+0.5*ggx``, or the path of a
measured file. A value is a number, a
colour (one number, ``1/0.78/0.34`` or a name such as ``gold``), or the name of a choice.
"""

from pathlib import Path

from shrm_cli.brdf.base import Brdf, Value, suggestion
from shrm_cli.brdf.models.ashikhmin_shirley import AshikhminShirley
from shrm_cli.brdf.models.blinn_phong import BlinnPhong
from shrm_cli.brdf.models.charlie import Charlie
from shrm_cli.brdf.models.cook_torrance import CookTorrance
from shrm_cli.brdf.models.disney_diffuse import DisneyDiffuse
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.models.kajiya_kay import KajiyaKay
from shrm_cli.brdf.models.lafortune import Lafortune
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.brdf.models.microfacet import Microfacet
from shrm_cli.brdf.models.oren_nayar import OrenNayar
from shrm_cli.brdf.models.phong import Phong
from shrm_cli.brdf.models.poulin_fournier import PoulinFournier
from shrm_cli.brdf.models.ward import Ward
from shrm_cli.brdf.sums import is_sum, parse_sum, term_texts
from shrm_cli.errors import BrdfError

_ALL: tuple[type[Brdf], ...] = (
    Lambertian, Phong, Microfacet, OrenNayar, DisneyDiffuse, BlinnPhong, CookTorrance, Ggx, Ward,
    AshikhminShirley, Lafortune, Charlie, KajiyaKay, PoulinFournier,
)  # fmt: skip

MODELS: dict[str, type[Brdf]] = {model.name: model for model in _ALL}

_MEASURED_SUFFIXES = {".binary", ".bsdf", ".brdf", ".csv", ".exr", ".npz", ".dat"}


def find_model(name: str) -> type[Brdf]:
    """The model of that name.

    Raises
    ------
    BrdfError
        If there is none; names that look like it are suggested.
    """
    if name in MODELS:
        return MODELS[name]
    raise BrdfError(f"no BRDF is called {name!r}; {suggestion(name, tuple(MODELS))}")


def parse_spec(spec: str) -> Brdf:
    """The BRDF that a specification such as ``microfacet:sigma=0.1`` names.

    Raises
    ------
    BrdfError
        If the model or a parameter is unknown, malformed, repeated or out of its range, or the
        measured file cannot be read.
    """
    if is_sum(spec) and not Path(spec).is_file():
        return parse_sum(spec, parse_spec)
    if names_file(spec):
        from shrm_cli.brdf.measured.open import open_measured  # it is slow to load

        return open_measured(Path(spec))
    name, colon, rest = spec.strip().partition(":")
    model = find_model(name)
    values: dict[str, Value] = {}
    for part in rest.split(",") if colon else []:
        key, equals, text = (piece.strip() for piece in part.partition("="))
        if not equals or not key:
            raise BrdfError(f"{spec!r}: expected key=value, got {part!r}")
        if key in values:
            raise BrdfError(f"{spec!r}: {key} is given twice")
        values[key] = _value(text)
    return model(**values)


def names_file(spec: str) -> bool:
    """Whether a specification is the path of a measured file rather than the name of a model.

    It is where no model has that name, and the file exists or the text looks like a path: it has
    a folder, or the suffix of a measured file.
    """
    name, _, rest = spec.strip().partition(":")
    if name in MODELS:
        return False
    path = Path(spec)
    looks_like_path = path.suffix.lower() in _MEASURED_SUFFIXES or len(path.parts) > 1
    return path.is_file() or (looks_like_path and "=" not in rest)


def named_files(spec: str) -> list[Path]:
    """The files that a specification names: what must not be overwritten."""
    parts = [spec] if Path(spec).is_file() else term_texts(spec)
    return [Path(part) for part in parts if Path(part).is_file()]


def _value(text: str) -> Value:
    """A number, the numbers between slashes, or the text itself; the parameter judges it."""
    try:
        numbers = [float(part) for part in text.split("/")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else numbers[0]


def file_label(spec: str) -> str:
    """A specification within a file name.

    ``phong:exponent=32`` is ``phong-exponent-32``, ``measured/paint.brdf`` is ``paint``.
    """
    text = Path(spec).stem if names_file(spec) and not is_sum(spec) else spec.strip()
    return "".join(c if c.isalnum() or c in "._+" else "-" for c in text)
