"""How a map was made: the record of its probe, its BRDF and its orders, which its file keeps.

Maps that are compared or joined must agree in what they were made of, which is told here too.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.base import Brdf, value_text
from shrm_cli.brdf.library import parse_recorded
from shrm_cli.brdf.sums import FILES
from shrm_cli.color import conversion
from shrm_cli.errors import BrdfError
from shrm_cli.orders import Orders
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.vocabulary import CENTERS, FRAMES, MAX_TERMS, SAMPLINGS, Domain

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.probe.proxy import ProxyBox

ERRORS = "predicted_error", "added_error", "filter_error", "storage_error"
"""What a map states of its errors, relative to all of the reflected light."""


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

    Examples
    --------
    >>> info = shrm.prefilter("probes/studio.exr", "lambertian", eps=0.1).info
    >>> info.order_f, info.brdf["name"], info.predicted_error < 0.1
    (2, 'lambertian', True)
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
    def errors(self) -> dict[str, float]:
        """The `ERRORS` of the map by their names."""
        return {name: getattr(self, name) for name in ERRORS}

    @property
    def stated_error(self) -> float:
        """The relative RMS error of all causes that are known, but for half precision."""
        return math.hypot(
            self.predicted_error, self.added_error, self.fit_residual, self.filter_error
        )

    def adding(self, error: float) -> "MapInfo":
        """Return the record of a map that the representation adds a further error to."""
        return replace(self, added_error=float(np.hypot(self.added_error, error)))

    @property
    def proxy(self) -> "ProxyBox | None":
        """Where the probe was captured and the box around that, by which light is looked up."""
        reading = self._reading()
        if "proxy" not in reading:
            return None
        from shrm_cli.probe.proxy import ProxyBox

        return ProxyBox.read(reading["proxy"])

    def read_otherwise(self, reading: Mapping[str, Any]) -> list[str]:
        """Return the names of what was done to the probe and is not done here, or otherwise.

        Colours that light is converted to and the box of a room are those of the map itself.
        """
        own, here = self._reading(), json.loads(json.dumps(dict(reading)))
        if not own:  # as of maps that do not record it
            return []
        names = {*own, *here} - {"working", "proxy"}
        return sorted(
            _READ.get(name, f"`{name}`") for name in names if own.get(name) != here.get(name)
        )

    def _reading(self) -> dict[str, Any]:
        """Return how the probe was read, as far as the map records it."""
        reading = self.options.get("reading")
        return reading if isinstance(reading, dict) else {}

    def _read_with(self, **changes: Any) -> "MapInfo":
        """Return the record of a probe that was read with changes; None leaves a rule out."""
        changed = {**self._reading(), **changes}
        reading = {name: value for name, value in changed.items() if value is not None}
        return replace(self, options={**self.options, "reading": reading})

    def without_box(self) -> "MapInfo":
        """Return the record of the same light that does not tell the room around it."""
        return self if self.proxy is None else self._read_with(proxy=None)

    def turned(self, matrix: ArrayLike) -> "MapInfo":
        """Return the record of the same light turned, as if the probe had been read so.

        Parameters
        ----------
        matrix : array_like, shape (3, 3)
            Orthogonal; what came from a direction d comes from ``matrix @ d``.
        """
        axes = np.asarray(matrix) @ _axes(self._reading().get("axes"))
        is_world = np.array_equal(axes, np.eye(3))
        box = None if self.proxy is None else self.proxy.turned(matrix)
        return self._read_with(
            axes=None if is_world else np.round(axes, 9).tolist(), proxy=box and box.record()
        )

    def in_primaries(self, primaries: tuple[float, ...]) -> "MapInfo":
        """Return the record of the same light in other primaries, as if it had been read so."""
        changed = self._read_with(working=list(primaries))
        return replace(changed, chromaticities=tuple(primaries))

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

    Raises ValueError if its frame, center or sampling is unknown.
    """
    for what, known in (("frame", FRAMES), ("center", CENTERS), ("sampling", SAMPLINGS)):
        if (name := getattr(made, what)) not in known:
            raise ValueError(f"{what} {name!r} is not one of {', '.join(known)}")


def record_of(brdf: Brdf) -> dict[str, Any]:
    """Return a BRDF in the form in which maps record it; see `MapInfo`."""
    return {"name": brdf.name, "parameters": dict(brdf.values)}


def probe_name(probe: Probe) -> str:
    """Return the name of a probe's file as maps record it, without folders."""
    return probe.name.replace("\\", "/").rsplit("/", 1)[-1]


def provenance(probe: Probe, brdf: Brdf, orders: Orders) -> MapInfo:
    """Return the record of how a map is made, with a predicted error of 0 to be replaced."""
    return MapInfo(
        orders.order_f, orders.order_p, orders.eps, orders.captured, 0.0, record_of(brdf),
        probe_name(probe), probe.digest(), probe.chromaticities,
    )  # fmt: skip


def spec_of(record: Mapping[str, Any]) -> str:
    """Return the specification of a BRDF that a map records, as `parse_recorded` reads it.

    Files can hold anything, so the result is ``unknown`` for a record without a name and
    parameters.
    """
    name, parameters = record.get("name"), record.get("parameters")
    if not isinstance(name, str) or not isinstance(parameters, dict):
        return "unknown"
    if name == "sum":
        return str(parameters.get("spec", "unknown"))
    inside = ",".join(
        f"{key}={value_text(value)}" for key, value in parameters.items() if key != FILES
    )
    return f"{name}:{inside}" if inside else name


def same_brdf(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two records are of the same BRDF.

    The order of the parameters does not matter, nor whether a grey is one number or three.
    """
    return _canonical(one) == _canonical(other)


def common_brdf(infos: Mapping[str, MapInfo], advice: str = "give `brdf`") -> Brdf:
    """Return the BRDF that all maps were made for.

    Maps record a measured file by its name without the folder, and by the digest of its bytes. It
    is looked for in the folders of the maps, and nowhere else: what a map says leads to no other
    file, and runs no code.

    `infos` are the records of maps by the paths of their files; at least one.
    """
    (path, first), *others = infos.items()
    for other, info in others:
        if not same_brdf(info.brdf, first.brdf):
            raise BrdfError(
                f"{other}: its BRDF is {spec_of(info.brdf)}, but that of {path} is "
                f"{spec_of(first.brdf)}; {advice}"
            )
    measured = _measured_file(first.brdf.get("parameters"))
    if measured is not None:
        return _found_again(path, measured, list(infos), advice)
    files = _files_of_terms(first.brdf)

    def opened(term: str) -> Brdf | None:
        return _found_again(path, files[term], list(infos), advice) if term in files else None

    try:
        return parse_recorded(spec_of(first.brdf), opened, first.chromaticities)
    except _Missing:
        raise
    except BrdfError as error:
        raise BrdfError(
            f"{path}: its BRDF, {spec_of(first.brdf)}, cannot be evaluated; {advice}"
        ) from error


class _Missing(BrdfError):
    """A measured file is not where it is looked for."""


def _files_of_terms(record: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Return the names and the digests of the measured files of a recorded sum, by their names.

    The base of a layer is recorded as a term.
    """
    found: dict[str, dict[str, str]] = {}
    waiting: list[Any] = [record.get("parameters")]
    for values in waiting:  # which grows: a term with a factor before it has a record of its own
        text = values.get(FILES) if isinstance(values, dict) else None
        terms = _parsed(text) if isinstance(text, str) else None
        if isinstance(terms, list) and len(waiting) + len(terms) <= MAX_TERMS**2:
            waiting += terms
        measured = _measured_file(values)
        if measured is not None:
            found[measured["file"]] = measured
    return found


def _parsed(text: str) -> Any:
    from shrm_cli.files.json_text import parse_json  # few BRDFs are of files

    try:
        return parse_json(text)
    except ValueError:
        return None


def _measured_file(values: object) -> dict[str, str] | None:
    """Return the name and the digest of the measured file that parameters name, if they do."""
    if not isinstance(values, dict) or set(values) != {"file", "sha256"}:
        return None
    name = values["file"]
    # The name comes from a file, which must not lead into other folders.
    is_bare = isinstance(name, str) and name not in ("", "..") and Path(name).name == name
    return values if is_bare and "\0" not in name else None


def _found_again(
    path: str, measured: Mapping[str, str], beside: Sequence[str], advice: str
) -> Brdf:
    """Open a map's measured file, which lies in the folder of one of some files."""
    from shrm_cli.brdf.measured import open_measured  # it is slow to load
    from shrm_cli.brdf.measured.reading.file import file_values

    name = measured["file"]
    places = dict.fromkeys(Path(other).parent / name for other in beside)
    # A link may lead to files that whoever sent the map must learn nothing of.
    there = [
        place
        for place in places
        if place.is_file() and place.resolve().parent == place.parent.resolve()
    ]
    for place in there:
        if file_values(place) == measured:
            return open_measured(place)
    why = (
        f"{there[0]} is another measurement than its BRDF's"
        if there
        else f"its BRDF was measured, and {name} does not lie beside it"
    )
    raise _Missing(f"{path}: {why}; put the file there, or {advice}")


_READ = {"axes": "`yaw`, `pitch`, `roll`, `mirror` or `up`"}
"""The options that values in records of how probes are read come from, where names differ."""


def differing_origins(
    infos: Mapping[str, MapInfo],
    probe: str,
    probe_sha256: str,
    brdf: Mapping[str, Any],
    reading: Mapping[str, Any] | None = None,
) -> list[str]:
    """Return a line for each map that was made from another probe, or for another BRDF.

    A map that does not record its probe or its BRDF is not said to differ in it.

    `infos` are the records of maps by the paths of their files. `probe_sha256` is the digest of the
    expected probe's bytes; nothing is compared where it is empty. `brdf` is the expected BRDF, as
    maps record it; nothing is compared where it is empty. `reading` is how that probe is read, as
    `Probe.reading` returns it; nothing is compared where it is None.
    """
    lines = []
    for path, info in infos.items():
        if probe_sha256 and info.probe_sha256 not in ("", probe_sha256):
            lines.append(f"{path}: its probe is not {probe}")
        elif reading is not None and (names := info.read_otherwise(reading)):
            lines.append(
                f"{path}: {probe} was read otherwise for it ({', '.join(names)}); give the options "
                "of then"
            )
        if brdf and info.brdf and not same_brdf(info.brdf, brdf):
            lines.append(f"{path}: its BRDF is {spec_of(info.brdf)}, not {spec_of(brdf)}")
    return lines


def _canonical(record: Mapping[str, Any]) -> tuple[str, dict[str, str]]:
    """Return the name and the parameters, as text, of a recorded BRDF, for comparisons."""
    parameters = record.get("parameters")
    values = parameters.items() if isinstance(parameters, dict) else ()
    return str(record.get("name")), {key: value_text(value) for key, value in values}


# ---- maps in other primaries, without their probes -----------------------------------------------


def with_stated_primaries(found: "Map", primaries: tuple[float, ...]) -> "Map":
    """Return a map that states other primaries for the numbers that it has."""
    return found.with_planes(
        found.planes(), found.sampling, replace(found.info, chromaticities=primaries)
    )


def in_primaries(found: "Map", primaries: tuple[float, ...]) -> "Map":
    """Return a map in other primaries, exactly, because what it makes is linear in the light.

    `primaries` are CIE x and y of red, green, blue and white. Those of the map are Rec.709's where
    it tells none. White stays white, by Bradford's adaptation.

    A BRDF with colors stays the one that it was in the old primaries, and so does the record of it.
    The errors that the map states are those in the old primaries.
    """
    matrix = conversion(found.info.chromaticities, primaries)
    info = found.info.in_primaries(primaries)
    if matrix is None:
        return found.with_planes(found.planes(), found.sampling, info)
    return found.mixed(matrix, info)
