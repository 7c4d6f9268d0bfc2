"""The interface of every map, whatever its representation.

Each representation has a folder beside this module; the three explicit maps share one. A folder
has these modules:

``prefilter``
    How the map is made: ``prefilter(probe, request) -> Prefiltered``; and ``report``, what
    `shrm prefilter` prints about it.
``file``
    The layout of the map in a file: ``encode(map) -> list of Part``, ``decode(file) -> map``.
``shader``
    Its look-up as code, where it has the option ``shader``: ``source(map, textures) -> Source``.

The registry (`shrm_cli.maps.registry`) describes what each takes, finds these modules, and loads
each only when it is needed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import mix_channels
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps import registry
from shrm_cli.maps.info import MapInfo
from shrm_cli.records import Displayed
from shrm_cli.sphere.directions import bisector
from shrm_cli.vocabulary import MAX_CUBE_SIZE, Frame, Orientation, Precision, Sampling

if TYPE_CHECKING:
    import os

    from shrm_cli.brdf.base import Color
    from shrm_cli.files.parts import Part
    from shrm_cli.maps.shrm.shrm import Shrm


class Map(Displayed, ABC):
    """Prefiltered light.

    Attributes
    ----------
    representation : str
        The name of the representation in `vocabulary.REPRESENTATIONS`, in files and on the
        command line.
    frame : {"global", "local"}
        The axes of the view in the map.
    center : {"reflection", "normal", "tangent"}
        The central direction, by which the map is looked up. A sum has the centers of its terms,
        joined by ``+``.
    size : int
        Texels along an edge of the largest cube that the map holds; 1 where it holds none.
    sampling : {"center", "border"}
        Where the edge texels of the cubes lie.
    info : MapInfo
        How the map was made.
    format_version : int
        The version of the format of its files, where they are laid out as OpenEXR's stacked cube.
    natural_precision : {"auto", "half", "float"}
        The precision of its files where the caller asks for ``auto``.
    is_rearrangeable : bool
        Whether files can hold its cubes in other layouts than OpenEXR's stacked cube.
    needs_surface : bool
        Whether the map holds light for any GGX surface, which is chosen when the map is used.
    needs_light : bool
        Whether the map holds a BRDF alone, whose light is chosen when the map is used.
    varies : bool
        Whether a parameter of the BRDF may vary over the surface; see `varied_radiance`.
    against_negatives : str
        What a user can do where the map is negative.
    """

    representation: ClassVar[str]
    format_version: ClassVar[int] = 1
    natural_precision: ClassVar[Precision] = "auto"
    is_rearrangeable: ClassVar[bool] = True
    needs_surface: ClassVar[bool] = False
    needs_light: bool = False
    varies: ClassVar[bool] = False
    against_negatives: ClassVar[str] = "take `to` auto without `eps` or orders"
    info: MapInfo

    if TYPE_CHECKING:
        # Subclasses define these as fields, class attributes or properties. Properties of this
        # class would get in the way of their fields at run time.
        @property
        def frame(self) -> str: ...
        @property
        def center(self) -> str: ...
        @property
        def size(self) -> int: ...
        @property
        def sampling(self) -> Sampling: ...

    # ---- what it reflects --------------------------------------------------------------------

    @abstractmethod
    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the reflected radiance.

        A map that `needs_surface` is shown as GGX of roughness 0.5 and reflectance 1 at normal
        incidence; `shaded` chooses another surface.

        Parameters
        ----------
        normals, views : array_like, shape (..., 3), broadcastable
            Unit vectors in world axes; views point to the viewer.

        Returns
        -------
        ndarray, shape (..., 3)
        """

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance that a surface reflects whose tangents are known.

        Maps of isotropic BRDFs about the normal or the mirror direction do not care for tangents,
        so that this is `radiance` here.

        Parameters
        ----------
        normals, tangents, views : array_like, shape (..., 3), broadcastable
            Unit vectors in world axes. Tangents are perpendicular to the normals and run along the
            x axis of the BRDF's own frame; the y axis is N x T.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        return self.radiance(normals, views)

    def varied_radiance(
        self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike, shares: ArrayLike
    ) -> Array:
        """Evaluate the radiance of a surface over which a parameter of the BRDF varies.

        Maps of which nothing varies do not care, so that this is `brushed_radiance` here.

        Parameters
        ----------
        normals, tangents, views : array_like, shape (..., 3), broadcastable
            As `brushed_radiance` takes them.
        shares : array_like, shape (...), broadcastable with them
            The parameter as a share of the way from its least to its largest value, 0 .. 1.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        return self.brushed_radiance(normals, tangents, views)

    def glimpse(self, reflections: Array, views: Array) -> Array:
        """Evaluate the reflected radiance roughly, but fast, without preparing any filter.

        Parameters
        ----------
        reflections, views : ndarray, shape (n, 3)
            The mirror directions of the views and the views, unit vectors in world axes.

        Returns
        -------
        ndarray, shape (n, 3)
            Here it is exact; maps that can do it faster take the nearest texels.
        """
        return self.radiance(bisector(reflections, views), views)

    @property
    def roughness_range(self) -> tuple[float, float]:
        """The least and the largest perceptual roughness that the map can be `shaded` with.

        It is 0 and 1 for maps to which the roughness makes no difference.
        """
        return 0.0, 1.0

    def shaded(self, roughness: float, f0: Color) -> Any:
        """Return the light of the map as a GGX surface reflects it.

        Parameters
        ----------
        roughness : float
            Perceptual roughness in 0 .. 1; GGX's alpha is its square.
        f0 : tuple of 3 float
            Reflectance at normal incidence, linear RGB, in 0 .. 1.

        Returns
        -------
        object with `info` and `radiance`
            The map itself, unless it `needs_surface`.

        Raises
        ------
        MapError
            If the map needs a surface, and a value is out of range.
        """
        return self

    def lit(self, lighting: ArrayLike) -> Map:
        """Return the map under light of some coefficients.

        Parameters
        ----------
        lighting : array_like, shape ((order+1)^2, 3)
            The light over the real harmonics of world axes, index l(l+1)+m.

        Raises
        ------
        MapError
            If the map holds its own light already, or needs more coefficients.
        """
        raise MapError(f"{self.what} holds its own light")

    # ---- what it is --------------------------------------------------------------------------

    @property
    @abstractmethod
    def cube_count(self) -> int:
        """The number of RGB cubes that the map stores."""

    @abstractmethod
    def planes(self) -> Sequence[Array]:
        """Return the cubes of the map, shape (6N, N, channels) each, in OpenEXR's arrangement."""

    @abstractmethod
    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> Self:
        """Return the same map with other cubes, which have the form of its `planes`."""

    @property
    def what(self) -> str:
        """What messages call the map."""
        return f"a map of representation {self.representation}"

    @property
    def stored(self) -> Map:
        """The map whose cubes files hold: the map itself, unless lamps are beside it."""
        return self

    @property
    def is_exact_in_half(self) -> bool:
        """Whether half-precision floats represent every value of the map's cubes exactly."""
        return all(_is_exact(plane) for plane in self.planes())

    @property
    def turns_with_texels(self) -> bool:
        """Whether the map's values belong to axes that turn from texel to texel.

        Such values cannot be interpolated between texels, so that they cannot be laid out as a
        lat-long.
        """
        return False

    @property
    def parts(self) -> tuple[tuple[Any, str], ...]:
        """What it is the sum of, and the central direction by which each of it is looked up."""
        return ((self, self.center),)

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told about every map, by the names used in JSON."""
        info = self.info
        return {
            "representation": self.representation,
            "frame": self.frame,
            "center": self.center,
            "size": self.size,
            "sampling": self.sampling,
            "maps": self.cube_count,
            "domain": info.domain,
            "order_f": info.order_f,
            "order_p": info.order_p,
            "order_carried": info.order_carried,
            "epsilon": info.eps,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "filter_error": info.filter_error,
            "storage_error": info.storage_error,
        }

    def details(self) -> dict[str, Any]:
        """Return what `shrm info` adds to the `summary`: all that the file holds besides cubes."""
        return {"fit_residual": self.info.fit_residual}

    # ---- other maps of the same light --------------------------------------------------------

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> Map:
        """Return the map on cubes of another size or sampling, filtered as `radiance` filters it.

        Parameters
        ----------
        size : int, optional
            Texels along a face's edge; that of the map by default.
        sampling : {"center", "border"}, optional
            Where the edge texels lie; that of the map by default.

        Returns
        -------
        Map
            The new map, whose `info` includes what the filtering adds to the relative RMS error,
            and what bilinear look-ups in the new cubes cost.

        Raises
        ------
        MapError
            If the result would be too large.
        """
        size = self.size if size is None else size
        if size > MAX_CUBE_SIZE:
            raise MapError(f"a map of size {size} is larger than {MAX_CUBE_SIZE}; lower `size`")
        sampling = sampling or self.sampling
        if (size, sampling) == (self.size, self.sampling):
            return self
        self.check_memory(size)
        return self._moved(size, sampling)

    def check_memory(self, size: int) -> None:
        """Check that the map could be kept in memory at another size.

        Maps of light alone are never made larger than they are, so nothing is checked here.

        Raises
        ------
        MapError
            If the map would be too large.
        """
        return

    def _moved(self, size: int, sampling: Sampling) -> Map:
        """Return the map on other cubes, each filtered from the old cube in its place."""
        from shrm_cli.maps.size import look_up_error
        from shrm_cli.sphere.cube import CubeSampler, cube_directions

        directions = cube_directions(size, sampling)
        before = self.planes()
        after = [CubeSampler(plane, self.sampling)(directions) for plane in before]
        lost = _lost(before[0], after[0], self.sampling, sampling)
        info = replace(self.info, added_error=float(np.hypot(self.info.added_error, lost)))
        if info.filter_error:
            order = info.order_carried + info.order_p
            info = replace(info, filter_error=look_up_error(after[0], sampling, order))
        return self.with_planes(after, sampling, info)

    def to_shrm(self, order_p: int | None = None, frame: Frame | None = None) -> Shrm:
        """Return the SHRM that the map holds, or the one that fits it best.

        Parameters
        ----------
        order_p : int, optional
            The order P of the result; that of the map by default.
        frame : {"global", "local"}, optional
            The frame of the result; that of the map by default.

        Raises
        ------
        MapError
            If the map has no SHRM, or does not determine so high an order.
        """
        raise MapError(f"{self.what} has no SHRM; prefilter the probe for a BRDF")

    def converted(
        self,
        to: str,
        size: int | None = None,
        sampling: Sampling | None = None,
        **options: Any,
    ) -> Map:
        """Convert the map to another representation.

        Parameters
        ----------
        to : str
            One of `vocabulary.REPRESENTATIONS`.
        size, sampling
            The size and sampling of the cubes, as `resampled` takes them.
        **options
            ``order_p`` and ``frame`` of an SHRM, and those options of the new representation that
            `shrm convert` takes.

        Raises
        ------
        MapError, ArgumentError
            If the map cannot be converted to that representation, or an option does not apply.
        """
        return registry.map_class(to).from_map(self.resampled(size, sampling), **options)

    def turned(self, matrix: ArrayLike) -> Map:
        """Return the map of the same light turned.

        Parameters
        ----------
        matrix : array_like, shape (3, 3)
            Orthogonal; what came from a direction d comes from ``matrix @ d``.

        Raises
        ------
        MapError
            If the map is no map of light alone that consists of coefficients. Other maps would
            have to be filtered again, which their probe need not.
        """
        raise MapError(
            f"{self.what} cannot be turned without loss; prefilter its probe with `yaw`, `pitch` "
            "and `roll`"
        )

    def mixed(self, matrix: Array, info: MapInfo) -> Map:
        """Return the map with a matrix times its red, green and blue; see `maps.primaries`."""
        planes = [mix_channels(plane, matrix) for plane in self.planes()]
        return self.with_planes(planes, self.sampling, info)

    @classmethod
    def from_map(cls, source: Map, **options: Any) -> Map:
        """Make a map of this representation from another map; see `converted`."""
        if source.representation != cls.representation:
            raise no_way(source, cls.representation)
        refuse_arguments(f"a map of representation {cls.representation}", **options)
        return source

    # ---- files -------------------------------------------------------------------------------

    def encode(self) -> list[Part]:
        """Return the parts of a file that holds the map as OpenEXR's stacked cubes."""
        parts: list[Part] = registry.module(self.representation, "file").encode(self)
        return parts

    def save(
        self,
        path: str | os.PathLike[str],
        precision: Precision = "auto",
        layout: str = "openexr",
        orientation: Orientation = "openexr",
    ) -> str:
        """Write the map to a file, completely or not at all; see `shrm_cli.maps.file.save`.

        Returns
        -------
        str
            The pixel type written, ``"half"`` or ``"float"``.

        Raises
        ------
        OutputError, MapError
        """
        from shrm_cli.maps.file import save

        return save(path, self, precision, layout, orientation)


def refuse_arguments(what: str, **values: Any) -> None:
    """Refuse arguments that would change nothing, if any of them is given.

    Parameters
    ----------
    what : str
        What the arguments do not apply to, such as ``"a map of representation she"``.
    **values
        The arguments by their names. An argument that is None counts as not given.

    Raises
    ------
    ArgumentError
        If an argument is given.
    """
    for name, value in values.items():
        if value is not None:
            raise ArgumentError(name, f"does not apply to {what}")


def no_way(source: Map, to: str) -> ArgumentError:
    """Return the error that refuses to convert a map to a representation made from the probe."""
    return ArgumentError(
        "to",
        f"{to} does not apply to {source.what}; it is made from the probe, by shrm prefilter PROBE "
        f"--to {to}",
    )


def _is_exact(values: Array) -> bool:
    """Whether half-precision floats represent all values exactly."""
    with np.errstate(over="ignore"):
        return bool(np.array_equal(values.astype(np.float16), values))


def _lost(before: Array, after: Array, old: Sampling, new: Sampling) -> float:
    """Return the relative RMS difference of two cubes of any sizes at the texels of the first."""
    from shrm_cli.sphere.cube import CubeSampler, cube_directions, cube_solid_angles

    size = before.shape[1]
    weights = np.tile(cube_solid_angles(size, old), (6, 1))[..., None]
    again = CubeSampler(after, new)(cube_directions(size, old))
    whole = np.sum(weights * before.astype(float) ** 2)
    return float(np.sqrt(np.sum(weights * (again - before) ** 2) / whole)) if whole > 0 else 0.0
