"""What is said of maps whose picture is wrong: what, by how much, and one thing that helps."""

from collections.abc import Sequence

from shrm_cli.maps.options import bytes_text
from shrm_cli.plan import policy

_WRONG = "the reflected light is wrong by"
"""How all lines about the error of the light begin."""


def wrong_light(error: float, why: str, remedy: str) -> str:
    """Return the line about a map whose relative RMS error is seen."""
    return f"{_WRONG} {error:.1%} (RMS), {why}; {remedy}"


def unkept_error(asked: float, error: float, max_size: int, remedy: str) -> str:
    """Return the line about the best map within some bytes, which misses the error asked for."""
    within = f"over `error` {asked:g}, in the best map of {bytes_text(max_size)} before packing"
    return wrong_light(error, within, remedy)


def with_wrong_share(lines: Sequence[str], share: float | None, error: float) -> list[str]:
    """Add to the warnings of an SHRM which part of the picture is wrong, if it is too much.

    Whoever asks for an SHRM gets one, but not in silence. One line says it: that about the light's
    error is left out.

    Parameters
    ----------
    lines : sequence of str
        The warnings.
    share : float, optional
        The share of what is visible that is predicted to be wrong by more than `vocabulary.WRONG`.
    error : float
        The predicted relative RMS error.
    """
    if share is None or share <= policy.WRONG_SHARE:
        return list(lines)
    said = (
        f"{share:.0%} of the picture is predicted to be wrong by more than 5 %, its light by "
        f"{error:.1%} (RMS); `to` auto, without `eps` or orders, chooses the form that it needs"
    )
    return [*(line for line in lines if not line.startswith(_WRONG)), said]
