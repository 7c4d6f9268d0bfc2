"""What `shrm prefilter` prints about an explicit map. This module loads no numpy."""

from typing import Any

from shrm_cli.maps.shrm.report import error_lines

_AZIMUTH = "leaving out the azimuth, and interpolation between slices"
"""What causes the added error of a local map."""


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then its orders, energy and errors.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    size, maps, kind = result["size"], result["maps"], result["representation"]
    what = f"{result['frame']} {kind} map, {maps} cubes of 6 x {size} x {size} texels"
    # A local map has slices, which depend on the view by its angle only.
    added_by = _AZIMUTH if result["frame"] == "local" else "interpolation between views"
    return [what, *error_lines(result, added_by)]
