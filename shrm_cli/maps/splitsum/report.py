"""The lines that `shrm prefilter` prints about a split sum. This module loads no numpy."""

from typing import Any

from shrm_cli.maps.options import counted


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then what is known of each level.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    levels = result["levels"]
    heading = f"{'roughness':<10} {'texels':>15} {'F':>4}  {'made by':<12} RMS error predicted"
    of = result["brdf"]["name"]
    of = "" if of == "ggx-lobe" else f" of {of}"
    what = f"split sum{of}, {counted(len(levels), 'level')} by the mapping {result['mapping']}"
    lines = [what, heading]
    for level in levels:
        texels = f"6 x {level['size']} x {level['size']}"
        order, error = str(level["order_f"]), f"{level['predicted_error']:.2%}"
        if level["domain"] != "frequency":  # the order of such a level only chose its size
            order = "-"
        if level["domain"] == "probe":
            error = "-"
        made_by = {"frequency": "coefficients", "angular": "integration"}
        lines.append(
            f"{level['roughness']:<10.4g} {texels:>15} {order:>4}  "
            f"{made_by.get(level['domain'], 'resampling'):<12} {error}"
        )
    return lines
