"""What `shrm prefilter` prints about a map of principal functions. This module loads no numpy."""

from typing import Any

from shrm_cli.maps.shrm.report import error_lines


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then its orders, energy and errors.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    size, maps = result["size"], result["maps"]
    what = f"principal functions, 6 x {size} x {size} texels of {maps} maps"
    return [what, *error_lines(result, "resampling")]
