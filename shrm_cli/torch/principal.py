"""Principal maps with gradients: the cubes of a BRDF's own functions of the view, by the light."""

from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from shrm_cli.arrays import Array, Indices
from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import BrdfError
from shrm_cli.maps.coupling import bundle_coefficients
from shrm_cli.maps.principal.plan import Term
from shrm_cli.maps.principal.principal import Lobe
from shrm_cli.maps.principal.proposal import Proposals, lobe_of
from shrm_cli.maps.principal.selection import bundle_functions
from shrm_cli.maps.request import Request
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.directions import central_directions
from shrm_cli.sphere.harmonics import degrees_and_orders
from shrm_cli.torch.transforms import CubeSynthesis, DirectionSynthesis, kept, table

_AT_ONCE = 64
"""Lights whose cubes are computed at a time."""
_NOTHING = 1e-14
"""Factors below this part of the largest one are rounding, and count as 0."""


def principal_lobes(probe: Probe, brdf: Brdf | str, **options: Any) -> list["PrincipalLobe"]:
    """Return a module for each lobe of the map that `maps.principal` would make of a probe.

    The probe decides which functions and orders are kept, and the modules then take any light.
    What the map shows is the sum of the lobes.

    Parameters
    ----------
    probe : Probe
    brdf : Brdf or str
        A BRDF, or its specification.
    **options
        Further arguments of `shrm_cli.prefilter` with ``to="principal"``, such as `eps`.

    Raises ArgumentError or BrdfError if an argument does not apply, or the BRDF is anisotropic.
    """
    request = Request.of("principal", {"brdf": brdf, **options}, probe)
    if not request.brdf.isotropic:
        raise BrdfError(f"{request.brdf!r}: PyTorch's principal maps are of isotropic BRDFs")
    proposal = Proposals(Projection(probe), request).propose()
    return [PrincipalLobe(term, lobe_of(term, request.sampling)) for term in proposal.terms]


class PrincipalLobe(nn.Module):
    """The cubes of one lobe of a principal map, and what they show, as functions of the light.

    Parameters
    ----------
    term : Term
        The functions and orders that are kept.
    lobe : Lobe
        What the numpy code makes of the term, whose functions of the view are used.

    Attributes
    ----------
    order : int
        The largest degree of the light that counts.
    """

    def __init__(self, term: Term, lobe: Lobe) -> None:
        super().__init__()
        self.order, self.lobe = term.form.carried, lobe
        self._couplings = nn.ModuleList(
            _Coupling(term, p, used) for p, used in bundle_functions(term.form.counts).items()
        )
        self._highest = self.order + max(lobe.degrees)

    def series(self, light: Tensor) -> Tensor:
        """Return the series of all cubes, shape ((order+p+1)^2, cubes, 3), of light (n, 3)."""
        count, light = (self._highest + 1) ** 2, kept(light, self.order)
        parts = [each(light) for each in self._couplings]
        padded = [torch.cat([x, x.new_zeros(count - len(x), *x.shape[1:])]) for x in parts]
        return torch.cat(padded, dim=1)

    def synthesis(self) -> CubeSynthesis:
        """Return the module that makes cubes of the series, of the size of the numpy map's."""
        return CubeSynthesis(self._highest, self.lobe.size)

    def forward(self, light: Tensor, synthesis: CubeSynthesis) -> Tensor:
        """Make the cubes, shape (6 size, size, cubes, 3), of light (>= (order+1)^2, 3)."""
        series = self.series(light)
        return synthesis(series.flatten(1)).unflatten(-1, series.shape[1:])

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> "PrincipalRadiance":
        """Return a module from light to the radiance at some normals and views, shape (n, 3)."""
        return PrincipalRadiance(self, np.asarray(normals, float), np.asarray(views, float))


class PrincipalRadiance(nn.Module):
    """What a lobe of a principal map reflects at some normals and views, without texels.

    Parameters
    ----------
    lobe : PrincipalLobe
    normals, views : ndarray, shape (n, 3)
        Unit vectors in world axes; views point to the viewer.
    """

    def __init__(self, lobe: PrincipalLobe, normals: Array, views: Array) -> None:
        super().__init__()
        self._lobe = lobe
        centers = central_directions(lobe.lobe.center, normals, views)
        self._synthesis = DirectionSynthesis(lobe._highest, centers)
        weights = _weights(lobe.lobe, centers, views)
        self.register_buffer("weights", table(weights), persistent=False)

    def forward(self, light: Tensor) -> Tensor:
        """Return the radiance, shape (n, 3), of light (>= (order+1)^2, 3)."""
        series = self._lobe.series(light)
        values = self._synthesis(series.flatten(1)).unflatten(-1, series.shape[1:])
        return (values * self.weights).sum(dim=1)


class _Coupling(nn.Module):
    """From light to the series of the cubes of bundles of one degree p: a sparse matrix.

    Its numbers are what `bundle_coefficients` makes of each harmonic of the light.
    """

    def __init__(self, term: Term, degree: int, bundles: list[tuple[int, ...]]) -> None:
        super().__init__()
        order = term.form.carried
        parts = term.planner.spectrum.bundle_parts(bundles, order)
        parts = parts * term.form.band.factors[:, None, None, None]
        self.shape = (order + degree + 1) ** 2, (2 * degree + 1) * len(bundles)
        for channel in range(3):
            found = _entries(parts[..., channel], order)
            for name, values in zip(("values", "rows", "columns"), found, strict=True):
                self.register_buffer(f"{name}{channel}", table(values), persistent=False)

    def forward(self, light: Tensor) -> Tensor:
        channels = []
        for channel in range(3):
            values, rows, columns = (
                self.get_buffer(f"{name}{channel}") for name in ("values", "rows", "columns")
            )
            empty = light.new_zeros(self.shape[0] * self.shape[1])
            channels.append(empty.index_add(0, rows, values * light[columns, channel]))
        return torch.stack(channels, dim=-1).reshape(*self.shape, 3)


def _entries(parts: Array, order: int) -> tuple[Array, Indices, Indices]:
    """Return the entries of the matrix of one channel that are not 0: values, rows, columns.

    A cube's coefficient (J, M) comes from light of degrees ``J - p .. J + p`` and of azimuthal
    orders ``|M| - p .. |M| + p``. Harmonics whose degrees and orders differ by multiples of 2 p + 1
    share no coefficient, and all of them are told apart in one light that holds them together.
    """
    p = parts.shape[1] - 1
    period = 2 * p + 1
    degree, m = degrees_and_orders(order)
    total, over = degrees_and_orders(order + p)
    light = (degree % period * period + abs(m) % period) * 2 + (m < 0)
    found = []
    for first in range(0, 2 * period**2, _AT_ONCE):
        lights = np.arange(first, min(first + _AT_ONCE, 2 * period**2))
        units = (light[:, None] == lights).astype(float)
        made = bundle_coefficients(units, np.repeat(parts[..., None], len(lights), axis=-1))
        made = made.swapaxes(1, 2).reshape(-1, len(lights))  # one bundle after the other
        rows, at = np.nonzero(np.abs(made) > _NOTHING * np.abs(made).max(initial=1e-300))
        row = rows // (len(made) // len(total))
        rest, is_sine = np.divmod(lights[at], 2)
        lowest, least = total[row] - p, abs(over[row]) - p
        l = lowest + (rest // period - lowest) % period  # noqa: E741
        columns = l * (l + 1) + (1 - 2 * is_sine) * (least + (rest % period - least) % period)
        found.append((made[rows, at], rows, columns))
    values, rows, columns = (np.concatenate(each) for each in zip(*found, strict=True))
    return values, rows, columns


def _weights(lobe: Lobe, centers: Array, views: Array) -> Array:
    """Return what each cube's value at the centers counts, shape (n, cubes, 3)."""
    cubes = lobe.cubes.shape[2]

    def counted(cube: int) -> Array:
        """Return what the lobe shows of a light that is 1 in one cube, and 0 in the others."""
        unit = np.zeros((1, cubes, 3))
        unit[:, cube] = 1
        return lobe.radiance(lambda at: np.tile(unit.reshape(1, -1), (len(at), 1)), centers, views)

    return np.stack([counted(cube) for cube in range(cubes)], axis=1)
