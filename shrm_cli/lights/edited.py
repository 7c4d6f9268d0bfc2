"""`edit_light`: the coefficients of a light after an edit, with others added."""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.color import conversion, same_primaries, title_of
from shrm_cli.lights.edit import Edit
from shrm_cli.probe.light_sum import LightSum
from shrm_cli.probe.lighting import project
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import open_probe
from shrm_cli.probe.series import sum_of
from shrm_cli.sphere.harmonics import order_of

_ORDER = 4
"""The order that light files and images are projected to."""


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
    lights = []
    for each in probes:
        matrix = conversion(each.chromaticities, probes[0].chromaticities)
        found = project(each, order).coefficients
        lights.append(found if matrix is None else found @ matrix.T)
    total = sum_of([edit.of_coefficients(lights[0]), *lights[1:]])
    warnings = [f"{each.name}: {line}" for each in probes for line in each.report.warnings()]
    colors = probes[0].chromaticities
    if not same_primaries(colors, None):
        warnings.append(
            f"coefficients are in the primaries {title_of(colors)}, which OUT cannot say"
        )
    return np.asarray(total), warnings
