"""What a map remembers of how it was made; it travels in the file's attributes."""

from dataclasses import dataclass, field
from typing import Any

from shrm_cli.vocabulary import Domain


@dataclass(frozen=True)
class MapInfo:
    """Provenance of a map.

    Attributes
    ----------
    order_f, order_p : int
        Orders kept, inclusive.
    tolerance : float
        The fraction of the BRDF's energy that was allowed to be missed (eps).
    captured : float
        The fraction of the BRDF's energy that the orders capture.
    predicted_error : float
        Relative RMS error of the reflected light, by Parseval.
    brdf : dict
        ``{"name": ..., "parameters": {...}}``.
    probe, probe_sha256 : str
        Name of the probe's file and the digest of its bytes.
    chromaticities : tuple of 8 float, optional
        Of the probe's primaries and white, passed through.
    added_error : float
        Relative RMS error that the representation adds to the SHRM that it was made from:
        interpolating views, leaving out the azimuth, compressing.
    fit_residual : float
        Of an SHRM that was fitted to another representation: the relative RMS of what it left.
    domain : {"frequency", "angular"}
        Where it was prefiltered. In the angular domain `captured` is the part of the BRDF's
        lobe that was integrated, and the orders only chose sizes.
    """

    order_f: int
    order_p: int
    tolerance: float
    captured: float
    predicted_error: float
    brdf: dict[str, Any] = field(default_factory=dict)
    probe: str = ""
    probe_sha256: str = ""
    chromaticities: tuple[float, ...] | None = None
    added_error: float = 0.0
    fit_residual: float = 0.0
    domain: Domain = "frequency"
