"""Between images and spherical harmonic series, as linear modules of PyTorch.

Each takes its tables from the numpy code that does the same, and has them as buffers: what a
module computes is one matrix product for each degree, order or row, and so is its gradient, which
PyTorch derives. Tables are of 64 bits until a module is moved, as by ``module.float()``.
"""

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from shrm_cli.arrays import Array
from shrm_cli.sphere.double_fourier import fourier_matrices, places_by_m
from shrm_cli.sphere.grid.latlong import AXES, column_waves, row_waves
from shrm_cli.sphere.harmonics import degrees, harmonic_planes
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.sphere.rotation import rotation_blocks
from shrm_cli.sphere.synthesis import ALONG_X, ALONG_Z, X_POLAR, longitude_waves, meridian_waves
from shrm_cli.vocabulary import FACES, Sampling


def table(values: ArrayLike) -> Tensor:
    """Return a contiguous tensor of an array of any strides, which shares no memory with it."""
    return torch.from_numpy(np.array(values, order="C"))


def kept(series: Tensor, order: int) -> Tensor:
    """Return the coefficients up to a degree, shape ((order+1)^2, maps), of as many or more.

    Raises ValueError if there are fewer, or they are not in columns: one map is one column.
    """
    count = (order + 1) ** 2
    if series.ndim != 2 or len(series) < count:
        raise ValueError(
            f"coefficients of shape {tuple(series.shape)}, not ({count} or more, maps)"
        )
    return series[:count]


class Rotation(nn.Module):
    """The rotation of series by one fixed matrix; see `sphere.rotation.transform_coefficients`.

    Parameters
    ----------
    order : int
        The largest degree.
    matrix : ndarray, shape (3, 3)
    """

    def __init__(self, order: int, matrix: Array) -> None:
        super().__init__()
        self.order = order
        for degree, block in enumerate(rotation_blocks(order, matrix)):
            self.register_buffer(f"block{degree}", table(block), persistent=False)

    def forward(self, series: Tensor) -> Tensor:
        """Turn series, shape (>= (order+1)^2, maps); further coefficients are left out."""
        parts = kept(series, self.order).split([2 * degree + 1 for degree in range(self.order + 1)])
        return torch.cat([self.get_buffer(f"block{k}") @ part for k, part in enumerate(parts)])


class _Fourier(nn.Module):
    """The matrices between series and double Fourier series, one product for each order m.

    They come in four parts, of even and odd m, and of even and odd l - m.
    """

    def __init__(self, order: int) -> None:
        super().__init__()
        count = self.count = order + 1
        self._slices = []
        for number, (which, above, _, matrices) in enumerate(fourier_matrices(count)):
            self._slices.append((which, above))
            self.register_buffer(f"matrices{number}", table(matrices), persistent=False)
        place, cosine, sine = places_by_m(count)
        # The row count^2 is empty: it stands for what has no l >= m, and for the sine of m = 0.
        source = np.full((count * count, 2), count * count)
        source[place, 0] = cosine
        source[place[count:], 1] = sine[count:]
        self.register_buffer("source", table(source), persistent=False)
        back = np.empty(count * count, dtype=np.intp)
        back[cosine] = 2 * place
        back[sine[count:]] = 2 * place[count:] + 1
        self.register_buffer("back", table(back), persistent=False)

    def parts(self, series: Tensor) -> list[Tensor]:
        """Return Fourier series, each of shape (2, m, maps, k), of series ((order+1)^2, maps)."""
        count, maps = self.count, series.shape[1]
        padded = torch.cat([series, series.new_zeros(1, maps)])
        by_m = padded[self.source].reshape(count, count, 2 * maps)
        found = []
        for number, (which, above) in enumerate(self._slices):
            matrices = self.get_buffer(f"matrices{number}")
            waves = by_m[which, above].transpose(1, 2) @ matrices.transpose(1, 2)
            found.append(waves.reshape(len(waves), 2, maps, matrices.shape[1]).transpose(0, 1))
        return found

    def series(self, moments: list[Tensor]) -> Tensor:
        """Return series ((order+1)^2, maps) from moments of the shapes of `parts`: its transpose.

        Moments are integrals with each wave, as in `sphere.double_fourier`.
        """
        count, maps = self.count, moments[0].shape[2]
        by_m = moments[0].new_zeros(count, count, 2 * maps)
        for number, ((which, above), part) in enumerate(zip(self._slices, moments, strict=True)):
            flat = part.transpose(0, 1).reshape(part.shape[1], 2 * maps, part.shape[-1])
            by_m[which, above] = (flat @ self.get_buffer(f"matrices{number}")).transpose(1, 2)
        return by_m.reshape(2 * count * count, maps)[self.back]


class LatLongProjection(nn.Module):
    """The spherical harmonic coefficients of a lat-long, in world axes.

    They are those of `probe.lighting.project`, whose rule weighs the rows, without what that adds
    for small lamps beside the poles. Rows at the poles have small weights, and so small gradients.

    Parameters
    ----------
    order : int
        The largest degree, at least 1 and less than the height.
    height : int
        Pixels from pole to pole; the width is twice that.
    sampling : {"center", "border"}
        Where the pixels at the edges lie.
    """

    def __init__(self, order: int, height: int, sampling: Sampling = "center") -> None:
        super().__init__()
        if not 1 <= order < height:
            raise ValueError(f"order {order} of an image of {height} rows")
        self.order, self.shape = order, (height, 2 * height)
        rows = row_waves(height, order, sampling)
        columns = column_waves(2 * height, order, sampling, np.dtype(float))
        for number, (row, column) in enumerate(zip(rows, columns, strict=True)):
            self.register_buffer(f"rows{number}", table(row), persistent=False)
            self.register_buffer(f"columns{number}", table(column), persistent=False)
        self._fourier = _Fourier(order)
        self._rotation = Rotation(order, AXES.T)

    def forward(self, image: Tensor) -> Tensor:
        """Project radiance, shape (height, 2 height, maps): ((order+1)^2, maps).

        The top row looks up, the middle column along +Z, and the left quarter along +X.
        """
        if image.shape[:2] != self.shape:
            raise ValueError(f"an image of shape {tuple(image.shape)}, not {(*self.shape, 'maps')}")
        planes = image.permute(2, 0, 1)
        middle = self.shape[1] // 2
        left, right = planes[..., :middle], planes[..., middle:].flip(-1)
        rings = torch.stack(  # [cos or sin, m, map, row]
            [
                ((left + right) @ self.columns0).permute(2, 0, 1),
                ((left - right) @ self.columns1).permute(2, 0, 1),
            ]
        )
        moments = []
        for m_parity in (0, 1):
            waves = self.get_buffer(f"rows{m_parity}")
            some = rings[:, m_parity::2]
            north, south = some[..., : len(waves)], some.flip(-1)[..., : len(waves)]
            for above, folded in enumerate((north + south, north - south)):
                moments.append(folded @ waves[:, (m_parity + above) % 2 :: 2])
        return self._rotation(self._fourier.series(moments[: len(self._fourier._slices)]))


class DirectionSynthesis(nn.Module):
    """The values of series in some fixed directions.

    Parameters
    ----------
    order : int
        The largest degree.
    directions : array_like, shape (..., 3)
        Unit vectors in world axes. They are no parameters that could be optimized.
    """

    def __init__(self, order: int, directions: ArrayLike) -> None:
        super().__init__()
        self.order = order
        self.shape = np.shape(directions)[:-1]
        # Products with few maps are several times as fast where the directions lie side by side.
        harmonics = harmonic_planes(order, directions).reshape((order + 1) ** 2, -1)
        self.register_buffer("harmonics", table(harmonics), persistent=False)
        self.register_buffer("degrees", table(degrees(order)), persistent=False)

    def forward(self, series: Tensor, factors: Tensor | None = None) -> Tensor:
        """Evaluate series, shape (>= (order+1)^2, maps): (..., maps).

        Further coefficients are left out; `factors`, shape (order+1,), multiply the degrees.
        """
        series = kept(series, self.order)
        if factors is not None:
            series = series * factors[self.degrees, None]
        values = series.T.contiguous() @ self.harmonics
        return values.T.contiguous().reshape(*self.shape, series.shape[1])


class CubeSynthesis(nn.Module):
    """The values of series at the texels of cubes, exact at each, by `sphere.synthesis`'s method.

    Parameters
    ----------
    order : int
        The largest degree, at least 1.
    size : int
        Texels along a face's edge.
    sampling : {"center", "border"}
    """

    def __init__(self, order: int, size: int, sampling: Sampling = "center") -> None:
        super().__init__()
        if order < 1:
            raise ValueError(f"order {order} of a cube, which is 1 at least")
        self.order, self.size = order, size
        count, s = order + 1, nodes(size, sampling)
        half = s[size // 2 :]
        for number, waves in enumerate(meridian_waves(count, half, half)):
            self.register_buffer(f"waves{number}", table(waves), persistent=False)
        for axis, faces in enumerate((ALONG_Z, ALONG_X)):
            quadrants = [face[0] for face in faces]
            longitudes = longitude_waves(count, quadrants, half, np.dtype(float))
            for parity, waves in enumerate(longitudes):
                self.register_buffer(f"longitudes{axis}{parity}", table(waves), persistent=False)
        self._fourier = _Fourier(order)
        self._rotation = Rotation(order, X_POLAR)
        self.register_buffer("degrees", table(degrees(order)), persistent=False)

    def forward(self, series: Tensor, factors: Tensor | None = None) -> Tensor:
        """Evaluate series.

        Parameters
        ----------
        series : Tensor, shape (>= (order+1)^2, maps)
            Further coefficients are left out.
        factors : Tensor, shape (levels, order+1), optional
            What the degrees of the series are multiplied with for each level.

        Returns
        -------
        Tensor, shape (6 size, size, maps) or (levels, 6 size, size, maps)
            Faces in OpenEXR's order and orientation.
        """
        series = kept(series, self.order)
        maps = series.shape[1]
        both = [series, self._rotation(series)]
        if factors is not None:
            by_index = factors[:, self.degrees].T[..., None]
            both = [(by_index * each[:, None]).flatten(1) for each in both]
        faces: dict[str, Tensor] = {}
        for axis, rows in enumerate((ALONG_Z, ALONG_X)):
            values = self._along(axis, both[axis], len(rows))
            for k, (_, name, s_falls, t_falls) in enumerate(rows):
                falling = [dim for dim, falls in ((0, s_falls), (2, t_falls)) if falls]
                faces[name] = values[:, k].flip(falling).transpose(1, 2)
        cube = torch.stack([faces[name] for name in FACES])  # [face, row, column, map]
        if factors is None:
            return cube.reshape(6 * self.size, self.size, maps)
        levels = cube.reshape(6 * self.size, self.size, len(factors), maps)
        return levels.permute(2, 0, 1, 3)

    def _along(self, axis: int, series: Tensor, quadrants: int) -> Tensor:
        """Return values on the faces about one polar axis, shape (s, quadrant, map, t)."""
        half, middle = self.waves0.shape[0], self.size // 2
        parts, maps = self._fourier.parts(series), series.shape[1]
        values = []
        for above in (0, 1):
            sums = []
            for parity, part in enumerate(parts[above::2]):
                longitudes = self.get_buffer(f"longitudes{axis}{parity}")
                flat = longitudes @ part.reshape(longitudes.shape[1], -1)
                sums.append(flat.reshape(half, 2 * quadrants * maps, part.shape[-1]))
            values.append(torch.cat(sums, dim=-1) @ self.get_buffer(f"waves{above}"))
        even, odd = values
        # The mirror images at -t, and then those at -s. A middle texel is its own.
        row = torch.cat([(even - odd).flip(-1)[..., :middle], even + odd], dim=-1)
        row = row.reshape(half, quadrants, 2, maps, self.size)
        return torch.cat([row[:, :, 1].flip(0)[:middle], row[:, :, 0]])
