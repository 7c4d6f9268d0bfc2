"""PyTorch, or the reason why tests of what needs it are skipped."""

import numpy as np
import pytest

torch = pytest.importorskip(
    "torch", reason="PyTorch is not installed; `make torch` does that", exc_type=ImportError
)
GRADIENTS = {"eps": 1e-6, "atol": 1e-6, "rtol": 1e-6}


def variable(*shape, seed=1, low=-1.0, high=1.0):
    """Return random numbers of 64 bits that gradients are asked of."""
    values = np.random.default_rng(seed).uniform(low, high, shape)
    return torch.tensor(values, requires_grad=True)


def has_right_gradients(function, *inputs):
    """Compare the derivatives with differences of values, and those of second order as well."""
    right = torch.autograd.gradcheck(function, inputs, **GRADIENTS)
    return right and torch.autograd.gradgradcheck(function, inputs, **GRADIENTS)
