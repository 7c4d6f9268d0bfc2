"""Numbers in words, as the pages show them."""

import math
from collections.abc import Iterable

from shrm_cli.analysis.facts import seen_channels


def percent(value: float | None) -> str:
    """Return a share with three digits; what JSON cannot hold is infinite."""
    if value is None or math.isinf(value):
        return "\u221e"
    if math.isnan(value):
        return "\u2013"
    share = 100 * value
    if share == 0:
        return "0 %"
    digits = min(max(1 - math.floor(math.log10(abs(share))), 0), 3)
    return f"{share:.{digits}f} %" if abs(share) >= 5e-4 else "< 0.001 %"


def known_percent(value: float | None) -> str:
    """Return a share that need not be known."""
    return "\u2013" if value is None else percent(value)


def duration(seconds: float) -> str:
    """Return a time with two or three digits."""
    if seconds < 0.0995:
        return f"{1000 * seconds:.0f} ms"
    return f"{seconds:.2f} s" if seconds < 9.95 else f"{seconds:.0f} s"


def number(value: float) -> str:
    """Return a number with four digits."""
    return f"{value:,.0f}" if 9999.5 <= abs(value) < 1e9 else f"{value:.4g}"


def color(values: Iterable[float]) -> str:
    """Return RGB, or one number of what is grey."""
    found = [number(value) for value in seen_channels(values)]
    return found[0] if len(set(found)) == 1 else " / ".join(found)


def stops(value: float) -> str:
    """Return an exposure with its sign."""
    return f"{signed(value)} EV"


def signed(value: float) -> str:
    """Return a number with its sign, which is no hyphen."""
    return f"{value:+.3g}".replace("-", "\u2212") if value else "0"


def angles(azimuth: float, elevation: float, digits: int) -> str:
    """Return a direction in degrees."""
    text = f"{azimuth:.{digits}f}\u00b0, {elevation:.{digits}f}\u00b0"
    return text.replace("-", "\u2212")


def base_name(path: str) -> str:
    """Return the name of a file without its folders, which are nobody's business."""
    return path.replace("\\", "/").rstrip("/").rsplit("/", 1)[-1] or path
