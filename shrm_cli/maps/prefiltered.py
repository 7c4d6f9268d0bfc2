"""A map that was just made, with facts about its making that its file does not keep.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from dataclasses import dataclass, field
from typing import Any

from shrm_cli.maps.base import Map


@dataclass(frozen=True)
class Prefiltered:
    """A map, and what is known of how it was made.

    Attributes
    ----------
    map : Map
    facts : dict
        Facts that the map's own `summary` does not have, by the names used in JSON. For maps
        that are made for a BRDF ``error_bound`` is among them: the conservative relative RMS
        error of eq. 5.19, or None in the angular domain. So is ``predicted_wrong_share``: the
        share of what is visible whose luminance is wrong by more than `vocabulary.WRONG`, or None
        where it is not known.
    notes : tuple of (str, str)
        Headings and texts that tell people what was chosen automatically.
    warnings : tuple of str
        Lines that the user should know about the map.
    """

    map: Map
    facts: dict[str, Any] = field(default_factory=dict)
    notes: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return the numbers that users and scripts ask for, by the names used in JSON."""
        return {**self.map.summary(), **self.facts, **self.map.info.origin()}
