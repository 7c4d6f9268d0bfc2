"""What `shrm prefilter` and `shrm product` print about a texture. This module loads no numpy."""

from typing import Any


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the texture is, then its energy and errors.

    Parameters
    ----------
    result : dict
        The object that the command's ``--json`` prints.
    """
    size, order = result["size"], result["order"]
    color = "RGB" if result["channels"] == 3 else "grey"
    varied = ""
    if "parameter" in result:
        low, *_, high = result["values"]
        count = len(result["values"])
        varied = f", for {count} values of {result['parameter']} from {low:g} to {high:g}"
    lines = [
        f"product texture, {size} x {size} views of {result['coefficients']} coefficients, {color}"
        f"{varied}",
        f"order          {order}, which captures {result['brdf_energy_captured']:.2%} of the "
        "BRDF's energy",
        f"quadrature     {result['residual']:.2g} relative change when the nodes are doubled, "
        f"{result['nodes']:,} directions at most",
        f"look-ups       {result['filter_error']:.2%} RMS error by bilinear filtering",
    ]
    if "parameter" in result:
        lines.append(
            f"between        {result['step_error']:.2%} RMS error between two values at most"
        )
    of = "of this light reflected" if result["lit"] else "of white noise reflected"
    lines.append(f"RMS error      {result['predicted_error']:.2%} {of}, beyond the order")
    window = result.get("window")
    if window is not None and window["name"] != "none":
        lines.append(
            f"window         {window['name']}, changes it by {result['added_error']:.2%} RMS, and "
            f"what is seen by {window['p95_change']:.1%} (p95)"
        )
    return lines
