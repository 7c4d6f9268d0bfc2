"""How a map was made: a record that travels in the attributes of the map's file."""

from dataclasses import field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.records import record
from shrm_cli.vocabulary import CENTERS, FRAMES, SAMPLINGS, Domain

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.probe.proxy import ProxyBox


@record
class MapInfo:
    """The provenance of a map.

    Attributes
    ----------
    order_f, order_p : int
        The orders F and P, inclusive, that the tolerance asks for. The map keeps no higher order
        of the view than P, but orders of the light up to `carried`.
    eps : float
        The fraction of the BRDF's energy that the orders were allowed to miss (eps).
    captured : float
        The fraction of the BRDF's energy that the orders capture.
    predicted_error : float
        The predicted relative RMS error of the reflected light, by Parseval, uniformly over central
        directions and views, with all orders that the map carries.
    brdf : dict
        The BRDF, as ``{"name": ..., "parameters": {...}}``.
    probe, probe_sha256 : str
        The name of the probe's file and the digest of its bytes.
    chromaticities : tuple of 8 float, optional
        The chromaticities of the probe's primaries and white, passed through.
    added_error : float
        The relative RMS error that the representation adds to that of the SHRM that it was made
        from, by interpolating views, leaving out the azimuth, compressing or resampling.
    fit_residual : float
        The relative RMS of what an SHRM that was fitted to another representation leaves of it;
        0 for other maps.
    carried : int, optional
        The largest order of the light that the map keeps. F is the order that the tolerance asks
        for; maps carry all that is visible of the orders beyond. None is F itself.
    filter_error : float
        The predicted relative RMS error of looking the map up as a GPU does, by bilinear filtering
        in its cubes.
    storage_error : float
        The relative RMS error of the file's half precision, where light is so dim that half has
        not all its digits for it; 0 elsewhere.
    domain : {"frequency", "angular"}
        The domain in which the map was prefiltered. In the angular domain `captured` is the
        fraction of the BRDF's energy in the integrated part of its lobe, and the orders were only
        used to choose sizes.
    options : dict
        The arguments that prefiltering was given, and how it read the probe under ``reading``; see
        `shrm_cli.maps.request.Request.record`.
    """

    order_f: int
    order_p: int
    eps: float
    captured: float
    predicted_error: float
    brdf: dict[str, Any] = field(default_factory=dict)
    probe: str = ""
    probe_sha256: str = ""
    chromaticities: tuple[float, ...] | None = None
    added_error: float = 0.0
    fit_residual: float = 0.0
    carried: int | None = None
    filter_error: float = 0.0
    storage_error: float = 0.0
    domain: Domain = "frequency"
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def order_carried(self) -> int:
        """The largest order of the light that the map keeps."""
        return self.order_f if self.carried is None else self.carried

    @property
    def proxy(self) -> "ProxyBox | None":
        """Where the probe was captured and the box around that, by which light is looked up."""
        reading = self.options.get("reading")
        found = reading.get("proxy") if isinstance(reading, dict) else None
        if found is None:
            return None
        from shrm_cli.probe.proxy import ProxyBox  # few probes have one

        return ProxyBox.read(found)

    def turned(self, matrix: ArrayLike) -> "MapInfo":
        """Return the record of the same light turned, as if the probe had been read so.

        Parameters
        ----------
        matrix : array_like, shape (3, 3)
            Orthogonal; what came from a direction d comes from ``matrix @ d``.
        """
        reading = self.options.get("reading")
        reading = dict(reading) if isinstance(reading, dict) else {}
        axes = np.asarray(matrix) @ _axes(reading.pop("axes", None))
        if not np.array_equal(axes, np.eye(3)):
            reading["axes"] = np.round(axes, 9).tolist()
        box = None if self.proxy is None else self.proxy.turned(matrix)
        reading = {**reading, "proxy": box and box.record()}
        if box is None:
            del reading["proxy"]
        return replace(self, options={**self.options, "reading": reading})

    def in_primaries(self, primaries: tuple[float, ...]) -> "MapInfo":
        """Return the record of the same light in other primaries, as if it had been read so."""
        reading = self.options.get("reading")
        reading = {**(reading if isinstance(reading, dict) else {}), "working": list(primaries)}
        options = {**self.options, "reading": reading}
        return replace(self, chromaticities=tuple(primaries), options=options)

    def read_as(self, whole: "MapInfo") -> "MapInfo":
        """Return the record of a part, with the primaries and the options of the whole map."""
        return replace(self, chromaticities=whole.chromaticities, options=whole.options)

    def origin(self) -> dict[str, Any]:
        """Return the BRDF and the probe that the map was made from, as reports name them."""
        return {"brdf": self.brdf, "probe": self.probe, "probe_sha256": self.probe_sha256}


def _axes(recorded: Any) -> NDArray[np.floating]:
    """Return the axes that a map records; those of the world where it records anything else."""
    try:
        axes = np.array(recorded, dtype=float)
    except (TypeError, ValueError):
        return np.eye(3)
    return axes if axes.shape == (3, 3) else np.eye(3)


def check_names(made: "Map") -> None:
    """Check the names in a map of one term, of which code would take an unknown one for another.

    Raises
    ------
    ValueError
        If its frame, center or sampling is unknown.
    """
    for what, known in (("frame", FRAMES), ("center", CENTERS), ("sampling", SAMPLINGS)):
        if (name := getattr(made, what)) not in known:
            raise ValueError(f"{what} {name!r} is not one of {', '.join(known)}")
