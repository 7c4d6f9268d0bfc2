"""Spherical harmonic exponentials with gradients, and the fit of their logarithm."""

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from shrm_cli.brdf.environment.environment_brdf import LobeMoments
from shrm_cli.maps.she.exponential import (
    LARGEST_EXPONENT,
    SphericalHarmonicExponential,
    exponent_series,
)
from shrm_cli.maps.she.prefilter import FLOOR, RIDGE
from shrm_cli.torch.transforms import table


class Exponential(nn.Module):
    """What GGX reflects at some normals and views, of the coefficients of `maps.she`.

    Parameters
    ----------
    factors : SphericalHarmonicExponential
        Of which the orders of both factors and the law count.
    normals, views : array_like, shape (..., 3)
        Unit vectors in world axes; views point to the viewer.
    roughness : float
        Perceptual roughness.
    f0 : float
        Reflectance at normal incidence.
    """

    def __init__(
        self,
        factors: SphericalHarmonicExponential,
        normals: ArrayLike,
        views: ArrayLike,
        roughness: float,
        f0: float = 1.0,
    ) -> None:
        super().__init__()
        normals, views = np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        moments = LobeMoments(roughness).at(np.sum(normals * views, axis=-1))
        series = exponent_series(factors, normals, views, roughness, moments, f0)
        for name in ("rows", "variances", "albedo"):
            self.register_buffer(name, table(getattr(series, name)), persistent=False)

    def forward(self, coefficients: Tensor) -> Tensor:
        """Return the radiance, shape (..., channels), for coefficients (k, channels)."""
        exponent = self.rows @ coefficients - self.variances @ coefficients**2
        return self.albedo[..., None] * torch.exp(exponent.clamp(max=LARGEST_EXPONENT))

    def fit(self, radiance: Tensor, weights: Tensor | None = None) -> Tensor:
        """Fit coefficients of the law ``paper`` to the logarithm of radiance, with gradients.

        It is the linear least-squares fit of `maps.she.prefilter.fit_logarithm`.

        Parameters
        ----------
        radiance : Tensor, shape (..., channels)
            What the surface reflects at the normals and views; not black.
        weights : Tensor, shape (...), optional
            Those of the squared errors; all are the same by default.

        Returns
        -------
        Tensor, shape (k, channels)
        """
        rows = self.rows.flatten(0, -2)
        target = (radiance / self.albedo[..., None]).flatten(0, -2)
        weight = torch.ones_like(target[:, 0]) if weights is None else weights.flatten()
        mean = weight @ target / weight.sum()
        logarithm = torch.log(torch.maximum(target, FLOOR * mean))
        weighted = rows * weight[:, None]
        normal = weighted.T @ rows
        ridge = RIDGE * normal.diagonal().mean() * torch.eye(len(normal)).to(normal)
        return torch.linalg.solve(normal + ridge, weighted.T @ logarithm)
