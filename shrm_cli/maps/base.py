"""The interface of every map, whatever its representation.

Each representation has a folder beside this module; the three explicit maps share one. A folder
has these modules:

``prefilter``
    How the map is made: ``prefilter(probe, request) -> Prefiltered``; ``report``, what
    `shrm prefilter` prints about it; and where other maps become such ones,
    ``converted(map, to, **options) -> map``.
``file``
    The layout of the map in a file: ``encode(map) -> list of Part``, ``decode(file) -> map``.
``shader``
    Its look-up as code, where it has the option ``shader``: ``source(map, textures) -> Source``.

The registry (`shrm_cli.maps.registry`) describes what each takes, finds these modules, and loads
each only when it is needed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import mix_channels
from shrm_cli.errors import MapError
from shrm_cli.maps import registry
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.options import SHARED
from shrm_cli.records import Displayed
from shrm_cli.sphere.directions import bisector
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS, MAX_CUBE_SIZE

if TYPE_CHECKING:
    import os

    from shrm_cli.files.parts import Part
    from shrm_cli.maps.kinds import HarmonicLight
    from shrm_cli.maps.shrm.shrm import Shrm
    from shrm_cli.vocabulary import Frame, Orientation, Precision, Sampling

_RESAMPLED = replace(SHARED["size"], limits=(1, MAX_CUBE_SIZE))
"""The sizes that maps are resampled to, some of which are smaller than any that is made."""
REMEDY = "dim them by `clamp`"
"""What helps against lamps; `prefilter` adds what else does where it knows the lamps."""
DISCS = "take them out with `sun` split, as discs"
"""What may help more."""


class ReflectedLight(ABC):
    """Light that surfaces of one BRDF reflect, for all of their orientations and all views."""

    if TYPE_CHECKING:

        @property
        def info(self) -> MapInfo: ...

    @abstractmethod
    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the reflected radiance; parameters and result are those of `Map.radiance`."""

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance that a surface reflects whose tangents are known, shape (..., 3).

        What is isotropic about the normal or the mirror direction does not care for tangents, so
        that this is `radiance` here.

        Parameters
        ----------
        normals, tangents, views : array_like, shape (..., 3), broadcastable
            Unit vectors in world axes. Tangents are perpendicular to the normals and run along the
            x axis of the BRDF's own frame; the y axis is N x T.
        """
        return self.radiance(normals, views)

    def varied_radiance(
        self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike, shares: ArrayLike
    ) -> Array:
        """Evaluate the radiance where parameters of the BRDF vary, shape (..., 3).

        Where nothing varies, this is `brushed_radiance`.

        Parameters
        ----------
        normals, tangents, views : array_like, shape (..., 3), broadcastable
            As `brushed_radiance` takes them.
        shares : array_like, shape (...), broadcastable with them
            The parameter as a share of the way from its least to its largest value, 0 .. 1. Those
            of several parameters have the shape (..., parameters).
        """
        return self.brushed_radiance(normals, tangents, views)

    def with_values(self, values: Mapping[str, float]) -> ReflectedLight:
        """Return it where parameters that vary have values, others those of their middles."""
        return self

    def rough_radiance(self, reflections: Array, views: Array) -> Array:
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


class Map(Displayed, ABC):
    """Prefiltered light, or a material that is made ready for light.

    A map is of one of three kinds, which `shaded` makes reflected light of:

    - `kinds.ReflectionMap`, the reflected light itself: it was made of light and a BRDF;
    - `kinds.LightMap`, light that was made without a BRDF, for a GGX surface that is chosen later;
    - `kinds.MaterialMap`, a BRDF that was made without light, which its `lit` gives to it.

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
    surface_arguments : tuple of str
        The arguments of `shaded` that change what it returns, in their order.
    texels_are_series : bool
        Whether texels hold coefficients that are summed up, so that errors of theirs add up, too.
    is_white : bool
        Whether it is of a white diffuse surface, whose color is that of the light.
    against_negatives : str
        What a user can do where the map is negative.
    table_bytes : int
        The bytes of a table that its file holds of its lamps' BRDF.

    Examples
    --------
    >>> made = shrm.prefilter("probes/furnace.exr", "lambertian")
    >>> made.radiance([0, 1, 0], [0, 0, 1]).round(2).tolist()
    [1.0, 1.0, 1.0]
    """

    representation: ClassVar[str]
    format_version: ClassVar[int] = 1
    natural_precision: ClassVar[Precision] = "auto"
    is_rearrangeable: ClassVar[bool] = True
    surface_arguments: tuple[str, ...] = ()
    texels_are_series: ClassVar[bool] = False
    is_white: ClassVar[bool] = False
    against_negatives: ClassVar[str] = "take `to` auto without `eps` or orders"
    table_bytes: int = 0

    if TYPE_CHECKING:
        # Subclasses define these as fields, class attributes or properties. Properties of this
        # class would get in the way of their fields at run time.
        @property
        def info(self) -> MapInfo: ...
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
    def shaded(
        self,
        roughness: float = DEFAULT_ROUGHNESS,
        f0: float | Sequence[float] = 1.0,
        anisotropy: float = 0.0,
        taps: int | None = None,
    ) -> ReflectedLight:
        """Return the reflected light: of light alone, that of a GGX surface.

        Parameters
        ----------
        roughness : float
            Perceptual roughness in 0 .. 1; GGX's alpha is its square.
        f0 : float or sequence of 3 float
            Reflectance at normal incidence, grey or linear RGB, in 0 .. 1.
        anisotropy : float
            That of glTF, in 0 .. 1, which split sums of GGX show.
        taps : {0, 1, 2, 3} or, with anisotropy, {3, 5, 8}, optional
            How many directions a split sum of GGX is looked up in, where the lobe lies; 0 for one
            about the mirror direction, as engines do. By default 3, or 5 of a brushed surface.

        Returns
        -------
        ReflectedLight
            The map itself, where it is reflected light already.

        Raises
        ------
        MapError
            If the map holds no light, or is light alone and a value is out of range.
        """

    @property
    def ways(self) -> Mapping[str, tuple[float, float]]:
        """The parameters of the BRDF that may vary, and the ends of their ranges."""
        return {}

    @property
    def varies(self) -> int:
        """How many parameters may vary over the surface, as `varied_radiance` shows it."""
        return len(self.ways)

    def shares(self, values: Mapping[str, float]) -> list[float]:
        """Return where values of parameters that vary are on their ways, 0.5 of the others."""
        return [
            (values[name] - low) / (high - low) if name in values else 0.5
            for name, (low, high) in self.ways.items()
        ]

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance that `shaded` reflects, for a first look at any map.

        Light alone is shown as GGX of roughness 0.5 and reflectance 1 at normal incidence.

        Parameters
        ----------
        normals, views : array_like, shape (..., 3), broadcastable
            Unit vectors in world axes; views point to the viewer.

        Returns
        -------
        ndarray, shape (..., 3)

        Raises
        ------
        MapError
            If the map holds no light.
        """
        return self.shaded().radiance(normals, views)

    @property
    def harmonic_light(self) -> HarmonicLight | None:
        """The light itself and what reflects it, where the map holds them apart."""
        return None

    @property
    def roughness_range(self) -> tuple[float, float]:
        """The least and the largest perceptual roughness that the map was made for.

        It is 0 and 1 for maps to which the roughness makes no difference.
        """
        return 0.0, 1.0

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
        with np.errstate(over="ignore"):
            return all(np.array_equal(each.astype(np.float16), each) for each in self.planes())

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

    @property
    def stated_error(self) -> float:
        """The relative RMS error of all causes that are known, but for half precision."""
        return self.info.stated_error

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
            **info.errors,
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
        MapError, ArgumentError
            If the result would be too large, or there is no such size or sampling.
        """
        size, sampling = self._asked(size, sampling)
        if (size, sampling) == (self.size, self.sampling):
            return self
        self.check_memory(size)
        return self._moved(size, sampling)

    def _asked(self, size: int | None, sampling: Sampling | None) -> tuple[int, Sampling]:
        """Return the size and the sampling that are asked for, by default those of the map."""
        size = self.size if size is None else _RESAMPLED.checked(size)
        return size, self.sampling if sampling is None else SHARED["sampling"].checked(sampling)

    def check_memory(self, size: int) -> None:
        """Raise a `MapError`, if a map of cubes could not be kept in memory at another size."""

    def _moved(self, size: int, sampling: Sampling) -> Map:
        """Return the map on other cubes, each filtered from the old cube in its place."""
        from shrm_cli.maps.size import look_up_error
        from shrm_cli.sphere.cube import CubeSampler, cube_directions, relative_change

        directions = cube_directions(size, sampling)
        before = self.planes()
        after = [CubeSampler(plane, self.sampling)(directions) for plane in before]
        lost = relative_change(before[0], after[0], self.sampling, sampling)
        info = self.info.adding(lost)
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
        self, to: str, size: int | None = None, sampling: Sampling | None = None, **options: Any
    ) -> Map:
        """Convert the map to another representation.

        Parameters
        ----------
        to : str
            One of `vocabulary.REPRESENTATIONS`, or a form of an installed package.
        size, sampling
            The size and sampling of the cubes, as `resampled` takes them.
        **options
            ``order_p`` and ``frame`` of an SHRM, ``max_size``, the most bytes in half precision
            where order or views are not given, and those options of the new representation that
            `shrm convert` takes.

        Raises
        ------
        MapError, ArgumentError
            If the map cannot be converted to that representation, or an option does not apply.
        """
        convert = getattr(registry.module(to, "prefilter"), "converted", registry.unconverted)
        return convert(self.resampled(size, sampling), to, **registry.checked(to, options))

    def with_info(self, info: MapInfo) -> Self:
        """Return the same map with another record of how it was made."""
        return replace(self, info=info)  # type: ignore[type-var]

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
        """Return the map with a matrix times its red, green and blue; see `maps.info`."""
        planes = [mix_channels(plane, matrix) for plane in self.planes()]
        return self.with_planes(planes, self.sampling, info)

    # ---- files -------------------------------------------------------------------------------

    def encode(self) -> list[Part]:
        """Return the parts of a file that holds the map as OpenEXR's stacked cubes."""
        return registry.module(self.representation, "file").encode(self)

    def save(
        self,
        path: str | os.PathLike[str],
        precision: Precision = "auto",
        layout: str = "openexr",
        orientation: Orientation = "openexr",
    ) -> str:
        """Write the map to a file, completely or not at all; see `shrm_cli.maps.stored.store`.

        Returns
        -------
        str
            The pixel type written, ``"half"`` or ``"float"``.

        Raises
        ------
        OutputError, MapError
        """
        from shrm_cli.maps.stored import store  # whoever reads maps only is spared it

        return store(path, self, precision, layout, orientation).pixel_type
