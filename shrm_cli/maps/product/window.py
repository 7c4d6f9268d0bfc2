"""The window of the light that a product texture is under, chosen by what the surface reflects.

A series of few orders is negative beside lamps. A BRDF blurs the light, so that what it reflects
may be negative nowhere all the same, and a window would cost sharpness for nothing. So the factors
of the degrees are sought that keep the reflected light from showing more than a few black spots, or
spots that lack one of its colors, and change it least; the light alone may stay negative.
"""

from dataclasses import asdict
from itertools import product as combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.maps.irradiance.window import Window, least_factors, make_window, parse_window
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize, surface_frames
from shrm_cli.sphere.harmonics import by_degree
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.sphere.rotation import own_axes, rotate_into_frames, transform_coefficients
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR

if TYPE_CHECKING:
    from shrm_cli.maps.product.product import ProductMap, ProductTexture
    from shrm_cli.probe.lighting import Projection

_FRAMES = 1024
"""The orientations of the surface for which reflected light is looked at."""
_VIEWS = 40
"""The views of each of them, all over the hemisphere."""
_LEAST_COSINE = 0.05
"""The least N.V of these views: a four-hundredth of a sphere's picture lies beyond."""
_PLACES = 0.0, 0.5, 1.0
"""Where on their ways parameters that vary are looked at."""
_GOLDEN = np.pi * (3 - np.sqrt(5))
_BLACK = 0.01
"""The share of what is seen that may be negative in a channel. A window that leaves no more than a
tenth of it makes far more wrong: of `ward:ax=.45,ay=.2` in a courtyard 58 % of the pixels, where
15 % are wrong without one and .2 % are black (the perceptual error FLIP is .15 in place of .05), in
a forest 24 % for 17 %, in an interior 56 % for 28 %. Without windows where luminance alone keeps
it, FLIP is larger, for spots that lack a color: of `ward:ax=.5,ay=.15` in a sunset, order 4, .31
for .28, where red is negative in 2.3 % and luminance in .1 %."""
_MARGIN = 2e-3
"""The least light that is aimed at, as a part of the mean: there are gaps between samples."""
_ROUNDS = 12
"""How often the factors are sought, at most."""
_ADDED = 400
"""The most samples that join after a round, the lowest ones."""
_HALVINGS = 10
"""How often the interval is halved in which the strength of the factors lies."""


@record
class LightWindow(Window):
    """A window of the light, and what it costs in what surfaces reflect."""

    p95_change: float = 0.0
    """The 95th percentile of the change of the luminance that is reflected, relative to the
    brighter of what it is without and with the window, or to `vocabulary.SEEN_FLOOR` of the mean
    where both are darker."""
    spots: float | None = None
    """The largest share of what is seen in which a channel would be negative without the window;
    None without one. The luminance, which warnings about black pixels tell of, is in fewer."""

    def summary(self, order: int) -> dict[str, Any]:
        return {**super().summary(order), "p95_change": self.p95_change, "spots": self.spots}


def product_window(spec: str, product: "ProductMap", series: ArrayLike) -> LightWindow:
    """Make the window of the light for a product texture.

    `spec` is as `make_window` takes it. ``auto`` asks for the factors that change the reflected
    light least, as RMS over orientations and views, and leave no channel negative anywhere; of
    these it takes as little as leaves each channel negative in no more than a hundredth of what is
    seen. Where the parameters of `product` vary, three values of each count. `series`, of shape
    ((order+1)^2, 3), are the coefficients of the light in world axes.

    The `change` of the window is that of the reflected light.
    """
    series = np.asarray(series, dtype=float)
    name, _ = parse_window(spec)
    found = Window() if name == "auto" else make_window(spec, series)
    if name == "none" or not series.any():
        return LightWindow(**asdict(found))
    own = transform_coefficients(series, own_axes(series @ LUMINANCE))
    textures = [product.at(shares) for shares in combinations(_PLACES, repeat=product.varies)]
    by_degree = np.concatenate([_by_degree(each, own) for each in textures])
    seen = by_degree @ LUMINANCE
    if name == "auto":
        factors = _weakened(by_degree)
        if factors is None:
            return LightWindow()
        found = Window.of(factors, series)
    whole, lost = by_degree.sum(axis=1), 1 - np.array(found.factors)
    change = np.einsum("nlc,l->nc", by_degree, lost)
    floor = SEEN_FLOOR * max(float(seen[:, 0].mean()), np.finfo(float).tiny)
    # What was negative is nothing to divide by: the brighter of before and after is.
    larger = np.maximum(seen.sum(axis=1), seen @ found.factors)
    relative = np.abs(seen @ lost) / np.maximum(larger, floor)
    costs = {
        "change": relative_rms(np.sum(change**2), np.sum(whole**2)),
        "p95_change": float(np.quantile(relative, 0.95)),
        "spots": _spots(by_degree, np.ones(len(lost))),
    }
    return LightWindow(**{**asdict(found), **costs})


def error_beyond_order(texture: "ProductTexture", light: "Projection", captured: float) -> float:
    """Predict the relative RMS error that light of higher degrees than a texture's makes.

    `captured` is how much of the BRDF's energy the texture has.

    It is in the measure of `maps.product.prefilter`, who knows the BRDF. Here all of its energy
    beyond the order is taken to be in the next octave of degrees.
    """
    order = texture.order
    density, beyond = light_densities(light, order)
    squares = texture.values(seen_views(_VIEWS, _LEAST_COSINE), linear=True) ** 2
    known = by_degree(squares, axis=1).mean(axis=0)
    left = known.sum(axis=0) * (1 - captured) / max(captured, np.finfo(float).tiny)
    missed = float(np.sum(left * beyond))
    return relative_rms(missed, float((known * density).sum()) + missed)


def light_densities(light: "Projection", order: int) -> tuple[Array, Array]:
    """Return how dense light is, ``|L_l|^2 / (2l+1)``, up to an order and beyond it.

    The first is by degree, shape (order+1, 3). The second, of shape (3,), is the mean of the octave
    of degrees behind it, which is what the rest of the energy of lobes of all widths meets, to a
    fifth.
    """
    known = light.to_order(2 * order + 2).power()[: 2 * order + 3]
    density = known / (2 * np.arange(len(known)) + 1)[:, None]
    return density[: order + 1], density[order + 1 :].mean(axis=0)


def seen_views(count: int, least: float) -> Array:
    """Return views of a surface with at least some N.V, as dense as pictures have them, (count, 3).

    A surface is seen on as many pixels as it is turned towards the eye, so that the squares of N.V
    are even. Errors over these views are in the measure of `reflected.predicted_error`.
    """
    views = spiral_directions(2 * count)[count:]
    z = np.sqrt(least**2 + (1 - least**2) * views[:, 2:])
    return np.concatenate([views[:, :2] * np.sqrt((1 - z**2) / (1 - views[:, 2:] ** 2)), z], axis=1)


def _by_degree(texture: "ProductTexture", series: Array) -> Array:
    """Return what each degree of the light adds to the reflected light, shape (n, order+1, 3).

    The samples are `seen_views` of surfaces in all orientations, whose tangents point anywhere.
    """
    normals = spiral_directions(_FRAMES)
    helper = np.where(np.abs(normals[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    across = normalize(np.cross(helper, normals))
    turn = (_GOLDEN * np.arange(_FRAMES) ** 2 % (2 * np.pi))[:, None]
    tangents = np.cos(turn) * across + np.sin(turn) * np.cross(normals, across)
    light = np.moveaxis(rotate_into_frames(series, surface_frames(normals, tangents)), -1, 0)
    views = seen_views(_VIEWS, _LEAST_COSINE)
    own = np.broadcast_to(texture.values(views), (_VIEWS, series.shape[0], 3))
    parts = [
        np.einsum("vkc,fkc->fvc", own[:, l * l : (l + 1) ** 2], light[:, l * l : (l + 1) ** 2])
        for l in range(texture.order + 1)  # noqa: E741
    ]
    return np.stack(parts, axis=2).reshape(-1, texture.order + 1, 3)


def _weakened(seen: Array) -> Array | None:
    """Find the factors of ``auto`` from what each degree adds to samples, shape (n, order+1, 3).

    Those that leave no sample negative pay dearly for the last few. So they are brought nearer to 1
    until `_BLACK` of what is seen of a channel is negative. The result is None where that is so
    without factors, and where the mean of no channel is positive, which no factors change.
    """
    if _spots(seen, np.ones(seen.shape[1])) <= _BLACK or not (seen[:, 0].mean(axis=0) > 0).any():
        return None
    strongest = _factors(seen)
    weak, strong = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (weak + strong) / 2
        if _spots(seen, 1 - middle * (1 - strongest)) <= _BLACK:
            strong = middle
        else:
            weak = middle
    return np.asarray(1 - strong * (1 - strongest))


def _spots(seen: Array, factors: Array) -> float:
    """Return the largest share of a channel that is negative with some factors."""
    negative = np.einsum("nlc,l->nc", seen, factors) < 0
    return float(negative.mean(axis=0).max())


def _factors(seen: Array) -> Array:
    """Find the factors that change reflected light least, and leave no sample below 0.

    They are sought for the lowest samples, each channel beside its mean, and those that are low
    with these factors join, until none is.
    """
    squares = np.sum(seen**2, axis=(0, 2))
    means = seen[:, 0].mean(axis=0)
    # A color that the light lacks has no spots.
    each = np.concatenate([seen[..., c] / means[c] for c in np.flatnonzero(means > 0)])
    chosen = np.zeros(len(each), dtype=bool)
    factors: Array = np.ones(seen.shape[1])
    for _ in range(_ROUNDS):
        low = np.flatnonzero((each @ factors < 0) & ~chosen)
        if not len(low):
            break
        chosen[low[np.argsort(each[low] @ factors)[:_ADDED]]] = True
        factors = least_factors(squares, each[chosen][:, :, None], np.array([_MARGIN]))
    return factors
