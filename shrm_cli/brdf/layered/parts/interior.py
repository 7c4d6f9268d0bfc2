"""The light between a coat and its base, which goes to and fro and leaves a part each time.

Light L reaches the base as L', refracted by Snell's law, and after the base's reflection leaves
along V, refracted again. If the coat is smooth, what leaves at once is exactly

    T(L) T(V) f(L', V') / ior^2

with the transmittance T and the base's BRDF f. A part is reflected at the border, and comes back to
the base. How much leaves after all such rounds is known from energies alone, which depend on angles
to the normal and not on azimuths: they are the solution of a linear system, `_visits`. Glossy parts
of the base get it as a lobe that is wider than their own, and as strong as these energies say.
Light that a diffuse part scatters has no direction any more, and leaves as ``E(l) E(v) / mean(E)``
with the albedo E says. Its rounds among the diffuse parts are a small linear system of their own,
a geometric series if there is one part; it meets the glossy parts on its way there and from there.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import product

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color, added, multiplied, scaled
from shrm_cli.brdf.layered.parts import table
from shrm_cli.brdf.layered.parts.dielectric import CoatLobe, refracted
from shrm_cli.brdf.layered.parts.layered import Layered, UnderLayer
from shrm_cli.brdf.layered.parts.opaque import UnderBorder
from shrm_cli.brdf.vectors import GRAZING, refracted_cosine
from shrm_cli.records import record

Terms = Sequence[tuple[float, Brdf]]
Lobes = Sequence[tuple[Brdf, table.Table]]

_BEYOND = np.linspace(0, 1, 9)[:-1]
"""Cosines beyond the critical angle that are tabulated, in parts of its cosine."""
_LOSSLESS = 0.9999
"""The most that comes back: without a loss, light beyond the critical angle would stay for ever."""


@record(eq=False)
class GlossyPart:
    """A glossy part of a base."""

    weight: float
    bare: Brdf
    """The part as it is without the coat."""
    lobe: Brdf
    """The part as it is seen through the coat after one reflection, but for its strength."""
    wider: Brdf
    """The part as it is seen after several reflections."""


class Interior:
    """How much brighter or darker the parts of a base are under a coat.

    `coat` is what the coat's border reflects outside. `color` is what passes through the coat along
    its normal, there and back.
    """

    def __init__(
        self, coat: CoatLobe, color: Color, glossy: Sequence[GlossyPart], diffuse: Terms
    ) -> None:
        self.coat, self.ior = coat, coat.number("ior")
        self._color, self._glossy, self._diffuse = np.array(color), glossy, diffuse
        seen = refracted_cosine(table.COSINES, self.ior)
        self._beyond = len(_BEYOND) if self.ior > 1 else 0
        self._cosines = np.append(_BEYOND[: self._beyond] * seen[0], seen)

    def glossy_lobes(self, number: int) -> Lobes:
        """The lobes that a glossy part has under the coat, with what they are multiplied by for the
        light and for the view.
        """
        part = self._glossy[number]
        once = np.einsum("pijc,jc->pic", self._matrices, self._leaving)
        whole = np.maximum(once.sum(axis=0), 1e-300)
        later = np.maximum(np.minimum(self._visits(whole), self._way) - whole, 0)
        matrix = part.weight * self._moved[1][number, self._beyond :]
        wanted = (later * once[number] / whole)[self._beyond :]
        gain = table.strength(matrix[:, self._beyond :], self._passing, wanted)
        return [
            (part.lobe, table.Table(self._passing * self._kept[number][self._beyond :] / self.ior)),
            (part.wider, table.Table(self._passing * gain / self.ior)),
        ]

    def diffuse_lobes(self, number: int) -> Lobes:
        """As `glossy_lobes`, of a diffuse part.

        Where a part is no product of functions of light and view, it is weighed so that as much
        light leaves.
        """
        weight, part = self._diffuse[number]
        own, ever, once, whole = (each[number] for each in self._scattered)
        passing = self._passing * ever[self._beyond :] / weight
        if part.zonal:
            rounds = np.sqrt(whole / np.maximum(once, 1e-300)) / self.ior
            gain = passing / np.maximum(own[self._beyond :], 1e-300) * rounds
        else:
            matrix = table.transport(_Inside(part, self.ior), table.COSINES, table.COSINES)
            gain = table.strength(matrix, np.ones_like(passing), passing * whole)
        return [(part, table.Table(gain))]

    @cached_property
    def _scattered(self) -> tuple[Array, Array, Array, Array]:
        """How light is scattered by each of the diffuse parts, which forgets where it came from.

        The albedos E of the parts alone, (parts, n, 3); the part of light from each angle that they
        are the first to scatter, (parts, n, 3); and how much of what they scatter, as E has it,
        leaves before it is scattered again, and ever, both of shape (parts, 3).
        """
        own = np.stack([table.albedos(part, self._cosines) for _, part in self._diffuse])
        weights = np.array([weight for weight, _ in self._diffuse])
        held = self._without_excess(weights[:, None, None] * own)
        first = np.stack([self._visits(each) for each in held])
        mean = np.maximum([_mean(each, self._cosines) for each in held], 1e-300)
        passing = self._passing * first[:, self._beyond :] / self.ior**2
        once = np.stack([_mean(each, table.COSINES) for each in passing]) / mean
        again = np.empty((3, len(held), len(held)))  # from a part to a part
        for (k, one), (j, other) in product(enumerate(held), enumerate(first)):
            again[:, k, j] = _mean(one * self._returned * other, self._cosines) / mean[k]
        whole = np.linalg.solve(np.eye(len(held)) - _less_than_all(again), once.T[..., None])
        return own, first, once, whole[..., 0].T

    def _without_excess(self, diffuse: Array) -> Array:
        """Albedos of diffuse parts, (parts, n, 3), which under borders leave the glossy its own.

        All are tabulated, too coarsely for a film that turns light back within the coat: in each
        round light would gain what they exceed 1 by together.
        """
        if not all(isinstance(part, UnderBorder) for _, part in self._diffuse):
            return diffuse
        left = np.maximum(1 - self._matrices.sum(axis=(0, 2)), 0)
        return diffuse * np.minimum(left / np.maximum(diffuse.sum(axis=0), 1e-300), 1)

    @cached_property
    def _border(self) -> Array:
        """What the border reflects of light from inside, at the cosines, (n, 3)."""
        outside = table.albedos(self.coat, table.COSINES)
        outside[0] = 1  # light that grazes is reflected
        return np.append(np.ones((self._beyond, 3)), outside, axis=0)

    @cached_property
    def _way(self) -> Array:
        """What the medium lets pass on one way at the cosines, (n, 3)."""
        return np.asarray(self._color ** (0.5 / np.maximum(self._cosines, 1e-3)[:, None]))

    @cached_property
    def _leaving(self) -> Array:
        """What leaves of light that the base reflects at the cosines, (n, 3)."""
        return (1 - self._border) * self._way

    @property
    def _passing(self) -> Array:
        """What passes the coat, at `COSINES` in air."""
        return self._leaving[self._beyond :]

    @property
    def _returned(self) -> Array:
        """What comes back to the base of light that it reflects at the cosines, (n, 3)."""
        return np.minimum(self._border * self._way**2, _LOSSLESS)

    @cached_property
    def _matrices(self) -> Array:
        """How each glossy part moves light between the cosines, (parts, n, n, 3)."""
        strong = self._kept[:, :, None] * self._kept[:, None]
        weights = np.array([part.weight for part in self._glossy])[:, None, None, None]
        return np.asarray(weights * self._moved[0] * strong)

    @cached_property
    def _moved(self) -> Array:
        """As `_matrices`, of the lobes as they are, and of the wider ones: (2, parts, n, n, 3)."""
        lobes = [(part.lobe, part.wider) for part in self._glossy]
        each = list(dict.fromkeys(lobe for pair in zip(*lobes, strict=True) for lobe in pair))
        found = table.transports(each, self._cosines, self._cosines)
        count = len(self._cosines)
        moved = [found[each.index(lobe)] for pair in zip(*lobes, strict=True) for lobe in pair]
        return np.reshape(moved, (2, len(lobes), count, count, 3))

    @cached_property
    def _kept(self) -> Array:
        """What each lobe is multiplied by for light and for view, (parts, n, 3).

        A lobe of GGX that is widened loses more among its facets; with this it reflects as much as
        the part does without the coat.
        """
        whole = np.ones((len(self._glossy), len(self._cosines), 3))
        for kept, matrix, part in zip(whole, self._moved[0], self._glossy, strict=True):
            if part.lobe is not part.bare:
                kept[:] = table.strength(matrix, kept, table.albedos(part.bare, self._cosines))
        return whole

    def _visits(self, each: Array) -> Array:
        """The sum of something over all visits of light to the glossy parts.

        `each`, of shape (n, 3), is that of a visit, for light that is followed back from a view at
        the cosines.
        """
        moved = _less_than_all((self._matrices.sum(axis=0) * self._returned).transpose(2, 0, 1))
        found = np.linalg.solve(np.eye(len(each)) - moved, each.T[..., None])
        return np.asarray(found[..., 0].T)


def _less_than_all(moved: Array) -> Array:
    """Matrices of what goes from row to column, (3, n, n), without what a base gains by itself."""
    share = moved.sum(axis=2, keepdims=True)
    return np.asarray(moved * np.minimum(_LOSSLESS / np.maximum(share, 1e-300), 1))


def _mean(values: Array, cosines: Array) -> Array:
    """The mean of values at cosines, (n, 3), over even light."""
    return np.asarray(np.trapezoid(2 * cosines[:, None] * values, cosines, axis=0))


class _Inside(Brdf):
    """A part of a base for light and views that are refracted before they meet it."""

    name = "inside"

    def __init__(self, part: Brdf, ior: float) -> None:
        self.part, self.ior, self.values = part, ior, {}

    def evaluate(self, light: Array, view: Array) -> Array:
        return self.part.evaluate(refracted(light, self.ior), refracted(view, self.ior))


class UnderCoat(UnderLayer):
    """A part of a base as it is seen through a coat."""

    def __init__(self, whole: Layered, part: Brdf, ior: float, lobes: Callable[[], Lobes]) -> None:
        super().__init__(whole, part)
        self.base, self.ior, self._make = whole.base, ior, lobes

    @property
    def is_slow(self) -> bool:
        return True  # it refracts, and has two lobes

    @cached_property
    def lobes(self) -> Lobes:
        """What is seen of it, for refracted light and view, and what it is multiplied by for each
        of both.
        """
        return self._make()

    def evaluate(self, light: Array, view: Array) -> Array:
        inner_light, inner_view = refracted(light, self.ior), refracted(view, self.ior)
        values = []
        for lobe, gain in self.lobes:
            value = lobe.evaluate(inner_light, inner_view)
            values.append(multiplied(value, gain.at(light), gain.at(view)))
        found = scaled(added(values), (light[..., 2] > 0) & (view[..., 2] > 0))
        if self.term.includes_cosine:
            found = scaled(found, 1 / np.maximum(inner_light[..., 2], GRAZING))
        return found
