"""SH exponentials and split sums beside the truth: spheres of twelve roughnesses and two f0.

This is the test of Silvennoinen et al. 2025, section 5.1. It has eight probes, f0 of 1 and .04, and
twelve alphas ``r^2`` with r evenly from .5 to 1. Its results are ratios of mean squared errors of
sphere pictures.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from research.extent import Extent
from research.glossy_truth import Light, Sphere, light_of, mirror_means, reflect, sphere
from research.split_sum import PaperSplitSum, source_of
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo, LobeMoments
from shrm_cli.maps.request import Request
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential, exponent_series
from shrm_cli.prefilter import make
from shrm_cli.probe.probe import Probe

Array = NDArray[np.floating]
Method = Callable[[int, float], Array]
"""A function of a roughness' index and an f0 that returns radiance, shape (pixels, 3 * probes)."""

F0 = 1.0, 0.04
VIEWS = (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0, 1, 0), (0, -1, 0)
"""Directions to the viewer; the first is the front."""


@dataclass(frozen=True)
class Scene:
    """Spheres under some probes, and the light that they reflect.

    Attributes
    ----------
    probes : tuple of Probe
    roughnesses : tuple of float
        Perceptual roughnesses.
    spheres : tuple of Sphere
    light : Light
        The probes as lights.
    truth : ndarray, shape (2, roughnesses, pixels of all spheres, 3 * probes)
        The integrals E0 and E1 of `reflect`.
    means : ndarray, shape (roughnesses, pixels of all spheres, 3 * probes)
        The exact first factor of the split sum, at the pixels' own R and for each roughness.
    """

    probes: tuple[Probe, ...]
    roughnesses: tuple[float, ...]
    spheres: tuple[Sphere, ...]
    light: Light
    truth: Array
    means: Array

    @classmethod
    def of(
        cls, probes: Sequence[Probe], roughnesses: Sequence[float], spheres: Sequence[Sphere]
    ) -> "Scene":
        light, alphas = light_of(probes), [roughness**2 for roughness in roughnesses]
        truth = [reflect(each, light, alphas) for each in spheres]
        means = [mirror_means(each.mirrored, light, alphas) for each in spheres]
        return cls(
            tuple(probes), tuple(roughnesses), tuple(spheres), light,
            np.concatenate(truth, axis=2), np.concatenate(means, axis=1),
        )  # fmt: skip

    @property
    def normals(self) -> Array:
        return np.concatenate([each.normals for each in self.spheres])

    @property
    def views(self) -> Array:
        return np.concatenate([each.views for each in self.spheres])

    def exact(self, k: int, f0: float) -> Array:
        """Return the true radiance; this is a `Method`."""
        return np.asarray(f0 * self.truth[0, k] + (1 - f0) * self.truth[1, k])

    def errors(self, method: Method) -> Array:
        """Compute a method's mean squared error over the pixels and channels of each picture.

        Returns
        -------
        ndarray, shape (f0, roughnesses, probes, spheres)
        """
        ends = np.cumsum([len(each.normals) for each in self.spheres])[:-1]
        result = np.empty((len(F0), len(self.roughnesses), len(self.probes), len(self.spheres)))
        for i, f0 in enumerate(F0):
            for k in range(len(self.roughnesses)):
                square = (method(k, f0) - self.exact(k, f0)) ** 2
                for v, part in enumerate(np.split(square, ends)):
                    result[i, k, :, v] = part.mean(axis=0).reshape(-1, 3).mean(axis=1)
        return result


def fitted(probe: Probe, **options: Any) -> SphericalHarmonicExponential:
    """Fit a SH exponential to one probe, with options of `prefilter`."""
    made = make(probe, Request.of("she", options, probe)).map
    assert isinstance(made, SphericalHarmonicExponential)
    return made


def exponentials(scene: Scene, **options: Any) -> Method:
    """Fit SH exponentials to all probes, with options of `prefilter`."""
    maps = [fitted(probe, **options) for probe in scene.probes]
    return evaluate(scene, maps)


def evaluate(scene: Scene, maps: Sequence[SphericalHarmonicExponential]) -> Method:
    """Return `radiance` of shaded maps as a method that computes the geometry only once."""
    normals, views = scene.normals, scene.views
    cosines = np.sum(normals * views, axis=-1)
    moments = [LobeMoments(roughness).at(cosines) for roughness in scene.roughnesses]

    def method(k: int, f0: float) -> Array:
        series = exponent_series(maps[0], normals, views, scene.roughnesses[k], moments[k], f0)
        exponents = [series.exponent(each.coefficients) for each in maps]
        return series.albedo[:, None] * np.exp(np.concatenate(exponents, axis=1))

    return method


def exact_split_sum(scene: Scene) -> Method:
    """Our split sum without noise, texels and levels: the lobe is integrated at each pixel."""
    return _split_sum(scene, lambda k: scene.means[k])


def paper_split_sum(scene: Scene, filtered: bool) -> Method:
    """The split sum as the paper and engines run it; see the module `split_sum`."""
    source = source_of([probe.image() for probe in scene.probes])
    directions = np.concatenate([each.mirrored for each in scene.spheres])
    made = PaperSplitSum(source, directions, filtered)
    return _split_sum(scene, lambda k: made.at(scene.roughnesses[k]))


def _split_sum(scene: Scene, means: Callable[[int], Array]) -> Method:
    """Multiply a first factor by the environment-BRDF."""
    cosines = np.sum(scene.normals * scene.views, axis=-1)
    albedos = [DirectionalAlbedo(roughness).scale_bias(cosines) for roughness in scene.roughnesses]

    def method(k: int, f0: float) -> Array:
        scale, bias = albedos[k]
        return means(k) * (f0 * scale + bias)[:, None]

    return method


@dataclass(frozen=True)
class Contest:
    """The mean squared errors of one method, divided by those of another.

    Attributes
    ----------
    name : str
        The heading of its columns.
    front, six : ndarray, shape (f0, roughnesses, probes)
        The ratio of the errors of the picture from the front, and the ratio of the mean errors of
        six pictures.
    """

    name: str
    front: Array
    six: Array

    @classmethod
    def of(cls, name: str, ours: Array, other: Array) -> "Contest":
        """Compare two results of `Scene.errors`."""
        return cls(name, ours[..., 0] / other[..., 0], ours.mean(axis=-1) / other.mean(axis=-1))


def share(ratios: Array) -> float:
    """The part of the cases with a ratio below 1, where the first method has the smaller error."""
    return float(np.mean(ratios < 1))


def geometric_mean(ratios: Array) -> float:
    return float(np.exp(np.mean(np.log(ratios))))


@dataclass(frozen=True)
class Results:
    """Three comparisons with split sums, and how the error falls with more coefficients.

    Attributes
    ----------
    names : tuple of str
        The names of the probes.
    roughnesses : tuple of float
        The perceptual roughnesses.
    paper : tuple of Contest
        Comparison (a), the paper's fit against the split sum as the paper runs it.
    plain : tuple of Contest
        Comparison (b), the paper's fit against the exact split sum.
    best : tuple of Contest
        Comparison (c), our fit against the exact split sum.
    falls : Contest
        Our fit with more coefficients against our fit with 33.
    """

    names: tuple[str, ...]
    roughnesses: tuple[float, ...]
    paper: tuple[Contest, ...]
    plain: tuple[Contest, ...]
    best: tuple[Contest, ...]
    falls: Contest


def compare(probes: Sequence[Probe], extent: Extent) -> Results:
    """Make all comparisons, which takes about a minute for eight probes."""
    front, others, _ = extent.glossy_pictures
    spheres = [sphere(v, others if k else front) for k, v in enumerate(VIEWS)]
    scene = Scene.of(probes, extent.roughnesses, spheres)
    exact = scene.errors(exact_split_sum(scene))
    noisy, filtered = (scene.errors(paper_split_sum(scene, each)) for each in (False, True))
    paper = scene.errors(exponentials(scene, law="paper"))
    ours = scene.errors(exponentials(scene))
    more = scene.errors(exponentials(scene, p_order=6, q_order=4))
    wide = scene.errors(exponentials(scene, roughness=(0.2, 1.0)))
    return Results(
        tuple(Path(probe.name).stem for probe in probes),
        extent.roughnesses,
        (
            Contest.of("samples read the probe", paper, noisy),
            Contest.of("samples read its mips", paper, filtered),
        ),
        (Contest.of("paper's fit", paper, exact),),
        (
            Contest.of("default", ours, exact),
            Contest.of("P 6, Q 4", more, exact),
            Contest.of("roughness .2 .. 1", wide, exact),
        ),
        Contest.of("P 6, Q 4 over P 4, Q 2", more, ours),
    )
