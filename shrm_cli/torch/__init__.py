"""Prefiltering with gradients: modules of PyTorch for light, irradiance, split sums and others.

They compute what the numpy code of this package does, on any device, and derivatives by whatever
they are given: pixels, coefficients, roughness. docs/torch.md shows how they are put together::

    from shrm_cli import torch as shrm_torch

    project = shrm_torch.LatLongProjection(order=24, height=64)
    levels = shrm_torch.SplitSumLevels(order=24, size=32)
    cubes = levels(project(image), roughness)
"""

import importlib.util

from shrm_cli.extras import install

if importlib.util.find_spec("torch") is None:
    raise ImportError(f"gradients need the package torch; {install('torch')}", name="torch")

from shrm_cli.torch.exponential import Exponential
from shrm_cli.torch.light import GgxMultipliers, Irradiance, SplitSumLevels, SplitSumRadiance
from shrm_cli.torch.principal import PrincipalLobe, principal_lobes
from shrm_cli.torch.transforms import CubeSynthesis, DirectionSynthesis, LatLongProjection, Rotation

__all__ = [
    "CubeSynthesis",
    "DirectionSynthesis",
    "Exponential",
    "GgxMultipliers",
    "Irradiance",
    "LatLongProjection",
    "PrincipalLobe",
    "Rotation",
    "SplitSumLevels",
    "SplitSumRadiance",
    "principal_lobes",
]
