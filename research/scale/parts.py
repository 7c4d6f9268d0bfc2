"""The parts of prefilters of many orders, sizes and forms, timed in one process with one thread."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO as oiio

from research.inputs import say
from research.scale.clock import Seconds, seconds_of, seconds_of_parts
from research.scale.model import Case
from research.scale.reach import Reach
from shrm_cli import settings
from shrm_cli.maps import stored
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.latlong import LatLong

SPEC = "microfacet:sigma=0.2"
"""The BRDF of the sweeps, whose orders are given. Their time does not depend on its values."""
_GRAIN = 0.02
"""The noise of a pixel, relative to it, without which enlarged probes would pack too well."""


@dataclass(frozen=True)
class Measured:
    """One prefilter.

    Attributes
    ----------
    label : str
        The form, and what else tells it from others.
    case : Case
        With F as far as the light is carried, and P and S of the map.
    seconds : dict of str to float
        Processor seconds of each part.
    read, written : int
        Bytes of the probe and of the map, as files.
    """

    label: str
    case: Case
    seconds: Seconds
    read: int
    written: int

    @property
    def total(self) -> float:
        return sum(self.seconds.values())


def write_probe(path: Path, light: Probe, rows: int, compression: int) -> Path:
    """Write a lat-long of half floats with the light of another probe, and some grain."""
    pixels = to_grid(light, LatLong(rows))
    rng = np.random.default_rng(rows)
    pixels = pixels * (1 + _GRAIN * rng.standard_normal(pixels.shape, dtype=np.float32))
    pixels = np.clip(pixels, 0, 65000).astype(np.float16)
    header = {"compression": compression, "type": OpenEXR.scanlineimage}
    planes = {name: np.ascontiguousarray(pixels[..., k]) for k, name in enumerate("RGB")}
    OpenEXR.File(header, planes).write(str(path))
    return path


def measured(probe: Path, folder: Path, to: str, given: dict[str, Any], repeats: int) -> Measured:
    """Time the parts of one prefilter, whose BRDF's coefficients are in the cache."""
    target = folder / f"made.{to}.exr"
    facts: dict[str, Any] = {}

    def work() -> None:
        made = prefilter_with_facts(open_probe(probe), to, given)
        stored.store(target, made.map)
        facts.update(made.summary())

    seconds = seconds_of_parts(work, repeats)
    order_p = int(facts.get("order_p") or 0)
    order_f = int(facts.get("order_carried") or facts.get("order_f") or 0)
    case = Case(open_probe(probe).height, order_f, order_p, int(facts.get("size") or 0))
    spec = "" if given.get("brdf") is None else f" {given['brdf']}"
    order = f" F={given['order_f']}" if "order_f" in given else ""
    return Measured(
        f"{to}{spec}{order}", case, seconds, probe.stat().st_size, target.stat().st_size
    )


def sweep(probe: Path, folder: Path, reach: Reach) -> Iterator[Measured]:
    """Time SHRMs of orders and sizes that are given, as far as their cubes can show the orders."""
    for order_f in reach.orders_f:
        for order_p in reach.orders_p:
            for size in reach.sizes:
                case = Case(0, order_f, order_p, size)
                if case.values <= reach.most_values and order_f <= 2 * size:
                    given = {"brdf": SPEC, "order_f": order_f, "order_p": order_p, "size": size}
                    yield measured(probe, folder, "shrm", given, -(-reach.repeats // 3))


def all_parts(light: Probe, folder: Path, reach: Reach) -> dict[str, list[Measured]]:
    """Time everything that the laws are fitted to and that forecasts are made of.

    Returns
    -------
    dict
        Under ``sweep`` SHRMs of given orders and sizes, under ``probes`` default SHRMs of probes
        of several heights, under ``forms`` all forms of one probe.
    """
    zipped = OpenEXR.ZIP_COMPRESSION
    probes = {rows: write_probe(folder / f"{rows}.exr", light, rows, zipped) for rows in reach.rows}
    middle = probes[reach.form_rows]
    found: dict[str, list[Measured]] = {"sweep": [], "probes": [], "forms": []}
    with settings.using(threads=1, cache=folder / "coefficients"):
        for rows, probe in probes.items():
            say(f"probes of {2 * rows} x {rows}")
            for order_f in (None, *reach.probe_orders):
                given = {"brdf": SPEC} if order_f is None else {"brdf": SPEC, "order_f": order_f}
                found["probes"].append(measured(probe, folder, "shrm", given, reach.repeats))
        say(f"forms, of a probe of {2 * reach.form_rows} x {reach.form_rows}")
        for to, spec in reach.forms:
            given = {} if spec is None else {"brdf": spec}
            found["forms"].append(measured(middle, folder, to, given, reach.repeats))
        say("orders and sizes")
        smallest = probes[min(probes)]
        found["sweep"] += sweep(smallest, folder, reach)
    return found


def floors(light: Probe, folder: Path, reach: Reach) -> dict[str, float]:
    """Time libraries alone, at the files of the default SHRM of a probe of `form_rows`.

    Returns
    -------
    dict of str to float
        Processor seconds: ``read`` and ``read as DWAB`` by OpenImageIO into floats, ``write`` by
        OpenEXR and ``write unpacked`` by it without compression.
    """
    rows, found = reach.form_rows, {}
    for name, kind in (
        ("read", OpenEXR.ZIP_COMPRESSION),
        ("read as DWAB", OpenEXR.DWAB_COMPRESSION),
    ):
        path = write_probe(folder / "floor.exr", light, rows, kind)
        found[name] = seconds_of(lambda path=path: _read(path), 3 * reach.repeats)
    with settings.using(threads=1, cache=folder / "coefficients"):
        made = prefilter_with_facts(open_probe(path), "shrm", {"brdf": SPEC})
    (part,) = made.map.encode()
    planes = {
        name: np.ascontiguousarray(plane, np.float16) for name, plane in part.channels.items()
    }
    for name, kind in (
        ("write", OpenEXR.ZIP_COMPRESSION),
        ("write unpacked", OpenEXR.NO_COMPRESSION),
    ):
        header = {"compression": kind, "type": OpenEXR.scanlineimage}

        def write(header: dict[str, Any] = header) -> None:
            with OpenEXR.File(header, planes, num_threads=1) as file:
                file.write(str(folder / "floor-out.exr"))

        found[name] = seconds_of(write, 3 * reach.repeats)
    return found


def _read(path: Path) -> None:
    source = oiio.ImageInput.open(str(path))
    source.read_image(0, 0, 0, 3, oiio.FLOAT)
    source.close()
