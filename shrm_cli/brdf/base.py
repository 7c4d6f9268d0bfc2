"""What every BRDF answers, and states about itself."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import BrdfError

Array = NDArray[np.floating]
Center = Literal["reflection", "normal"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model: its range is closed, its default applies when it is left out."""

    name: str
    default: float
    minimum: float
    maximum: float
    meaning: str


class Brdf(ABC):
    """A reflection model. A subclass is one model; an instance has its parameters set.

    Attributes
    ----------
    name, summary, source : str
        As `shrm brdf` prints them.
    parameters : tuple of Parameter
    center : {"reflection", "normal"}
        The central direction C that its map is parameterised by (section 5.3.1).
    includes_cosine : bool
        Whether `evaluate` is already the transfer function rho_hat rather than f_r.
    has_horizon : bool
        Whether light from below the surface (N.L <= 0) is cut off; phenomenological lobes about
        the mirror direction go on there.
    zonal : bool
        Whether rho_hat depends on the angle between C and the light alone, and is zero beyond
        90 degrees (the "radially symmetric" BRDFs of section 5.3.1).
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    center: ClassVar[Center] = "reflection"
    includes_cosine: ClassVar[bool] = False
    has_horizon: ClassVar[bool] = True
    zonal: ClassVar[bool] = False

    def __init__(self, **values: float) -> None:
        known = {parameter.name: parameter for parameter in self.parameters}
        for key, value in values.items():
            if key not in known:
                raise BrdfError(
                    f"{self.name}: unknown parameter {key!r}; it has {_listing(list(known))}"
                )
            low, high = known[key].minimum, known[key].maximum
            if not low <= value <= high:  # a NaN is in no range
                raise BrdfError(f"{self.name}: {key}={value:g} is outside {low:g} .. {high:g}")
        self.values = {key: float(values.get(key, p.default)) for key, p in known.items()}

    @abstractmethod
    def evaluate(self, light: Array, view: Array) -> Array:
        """Value of the BRDF.

        Parameters
        ----------
        light, view : ndarray, shape (..., 3), broadcastable
            Unit directions to the light and to the viewer in the frame of the normal, z = N.

        Returns
        -------
        ndarray, shape (..., 3)
            f_r (1/sr) of linear RGB, or rho_hat where `includes_cosine`. Grey models return a
            read-only broadcast view.
        """

    def transfer(self, light: Array, view: Array) -> Array:
        """The BRDF transfer function rho_hat: with the cosine of the light's angle, and horizon.

        Takes and returns what `evaluate` does.
        """
        value = self.evaluate(light, view)
        height = light[..., 2]
        if not self.includes_cosine:
            return scaled(value, np.maximum(height, 0.0))
        return scaled(value, height > 0) if self.has_horizon else value

    def __repr__(self) -> str:
        inside = ",".join(f"{key}={value:g}" for key, value in self.values.items())
        return f"{self.name}:{inside}" if inside else self.name


def grey(value: Array) -> Array:
    """A scalar as three equal channels, shape (...) to (..., 3), without copying."""
    return np.broadcast_to(value[..., None], (*value.shape, 3))


def scaled(values: Array, factor: Array | NDArray[np.bool_]) -> Array:
    """RGB values (..., 3) times a factor (...); grey values stay a broadcast view."""
    if values.strides[-1] == 0:
        return grey(values[..., 0] * factor)
    return values * factor[..., None]


def _listing(names: list[str]) -> str:
    return ", ".join(names) if names else "none"
