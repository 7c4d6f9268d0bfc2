"""How a picture was made, as the attributes of its EXR say it."""

import json
from collections.abc import Iterable
from typing import Any

from shrm_cli.vocabulary import RECIPE_ATTRIBUTE


def picture_attributes(
    recipe: dict[str, Any], primaries: Iterable[tuple[float, ...] | None]
) -> dict[str, Any]:
    """Return the attributes of an EXR picture.

    `recipe` is how it was made. File names stand in it without their folders, because the bytes of
    the picture must not depend on them. `primaries` are the chromaticities of everything that the
    picture shows; they are passed on where all are the same.
    """
    attributes: dict[str, Any] = {RECIPE_ATTRIBUTE: json.dumps(recipe)}
    known = set(primaries)
    if len(known) == 1 and None not in known:
        attributes["chromaticities"] = known.pop()
    return attributes


def unclipped_radiance(recipe: str) -> tuple[float, ...] | None:
    """Return the radiance that a reading gave the lamp of a probe, RGB, by its recipe.

    It is None of probes that were made in other ways, and of recipes that are not ours.
    """
    try:
        found = json.loads(recipe)
        radiance = tuple(map(float, found["radiance"])) if found["probe"] == "unclip" else ()
    except (ValueError, TypeError, KeyError):
        return None
    return radiance if len(radiance) == 3 else None
