"""A map that was just made, with facts about its making that its file does not keep.

Where its picture is wrong, the functions here say what, by how much, and one thing that helps.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any

from shrm_cli.maps.base import Map
from shrm_cli.maps.options import bytes_text
from shrm_cli.records import record

_WRONG = "the reflected light is wrong by"
"""How all lines about the error of the light begin."""
REMEDY = "take them out with `shrm sun` and prefilter its light file, dim them by `clamp`"
"""What helps against lamps; `prefilter` says so in other words where it knows the lamps."""


@record(eq=False)
class Prefiltered:
    """A map, and what is known of how it was made.

    Attributes
    ----------
    map : Map
    facts : dict
        Facts that the map's own `summary` does not have, by the names used in JSON. For maps
        that are made for a BRDF ``error_bound`` is among them: the conservative relative RMS
        error of eq. 5.19, or None in the angular domain.
    notes : tuple of (str, str)
        Headings and texts that tell people what was chosen automatically.
    warnings : tuple of str
        Lines that the user should know about the map.
    further : dict
        Facts that take a while to find, by functions that find them when somebody asks for the
        `summary`. For maps that are made for a BRDF ``predicted_wrong_share`` is here or among the
        facts: the share of what is visible whose luminance is wrong by more than
        `vocabulary.WRONG`, or None where it is not known.
    """

    map: Map
    facts: dict[str, Any] = field(default_factory=dict)
    notes: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()
    further: dict[str, Callable[[], Any]] = field(default_factory=dict)

    def quick_summary(self) -> dict[str, Any]:
        """Return what the `summary` has but for the further facts, which take as long as a map."""
        return {**self.map.summary(), **self.facts, **self.map.info.origin()}

    def summary(self) -> dict[str, Any]:
        """Return the numbers that users and scripts ask for, by the names used in JSON."""
        found = {name: find() for name, find in self.further.items()}
        return {**self.map.summary(), **self.facts, **found, **self.map.info.origin()}


def wrong_light(error: float, why: str, remedy: str) -> str:
    """Return the line about a map whose relative RMS error is seen."""
    return f"{_WRONG} {error:.1%} (RMS), {why}; {remedy}"


def unkept_error(asked: float, error: float, max_size: int, remedy: str) -> str:
    """Return the line about the best map within some bytes, which misses the error asked for."""
    within = f"over `error` {asked:g}, in the best map of {bytes_text(max_size)} before packing"
    return wrong_light(error, within, remedy)


def with_wrong_share(
    lines: Sequence[str], share: float, error: float, instead: str | None = None
) -> list[str]:
    """Add to the warnings of an SHRM which part of the picture is wrong.

    Whoever asks for an SHRM gets one, but not in silence. One line says it: that about the light's
    error is left out.

    Parameters
    ----------
    lines : sequence of str
        The warnings.
    share : float
        The share of what is visible that is predicted to be wrong by more than `vocabulary.WRONG`.
    error : float
        The predicted relative RMS error.
    instead : str, optional
        What ``auto`` would make, where that is known.
    """
    chosen = "chooses the form that it needs" if instead is None else f"would make {instead}"
    said = (
        f"{share:.0%} of the picture is predicted to be wrong by more than 5 %, its light by "
        f"{error:.1%} (RMS); `to` auto, without `eps` or orders, {chosen}"
    )
    return [*(line for line in lines if not line.startswith(_WRONG)), said]


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
    share = result["predicted_wrong_share"]
    if share is not None:
        lines.append(f"pixels         {share:.1%} predicted to be wrong by more than 5%")
    return lines
