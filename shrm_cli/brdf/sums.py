"""Sums of BRDFs, and the split of other BRDFs into a diffuse and a glossy term."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Self

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Value, added, cut, excess, masked, scaled, value_text
from shrm_cli.errors import BrdfError
from shrm_cli.sphere.directions import from_angles
from shrm_cli.vocabulary import MAX_TERMS

# Directions at which the least value of a BRDF is looked for. They end at 95 % of the way to the
# horizon, where measured data end and models reach their limits.
_ANGLES = 24
_AZIMUTHS = 13
_GRAZING = 0.95
_LARGEST_WEIGHT = 1e30
FILES = "terms"
"""What records have the values of terms under, where these are measured."""
_LEAST_ALBEDO = 0.005  # a smaller Lambertian part is not worth a map of its own


class Sum(Brdf):
    """A weighted sum of BRDFs.

    `terms` are the weights and the terms, two at least. All must be defined about the normal or the
    mirror direction, since a BRDF about the tangent is evaluated in another frame.
    """

    name = "sum"
    summary = "sum of terms"
    source = "its terms"

    def __init__(self, terms: Sequence[tuple[float, Brdf]]) -> None:
        if len(terms) < 2:
            raise BrdfError("a sum has two terms at least")
        for weight, term in terms:
            _check_weight(weight, term)
        self._hold(terms)
        self.values = _record(
            "+".join(f"{value_text(weight)}*{term!r}" for weight, term in terms),
            [term for _, term in terms],
        )

    def _hold(self, terms: Sequence[tuple[float, Brdf]]) -> None:
        """Take the terms, and in the place of sums among them the terms of these."""
        self.terms = tuple(flat_terms(terms))
        for _, term in terms:
            if term.center == "tangent":
                raise BrdfError(f"{term!r}: hair has no normal in common with the other terms")
        self.includes_cosine = any(term.includes_cosine for _, term in terms)
        self.has_horizon = False
        self.isotropic = all(term.isotropic for _, term in terms)
        diffuse = all(term.center == "normal" for _, term in terms)
        self.center = "normal" if diffuse else "reflection"

    @property
    def is_measured(self) -> bool:
        return any(term.is_measured for _, term in self.terms)

    def with_values(self, **values: Value) -> Self:
        if not self.parameters:
            raise BrdfError(
                f"{self!r}: a sum has no parameter {next(iter(values))!r}; change it of a term"
            )
        return super().with_values(**values)

    def evaluate(self, light: Array, view: Array) -> Array:
        # Most runs evaluate no sum, and are spared the loading of the module.
        from shrm_cli.brdf.vectors import sharing

        values = []
        with sharing():
            for weight, term in self.terms:
                value = (term.transfer if self.includes_cosine else term.evaluate)(light, view)
                values.append(scaled(value, value.dtype.type(weight)))
        return added(values)

    def __repr__(self) -> str:
        return str(self.values["spec"])


def flat_terms(terms: Iterable[tuple[float, Brdf]]) -> Iterator[tuple[float, Brdf]]:
    """The terms of a sum, with those of sums and of weighted terms among them in their place."""
    for weight, term in terms:
        if isinstance(term, Sum):
            yield from ((weight * own, part) for own, part in term.terms)
        elif isinstance(term, _Weighted):
            yield from flat_terms([(weight * term.weight, term.term)])
        else:
            yield weight, term


def _check_weight(weight: float, term: Brdf) -> None:
    """Refuse weights of which energies, which are squares, are not finite."""
    if not 0 <= weight <= _LARGEST_WEIGHT:
        raise BrdfError(
            f"{weight:g}*{term!r}: weights are not negative, and {_LARGEST_WEIGHT:g} at most"
        )


def _record(spec: str, terms: Sequence[Brdf]) -> dict[str, Value]:
    """What identifies a sum: its specification, and the digests of the files that it names."""
    record: dict[str, Value] = {"spec": spec}
    if any(term.is_measured for term in terms):
        record[FILES] = json.dumps([term.values for term in terms], sort_keys=True)
    return record


class Diffuse(Brdf):
    """The Lambertian part that `split` takes from another BRDF."""

    name = "diffuse-part"
    summary = "the largest Lambertian part of a BRDF"
    source = "Lambert 1760"
    center = "normal"
    zonal = True

    def __init__(self, albedo: Array) -> None:
        self.values = {"albedo": [float(x) for x in albedo]}

    def evaluate(self, light: Array, view: Array) -> Array:
        shape = np.broadcast_shapes(light.shape, view.shape)
        dtype = np.result_type(light, view)
        color = np.array(self.values["albedo"], dtype=dtype) / dtype.type(np.pi)
        return np.broadcast_to(_narrowed(color), shape)


class Rest(Brdf):
    """What `split` leaves of a BRDF without its Lambertian part."""

    summary = "a BRDF without its Lambertian part"

    def __init__(self, whole: Brdf, albedo: Array) -> None:
        self.whole, self.albedo = whole, np.asarray(albedo, dtype=float)
        self.name, self.source = whole.name, whole.source
        self.values = {**whole.values, "without": [float(x) for x in albedo]}
        self.center = whole.center
        self.isotropic = whole.isotropic

    def evaluate(self, light: Array, view: Array) -> Array:
        value = self.whole.evaluate(light, view)
        less = _narrowed((self.albedo / np.pi).astype(value.dtype))
        return excess(value, np.broadcast_to(less, value.shape))


def _narrowed(color: Array) -> Array:
    """Return a color (3,), or its first channel (1,) if all are equal, for broadcasting."""
    return color[:1] if (color == color[0]).all() else color


def split(brdf: Brdf) -> list[Brdf]:
    """Split a BRDF into terms, each of which may be prefiltered about a center of its own.

    A sum is split into its terms. Any other BRDF is split into the largest Lambertian part that
    leaves nothing negative, and the rest.

    Returns only the BRDF itself where there is nothing to split.
    """
    if isinstance(brdf, Sum):
        return [_Weighted(weight, term) for weight, term in brdf.terms]
    if brdf.includes_cosine or brdf.zonal:
        return [brdf]
    albedo = diffuse_albedo(brdf)
    worth_it = albedo.max() > _LEAST_ALBEDO
    return [Diffuse(albedo), Rest(brdf, albedo)] if worth_it else [brdf]


def weighted_terms(brdf: Brdf) -> list[tuple[float, Brdf]]:
    """Return the terms of a sum with their weights; of any other BRDF, itself."""
    return list(flat_terms([(1.0, brdf)]))


class _Weighted(Brdf):
    """A BRDF times a weight: a term of a sum."""

    name = "sum"
    summary = "a term of a sum"

    def __init__(self, weight: float, term: Brdf) -> None:
        self.weight, self.term = weight, term
        self.source = term.source
        self.values = _record(repr(self), [term])
        self.center, self.zonal, self.isotropic = term.center, term.zonal, term.isotropic
        self.includes_cosine, self.has_horizon = term.includes_cosine, term.has_horizon

    def evaluate(self, light: Array, view: Array) -> Array:
        value = self.term.evaluate(light, view)
        return scaled(value, value.dtype.type(self.weight))

    def __repr__(self) -> str:
        return f"{value_text(self.weight)}*{self.term!r}"

    @property
    def is_measured(self) -> bool:
        return self.term.is_measured


def diffuse_albedo(brdf: Brdf) -> Array:
    """Find the albedo of the largest Lambertian part of a BRDF.

    It is pi times the least value over light and view above the horizon.

    Returns an array of shape (3,): linear RGB, not negative.
    """
    theta = (np.arange(_ANGLES) + 0.5) / _ANGLES * (_GRAZING * np.pi / 2)
    phi = np.linspace(0, np.pi, _AZIMUTHS)
    light = from_angles(theta[:, None, None], phi)
    view = from_angles(theta, 0.0)[None, :, None]
    least = brdf.evaluate(light, view).reshape(-1, 3).min(axis=0)
    return np.asarray(np.maximum(least, 0) * np.pi)


_PLUS = re.compile(r"(?<![0-9.][eE])\+")  # a plus that is no sign of an exponent, as in 1e+5
_WEIGHT = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*\*")
_TOO_MANY_WEIGHTS = re.compile(rf"(?:\s*[0-9.]+(?:[eE][-+]?[0-9]+)?\s*\*){{{MAX_TERMS + 1}}}")


def is_sum(spec: str) -> bool:
    """Whether a specification has several terms, or a weight."""
    return _PLUS.search(masked(spec)) is not None or _WEIGHT.match(spec) is not None


def term_texts(spec: str) -> list[str]:
    """The specifications of the terms of a sum, without their weights."""
    return [_WEIGHT.sub("", part, count=1).strip() for part in cut(_PLUS, spec)]


def parse_sum(spec: str, parse: Callable[[str], Brdf]) -> Brdf:
    """Parse a sum such as ``0.5*lambertian+0.5*ggx:roughness=0.3``."""
    terms = []
    parts = list(cut(_PLUS, spec))
    if len(parts) > MAX_TERMS:
        raise BrdfError(f"{spec!r:.60}: a sum of {len(parts):,} terms; give {MAX_TERMS} at most")
    for part in parts:
        if _TOO_MANY_WEIGHTS.match(part):
            raise BrdfError(f"{part!r:.60}: too many factors; multiply them into one")
        if not _WEIGHT.sub("", part, count=1).strip():
            raise BrdfError(f"{spec!r}: a term is empty; '+' stands between terms")
        match = _WEIGHT.match(part)
        try:
            weight = float(match[1]) if match else 1.0
        except ValueError:
            raise BrdfError(f"{spec!r}: {part!r} has no sound weight") from None
        terms.append((weight, parse(part[match.end() :] if match else part)))
    return joined(terms)


def joined(terms: Sequence[tuple[float, Brdf]]) -> Brdf:
    """The sum of terms, of which there may be one."""
    if len(terms) == 1:
        _check_weight(*terms[0])
        return _Weighted(*terms[0])
    return Sum(terms)
