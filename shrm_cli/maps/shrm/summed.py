"""Sums of SHRMs, for BRDFs whose terms are each kept about their own central direction."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.joint import brightness, joint_error
from shrm_cli.maps.kinds import ReflectionMap
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm
from shrm_cli.maps.size import look_up_error
from shrm_cli.records import record
from shrm_cli.sphere.cube import texel_solid_angles
from shrm_cli.sphere.directions import bisector
from shrm_cli.vocabulary import Frame, Sampling


def rms(term: Shrm | CompressedShrm) -> float:
    """Return the RMS of a map's radiance over mirror directions and views, by Parseval's theorem.

    The channels count together. The rows of a compressed map's matrix are orthonormal, so that
    its components have the energy of its coefficients.
    """
    (plane,) = term.planes()
    texels = texel_solid_angles(term.size, term.sampling)
    energy = np.einsum("ijk,ijk,ij->", plane, plane, texels, dtype=float)
    return float(np.sqrt(energy / 3) / (4 * np.pi))


@record(eq=False)
class SummedShrm(ReflectionMap):
    """SHRMs whose radiances add up.

    A diffuse term, for example, needs few coefficients about the normal, but many about the mirror
    direction.
    """

    terms: tuple[Shrm | CompressedShrm, ...]
    """The terms, which may differ in centre, size and orders."""
    info: MapInfo
    """How the sum was made, with the largest orders and the combined error of the terms."""

    representation = "shrm"
    texels_are_series = True
    format_version = 2
    is_rearrangeable = False
    what = "a sum of terms"

    def __post_init__(self) -> None:
        if len(self.terms) < 2:
            raise ValueError(f"{len(self.terms)} terms make no sum")

    @property
    def size(self) -> int:
        """Texels along an edge of the largest term's cube."""
        return max(term.size for term in self.terms)

    @property
    def frame(self) -> str:
        return self.terms[0].frame

    @property
    def center(self) -> str:
        """The centers of the terms, joined by plus signs."""
        return "+".join(term.center for term in self.terms)

    @property
    def parts(self) -> tuple[tuple[Any, str], ...]:
        return tuple((term, term.center) for term in self.terms)

    @property
    def sampling(self) -> Sampling:
        return self.terms[0].sampling

    @property
    def cube_count(self) -> int:
        return sum(term.cube_count for term in self.terms)

    def summary(self) -> dict[str, Any]:
        held = [term.cube_count for term in self.terms if isinstance(term, CompressedShrm)]
        return {**super().summary(), **({"components": sum(held)} if held else {})}

    def planes(self) -> list[Array]:
        return [plane for term in self.terms for plane in term.planes()]

    def with_planes(
        self, planes: Sequence[Array], sampling: Sampling, info: MapInfo
    ) -> "SummedShrm":
        """Return the same terms with other cubes; each term has a single one."""
        pairs = zip(self.terms, planes, strict=True)
        terms = tuple(
            term.with_planes([plane], sampling, term.info.read_as(info)) for term, plane in pairs
        )
        return replace(self, terms=terms, info=info)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> "SummedShrm":
        # What is known of the errors of a term may be those of the whole sum, as files have it, so
        # that what each term loses here is found without them.
        bare = [replace(term, info=replace(term.info, added_error=0.0)) for term in self.terms]
        moved = [cast("Shrm | CompressedShrm", term.resampled(size, sampling)) for term in bare]
        if all(one is other for one, other in zip(bare, moved, strict=True)):
            return self
        strengths = [rms(term) for term in bare]
        # Few pairs tell little of the light of a lamp, but well enough how much terms share of it.
        apart, together = brightness(bare)
        whole = float(np.sum(strengths)) * together / max(float(np.sum(apart)), 1e-300)
        own = joint_error(strengths, [each.info.added_error for each in moved], whole)
        info = self.info.adding(own)
        if self.info.filter_error:
            order = self.info.order_carried + self.info.order_p
            looked_up = [look_up_error(term.planes()[0], term.sampling, order) for term in moved]
            info = replace(info, filter_error=joint_error(strengths, looked_up, whole))
        terms = []
        for each in moved:
            known = replace(each.info, added_error=info.added_error, filter_error=info.filter_error)
            terms.append(replace(each, info=known))
        return SummedShrm(tuple(terms), info)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Refuse: a sum has no single SHRM, because its terms have different centers."""
        raise MapError(
            "a sum of terms about different centres has no single SHRM; prefilter again with "
            "`split=False`, or convert it to explicit maps"
        )

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        first, *others = (term.radiance(normals, views) for term in self.terms)
        return np.asarray(sum(others, start=first))

    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance, shape (..., 3), for mirror directions instead of normals."""
        centers, views = np.asarray(centers, dtype=float), np.asarray(views, dtype=float)
        return self.radiance(bisector(centers, views), views)

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
        return np.sum([term.rough_radiance(reflections, views) for term in self.terms], axis=0)
