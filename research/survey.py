"""A survey of all BRDFs: what SHRMs and principal maps cost, and how near to the truth they are."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from research.glossy_truth import Sphere, sphere
from shrm_cli import settings
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ShrmError
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.seen import seen_errors

Array = NDArray[np.floating]

SETTINGS: dict[str, tuple[str, ...]] = {
    "ashikhmin-shirley": ("nu=10", "nu=100", "nu=1000", "nu=10000",
                          "nu=100,specular=0.05,diffuse=0.5"),
    "blinn-phong": ("exponent=8", "exponent=32", "exponent=128", "exponent=512", "exponent=2048"),
    "charlie": ("roughness=0.1", "roughness=0.2", "roughness=0.4", "roughness=0.7", "roughness=1"),
    "coated": ("roughness=0.3", "roughness=0.5", "roughness=0.3,base=(ggx:roughness=0.5,f0=gold)",
               "roughness=0.3,color=0.9/0.5/0.2,base=(ggx:roughness=0.4)",
               "roughness=0.2,base=(0.7*lambertian:albedo=0.6/0.05/0.03+0.3*ggx:f0=0.9)"),
    "cook-torrance": ("roughness=0.05", "roughness=0.1", "roughness=0.2", "roughness=0.3",
                      "roughness=0.6"),
    "disney-diffuse": ("roughness=0", "roughness=0.25", "roughness=0.5", "roughness=0.75",
                       "roughness=1"),
    "eon": ("roughness=0", "roughness=0.25", "roughness=0.5", "roughness=0.75", "roughness=1"),
    "fuzzy": ("roughness=0.1", "roughness=0.3", "roughness=0.6", "roughness=1",
              "color=0.5,base=(ggx:roughness=0.5)"),
    "ggx": ("roughness=0.1", "roughness=0.2", "roughness=0.3", "roughness=0.5", "roughness=0.8",
            "roughness=0.3,f0=gold", "roughness=0.3,f0=0.04"),
    "kajiya-kay": ("exponent=4", "exponent=8", "exponent=32", "exponent=64", "exponent=128"),
    "lafortune": ("fit=bluepaint", "fit=brushedmetal", "fit=skin", "exponent=20", "exponent=100"),
    "lambertian": ("albedo=0.2", "albedo=0.5", "albedo=0.8", "albedo=0.8/0.1/0.05", "albedo=1"),
    "microfacet": ("sigma=0.05", "sigma=0.1", "sigma=0.2", "sigma=0.3", "sigma=0.5"),
    "openpbr": ("base_color=0.6", "base_metalness=1,base_color=0.9/0.6/0.3",
                "specular_roughness=0.6", "coat_weight=1,coat_roughness=0.3",
                "fuzz_weight=0.5,specular_roughness=0.5"),
    "oren-nayar": ("sigma=0", "sigma=0.2", "sigma=0.4", "sigma=0.8", "sigma=1.2"),
    "phong": ("exponent=8", "exponent=32", "exponent=128", "exponent=512", "exponent=2048"),
    "poulin-fournier": ("exponent=20",),
    "ward": ("ax=0.05", "ax=0.1", "ax=0.2", "ax=0.3", "ax=0.5"),
}  # fmt: skip
"""For each model its useful range. A brushed one is among them although no SHRM holds it, to see
that it is refused."""
SUMS = (
    "0.5*lambertian+0.5*ggx:roughness=0.2,f0=0.04",
    "0.5*lambertian+0.5*ggx:roughness=0.3,f0=0.04",
    "0.5*lambertian+0.5*ggx:roughness=0.5,f0=0.04",
    "lambertian:albedo=0.8/0.1/0.05+ggx:roughness=0.4,f0=0.04",
    "0.9*lambertian:albedo=0.8/0.1/0.05+0.1*phong:exponent=64",
)
"""Plastics and paints."""
PROBES = "interior", "city"
FORMS = "shrm", "principal"
MOST_SECONDS = 10.0
"""The processor time that a map may take."""
MOST_BYTES = 32e6
"""The bytes that a map may take in half precision."""

_VIEWERS = Viewer(0, 0), Viewer(120, 20), Viewer(240, -20)
"""Those of `shrm compare`."""


@dataclass(frozen=True)
class Outcome:
    """One map of the survey.

    Attributes
    ----------
    spec, probe, form : str
        The BRDF, the name of the probe, and the representation.
    seconds : float
        Processor time of the prefiltering, of all threads, without a cache.
    bytes : int
        The map's values in half precision, before they are packed.
    predicted : float
        The predicted relative RMS error, bilinear look-ups not included.
    p95, negative : float
        As `SeenErrors` has them, over the pixels of three views.
    refused : str
        The error, where there is no map; the other numbers but the seconds are nan then.
    """

    spec: str
    probe: str
    form: str
    seconds: float
    bytes: float = float("nan")
    predicted: float = float("nan")
    p95: float = float("nan")
    negative: float = float("nan")
    refused: str = ""

    @property
    def marks(self) -> list[str]:
        """What is wrong with the map, if anything: ``slow``, ``large`` or ``refused``."""
        found = {
            "slow": self.seconds > MOST_SECONDS,
            "large": self.bytes > MOST_BYTES,
            "refused": bool(self.refused),
        }
        return [name for name, is_so in found.items() if is_so]


def all_specs() -> list[str]:
    """Return the specifications of all models at their settings, and of sums."""
    models = [f"{name}:{each}" for name, many in SETTINGS.items() for each in many]
    return [*models, *SUMS]


def outcomes(
    probes: Sequence[Probe], specs: Sequence[str], picture: int
) -> Iterator[list[Outcome]]:
    """Make all maps and compare them with the truth; yields those of one BRDF at a time."""
    spheres = [sphere(viewer.direction, picture) for viewer in _VIEWERS]
    for spec in specs:
        yield [outcome for probe in probes for outcome in _of_probe(spec, probe, spheres)]


def _of_probe(spec: str, probe: Probe, spheres: Sequence[Sphere]) -> list[Outcome]:
    """Make the maps of one BRDF and probe."""
    made: dict[str, Any] = {}
    rows, truth = [], None
    for form in FORMS:
        started = time.process_time()
        try:
            with settings.using(cache=False):
                made[form] = prefilter_with_facts(probe, form, {"brdf": spec}).map
        except Exception as error:  # a defect that one BRDF shows is not to end the survey
            seconds = time.process_time() - started
            kind = "" if isinstance(error, ShrmError) else f"{type(error).__name__}: "
            rows.append(Outcome(spec, probe.name, form, seconds, refused=f"{kind}{error}"))
            continue
        seconds, each = time.process_time() - started, made[form]
        if truth is None:
            brdf = parse_spec(spec)
            truth = np.concatenate(
                [reference(probe, brdf, ball.normals, ball.views, exact=True) for ball in spheres]
            )
        found = np.concatenate([each.radiance(ball.normals, ball.views) for ball in spheres])
        seen = seen_errors(found, truth)
        rows.append(Outcome(
            spec, probe.name, form, seconds, 2 * sum(plane.size for plane in each.planes()),
            float(np.hypot(each.info.predicted_error, each.info.added_error)),
            seen.p95_relative_error, seen.negative_share,
        ))  # fmt: skip
    return rows
