"""The syntax that names a BRDF on the command line.

A specification is one of

- the name of a model, ``NAME`` or ``NAME:key=value,key=value``,
- a class in a Python file of one's own, ``path/to/mine.py:Mine`` or with ``:key=value`` after it,
- the path of a measured file,
- a sum of these, such as ``0.5*lambertian+0.5*ggx``.

A value is a number, a color (one number, ``1/0.78/0.34`` or a name such as ``gold``), or the name
of a choice.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.addresses import shown
from shrm_cli.brdf.base import Brdf, Value
from shrm_cli.brdf.library import built_in_names, find_model, is_built_in, model_names
from shrm_cli.brdf.sums import is_sum, parse_sum, term_texts
from shrm_cli.color import Primaries, from_rec709
from shrm_cli.errors import BrdfError

if TYPE_CHECKING:
    from shrm_cli.brdf.python_file import FileTerm


def parse_spec(spec: str, *, run_code: bool = True, primaries: Primaries | None = None) -> Brdf:
    """The BRDF that a specification such as ``microfacet:sigma=0.1`` names.

    Parameters
    ----------
    spec : str
    run_code : bool
        Whether it may name a Python file, which is run. It must not where the specification
        comes out of a manifest; what a map records is read by `parse_recorded`.
    primaries : sequence of 8 float, optional
        The probe's chromaticities, which the colors of metals are converted to. They are those of
        Rec.709 by default.

    Raises
    ------
    BrdfError
        If the model or a parameter is unknown, malformed, repeated or out of its range, or a
        file cannot be used.
    """
    if not _is_one_file(spec) and is_sum(spec):
        return parse_sum(
            spec, lambda term: parse_spec(term, run_code=run_code, primaries=primaries)
        )
    if names_file(spec):
        from shrm_cli.brdf.measured import open_measured  # it is slow to load

        return open_measured(Path(spec))
    term = _python_term(spec)
    if term is None:
        return _of_model(spec, primaries)
    if not run_code:
        raise BrdfError(f"{spec!r}: names code, which is run only where you name it yourself")
    from shrm_cli.brdf.python_file import load_model, make_checked

    model = load_model(term)
    if model.name in built_in_names() and not is_built_in(model):
        raise BrdfError(
            f"{term.path}: {term.name} calls itself {model.name!r}, as a model of shrm does; "
            "give it another name"
        )
    values = {} if term.values is None else _values(spec, term.values)
    return make_checked(model, values, f"{term.path}: {term.name}")


def parse_recorded(
    spec: str, open_file: Callable[[str], Brdf | None], primaries: Primaries | None = None
) -> Brdf:
    """The BRDF of a specification that a file records, which may come from anywhere.

    No part of it is taken for a path, and none for code: terms are names of models, or whatever
    the caller knows to be files.

    Parameters
    ----------
    spec : str
    open_file : callable
        Returns the measured BRDF that a term stands for, or None where it is the name of a model.
    primaries : sequence of 8 float, optional
        As of `parse_spec`.

    Raises
    ------
    BrdfError
        As of `parse_spec`.
    """
    if is_sum(spec):
        return parse_sum(spec, lambda term: parse_recorded(term, open_file, primaries))
    found = open_file(spec.strip())
    return _of_model(spec, primaries) if found is None else found


def _of_model(spec: str, primaries: Primaries | None) -> Brdf:
    """The BRDF of a model that has a name, and of the values after it."""
    name, colon, rest = spec.strip().partition(":")
    model = find_model(name)
    values = _values(spec, rest) if colon else {}
    values = {key: _converted(model, key, each, primaries) for key, each in values.items()}
    if is_built_in(model):
        return model(**values)
    from shrm_cli.brdf.python_file import make_checked

    return make_checked(model, values, name)


def names_file(spec: str) -> bool:
    """Whether a specification is the path of a measured file rather than the name of a model.

    It is where no model has that name, and the file exists or the text looks like a path: it has
    a folder, or the suffix of a measured file.
    """
    name, _, rest = spec.strip().partition(":")
    if name in built_in_names() or _python_term(spec) is not None:
        return False
    path = Path(spec)
    if os.path.isfile(path):
        return len(path.parts) > 1 or name not in model_names()
    if "=" in rest:
        return False
    return len(path.parts) > 1 or _is_measured_suffix(path.suffix.lower())


def named_files(spec: str) -> list[Path]:
    """The files that a specification names: what must not be overwritten."""
    found = []
    for part in [spec] if _is_one_file(spec) else term_texts(spec):
        term = _python_term(part)
        path = Path(part) if term is None else term.path
        if os.path.isfile(path):
            found.append(path)
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
        text = Path(spec).stem
    return "".join(c if c.isalnum() or c in "._+" else "-" for c in text)


def _python_term(spec: str) -> "FileTerm | None":
    """The Python file that a term names; models of `shrm` come first, whatever their values."""
    if spec.strip().partition(":")[0] in built_in_names():
        return None
    from shrm_cli.brdf.python_file import file_term  # most runs do not need it

    return file_term(spec)


def _is_one_file(spec: str) -> bool:
    """Whether a specification is as a whole a file that exists, though it may hold a ``+``."""
    term = _python_term(spec)
    is_code = term is not None and term.is_there and not is_sum(term.label)
    return is_code or os.path.isfile(spec)


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


def _values(spec: str, text: str) -> dict[str, Value]:
    """The values of ``key=value,key=value``."""
    values: dict[str, Value] = {}
    for part in text.split(","):
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not key:
            raise BrdfError(f"{spec!r}: expected key=value, got {part!r}")
        if key in values:
            raise BrdfError(f"{spec!r}: {key} is given twice")
        values[key] = _value(value)
    return values


def _converted(model: type[Brdf], key: str, value: Value, primaries: Primaries | None) -> Value:
    """A value, or, where it is the name of a color, that color in the probe's primaries."""
    matrix = from_rec709(primaries)
    for parameter in model.parameters if matrix is not None and isinstance(value, str) else ():
        if parameter.name == key and value in parameter.names:
            color = matrix @ np.asarray(parameter.names[str(value)])
            return [float(each) for each in np.clip(color, parameter.minimum, parameter.maximum)]
    return value


def _value(text: str) -> Value:
    """A number, the numbers between slashes, or the text itself; the parameter judges it."""
    try:
        numbers = [float(part) for part in text.split("/")]
    except ValueError:
        return text
    return numbers if len(numbers) > 1 else numbers[0]
