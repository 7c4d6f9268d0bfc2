"""Lamps that go out of what is filtered, and become lights of the engine: `--sun split`.

A lamp of a few texels is what packing, mips and the filters of engines get wrong. What is left
without it is smooth enough for all of them, and the light that surfaces get stays the same.
"""

import json
from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.pixels import CURE
from shrm_cli.lights.snippets import beside_cubes
from shrm_cli.lights.split import LampSplit, split_lamps
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import LAMP_COUNT


def without_lamps(
    probe: Probe, engine: Engine
) -> tuple[Probe, tuple[Disc, ...], list[str], list[str]]:
    """Take the lamps out of a probe, as many as the engine has lights for.

    A lamp is what gives more irradiance than `LAMP_ERROR`, so that the error and the engine decide
    how many there are. A night with 13 lamps loses 1.4 % (RMS) of its sharp level to BC6H where all
    of them are lights, and 2.9 % where five stay.

    Returns what is left, the discs, what is told of them, and warnings.
    """
    most = engine.lamps
    split = split_lamps(probe, count=most)
    while len(split.discs) > engine.lamps:  # a long lamp is several discs
        most = min(most, len(split.lamps) + split.left) - 1
        split = split_lamps(probe, count=most)
    if not split.discs:
        return probe, (), ["lamps: none was found"], []
    return split.residual_probe, split.discs, [_lamps_line(split)], [*split.clipped, *split.changed]


def better_cures(made: Package, probe: Probe, engine: Engine) -> list[str]:
    """Return the warnings of an export, with what is better than to dim lamps that were clipped.

    Where nothing is left to clip without the lamps, they are better taken out: no light is lost.
    """
    if not np.isfinite(made.limit):
        return made.warnings
    split = split_lamps(probe, count=engine.lamps or LAMP_COUNT)
    left = float(split.residual.max())
    if not split.discs or left > made.limit:
        return made.warnings
    whole = lost = 0.0
    for _, pixels, weights in probe.blocks():  # arrays of all pixels would be large
        whole += float((pixels * weights[..., None]).sum())
        lost += float((np.maximum(pixels - made.limit, 0) * weights[..., None]).sum())
    how = "`sun` split" if engine.lamps else "shrm sun, and make lights of them"
    cure = (
        f"take the lamps out with {how}, which leaves {left:.3g} at most, or dim them "
        f"with `clamp`, which loses {lost / whole:.1%} of the light"
    )
    return [line.replace(CURE, cure) for line in made.warnings]


def _lamps_line(split: LampSplit) -> str:
    radii = ", ".join(f"{np.degrees(disc.radius):.2g}" for disc in split.discs)
    left = f"; {split.left} more stay" if split.left else ""
    return (
        f"lamps: {split.share:.1%} of the light is lights of the engine, discs of a radius of "
        f"{radii} degrees{left}; together they change the irradiance by {split.proof.rms:.2g} RMS"
    )


def add_lamps(made: Package, light: Light, engine: Engine) -> None:
    """Add a list of lamps, and the lines that make lights of them."""
    if not light.discs:
        return
    made.add_text(f"{light.name}_lamps.json", lamps_json(light.discs))
    made.loading += beside_cubes(engine.name, light.discs).splitlines()


def lamps_json(discs: Sequence[Disc]) -> str:
    """Return the lamps as JSON: for programs that read lights, whatever their axes are."""
    return (
        json.dumps(
            {
                "about": "Lamps that the other files are without. direction: from the origin to "
                "the lamp, +Y up, as shrm has it. radius: degrees. radiance: of the disc. "
                "irradiance: of a surface that faces it. Linear RGB, units of the probe.",
                "lamps": [
                    {
                        "direction": _short(disc.direction),
                        "radius": float(f"{np.degrees(disc.radius):.7g}"),
                        "radiance": _short(disc.radiance),
                        "irradiance": _short(disc.irradiance),
                    }
                    for disc in discs
                ],
            },
            indent=1,
        )
        + "\n"
    )


def _short(values: Array) -> list[float]:
    return [float(f"{value + 0.0:.7g}") for value in values]
