"""Light that is edited by hand: its harmonic coefficients, or the tables of a light file.

The coefficients are few, and have meanings: that of y tells how much brighter light is from above
than from below (Ramamoorthi 2002, section 4.3.3).

`edit_light`: the coefficients of a light after an edit, with others added.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import conversion, same_primaries, title_of
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.messages import check_fields
from shrm_cli.probe.light_sum import LightSum
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.series import sum_of
from shrm_cli.records import record
from shrm_cli.sphere.directions import (
    from_angles,
    from_azimuth_elevation,
    local_frame,
    normalize,
    to_angles,
)
from shrm_cli.sphere.harmonics import order_of, real_harmonics
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import DIMMED_WIDTHS

Tables = dict[str, list[dict[str, Any]]]
"""The tables of a light file by their kinds."""


@record(eq=False)
class Dimming:
    """Light about a direction, made dimmer or brighter.

    Attributes
    ----------
    direction : ndarray, shape (3,)
    factor : float
        What the radiance from the direction itself is multiplied by.
    width : float
        The angle from it at which the light changes half as much, 0.001 to 180 degrees.

    Raises
    ------
    ArgumentError
        If the width is outside.

    Examples
    --------
    >>> dimmer = shrm.Dimming(np.array([0.0, 1.0, 0.0]), 0.5, 30)
    >>> edit = shrm.Edit([], np.ones(3), [dimmer], np.eye(3))
    >>> dimmed, _ = shrm.edit_light("probes/furnace.exr", edit, order=2)
    >>> bool(dimmed[1, 0] < 0)  # less comes from above
    True
    """

    direction: Array
    factor: float
    width: float

    def __post_init__(self) -> None:
        check_fields(self)
        low, high = DIMMED_WIDTHS
        if not low <= self.width <= high:
            raise ArgumentError("width", f"is {self.width:g}; give {low:g} .. {high:g} degrees")

    @property
    def _sharpness(self) -> float:
        """The radiance changes by ``exp(sharpness (cos - 1))`` of what it does in the middle."""
        return float(np.log(2) / (1 - np.cos(np.radians(self.width))))

    def at(self, cosines: ArrayLike) -> Array:
        """Return what radiance is multiplied by, by the cosine of the angle from the direction."""
        change = np.exp(self._sharpness * (np.asarray(cosines, dtype=float) - 1))
        return np.asarray(1 + (self.factor - 1) * change)

    def of(self, coefficients: Array) -> Array:
        """Return the coefficients of the light so dimmed, cut off at their order.

        The change is integrated over a cap, beyond which it is less than rounding. Over the cap's
        heights, scaled to -1 to 1, it is ``exp(s t)``, whose Legendre series falls with the degree
        n as ``exp(-n^2 / 2s)``. So many nodes integrate what has that degree, times the products of
        two harmonics, exactly.
        """
        order = order_of(len(coefficients))
        digits = -float(np.log(np.finfo(float).eps))
        half = min(digits / (2 * self._sharpness), 1.0)  # of the cap's height
        scaled = self._sharpness * half
        nodes, weights = gauss_legendre(order + 1 + math.ceil(math.sqrt(2 * scaled * digits) / 2))
        heights = 1 + half * (nodes - 1)
        count = 2 * order + 1  # azimuths, at which products of two harmonics are exact
        local = from_angles(np.arccos(heights)[:, None], 2 * np.pi * np.arange(count) / count)
        frame = local_frame(*to_angles(self.direction))
        harmonics = real_harmonics(order, local.reshape(-1, 3) @ frame.T)
        changes = half * weights * (self.at(heights) - 1)
        area = np.repeat(changes, count) * 2 * np.pi / count
        return coefficients + harmonics.T @ (area[:, None] * (harmonics @ coefficients))


@record(eq=False)
class Edit:
    """What is done to a light, in this order.

    Attributes
    ----------
    numbers : sequence of (int, ndarray)
        Coefficients that are replaced: index l(l+1)+m and RGB.
    scale : ndarray, shape (3,)
    dimmings : sequence of Dimming
    turn : ndarray, shape (3, 3)
        A rotation.

    Examples
    --------
    >>> half = shrm.Edit([], np.full(3, 0.5), [], np.eye(3))
    >>> edited, _ = shrm.edit_light("probes/furnace.exr", half, order=0)
    >>> (edited / np.sqrt(4 * np.pi)).round(2).tolist()
    [[0.5, 0.5, 0.5]]
    """

    numbers: Sequence[tuple[int, Array]]
    scale: Array
    dimmings: Sequence[Dimming]
    turn: Array

    def __post_init__(self) -> None:
        check_fields(self)
        numbers = [value for _, value in self.numbers]
        for name, given in (("numbers", numbers), ("scale", self.scale), ("turn", self.turn)):
            if not all(np.isfinite(each).all() for each in given):
                raise ArgumentError(name, "holds NaN or infinite values; give finite numbers")

    def of_coefficients(self, coefficients: Array, order: int | None = None) -> Array:
        """Return the coefficients of the light after it, to `order`, by default their own.

        What is dimmed mixes degrees, so that the first ones are nearer to those of the dimmed light
        where more are given than returned.

        Raises
        ------
        ProbeError
            If a coefficient is to be replaced that there is not.
        """
        found = np.array(coefficients, dtype=float)
        order = order_of(len(found)) if order is None else order
        for index, value in self.numbers:
            if index >= (order + 1) ** 2:
                raise ProbeError(
                    f"the light has order {order}, so that there is no coefficient "
                    f"{order_of_index(index)}; raise `order`"
                )
            found[index] = value
        found *= self.scale
        for dimming in self.dimmings:
            found = dimming.of(found)
        found = found[: (order + 1) ** 2]
        is_turned = not np.array_equal(self.turn, np.eye(3))
        return transform_coefficients(found, self.turn) if is_turned else found

    def of_tables(self, name: str, tables: Tables) -> Tables:
        """Return the tables of a light file after it.

        Raises
        ------
        ProbeError
            If coefficients of the whole, or pixels of a probe, would have to change.
        """
        if self.numbers:
            raise ProbeError(
                f"{name}: a light file has no coefficients of the whole; write .txt, .npy or .json"
            )
        if self.dimmings and (tables.get("probe") or tables.get("sh")):
            raise ProbeError(
                f"{name}: the light of an image is not dimmed in a light file; write .txt, .npy or "
                ".json"
            )
        edits = {"probe": self._image, "sh": self._image, "disc": self._disc}
        return {kind: [edits[kind](each) for each in some] for kind, some in tables.items()}

    def _image(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """A [[probe]] or [[sh]]: scaled, and turned by other angles."""
        found = dict(table)
        if not np.all(self.scale == 1):
            found["scale"] = (np.asarray(table.get("scale", 1.0)) * self.scale).tolist()
        if not np.array_equal(self.turn, np.eye(3)):
            angles = {key: table.get(key, 0.0) for key in ("yaw", "pitch", "roll")}
            yaw, pitch, roll = turn_angles(self.turn @ ReadOptions(**angles).matrix())
            found |= {"yaw": yaw, "pitch": pitch, "roll": roll}
        return found

    def _disc(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """A [[disc]], whose light is that of its middle."""
        found = dict(table)
        if "direction" in table:
            direction = normalize(np.asarray(table["direction"], dtype=float))
        else:
            direction = from_azimuth_elevation(table["azimuth"], table["elevation"])
        factor = np.array(self.scale)
        for each in self.dimmings:
            factor = factor * each.at(each.direction @ direction)
        key = "radiance" if "radiance" in table else "irradiance"
        if not np.all(factor == 1):
            found[key] = (np.asarray(table[key]) * factor).tolist()
        if not np.array_equal(self.turn, np.eye(3)):
            found = {k: v for k, v in found.items() if k not in ("azimuth", "elevation")}
            found["direction"] = (self.turn @ direction).tolist()
        return found


def turn_angles(matrix: Array) -> tuple[float, float, float]:
    """Return the yaw, pitch and roll, degrees, of which `turn_matrix` makes a rotation."""
    # The matrix is Ry Rx Rz: its third column is Ry Rx e_z, its second row is e_y Rx Rz.
    pitch = np.arcsin(np.clip(-matrix[1, 2], -1, 1))
    if np.hypot(matrix[1, 0], matrix[1, 1]) < 1e-9:  # yaw and roll turn about one axis
        yaw, roll = np.arctan2(-matrix[2, 0], matrix[0, 0]), 0.0
    else:
        yaw = np.arctan2(matrix[0, 2], matrix[2, 2])
        roll = np.arctan2(matrix[1, 0], matrix[1, 1])
    # Rounding keeps 30 degrees from 29.999999999999996, and adding 0 makes 0 of -0.
    found = np.round(np.degrees([yaw, pitch, roll]), 12) + 0.0
    return float(found[0]), float(found[1]), float(found[2])


def order_of_index(index: int) -> str:
    """Return the degree and the order m of a linear index, as ``L,M``."""
    degree = int(np.sqrt(index))
    return f"{degree},{index - degree * (degree + 1)}"


_ORDER = 4
"""The order that light files and images are projected to."""
_DIMMED_ORDER = 32
"""The order to which light is known while it is dimmed, whatever is left of it. Of a sun that is a
few pixels, few degrees show light everywhere: dimmed beside the sun, 9 coefficients would lose a
tenth of its light, which is not there."""


def edit_light(
    file: str,
    edit: Edit,
    add: Sequence[str] = (),
    order: int | None = None,
    reading: ReadOptions | None = None,
) -> tuple[Array, list[str]]:
    """Return the coefficients of a light after an edit.

    Parameters
    ----------
    file : str
        Coefficients, an irradiance map, a light file or a light probe.
    edit : Edit
    add : sequence of str
        Other lights, which are added afterwards.
    order : int, optional
        The largest degree; by default that of the coefficients, 4 of light files and images.
    reading : ReadOptions, optional
        How files are read.

    Returns
    -------
    coefficients : ndarray, shape ((order+1)^2, 3)
    warnings : list of str

    Raises
    ------
    ProbeError
        If a file cannot be read.

    Examples
    --------
    >>> twice = shrm.Edit([], 2 * np.ones(3), [], np.eye(3))
    >>> brighter, _ = shrm.edit_light("probes/furnace.exr", twice, order=0)
    >>> light = shrm.project(shrm.open_probe("probes/furnace.exr"), 0).coefficients
    >>> np.allclose(brighter, 2 * light)
    True
    """
    probes = [open_probe(path, reading) for path in (file, *add)]
    if order is None:
        known = [
            each.series
            for each in probes
            if isinstance(each, LightSum) and each.image_of_sum.file_format == "coefficients"
        ]
        orders = [order_of(len(each)) for each in known if each is not None]
        order = max(orders) if len(orders) == len(probes) else max([_ORDER, *orders])
    known_order = max(order, _DIMMED_ORDER) if edit.dimmings else order
    lights = [edit.of_coefficients(project(probes[0], known_order).coefficients, order)]
    for each in probes[1:]:
        matrix = conversion(each.chromaticities, probes[0].chromaticities)
        found = project(each, order).coefficients
        lights.append(found if matrix is None else found @ matrix.T)
    total = sum_of(lights)
    warnings = [line for each in probes for line in each.warnings()]
    colors = probes[0].chromaticities
    if not same_primaries(colors, None):
        warnings.append(f"coefficients are in {title_of(colors)}, which their file cannot say")
    return np.asarray(total), warnings
