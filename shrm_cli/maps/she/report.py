"""The lines that `shrm prefilter` prints about an SH exponential. This module loads no numpy."""

from typing import Any


def report(result: dict[str, Any]) -> list[str]:
    """Return lines for people: first what the map is, then what is known of it.

    Parameters
    ----------
    result : dict
        The object that `shrm prefilter --json` prints.
    """
    p, q = result["p_order"], result["q_order"]
    (first, last), (low, high) = result["roughness"], result["ggx_alpha"]
    return [
        f"SH exponential, {(p + 1) ** 2} + {(q + 1) ** 2 - 1} coefficients a channel",
        f"orders         P = {p}, Q = {q}, attenuated by the law {result['law']!r}",
        f"roughness      {first:.4g} .. {last:.4g} (GGX's alpha {low:.4g} .. {high:.4g})",
        f"RMS error      {result['fit_residual']:.2%} of the reflected light left by the fit",
    ]
