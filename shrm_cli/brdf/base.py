"""The base class of all BRDFs: what each answers, and what each states about itself.

A value that is a BRDF stands in parentheses: ``coated:base=(0.5*lambertian+0.5*ggx),ior=1.4``.
Nothing in them takes part in what is outside: a comma or a plus there ends neither the value nor
the term.

Sections and equations with a number 5.x are those of Ramamoorthi's thesis, "A Signal-Processing
Framework for Forward and Inverse Rendering" (2002).
"""

import copy
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from functools import reduce, wraps
from operator import add, mul
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import BrdfError
from shrm_cli.messages import explained
from shrm_cli.records import record
from shrm_cli.sphere.directions import as_vectors
from shrm_cli.vocabulary import Center

Color = tuple[float, float, float]

Value = float | Sequence[float] | str
"""What `Brdf.values` holds and a constructor takes: a number, a color's channels, or a name."""


@record
class Parameter:
    """A parameter of a model: a number, a color, a choice of names or a BRDF, as its default is.

    Attributes
    ----------
    name : str
    default : float, tuple of 3 floats (linear RGB) or str
        The value of the parameter where a specification leaves it out. A text without choices is
        the specification of a BRDF, in parentheses.
    minimum, maximum : float
        The closed range of a number, and of each channel of a colour.
    meaning : str
        What it does, in a few words, as `shrm brdf` prints them.
    names : mapping of str to tuple of 3 floats
        The colors that may be given by name.
    choices : tuple of str
        The values of a choice.
    follows : str
        The name of an earlier parameter whose value this one takes, instead of its default,
        where it is left out.
    is_optional : bool
        Whether `Brdf.values` holds the parameter only where it is given.

    Examples
    --------
    >>> class Shiny(shrm.Brdf):
    ...     '''A lobe about the mirror direction.'''
    ...     parameters = (shrm.Parameter("n", 8.0, 1.0, 64.0, "the exponent"),)
    >>> Shiny.parameters[0].default
    8.0
    """

    name: str
    default: float | Color | str
    minimum: float = 0.0
    maximum: float = 1.0
    meaning: str = ""
    names: Mapping[str, Color] = field(default_factory=dict)
    choices: tuple[str, ...] = ()
    follows: str = ""
    is_optional: bool = False

    @property
    def is_brdf(self) -> bool:
        """Whether the values are BRDFs, of which `Brdf.values` holds the specifications."""
        return isinstance(self.default, str) and not self.choices

    @property
    def domain(self) -> str:
        """The values that are allowed, in words: ``0 .. 1`` or ``skin, clay or felt``."""
        if self.choices:
            return _either(self.choices)
        if self.is_brdf:
            return "a BRDF in parentheses"
        span = f"{self.minimum:g} .. {self.maximum:g}"
        if not isinstance(self.default, tuple):
            return span
        return f"{span} or R/G/B" + (f" or {_either(tuple(self.names))}" if self.names else "")

    @property
    def default_text(self) -> str:
        """The default, written as in a specification."""
        return f"that of {self.follows}" if self.follows else value_text(self.default)

    def checked(self, value: object) -> Value:
        """A value as `Brdf.values` holds it: a float, a list of 3 floats, or a name.

        A grey color becomes one number, however it is given.

        Raises
        ------
        BrdfError
            If the value is of another kind than the default, or outside the range.
        """
        if self.choices:
            if value not in self.choices:
                hint = suggestion(str(value), self.choices)
                raise BrdfError(f"{self.name}={value_text(value)} is unknown; {hint}")
            return str(value)
        if self.is_brdf:
            return f"({inside(self.name, value)})"
        if isinstance(self.default, tuple):
            return self._checked_color(value)
        return self._checked_number(value, value)

    def _checked_color(self, value: object) -> Value:
        if isinstance(value, str) and value in self.names:
            value = self.names[value]
        elif isinstance(value, str) and self.names and value:
            hint = suggestion(value, tuple(self.names))
            raise BrdfError(f"{self.name}={value} is neither a colour nor the name of one; {hint}")
        is_list = isinstance(value, Sequence) and not isinstance(value, str)
        channels = list(value) if is_list else [value] * 3  # type: ignore[call-overload]
        if len(channels) != 3:
            raise BrdfError(
                f"{self.name}={value_text(value)} has {len(channels)} channels; give R/G/B"
            )
        red, green, blue = (self._checked_number(channel, value) for channel in channels)
        return red if red == green == blue else [red, green, blue]

    def _checked_number(self, number: object, whole: object) -> float:
        is_number = isinstance(number, int | float | np.number) and not isinstance(number, bool)
        if not is_number or not math.isfinite(number):  # type: ignore[arg-type]
            raise BrdfError(f"{self.name}={value_text(whole)} is not a number")
        found = float(number)  # type: ignore[arg-type]
        if not self.minimum <= found <= self.maximum:
            raise BrdfError(
                f"{self.name}={value_text(whole)} is outside {self.minimum:g} .. {self.maximum:g}"
            )
        return found


class Brdf(ABC):
    """A reflection model. A subclass is one model; an instance has its parameters set.

    Attributes
    ----------
    name, summary, source : str
        What specifications call the model, what it is in one line, and where it was published;
        `shrm brdf` prints them. By default the name is that of the class in lower case, and the
        summary the first line of its docstring.
    parameters : tuple of Parameter
        What a constructor takes; none by default.
    values : dict
        The values of the parameters: numbers (also for grey colors), lists of 3 numbers (linear
        RGB) and names. JSON can hold them, and ``type(brdf)(**values)`` is the same model. Those
        of sums and of weighted BRDFs are ``spec``, which `parse_spec` makes the same of; what is
        measured is its file alone.
    center : {"reflection", "normal", "tangent"}
        The central direction C, about which the BRDF is expanded and by which a map of it is
        looked up (section 5.3.1 of the thesis): the mirror direction of the view, the normal,
        or the tangent.
    includes_cosine : bool
        Whether `evaluate` returns the transfer function rho_hat, which includes the cosine of
        the light's angle, rather than the BRDF f_r.
    has_horizon : bool
        Whether light from below the surface (N.L <= 0) is cut off. Phenomenological lobes about
        the mirror direction, such as Phong's, go on there.
    zonal : bool
        Whether rho_hat depends on the angle between C and the light alone, and is zero beyond
        90 degrees (the "radially symmetric" BRDFs of section 5.3.1 of the thesis).
    isotropic : bool
        Whether turning light and view together about the normal changes nothing. Anisotropic
        BRDFs can be evaluated, and prefiltered as principal maps and product textures, but in no
        other form.
    roughness_names : tuple of str
        The parameters that are the roughness of the model, all of which `at_roughness` sets.
    roughness_power : float
        Which power of the perceptual roughness they are, which is what engines have between 0 and
        1: 2 where they are GGX's alpha, or like it.

    Examples
    --------
    >>> class Grey(shrm.Brdf):
    ...     '''Half of the light, evenly.'''
    ...     center = "normal"
    ...     def evaluate(self, light, view):
    ...         return np.full((*np.broadcast_shapes(light.shape, view.shape)[:-1], 3), 0.5 / np.pi)
    >>> made = shrm.prefilter("probes/furnace.exr", Grey())
    >>> made.radiance([0, 1, 0], [0, 0, 1]).round(2).tolist()
    [0.5, 0.5, 0.5]
    """

    name: str
    summary: str = ""
    source: str = "not stated"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    center: Center = "reflection"
    includes_cosine: bool = False
    has_horizon: bool = True
    zonal: bool = False
    isotropic: bool = True
    roughness_names: ClassVar[tuple[str, ...]] = ("roughness",)
    roughness_power: ClassVar[float] = 1.0
    values: dict[str, Value]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        own = vars(cls)
        if "name" not in own:
            cls.name = cls.__name__.lower()
        if "summary" not in own and cls.__doc__:
            cls.summary = cls.__doc__.strip().partition("\n")[0]
        if "evaluate" in own:
            cls.evaluate = _of_vectors(own["evaluate"])  # type: ignore[method-assign]

    def __init__(self, **values: Value) -> None:
        known = {parameter.name: parameter for parameter in self.parameters}
        for key in values:
            if key not in known:
                has = ", ".join(known) or "none"
                raise BrdfError(f"{self.name}: unknown parameter {key!r}; it has {has}")
        self.values = {}
        for key, parameter in known.items():
            if parameter.is_optional and key not in values:
                continue
            default = self.values.get(parameter.follows, parameter.default)
            try:
                self.values[key] = parameter.checked(values.get(key, default))
            except BrdfError as error:
                raise BrdfError(f"{self.name}: {error}") from None

    @abstractmethod
    def evaluate(self, light: Array, view: Array) -> Array:
        """Evaluate the BRDF for pairs of directions.

        Parameters
        ----------
        light, view : ndarray, shape (..., 3), broadcastable
            Unit directions to the light and to the viewer, in the frame whose z axis is the
            normal N, or the tangent where `center` is the tangent.

        Returns
        -------
        ndarray, shape (..., 3)
            f_r (1/sr) for linear RGB, or rho_hat where `includes_cosine` is set. Grey models
            return a read-only broadcast view, of which functions here look at one channel only.

        Raises
        ------
        ArgumentError
            If light or view are no vectors, or cannot be broadcast to one shape. Subclasses need
            not check it.
        """

    def transfer(self, light: Array, view: Array) -> Array:
        """Evaluate the transfer function rho_hat: the BRDF times the cosine of the light's angle.

        It is 0 for light from below the surface, unless the BRDF has no horizon. Parameters and
        result are those of `evaluate`.
        """
        light, view = as_vectors(light=light, view=view)
        value = self.evaluate(light, view)
        cosine = light[..., 2]
        if not self.includes_cosine:
            return scaled(value, np.maximum(cosine, 0.0))
        return scaled(value, cosine > 0) if self.has_horizon else value

    def recentered(self, center: Center) -> Self:
        """The same BRDF, to be expanded about another central direction.

        Raises
        ------
        BrdfError
            If one of the centers is the tangent and the other is not: a function of the angles
            to the tangent is not a function of the angles to the normal.
        """
        if center == self.center:
            return self
        if "tangent" in (center, self.center):
            raise BrdfError(
                f"{self.name}: it is defined about the {self.center}, "
                f"and cannot be expanded about the {center}"
            )
        other = copy.copy(self)
        other.center, other.zonal = center, False
        return other

    def with_values(self, **values: Value) -> Self:
        """The same model with some of its parameters changed."""
        return self._remade(values)

    def at_roughness(self, perceptual: float) -> Self:
        """The same material of another roughness.

        Parameters
        ----------
        perceptual : float
            As engines have it, in 0 .. 1. Where the model does not reach it, the nearest roughness
            that it has takes its place.

        Raises
        ------
        BrdfError
            If the model has no parameter of roughness.
        """
        given = [self.values.get(name) for name in self.roughness_names]
        if not all(isinstance(value, int | float) for value in given):
            wanted = " and ".join(self.roughness_names)
            raise BrdfError(
                f"{self!r}: it has no roughness (a number {wanted}), for which split sums have "
                "levels; a principal map holds this one"
            )
        roughness = perceptual**self.roughness_power
        limits = {each.name: (each.minimum, each.maximum) for each in self.parameters}
        found = {
            name: min(max(roughness, limits[name][0]), limits[name][1])
            for name in self.roughness_names
        }
        return self._remade(found)

    def _remade(self, changed: Mapping[str, Value]) -> Self:
        """The same model with some values changed, of which a class of the user's may fail."""
        try:
            return type(self)(**{**self.values, **changed})
        except BrdfError:
            raise
        except (Exception, SystemExit) as error:
            values = ",".join(f"{key}={value_text(value)}" for key, value in changed.items())
            raise BrdfError(
                f"{type(self).__name__} cannot be made with {values}: {explained(error)}"
            ) from error

    @property
    def is_measured(self) -> bool:
        """Whether the BRDF interpolates samples of a file, so that it has kinks and noise."""
        return "sha256" in self.values

    @property
    def is_slow(self) -> bool:
        """Whether evaluating the BRDF takes several times as long as an analytic lobe."""
        return self.is_measured

    def number(self, key: str) -> float:
        """The value of a parameter that is a number."""
        return float(self.values[key])  # type: ignore[arg-type]

    def color(self, key: str) -> Color:
        """The value of a parameter that is a color: linear red, green and blue."""
        value = self.values[key]
        if isinstance(value, int | float):
            return value, value, value
        red, green, blue = (float(channel) for channel in value)
        return red, green, blue

    def __repr__(self) -> str:
        inside = ",".join(f"{key}={value_text(value)}" for key, value in self.values.items())
        return f"{self.name}:{inside}" if inside else self.name


def check_finite(values: ArrayLike, of: Brdf | str) -> None:
    """Raise a `BrdfError` if values of a BRDF, or of what messages call so, are not finite."""
    if not np.isfinite(values).all():
        raise BrdfError(f"{of}: its value is not finite everywhere")


def _of_vectors(evaluate: Callable[[Any, Array, Array], Array]) -> Callable[..., Array]:
    """Return the method of a subclass, which gets vectors, whatever it is called with."""

    @wraps(evaluate)
    def checked(self: Brdf, light: ArrayLike, view: ArrayLike) -> Array:
        try:
            return evaluate(self, *as_vectors(light=light, view=view))
        except SystemExit as error:  # it would end the process as if all were well
            raise BrdfError(f"{self.name}: evaluate() fails: {explained(error)}") from error

    return checked


def value_text(value: object) -> str:
    """A value of a parameter as specifications have it: ``0.3``, ``1/0.78/0.34``, ``skin``.

    Parsing the text gives the same number, to the last bit.
    """
    if isinstance(value, Sequence) and not isinstance(value, str):
        channels = [value_text(channel) for channel in value]
        return channels[0] if len(channels) == 3 and len(set(channels)) == 1 else "/".join(channels)
    if isinstance(value, int | float | np.number):
        short = f"{value:g}"
        return short if float(short) == value else repr(float(value))
    return str(value)


def suggestion(text: str, known: Sequence[str]) -> str:
    """The end of an error about a mistyped name: the known names that resemble it, or all."""
    import difflib  # slow to load, and rarely needed

    lower = text.lower()
    near = [lower] if lower in known else difflib.get_close_matches(lower, known, cutoff=0.5)
    return f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(known)}"


def grey(value: Array) -> Array:
    """View a value of shape (...) as three equal channels, shape (..., 3), without copying it."""
    return np.broadcast_to(value[..., None], (*value.shape, 3))


def scaled(values: Array, factor: Array | NDArray[np.bool_] | np.floating) -> Array:
    """Multiply RGB values (..., 3) by a factor (...); grey values stay a broadcast view."""
    if values.strides[-1] == 0:
        return grey(np.asarray(values[..., 0] * factor))
    return np.asarray(values * np.asarray(factor)[..., None])


def multiplied(*factors: Array) -> Array:
    """Multiply RGB values (..., 3); if all are grey, the product stays a broadcast view."""
    return _once_if_grey(lambda *each: reduce(mul, each), *factors)


def added(values: Sequence[Array]) -> Array:
    """Add RGB values (..., 3); if all are grey, the sum stays a broadcast view."""
    # From 0 on, as of `sum`, a grey value would become triples in memory, and all that follows.
    return _once_if_grey(lambda *each: reduce(add, each), *values)


def excess(values: Array, less: Array) -> Array:
    """Subtract RGB values (..., 3) down to 0; if both are grey, the rest stays a broadcast view."""
    return _once_if_grey(lambda value, part: np.maximum(value - part, 0), values, less)


def _once_if_grey(function: Callable[..., Any], *values: Array) -> Array:
    """Call a function with RGB values (..., 3), or once for all channels if all values are grey.

    What is sampled of grey values takes a third of the time.
    """
    if all(each.strides[-1] == 0 for each in values):
        return grey(np.asarray(function(*(each[..., 0] for each in values))))
    return np.asarray(function(*values))


def _either(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]


COMMA = re.compile(",")
MOST_NESTED = 8
"""The most BRDFs within a term, one in another or beside each other."""
_OPENING = "=("


def masked(text: str) -> str:
    """The text with underscores for all that is in parentheses of values, which keeps its length.

    Parentheses in the names of files follow no equals sign, and are none of these. Where one is not
    closed, the text is left as it is.
    """
    kept, depth = [], 0
    for at, char in enumerate(text):
        if char == "(" and (depth or text[max(at - 1, 0) : at + 1] == _OPENING):
            depth += 1
        kept.append("_" if depth else char)
        if char == ")" and depth:
            depth -= 1
    return text if depth else "".join(kept)


def cut(pattern: re.Pattern[str], text: str) -> Iterator[str]:
    """Cut a text where a pattern is, and not within the parentheses of values."""
    start = 0
    for found in pattern.finditer(masked(text)):
        yield text[start : found.start()]
        start = found.end()
    yield text[start:]


def inside(key: str, value: object) -> str:
    """The specification that a value holds in its parentheses."""
    text = str(value)
    if not (isinstance(value, str) and text.startswith("(") and text.endswith(")")):
        raise BrdfError(f"{key}={text:.40} is no BRDF in parentheses, such as {key}=(lambertian)")
    return text[1:-1]


def nested_texts(term: str) -> list[str]:
    """The specifications that the values of a term hold."""
    values = (part.partition("=")[2].strip() for part in cut(COMMA, term.partition(":")[2]))
    return [value[1:-1] for value in values if value.startswith("(") and value.endswith(")")]


def check_number(spec: str) -> None:
    """Refuse a term with more than `MOST_NESTED` BRDFs in it, which files may claim."""
    if spec.count(_OPENING) > MOST_NESTED:
        raise BrdfError(f"{spec!r:.60}: more than {MOST_NESTED} BRDFs within one")
