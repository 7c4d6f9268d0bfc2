"""Fits the polynomials of taps to lobes, by Levenberg's and Marquardt's method.

What is fitted are the coefficients of all polynomials at once, over roughnesses, anisotropies,
N.V and azimuths of the view. A polynomial is linear in its coefficients, so that the derivatives
with respect to these are those with respect to the numbers of the taps at a node, times monomials.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from research.taps.lobes import Norm, view
from shrm_cli.brdf.environment.taps import (
    EVEN_KINDS,
    KINDS,
    Taps,
    even_monomials,
    even_taps_of,
    monomials,
    taps_of,
)
from shrm_cli.records import record

_RATIOS = 0.25, 0.4, 0.55, 0.7, 0.85, 1.0
_ROUGHNESS = 0.2, 0.3, 0.4, 0.5, 0.62, 0.75, 0.9
_COSINES = 0.99, 0.85, 0.65, 0.45, 0.28, 0.14
_AZIMUTHS = 0.0, np.pi / 4, np.pi / 2
"""Views along the stretched axis, between both, and across it."""
_EVEN_ROUGHNESS = 0.2, 0.3, 0.4, 0.5, 0.62, 0.75, 0.87, 1.0
_EVEN_COSINES = 0.99, 0.85, 0.65, 0.45, 0.28, 0.14, 0.06
_HELD = 0.01
"""How much of a number's distance from its start counts as an error, so that none runs away whose
tap weighs next to nothing."""
_STARTS = {
    3: [0.8, 0.7, 0.8, 1.0, 0.3, 1.0],
    5: [0.5, 0.9, 0.85, 0.6, 0.8, 0.85, 1.1, 0.2, 0.5, 1.5],
    8: [0.25, 0.45, 0.7, 0.9, 0.95, 0.55, 0.6, 0.75, 0.85, 0.8, 1.15, 0.15, 0.5, 1.0, 2.0],
}
"""The numbers that all nodes begin with, in the order of `kinds`: medians of a fit before."""
_EVEN_STARTS = {
    1: [0.9, 1.0],
    2: [0.7, 0.8, 0.9, 0.6, 1.3],
    3: [0.7, 0.3, 0.8, 0.85, 0.9, 0.5, 1.0, 1.6],
}
_STEP = 1e-4
_ENOUGH = 1e-3
"""The part of the squared error by which a step has to lower it."""


@record(eq=False)
class Node:
    """A view of a surface: what its taps are to be."""

    basis: np.ndarray
    lobe: np.ndarray
    taps_of: Callable[[tuple[np.ndarray, ...]], Taps]
    """From polynomials, of which a node knows the first coefficients alone, to taps."""


def nodes(norm: Norm) -> list[Node]:
    """Return all brushed surfaces and views that are fitted, with the lobes' own vectors."""
    return list(_nodes(norm))


def _nodes(norm: Norm) -> Iterator[Node]:
    for ratio in _RATIOS:
        for roughness in _ROUGHNESS:
            ay = roughness**2
            alphas = min(ay / ratio**2, 1.0), ay
            if roughness > ratio * (1 + 1e-9):
                continue
            for cosine in _COSINES:
                for azimuth in _AZIMUTHS:
                    yield brushed_node(norm, alphas, view(cosine, azimuth))


def brushed_node(norm: Norm, alphas: tuple[float, float], seen: np.ndarray) -> Node:
    """Return a view of a brushed surface."""
    basis = monomials(np.sqrt(alphas[1]), np.sqrt(alphas[1] / alphas[0]), seen[2])
    make = partial(taps_of, alphas=alphas, views=seen)
    return Node(basis, norm.brushed(alphas, seen), make)


def even_nodes(norm: Norm) -> list[Node]:
    """Return the surfaces that are not brushed, and views, that are fitted."""
    return [
        even_node(norm, roughness, view(cosine, 0.0))
        for roughness in _EVEN_ROUGHNESS
        for cosine in _EVEN_COSINES
    ]


def even_node(norm: Norm, roughness: float, seen: np.ndarray) -> Node:
    """Return a view of a surface that is not brushed."""
    make = partial(even_taps_of, roughness=roughness, normals=[0, 0, 1], views=seen)
    lobe = norm.brushed((roughness**2, roughness**2), seen)
    return Node(even_monomials(roughness, seen[2]), lobe, make)


def kinds(count: int) -> str:
    """Return the letter of each polynomial of a number of taps, in order."""
    pairs, odd = divmod(count, 2)
    return "u" * pairs + "w" * (pairs + odd - 1) + "r" * (pairs + odd) + "t" * (pairs + odd)


def even_kinds(count: int) -> str:
    """Return the same of taps of even GGX."""
    return "w" * (count - 1) + "r" * count + "t" * count


def missed(norm: Norm, node: Node, numbers: np.ndarray, names: str) -> np.ndarray:
    """Return what taps miss of a lobe, as a vector relative to it."""
    rows = np.array(list(names))
    # At a single node a polynomial is its first coefficient.
    order = KINDS if "u" in names else EVEN_KINDS
    parts = tuple(_constant(numbers[rows == kind], len(node.basis)) for kind in order)
    found = node.taps_of(parts)
    lobe = sum(
        weight * norm.even(roughness, axis)
        for weight, roughness, axis in zip(
            found.weights, found.roughness, found.directions, strict=True
        )
    )
    return (lobe - node.lobe) / np.linalg.norm(node.lobe)


def _constant(values: np.ndarray, count: int) -> np.ndarray:
    return np.concatenate([values[:, None], np.zeros((len(values), count - 1))], axis=1)


def fitted(
    count: int, norm: Norm, among: list[Node], told: Callable[[str], None] = print
) -> np.ndarray:
    """Return the coefficients of the polynomials of brushed GGX, in the order of `kinds`."""
    title = f"brushed GGX, {count} taps"
    return _fitted(kinds(count), np.array(_STARTS[count]), norm, among, told, title)


def even_fitted(
    count: int, norm: Norm, among: list[Node], told: Callable[[str], None] = print
) -> np.ndarray:
    """Return the coefficients of the polynomials of even GGX, in the order of `even_kinds`."""
    title = f"even GGX, {count} taps"
    return _fitted(even_kinds(count), np.array(_EVEN_STARTS[count]), norm, among, told, title)


def _fitted(
    names: str, first: np.ndarray, norm: Norm, among: list[Node],
    told: Callable[[str], None], title: str,
) -> np.ndarray:  # fmt: skip
    """Fit polynomials to nodes; return coefficients of shape (numbers, monomials)."""
    size = len(names), len(among[0].basis)

    def errors(node: Node, numbers: np.ndarray) -> np.ndarray:
        held = _HELD * (numbers - first)
        return np.concatenate([missed(norm, node, numbers, names), held])

    def total(tried: np.ndarray) -> float:
        return sum(float(np.sum(errors(each, tried @ each.basis) ** 2)) for each in among)

    found = _constant(first, size[1])
    best, damping = total(found), 0.01
    while True:
        curvature, slope = np.zeros(size * 2), np.zeros(size)
        for node in among:
            numbers = found @ node.basis
            here = errors(node, numbers)
            steps = _STEP * np.eye(len(numbers))
            rows = np.array([errors(node, numbers + step) - here for step in steps]) / _STEP
            curvature += np.einsum("ij,a,b->iajb", rows @ rows.T, node.basis, node.basis)
            slope += np.outer(rows @ here, node.basis)
        square = curvature.reshape(found.size, found.size)
        for _ in range(10):
            damped = square + np.diag(damping * np.diag(square) + 1e-6)
            tried = found - np.linalg.solve(damped, slope.ravel()).reshape(size)
            if (error := total(tried)) < best:
                break
            damping *= 5
        else:
            return found
        gain, found, best, damping = 1 - error / best, tried, error, max(damping / 5, 1e-6)
        told(f"{title}: error {np.sqrt(best / len(among)):.2%}")
        if gain < _ENOUGH:
            return found
