"""BRDFs whose code is not of this package: checked first, so that each mistake is one clear line.

They come from a file that the user names, or from an installed package.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shrm_cli.brdf.base import Brdf, Parameter, Value
from shrm_cli.errors import BrdfError
from shrm_cli.vocabulary import CENTERS

# They lie along the normal, slanting, grazing, opposite each other, and below the surface.
_DIRECTIONS = np.array(
    [[0, 0, 1], [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0.96, 0.28], [1, 0, 0], [0.6, 0, -0.8]]
)


def checked_model(found: object, where: str) -> type[Brdf]:
    """What a file or a package calls a BRDF, if it is one.

    Parameters
    ----------
    found : object
        What has the name that the user gave.
    where : str
        Where it is, for the messages: ``mine.py: Mine``.

    Raises
    ------
    BrdfError
        If it is no subclass of `Brdf`, lacks `evaluate`, or says impossible things of itself.
    """
    if not (isinstance(found, type) and issubclass(found, Brdf)):
        raise BrdfError(f"{where} is not a subclass of Brdf; make it one")
    if getattr(found, "__abstractmethods__", None):
        raise BrdfError(f"{where} has no method evaluate(self, light, view); write one")
    if found.center not in CENTERS:
        raise BrdfError(f"{where} has the center {found.center!r}; known: {', '.join(CENTERS)}")
    if not all(isinstance(each, Parameter) for each in found.parameters):
        raise BrdfError(f"{where} has parameters that are no Parameter(name, default, ...)")
    texts = {"name": found.name, "summary": found.summary, "source": found.source}
    for key, text in texts.items():
        if not isinstance(text, str):
            raise BrdfError(f"{where} has a {key} that is no text")
    return found


def make_checked(model: type[Brdf], values: Mapping[str, Value], where: str) -> Brdf:
    """An instance of a foreign model, evaluated once at a few directions.

    Raises
    ------
    BrdfError
        If making or evaluating it fails, or what it returns is not what `Brdf.evaluate` should.
    """
    try:
        brdf = model(**values)
    except BrdfError:
        raise
    except Exception as error:
        raise BrdfError(f"{where} cannot be made: {explained(error)}") from error
    if not isinstance(getattr(brdf, "values", None), dict):
        raise BrdfError(f"{where} has an __init__ that lacks super().__init__(**values)")
    for dtype in (np.float64, np.float32):
        directions = _DIRECTIONS.astype(dtype)
        _try(brdf, directions[:, None], directions, where)
        _try(brdf, directions, directions[1], where)
    return brdf


def explained(error: BaseException, path: Path | None = None) -> str:
    """An error of foreign code in one line, with the last line of the file that took part in it."""
    import traceback  # slow to load, and rarely needed

    words = f"{type(error).__name__}: {error}".rstrip(": ")
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if path is not None and frame.filename == str(path)]
    place = f"line {lines[-1]}: " if lines else ""
    return place + " ".join(words.split())


def _try(brdf: Brdf, light: np.ndarray, view: np.ndarray, where: str) -> None:
    try:
        with np.errstate(all="ignore"):  # what is not finite is found where it matters
            value: object = brdf.evaluate(light, view)
    except Exception as error:
        raise BrdfError(f"{where} cannot be evaluated: {explained(error)}") from error
    expected = np.broadcast_shapes(light.shape, view.shape)
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f":
        kind = f"{value.dtype} numbers" if isinstance(value, np.ndarray) else f"{value!r:.40}"
        raise BrdfError(f"{where}: evaluate() returns {kind}, not an array of floats")
    if value.shape != expected:
        raise BrdfError(
            f"{where}: evaluate() returns the shape {value.shape} for light {light.shape} and "
            f"view {view.shape}; it must be {expected}"
        )
