"""The syntax that names a BRDF on the command line.

A specification is one of

- the name of a model, ``NAME`` or ``NAME:key=value,key=value``,
- a class in a Python file of one's own, ``path/to/mine.py:Mine`` or with ``:key=value`` after it,
- the path of a measured file,
- a material in a file of MaterialX or glTF, ``material.mtlx`` or ``asset.glb#name``,
- a sum of these, such as ``0.5*lambertian+0.5*ggx``.

A value is a number, a color (one number, ``1/0.78/0.34`` or a name such as ``gold``), the name of a
choice, or a specification in parentheses.
"""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from shrm_cli.brdf import library
from shrm_cli.brdf.base import Brdf, nested_texts
from shrm_cli.brdf.sums import is_sum, parse_sum, term_texts
from shrm_cli.color import Primaries
from shrm_cli.errors import ArgumentError, BrdfError
from shrm_cli.messages import shown

if TYPE_CHECKING:
    from shrm_cli.brdf.python_file import FileTerm

AnyBrdf = Brdf | str | os.PathLike[str]
"""What stands for a BRDF: itself, its specification, or the path of its file."""

_MATERIAL = re.compile(r"([^=]+?\.(?:mtlx|gltf|glb))(?:#(.*))?", re.IGNORECASE | re.DOTALL)


def parse_spec(
    spec: str | os.PathLike[str], *, run_code: bool = True, primaries: Primaries | None = None
) -> Brdf:
    """The BRDF that a specification such as ``microfacet:sigma=0.1`` names.

    Parameters
    ----------
    spec : str
        Or the path of a file, as path-like.
    run_code : bool
        Whether it may name a Python file, which is run. It must not where the specification
        comes out of a manifest; what a map records is read by `library.parse_recorded`.
    primaries : sequence of 8 float, optional
        The probe's chromaticities, which the colors of metals are converted to. They are those of
        Rec.709 by default.

    Raises
    ------
    BrdfError
        If the model or a parameter is unknown, malformed, repeated or out of its range, or a
        file cannot be used.

    Examples
    --------
    >>> shrm.parse_spec("ggx:roughness=0.4").number("roughness")
    0.4
    """
    if not isinstance(spec, str | os.PathLike):
        raise BrdfError(f"{spec!r:.80} is no specification; give text such as 'ggx:roughness=0.4'")
    spec = os.fspath(spec)

    def parse(term: str) -> Brdf:
        return parse_spec(term, run_code=run_code, primaries=primaries)

    if not _is_one_file(spec) and is_sum(spec):
        return parse_sum(spec, parse)
    place = material_place(spec)
    if place is not None:
        from shrm_cli.brdf.imported.file import open_material  # few runs need it

        return open_material(*place, primaries)
    if names_file(spec):
        from shrm_cli.brdf.measured import open_measured  # it is slow to load

        return open_measured(Path(spec))
    term = _python_term(spec)
    if term is None:
        return library.of_model(spec, primaries, parse)
    if not run_code:
        raise BrdfError(f"{spec!r}: names code, which is run only where you name it yourself")
    from shrm_cli.brdf.foreign import make_checked
    from shrm_cli.brdf.python_file import load_model

    model = load_model(term)
    if model.name in library.built_in_names() and not library.is_built_in(model):
        raise BrdfError(
            f"{term.path}: {term.name} calls itself {model.name!r}, as a model of shrm does; "
            "give it another name"
        )
    values = {} if term.values is None else library.given_values(spec, term.values)
    return make_checked(model, values, f"{term.path}: {term.name}")


def as_brdf(brdf: AnyBrdf, primaries: Primaries | None = None) -> Brdf:
    """A BRDF from itself, or from its specification or its file, as `parse_spec` takes them.

    What is not of `shrm` is checked as that of a specification is.
    """
    if isinstance(brdf, Brdf):
        library.check_given(brdf)
        return brdf
    if not isinstance(brdf, str | os.PathLike):
        raise ArgumentError("brdf", f"{brdf!r:.80} is neither a BRDF nor the specification of one")
    return parse_spec(brdf, primaries=primaries)


def material_place(spec: str) -> tuple[Path, str] | None:
    """The file and the material's name that a specification is; None if it is no such one."""
    found = _MATERIAL.fullmatch(spec.strip())
    return None if found is None else (Path(found[1]), (found[2] or "").strip())


def names_file(spec: str) -> bool:
    """Whether a specification is the path of a file rather than the name of a model.

    It is where no model has that name, and the file exists or the text looks like a path: it has
    a folder, or the suffix of a measured file.
    """
    name, _, rest = spec.strip().partition(":")
    if name in library.built_in_names() or _python_term(spec) is not None:
        return False
    if material_place(spec) is not None:
        return True
    path = Path(spec)
    if os.path.isfile(path):
        return len(path.parts) > 1 or name not in library.model_names()
    if "=" in rest:
        return False
    return len(path.parts) > 1 or _is_measured_suffix(path.suffix.lower())


def named_files(spec: str) -> list[Path]:
    """The files that a specification names: what must not be overwritten."""
    found = []
    for part in [spec] if _is_one_file(spec) else term_texts(spec):
        term, place = _python_term(part), material_place(part)
        path = term.path if term is not None else Path(part) if place is None else place[0]
        if os.path.isfile(path):
            found.append(path)
        else:
            found += [file for text in nested_texts(part) for file in named_files(text)]
    return found


def file_label(spec: str) -> str:
    """A specification within a file name.

    ``phong:exponent=32`` is ``phong-exponent-32``, ``measured/paint.brdf`` is ``paint``, and
    ``mine.py:Mine:k=2`` is ``Mine-k-2``. Of a URL, which names none, it has no password either.
    """
    text, term = shown(spec.strip()), _python_term(spec)
    if term is not None and (_is_one_file(spec) or not is_sum(spec)):
        text = term.label
    elif names_file(spec) and not is_sum(spec):
        path, name = material_place(spec) or (Path(spec), "")
        text = f"{path.stem}-{name}" if name else path.stem
    return "".join(c if c.isalnum() or c in "._+" else "-" for c in text)


def _python_term(spec: str) -> "FileTerm | None":
    """The Python file that a term names; models of `shrm` come first, whatever their values."""
    if spec.strip().partition(":")[0] in library.built_in_names():
        return None
    from shrm_cli.brdf.python_file import file_term  # most runs do not need it

    return file_term(spec)


def _is_one_file(spec: str) -> bool:
    """Whether a specification is as a whole a file that exists, though it may hold a ``+``."""
    term, place = _python_term(spec), material_place(spec)
    is_code = term is not None and term.is_there and not is_sum(term.label)
    return is_code or os.path.isfile(spec if place is None or is_sum(place[1]) else place[0])


def is_measured_file(name: str) -> bool:
    """Tell whether a file has a name that only measured BRDFs have, and no image."""
    suffix = Path(name).suffix.lower()
    # Tables are images or archives, and are told from others by their content.
    return suffix not in (".exr", ".npz") and os.path.isfile(name) and _is_measured_suffix(suffix)


def _is_measured_suffix(suffix: str) -> bool:
    if not suffix:
        return False
    from shrm_cli.brdf.measured import formats  # it is slow to load

    return any(suffix in each.suffixes for each in formats())
