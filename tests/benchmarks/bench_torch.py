"""Six levels of 128 texels with gradients, beside importance sampling in plain PyTorch.

``python -m tests.benchmarks.bench_torch`` prints the table, where PyTorch is installed. Sampling is
how renderers with gradients prefilter: each texel averages bilinear look-ups in the light, along
directions that are distributed as the lobe. Its directions are made beforehand, unmeasured, so that
it has no gradient by roughness, which ours has.
"""

from collections.abc import Iterable

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from shrm_cli.torch import LatLongProjection, SplitSumLevels
from tests.benchmarks.table import Row, measure, print_table
from tests.oracles import cube_texels, latlong_pixels

SIZE, HEIGHT, SAMPLES = 128, 256, 32
ROUGHNESS = (0.25, 0.4, 0.55, 0.7, 0.85, 1.0)
GOAL = 150.0
"""The milliseconds that values and gradients may take on two cores."""


def rows() -> Iterable[Row]:
    """Yield the rows, of an order that the sharpest level hardly passes, and of twice that."""
    image = torch.tensor(_light(), dtype=torch.float32, requires_grad=True)
    toward = torch.from_numpy(np.random.default_rng(1).random((6, 6 * SIZE, SIZE, 3), np.float32))
    peers = [_sample_points(each) for each in ROUGHNESS]

    def sampled() -> Tensor:
        return torch.stack([_average(image, *each) for each in peers])

    def gradients(levels: Tensor) -> Tensor:
        image.grad = None
        (levels * toward).sum().backward()
        return levels.detach()

    truth = _levels(128)(image).detach()
    for order in (64, 128):
        made = _levels(order)
        error, other = (_error(each, truth) for each in (made(image), sampled()))
        note = f"RMS error {error:.1e}, by {SAMPLES} samples {other:.1e}; the goal is {GOAL:g} ms"
        name = f"6 levels of {SIZE}, F {order}, values and gradients"
        yield measure(
            name, lambda made=made: gradients(made(image)), lambda: gradients(sampled()),
            note=note, pairs=3,
        )  # fmt: skip


def _levels(order: int) -> "torch.nn.Module":
    """Return a module from the image to the levels."""

    class Made(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.project = LatLongProjection(order, HEIGHT)
            self.levels = SplitSumLevels(order, SIZE)
            self.roughness = torch.nn.Parameter(torch.tensor(ROUGHNESS))

        def forward(self, image: Tensor) -> Tensor:
            return self.levels(self.project(image), self.roughness)

    return Made().float()


def _light() -> np.ndarray:
    """Return a smooth sky and a lamp of ten degrees."""
    pixels = latlong_pixels(2 * HEIGHT, HEIGHT)
    lamp = 60 * np.exp((pixels @ [0.36, 0.48, 0.8] - 1) * 120)
    return (1 + pixels[..., 1])[..., None] * [0.3, 0.4, 0.6] + lamp[..., None]


def _sample_points(roughness: float) -> tuple[Tensor, Tensor]:
    """Return where a level's samples lie in a lat-long, and their weights, for N = V = R."""
    at = (np.arange(SAMPLES) + 0.5) / SAMPLES
    turn = 2 * np.pi * ((np.arange(SAMPLES) * 0.6180339887498949) % 1)
    cosine = np.sqrt((1 - at) / (1 + (roughness**4 - 1) * at))  # of half vectors, as GGX has them
    z, sine = 2 * cosine**2 - 1, 2 * cosine * np.sqrt(1 - cosine**2)
    toward = np.array([sine * np.cos(turn), sine * np.sin(turn), z])
    axis = cube_texels(SIZE).reshape(-1, 3)
    helper = np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(helper, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frame = np.stack([across, np.cross(axis, across), axis], axis=2)
    x, y, z_world = np.moveaxis(frame @ toward, 1, 0)
    longitude, height = -np.arctan2(x, z_world), np.arccos(np.clip(y, -1, 1))
    place = np.stack([longitude / np.pi, height / np.pi * 2 - 1])
    facing = np.maximum(z, 0)
    alpha2 = roughness**4
    weights = facing / (facing + np.sqrt(alpha2 + (1 - alpha2) * facing**2))
    weights /= weights.sum()
    points = torch.from_numpy(np.moveaxis(place, 0, -1).astype(np.float32))
    return points, torch.from_numpy(weights.astype(np.float32))


def _average(image: Tensor, points: Tensor, weights: Tensor) -> Tensor:
    found = grid_sample(
        image.permute(2, 0, 1)[None], points[None], padding_mode="border", align_corners=False
    )
    return (found[0] @ weights).T.reshape(6 * SIZE, SIZE, 3)


def _error(levels: Tensor, truth: Tensor) -> float:
    return float((levels.detach() - truth).square().mean().sqrt() / truth.square().mean().sqrt())


if __name__ == "__main__":
    print(f"{torch.get_num_threads()} threads")
    print_table(rows())
