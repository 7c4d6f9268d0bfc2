"""The lines that `shrm prefilter` prints about an irradiance map. This module loads no numpy."""

from typing import Any

from shrm_cli.maps.options import counted


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then what is known of it.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    size, window = result["size"], result["window"]
    lines = [
        f"irradiance, {counted(result['coefficients'], 'coefficient')} and a cube of "
        f"6 x {size} x {size} texels",
        f"order          F = {result['order_f']}",
        f"RMS error      {result['predicted_error']:.2%} of the irradiance predicted",
    ]
    least = f"minimum        {result['minimum_irradiance']:.4g} over all sides and channels"
    if window["name"] == "none":
        asked = " is needed" if window["asked"] == "auto" else ""
        return [*lines, f"window         none{asked}", least]
    width = "" if window["width"] is None else f" of width {window['width']:.4g}"
    return [
        *lines,
        f"window         {window['name']}{width}: takes "
        f"{window['energy_lost']:.2%} of the energy, changes {window['change']:.2%} (RMS)",
        f"{least}, {result['minimum_without_window']:.4g} without the window",
    ]
