"""Light that surfaces of any roughness reflect: irradiance and split sums, with gradients."""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from shrm_cli.arrays import Array
from shrm_cli.brdf.cache import cached_coefficients
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.maps.size import Band
from shrm_cli.maps.splitsum.core import multipliers
from shrm_cli.sphere.directions import reflect
from shrm_cli.torch.transforms import CubeSynthesis, DirectionSynthesis, table
from shrm_cli.vocabulary import MIN_ROUGHNESS

_ACCURACY = 1e-5
"""The part of a lobe's energy that its coefficients may miss, as in `maps.splitsum.prefilter`."""
_NODES = 48
"""The roughnesses that are interpolated between. Multipliers to degree 256 are exact to 1e-10."""


class Irradiance(nn.Module):
    """The irradiance E(N) of some normals, without a factor 1/pi; see `maps.irradiance`.

    Parameters
    ----------
    order : int
        The largest degree of the light that counts; 2 makes nine coefficients.
    normals : array_like, shape (..., 3)
        Unit vectors in world axes.
    """

    def __init__(self, order: int, normals: ArrayLike) -> None:
        super().__init__()
        self._synthesis = DirectionSynthesis(order, normals)
        self.register_buffer("factors", table(lambert_factors(order)), persistent=False)

    def forward(self, light: Tensor) -> Tensor:
        """Return E(N), shape (..., channels), of light (>= (order+1)^2, channels)."""
        return self._synthesis(light, self.factors)


class RoughnessTable(nn.Module):
    """What depends on perceptual roughness smoothly, interpolated by Chebyshev polynomials.

    Their variable is the logarithm of the roughness, so that sharp lobes have as many nodes as
    broad ones. Roughness is kept within 0.05 and 1, where values are known.

    Parameters
    ----------
    function : callable
        From a roughness to an array, which is computed at the nodes.
    """

    def __init__(self, function: Callable[[float], Array]) -> None:
        super().__init__()
        angles = (np.arange(_NODES) + 0.5) * (np.pi / _NODES)
        roughness = MIN_ROUGHNESS ** ((1 - np.cos(angles)) / 2)
        values = np.stack([function(min(float(each), 1.0)) for each in roughness])
        waves = np.cos(np.outer(np.arange(_NODES), angles)) * (2 / _NODES)
        waves[0] /= 2
        series = np.tensordot(waves, values, axes=1)
        self.register_buffer("series", table(series), persistent=False)

    def forward(self, roughness: Tensor) -> Tensor:
        """Return the values of each roughness, shape (levels, ...), for roughness (levels,)."""
        kept = roughness.clamp(MIN_ROUGHNESS, 1.0)
        x = 1 - 2 * torch.log(kept) / float(np.log(MIN_ROUGHNESS))
        terms = [torch.ones_like(x), x]
        while len(terms) < len(self.series):
            terms.append(2 * x * terms[-1] - terms[-2])
        return torch.tensordot(torch.stack(terms, dim=-1), self.series, dims=1)


class GgxMultipliers(nn.Module):
    """What GGX's lobe for N = V = R multiplies the degrees of the light with, by roughness.

    Parameters
    ----------
    order : int
        The largest degree.
    whole : int, optional
        The degree beyond which the multipliers fade out, as `maps.band.Band` has it, so that sharp
        lobes do not ring; none fades by default.
    """

    def __init__(self, order: int, whole: int | None = None) -> None:
        super().__init__()
        fade = Band(order if whole is None else whole, order).factors

        def values(roughness: float) -> Array:
            lobe = GgxLobe(roughness=roughness)
            found = cached_coefficients(lobe, order, 0, _ACCURACY, compute_coefficients)
            return multipliers(found)[: order + 1] * fade

        self._table = RoughnessTable(values)

    def forward(self, roughness: Tensor) -> Tensor:
        """Return one number for each degree, shape (levels, order+1), for roughness (levels,)."""
        return self._table(roughness)


class SplitSumLevels(nn.Module):
    """The cubes of a split sum of GGX, all of one size, by light and roughness.

    Parameters
    ----------
    order : int
        The largest degree of the light that counts. Sharp lobes of a roughness r pass light of
        degrees up to 6 / r^2 or so.
    size : int
        Texels along a face's edge.
    whole : int, optional
        As `GgxMultipliers` takes it.
    """

    def __init__(self, order: int, size: int, whole: int | None = None) -> None:
        super().__init__()
        self._multipliers = GgxMultipliers(order, whole)
        self._synthesis = CubeSynthesis(order, size)

    def forward(self, light: Tensor, roughness: Tensor) -> Tensor:
        """Make levels, shape (levels, 6 size, size, channels).

        Parameters
        ----------
        light : Tensor, shape (>= (order+1)^2, channels)
        roughness : Tensor, shape (levels,)
        """
        return self._synthesis(light, self._multipliers(roughness))


class SplitSumRadiance(nn.Module):
    """What GGX surfaces reflect at some normals and views, by the split sum, without texels.

    Parameters
    ----------
    order : int
        The largest degree of the light that counts.
    normals, views : array_like, shape (..., 3)
        Unit vectors in world axes; views point to the viewer.
    whole : int, optional
        As `GgxMultipliers` takes it.
    """

    def __init__(
        self, order: int, normals: ArrayLike, views: ArrayLike, whole: int | None = None
    ) -> None:
        super().__init__()
        normals, views = np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        cosines = np.sum(normals * views, axis=-1)
        self._multipliers = GgxMultipliers(order, whole)
        self._synthesis = DirectionSynthesis(order, reflect(views, normals))
        self._albedo = RoughnessTable(
            lambda roughness: np.stack(DirectionalAlbedo(roughness).scale_bias(cosines))
        )

    def forward(self, light: Tensor, roughness: Tensor, f0: Tensor) -> Tensor:
        """Return the reflected radiance, shape (..., channels).

        Parameters
        ----------
        light : Tensor, shape (>= (order+1)^2, channels)
        roughness : Tensor
            A single perceptual roughness.
        f0 : Tensor, shape (channels,)
            Reflectance at normal incidence.
        """
        (factors,) = self._multipliers(roughness.reshape(1))
        ((scale, bias),) = self._albedo(roughness.reshape(1))
        return self._synthesis(light, factors) * (scale[..., None] * f0 + bias[..., None])
