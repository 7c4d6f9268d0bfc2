"""What can be shipped for a probe and a material, which of it is on a front, and which is best."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from html import escape
from typing import Any

from shrm_cli.maps.base import Map
from shrm_cli.plan.search import Candidate, Goal, least_wrong
from shrm_cli.records import record


@record
class Offer:
    """A map that could be shipped.

    Attributes
    ----------
    form : str
        Its representation.
    what : str
        Its orders, cubes and texels, in words.
    bytes : int
        The bytes of what a shader reads: cubes in half precision, before they are packed, and
        coefficients as 32-bit floats. Tables that depend on no probe are not counted.
    error : float
        The relative RMS error of the reflected light, with bilinear look-ups and half precision.
    wrong_share : float
        The share of what is visible whose luminance is wrong by more than 5 %.
    measured : tuple of str
        Which of ``error`` and ``wrong_share`` are no predictions, but measured at some hundred
        points beside the truth.
    look_ups : int
        How many textures its shader fetches.
    multiply_adds : int, optional
        What its shader multiplies; see `shrm_cli.maps.shader.cost`. None where lamps lie beside a
        map, whose integrals take what their BRDF takes.
    arguments : dict, optional
        Those of `shrm_cli.prefilter.prefilter` that make it; None where no arguments do.
    make : callable
        Makes the map.
    on_front, on_cost_front : bool
        Whether no other offer has fewer bytes for no more error; or a cheaper shader.
    has_spots : bool
        Whether it was looked at, and is negative where that is seen: black, mostly beside lamps.

    Examples
    --------
    >>> (choice,) = shrm.choose("probes/furnace.exr", "lambertian")
    >>> least = choice.offers[0]
    >>> all(least.bytes <= offer.bytes for offer in choice.offers)
    True
    """

    form: str
    what: str
    bytes: int
    error: float
    wrong_share: float
    measured: tuple[str, ...]
    look_ups: int
    multiply_adds: int | None
    arguments: Mapping[str, Any] | None
    make: Callable[[], Map] = field(repr=False, compare=False)
    on_front: bool = False
    on_cost_front: bool = False
    has_spots: bool = False

    def keeps(self, goal: Goal) -> bool:
        """Tell whether its picture is right; looks at no spots that were not looked for."""
        return not self.has_spots and self._candidate().keeps(goal)

    def is_like(self, other: "Offer") -> bool:
        """Tell whether another one has as many cubes of the same size."""
        names = "form", "bytes", "look_ups", "multiply_adds"
        return all(getattr(self, name) == getattr(other, name) for name in names)

    def _candidate(self) -> Candidate[Map]:
        return Candidate(
            self.form, self.bytes, self.look_ups, self.error, lambda: self.wrong_share, self.make
        )


@record
class Choice:
    """What can be shipped for a probe and a material.

    Attributes
    ----------
    probe, brdf : str
        The name of the probe's file, and the material as it was given.
    goal : Goal
        What the recommended offer should keep.
    budget : int, optional
        The most bytes that it may have.
    offers : tuple of Offer
        By their bytes.
    recommended : Offer, optional
        The one of the fewest bytes that keeps the goal within the budget; else the one that fits
        and is least wrong. None if nothing fits.
    is_kept : bool
        Whether it keeps the goal.
    warnings : tuple of str
        Why forms are missing.
    lamps : int
        How many lamps of the probe could lie beside a map of the material. They are in the cubes of
        all offers but that which ``to="auto"`` makes.

    Examples
    --------
    >>> (choice,) = shrm.choose("probes/furnace.exr", "lambertian")
    >>> choice.recommended in choice.offers
    True
    """

    probe: str
    brdf: str
    goal: Goal
    budget: int | None
    offers: tuple[Offer, ...]
    recommended: Offer | None
    is_kept: bool
    warnings: tuple[str, ...] = ()
    lamps: int = 0

    def _repr_html_(self) -> str:
        """Return the offers as a table, which notebooks show; the recommended one is bold."""
        rows = [("form", "what", "bytes", "RMS", "wrong", "look-ups", "multiply-adds")]
        rows += [
            (each.form, each.what, f"{each.bytes:,}", f"{each.error:.1%}",
             f"{each.wrong_share:.1%}", str(each.look_ups), work_text(each))
            for each in self.offers
        ]  # fmt: skip
        lines = []
        for offer, row in zip((None, *self.offers), rows, strict=True):
            cell = "th" if offer is None or offer is self.recommended else "td"
            cells = "".join(f"<{cell}>{escape(text)}</{cell}>" for text in row)
            lines.append(f"<tr>{cells}</tr>")
        title = escape(f"{self.probe}, {self.brdf}")
        return f"<table><caption>{title}</caption>{''.join(lines)}</table>"


def work_text(offer: Offer) -> str:
    """Return the multiply-adds of an offer's shader, or a dash where they are not counted."""
    return "-" if offer.multiply_adds is None else str(offer.multiply_adds)


def decided(
    probe: str,
    brdf: str,
    goal: Goal,
    budget: int | None,
    offers: Sequence[Offer],
) -> Choice:
    """Sort offers, mark the fronts, and recommend one."""
    unique = {(each.form, each.what): each for each in offers}.values()
    costed = [each for each in unique if each.multiply_adds is not None]
    marked = [
        replace(
            each,
            on_front=not any(_beats(other, each, ("bytes",)) for other in unique),
            on_cost_front=each in costed
            and not any(_beats(other, each, ("look_ups", "multiply_adds")) for other in costed),
        )
        for each in sorted(unique, key=lambda each: (each.bytes, each.error))
    ]
    fitting = [each for each in marked if budget is None or each.bytes <= budget]
    kept = [each for each in fitting if each.keeps(goal)]
    best = kept[0] if kept else _least_wrong(fitting, goal)
    return Choice(probe, brdf, goal, budget, tuple(marked), best, bool(kept))


def _beats(one: Offer, other: Offer, costs: Sequence[str]) -> bool:
    """Tell whether an offer is nowhere worse than another, and somewhere better."""
    pairs = [(getattr(one, name), getattr(other, name)) for name in ("error", *costs)]
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def _least_wrong(offers: Sequence[Offer], goal: Goal) -> Offer | None:
    """Return the offer of the fewest bytes that is nearly as good as any; None if there is none."""
    if not offers:
        return None
    candidates = [each._candidate() for each in offers]
    return offers[candidates.index(least_wrong(candidates, goal))]
