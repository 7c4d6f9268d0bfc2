"""A base under a layer: a sum of what the layer reflects, and of the terms of the base below it."""

import json
from abc import abstractmethod
from collections.abc import Sequence
from typing import Self

from shrm_cli.brdf.base import Brdf, Parameter, Value, inside, value_text
from shrm_cli.brdf.library import parse_recorded
from shrm_cli.brdf.sums import FILES, Sum

BASE = Parameter("base", "(lambertian:albedo=0.5)", meaning="what lies under it, such as a sum")


class Layered(Sum):
    """A base under a layer, of which each lobe is a term, to be prefiltered as it wants it.

    `base` is what lies under the layer; as text it stands in parentheses, and names models alone:
    no file is opened for it. `**values` are the other parameters.
    """

    def __init__(self, base: Brdf | str = str(BASE.default), **values: Value) -> None:
        if not isinstance(base, Brdf):
            base = parse_recorded(inside("base", base))
        Brdf.__init__(self, base=f"({base!r})", **values)
        self.base = base
        if base.is_measured:
            self.values[FILES] = json.dumps([base.values], sort_keys=True)
        self._hold([(weight, term) for weight, term in self._layers() if weight > 0])

    @abstractmethod
    def _layers(self) -> Sequence[tuple[float, Brdf]]:
        """The lobes with their weights, from the outermost one to the base."""

    def with_values(self, **values: Value) -> Self:
        numbers = {name: self.values[name] for name in self.values if name not in ("base", FILES)}
        return type(self)(**{"base": self.base, **numbers, **values})  # type: ignore[arg-type]

    def __repr__(self) -> str:
        inside = (f"{key}={value_text(x)}" for key, x in self.values.items() if key != FILES)
        return f"{self.name}:{','.join(inside)}"


class UnderLayer(Brdf):
    """A term of a base as it is seen through the layer over it."""

    summary = "a term of a base under a layer"

    def __init__(self, whole: Layered, term: Brdf) -> None:
        self.term = term
        self.name, self.source = f"{whole.name}-part", whole.source
        self.values = {**whole.values, "part": repr(term)}
        self._text = f"{term!r} in {whole!r}"
        self.center, self.isotropic = term.center, term.isotropic

    def __repr__(self) -> str:
        return self._text

    @property
    def is_measured(self) -> bool:
        return self.term.is_measured
