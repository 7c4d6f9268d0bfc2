"""Coefficients of BRDF product functions: the BRDF times the cosine, for one view each.

For a view v in the frame of the surface (z = N, x along the tangent) the product function
``f*_v(s) = f(s, v) max(0, s_z)`` is a function of the direction s to the light. Its harmonics are
``c_i(v) = int y_i(s) f*_v(s) ds``, and a surface under light of the coefficients L_i in that frame
reflects ``sum_i L_i c_i(v)``.

They are integrated with nodes where the lobe is. Lobes about the mirror direction are functions of
the half vector H between light and view, which is near the normal in all of a lobe however the view
grazes. So the rule for them is one in the polar angle eta and the azimuth psi of H, and
``dL = 4 (V.H) dH``. With the view at the angle theta from the normal, and psi counted from its
azimuth, the light is above the horizon where ``eta < pi/4 + atan(tan(theta) cos(psi)) / 2``. The
radii of each azimuth end there, so that no sample is beyond the horizon and the integrand is smooth
on all of its domain, for which rules of Gauss and Legendre converge exponentially. That bound rises
steeply where psi is a right angle and the view grazes; azimuths crowd there. The lobes of brushed
surfaces are ellipses over H, which have next to all azimuths beside their long axis; azimuths crowd
there, too, and radii as far out as the ellipse reaches.

BRDFs about the normal have a rule in the light's own polar coordinates, and so have those that have
no horizon, about their central direction.

References: Kautz, Sloan and Snyder 2002, "Fast, Arbitrary BRDF Shading for Low-Frequency Lighting
Using Spherical Harmonics", section 3 and eq. 1.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import Self

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices, relative_difference, slices
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.lobe_expansion import axis_widths, lobe_width
from shrm_cli.brdf.polar_rule import PolarRule, SplitRule
from shrm_cli.brdf.sums import Sum
from shrm_cli.progress import in_order
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, local_frame, to_angles
from shrm_cli.sphere.harmonics import harmonic_planes
from shrm_cli.sphere.parabolic import project, unproject
from shrm_cli.sphere.quadrature import gauss_legendre

_LEAST_COSINE = 1e-3
"""The least N.V that the crowding of azimuths knows."""


@record
class LightRule:
    """Nodes over the light for any view."""

    center: str
    """What the nodes crowd about. One of "reflection", "normal" and "tangent"."""
    width: tuple[float, float]
    """The angles from it within which about half of a BRDF's energy lies, along the tangent and
    across it, radians."""
    has_horizon: bool
    """Whether the nodes are above the horizon only."""

    @classmethod
    def of(cls, brdf: Brdf) -> "LightRule":
        """Return the rule that suits a BRDF."""
        along = across = 1.0
        if brdf.center == "reflection" and brdf.isotropic:
            along = across = lobe_width(brdf)
        elif brdf.center == "reflection":
            along, across = axis_widths(brdf)
        return cls(brdf.center, (min(along, 1.0), min(across, 1.0)), cuts_horizon(brdf))

    def nodes(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        """Return directions to the light, and their weights, for each view.

        `views`, of shape (n, 3), are directions to the viewer in the frame of the normal, z = N,
        with the tangent along x. `along` and `around` are the numbers of nodes along a radius, and
        around it, of which the latter is a multiple of 8.

        Returns `directions` of shape (n, along * around, 3), unit, in the same frame; and `weights`
        of shape (n, along * around), they sum to the solid angle, 2 pi or 4 pi.
        """
        if self.has_horizon and self.center == "reflection":
            return self._of_half_vectors(views, along, around)
        return self._of_lights(views, along, around)

    def _of_half_vectors(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        theta, azimuth = (angle[:, None] for angle in to_angles(views))
        along_tangent, across = self.width
        # The bound of the radii is steep beside the right angles.
        steep = np.pi / 2 * np.maximum(np.cos(theta), _LEAST_COSINE)
        turns: list[Array] = [np.full_like(theta, side) for side in (-np.pi / 2, np.pi / 2)]
        widths: list[Array] = [steep, steep]
        if along_tangent != across:
            axis = (0.0 if along_tangent > across else np.pi / 2) - azimuth
            ratio = np.full_like(theta, min(self.width) / max(self.width))
            turns, widths = [*turns, axis, axis + np.pi], [*widths, ratio, ratio]
        psi, psi_weights = _azimuths(np.hstack(turns), np.hstack(widths), around)
        slope = np.sin(theta) * np.cos(psi)
        end = np.pi / 4 + np.arctan2(slope, np.maximum(np.cos(theta), 0.0)) / 2
        turned = psi + azimuth
        reach = 1 / np.hypot(np.cos(turned) / along_tangent, np.sin(turned) / across)
        eta, weights = _radii(end, reach / 2, along)
        half = from_angles(eta, turned[..., None])
        weights = weights * psi_weights[..., None] * np.sin(eta)
        cosine = np.einsum("nijk,nk->nij", half, views)
        directions = 2 * cosine[..., None] * half - views[:, None, None]
        shape = len(views), along * around
        return directions.reshape(*shape, 3), (4 * weights * cosine).reshape(shape)

    def _of_lights(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        is_half = self.has_horizon and self.center == "normal"
        rule = SplitRule() if is_half else PolarRule(min(self.width))
        theta, weights = rule.nodes(along)
        psi = 2 * np.pi * (np.arange(around) + 0.5) / around
        local = from_angles(theta[:, None], psi).reshape(-1, 3)
        directions = local @ local_frame(*to_angles(self._centers(views))).swapaxes(1, 2)
        weights = np.repeat(weights * (2 * np.pi / around), around)
        return directions, np.broadcast_to(weights, directions.shape[:2])

    def _centers(self, views: Array) -> Array:
        if self.center == "reflection":
            return views * np.array([-1.0, -1.0, 1.0])
        axis = np.array([0.0, 0.0, 1.0] if self.center == "normal" else [1.0, 0.0, 0.0])
        return np.broadcast_to(axis, views.shape)


def _azimuths(turns: Array, widths: Array, count: int) -> tuple[Array, Array]:
    """Azimuths that crowd about k of them, within widths, for each of n views, and their weights.

    Each half of a part of the circle between two of these begins at one, with as many nodes.

    `turns` and `widths` are of shape (n, k), radians. Returns two arrays of shape (n, count).
    """
    turns = np.mod(turns, 2 * np.pi)
    # What is steep beside one of them is so beside its neighbours, too.
    apart = np.abs(np.mod(turns[:, :, None] - turns[:, None] + np.pi, 2 * np.pi) - np.pi)
    widths = np.min(widths[:, None] + apart, axis=2)
    order = np.argsort(turns, axis=1, kind="stable")
    turns, widths = (np.take_along_axis(each, order, axis=1) for each in (turns, widths))
    following = np.append(turns[:, 1:], turns[:, :1] + 2 * np.pi, axis=1)
    ends, share = (following - turns) / 2, count // (2 * turns.shape[1])
    found = []
    for first, width, way in ((turns, widths, 1), (following, np.roll(widths, -1, axis=1), -1)):
        away, weights = _radii(ends, width, share)
        found.append((first[..., None] + way * away, weights))
    psi, weights = (np.concatenate(each, axis=1) for each in zip(*found, strict=True))
    return psi.reshape(len(turns), -1), weights.reshape(len(turns), -1)


def _radii(end: Array, width: Array, count: int) -> tuple[Array, Array]:
    """Nodes within 0 .. end that crowd within a width: (..., count), and their weights."""
    end, width = end[..., None], width[..., None]
    crowding = np.arcsinh(end / width)
    nodes, weights = gauss_legendre(count)
    u = crowding * (nodes + 1) / 2
    return width * np.sinh(u), weights / 2 * crowding * width * np.cosh(u)


ACCURACY = 1e-4
"""The relative RMS change, by doubling its nodes, that a rule may show."""
_LEAST_NODES = 12, 24
"""The numbers of nodes along the radius and around it that are tried first."""


@record
class _Effort:
    """How many nodes a rule may have."""

    most: int
    """The most nodes."""
    good: float
    """The relative residual with which a rule of many nodes will do."""
    good_most: int
    """The most nodes of such a rule."""


_MODELS = _Effort(2**15, 6e-4, 2**12)
"""Models with kinks converge slowly, and files in half precision do not keep what they gain."""
_MEASURED = _Effort(2**13, 0.0, 0)
"""Measured data have kinks and noise that finer rules do not mend."""
_BRUSHED = _Effort(2**12, 1e-2, 2**11)
"""In measured data that are anisotropic no view is another one turned, so that there are eight
times as many of them. Filtering between texels misses about a hundredth of such data."""
_SAMPLES_AT_ONCE = 2**13
_BANDS = 0.0, 0.5, 0.75, 0.9, 0.97, 1.0
"""Radii in the parabolic map between which views have a rule in common. Lobes are narrower and less
regular the more the view grazes, so most nodes are needed in the narrowest bands."""
_SCOUTS = 8
"""Views in each band that rules are tried at."""
_SCOUT_EDGE = 0.005
"""How near to the rim of the map views are tried; N.V is 0.005 there."""


@record
class ProductQuadrature:
    """A rule with enough nodes for a BRDF, and what it still misses."""

    brdf: Brdf
    rule: LightRule
    along: int
    around: int
    """`along` and `around`: the numbers of nodes along the radius and around it."""
    residual: float
    """The relative RMS change of the coefficients when the nodes were last doubled in number, which
    is more than what the rule misses."""

    @classmethod
    def converged(cls, brdf: Brdf, views: Array, order: int, accuracy: float = ACCURACY) -> Self:
        """Double the nodes until the coefficients of some views do not change any more.

        `brdf` is no sum; the terms of a sum have rules of their own. `views`, of shape (n, 3), are
        directions to the viewer, unit, in the frame of the surface. `accuracy` is the relative RMS
        change at which to stop, if no more nodes are needed than the BRDF is worth.
        """
        effort = _MODELS
        if brdf.is_measured:
            effort = _MEASURED if brdf.isotropic else _BRUSHED
        along, around = _LEAST_NODES
        made = cls(brdf, LightRule.of(brdf), along, around, np.inf)
        now = made.coefficients(views, order)
        while True:
            changes = []
            for more in ((2 * made.along, made.around), (made.along, 2 * made.around)):
                finer = cls(brdf, made.rule, *more, np.inf)
                then = finer.coefficients(views, order)
                changes.append((relative_difference(now, then), finer, then))
            residual = float(np.hypot(changes[0][0], changes[1][0]))
            most = effort.good_most if residual <= effort.good else effort.most
            if residual <= accuracy or 2 * made.along * made.around > most:
                return cls(brdf, made.rule, made.along, made.around, residual)
            # The axis that changes more is refined; the other will have its turn.
            _, made, now = max(changes, key=lambda change: change[0])

    def coefficients(self, views: Array, order: int) -> Array:
        """Project product functions onto the harmonics.

        Returns an array of shape (n, (order+1)^2, channels): index l(l+1)+m; one channel for a grey
        BRDF, else three.
        """
        return self.expanded(views, order)[0]

    def expanded(self, views: Array, order: int) -> tuple[Array, Array]:
        """Project product functions, and integrate their squares.

        Returns `coefficients` of shape (n, (order+1)^2, channels); and `energy` of shape (n,
        channels), the integrals of the squared product functions, which by Parseval are the sums of
        the squared coefficients of all degrees.
        """
        parts = [self._block(views[part], order) for part in self.blocks(len(views))]
        coefficients, energy = (np.concatenate(part) for part in zip(*parts, strict=True))
        check_finite(energy.sum(), self.brdf)
        return coefficients, energy

    def fine_enough(self, order: int) -> Self:
        """Return a rule with nodes enough to tell harmonics of a degree from those of others.

        A rule that has converged at low degrees may have too few nodes for high ones, which would
        seem to hold energy that is not theirs.
        """
        along, around = ceil(1.5 * order), 8 * ceil(0.75 * order)
        return replace(self, along=max(self.along, along), around=max(self.around, around))

    def blocks(self, count: int) -> Iterator[slice]:
        """Cut a number of views into blocks whose samples fit into the cache."""
        return slices(count, _SAMPLES_AT_ONCE // (self.along * self.around))

    def _block(self, views: Array, order: int) -> tuple[Array, Array]:
        light, weights = self.rule.nodes(views, self.along, self.around)
        # Single precision is far more exact than any rule, and models and tables are faster in it.
        values = self.brdf.transfer(
            own_frame(self.brdf, light.astype(np.float32)),
            own_frame(self.brdf, views[:, None].astype(np.float32)),
        )
        if values.strides[-1] == 0:
            values = values[..., :1]
        weighted = values * weights[..., None]
        harmonics = harmonic_planes(order, light)
        return (
            harmonics.transpose(1, 0, 2) @ weighted,
            np.einsum("nsc,nsc->nc", weighted, values, dtype=float),
        )


@record
class ProductFunctions:
    """The product functions of any BRDF, also of a sum, with rules that suffice for them."""

    terms: tuple[tuple[float, tuple[ProductQuadrature, ...]], ...]
    """The weight of each term of a sum, and its rules for the bands of `_BANDS`."""

    @classmethod
    def of(cls, brdf: Brdf, order: int, accuracy: float = ACCURACY) -> Self:
        """Find the rules for a BRDF; see `ProductQuadrature.converged`."""
        terms = brdf.terms if isinstance(brdf, Sum) else ((1.0, brdf),)
        scouts = scout_views()
        return cls(
            tuple(
                (
                    weight,
                    tuple(
                        ProductQuadrature.converged(term, views, order, accuracy)
                        for views in scouts
                    ),
                )
                for weight, term in terms
            )
        )

    @property
    def residual(self) -> float:
        """The largest relative residual of any rule."""
        return max(rule.residual for _, rules in self.terms for rule in rules)

    @property
    def most_nodes(self) -> int:
        """The number of directions to the light that are sampled for a grazing view."""
        return sum(max(rule.along * rule.around for rule in rules) for _, rules in self.terms)

    def coefficients(self, views: Array, order: int) -> Array:
        """Project the functions of all terms, as `ProductQuadrature.coefficients` does of one."""
        jobs = self._jobs(views)
        count = sum(len(part) * rule.along * rule.around for _, rule, part in jobs)
        result: Array = np.zeros((len(views), (order + 1) ** 2, 1))
        done = 0

        def work(job: tuple[float, ProductQuadrature, Indices]) -> Array:
            weight, rule, part = job
            return weight * rule.coefficients(views[part], order)

        for (_, rule, part), found in zip(jobs, in_order(work, jobs), strict=True):
            if found.shape[-1] > result.shape[-1]:
                result = np.repeat(result, found.shape[-1], axis=-1)
            result[part] += found
            done += len(part) * rule.along * rule.around
            progress.report(done, count)
        return result

    def expanded(self, views: Array, order: int) -> tuple[Array, Array]:
        """Project product functions, and integrate their squares.

        What the terms of a sum have beyond the order is taken to be in phase, which is the most
        that it can be.
        """
        coefficients, beyond = (np.zeros((len(views), k, 1)) for k in ((order + 1) ** 2, 1))
        for weight, rule, part in self._jobs(views):
            values, energy = rule.fine_enough(order).expanded(views[part], order)
            channels = max(values.shape[-1], coefficients.shape[-1])
            coefficients, beyond = (
                np.repeat(each, channels // each.shape[-1], axis=-1)
                for each in (coefficients, beyond)
            )
            coefficients[part] += weight * values
            rest = np.maximum(energy - np.sum(values**2, axis=1), 0.0)
            beyond[part, 0] += weight * np.sqrt(rest)
        return coefficients, np.sum(coefficients**2, axis=1) + beyond[:, 0] ** 2

    def _jobs(self, views: Array) -> list[tuple[float, ProductQuadrature, Indices]]:
        """List what is to be computed: for each job a weight, a rule, and indices of views."""
        radius = np.hypot(*project(views))
        band = np.searchsorted(_BANDS[1:-1], radius, side="right")
        jobs = []
        for weight, rules in self.terms:
            for index, rule in enumerate(rules):
                own = np.flatnonzero(band == index)
                jobs += [(weight, rule, own[part]) for part in rule.blocks(len(own))]
        return jobs


def scout_views() -> list[Array]:
    """Return views in each of the bands, in no symmetric places, shape (`_SCOUTS`, 3) each."""
    found = []
    for low, high in pairwise(_BANDS):
        k = np.arange(_SCOUTS)
        share = k / (_SCOUTS - 1)
        radius = np.minimum(low + (high - low) * share, 1 - _SCOUT_EDGE)
        turn = k * (np.pi * (3 - np.sqrt(5))) + 0.3
        found.append(unproject(radius * np.cos(turn), radius * np.sin(turn)))
    return found


def own_frame(brdf: Brdf, directions: Array) -> Array:
    """Bring directions from the surface's frame into that of the BRDF.

    They are the same, but a BRDF about the tangent has its z axis along the surface's x axis.
    """
    return directions[..., [1, 2, 0]] if brdf.center == "tangent" else directions
