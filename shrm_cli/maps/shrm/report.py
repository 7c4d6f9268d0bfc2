"""What `shrm prefilter` prints about an SHRM. This module loads no numpy."""

from typing import Any


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then its orders, energy and errors.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    size, maps = result["size"], result["maps"]
    unit = "components" if "components" in result else "coefficients"
    what = f"{result['frame']} SHRM, 6 x {size} x {size} texels of {maps} {unit}"
    return [what, *error_lines(result, "leaving out principal components")]


def error_lines(result: dict[str, Any], added_by: str) -> list[str]:
    """Return lines about the orders, the energy and the errors of a map made for a BRDF.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    added_by : str
        What causes the added error of the map, in words.
    """
    captured, bound = result["brdf_energy_captured"], result["error_bound"]
    energy = f"{captured:.2%} captured, {1 - result['epsilon']:.2%} asked"
    if "+" in result["center"]:
        energy = f"{captured:.2%} captured by the terms, whose error together is that of one map"
    if result["domain"] == "angular":
        energy = f"{captured:.2%} in the truncated lobe"
    at_most = "" if bound is None else f", {bound:.2%} at most"
    carried = result["order_carried"]
    further = f"; carried to {carried}" if carried > result["order_f"] else ""
    lines = [
        f"orders         F = {result['order_f']}, P = {result['order_p']}{further}",
        f"BRDF energy    {energy}",
        f"RMS error      {result['predicted_error']:.2%} of the reflected light predicted{at_most}",
    ]
    if result["added_error"] >= 5e-5:
        lines.append(f"and            {result['added_error']:.2%} from {added_by}")
    if result["filter_error"]:
        lines.append(
            f"and            {result['filter_error']:.2%} from bilinear look-ups, as on a GPU"
        )
    return lines
