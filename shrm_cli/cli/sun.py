"""`shrm sun` takes the lamps out of a probe."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, echo, progress_bar, warn
from shrm_cli.cli.types import FRACTION, PATH, option, whole, within
from shrm_cli.maps.options import counted
from shrm_cli.vocabulary import LAMP_COUNT, LAMP_ERROR, LIGHT_ENGINES, Precision

if TYPE_CHECKING:
    from shrm_cli.lights.lamp import Lamp
    from shrm_cli.lights.split import LampSplit


@click.command()
@click.argument("probe", type=PATH)
@option(
    "-o --output EXR", PATH,
    help="Write the residual: the probe with its lamps replaced by what is around them.",
)  # fmt: skip
@option("--light-file TOML", PATH, "Write residual and discs as a probe of all commands; needs -o.")
@option("--usd USDA", PATH, "Write a DomeLight_1 and DistantLights; needs -o.")
@option(
    "--for engine", click.Choice(LIGHT_ENGINES),
    help="Print lines that make the lamps there, instead of the report.",
)  # fmt: skip
@option(
    "--error X", FRACTION, default=LAMP_ERROR,
    help="RMS error of the irradiance that discs may make; what gives less is no lamp.",
)  # fmt: skip
@option("--count", whole(0, 100), "The most lamps.", default=LAMP_COUNT)
@option(
    "--sun-radius DEG", within(0.001, 90),
    help="Radius of the brightest lamp, instead of the one found; the sun's is 0.265.",
)  # fmt: skip
@options.precision_option
@options.probe_options
@options.report_options
def sun(
    probe: str,
    output: str | None,
    light_file: str | None,
    usd: str | None,
    engine: str | None,
    precision: Precision,
    **values: Any,
) -> None:
    """Find the lamps of PROBE, such as the sun, and take them out of it.

    Lamps are compact places that are much brighter than what is around them. Each becomes a disc,
    or several where it is long, with the flux that is taken out of the probe. The irradiance of
    what is left and the discs is compared with that of the probe.

    \b
      shrm sun probe.exr
      shrm sun probe.exr -o residual.exr --light-file sun.toml --usd sun.usda
      shrm prefilter sun.toml --brdf microfacet
    """
    for name, target in (("--light-file", light_file), ("--usd", usd)):
        if target is not None and output is None:
            raise usage.wrong_usage(f"{name} names the residual; give -o FILE.exr, too")
    if engine is not None and usage.wants_json():
        raise usage.wrong_usage("--for excludes --json")
    read_as = options.make_read_options(values)
    from shrm_cli.progress import Rising, using

    found = shrm.open_probe(probe, read_as)
    targets = {output: ".exr", light_file: ".toml", usd: ".usda"}
    for path, suffix in targets.items():
        if path is not None:
            usage.check_outputs([path], suffixes=[suffix])
    with progress_bar("looking for lamps") as progress, using(Rising(progress)):
        split = shrm.split_lamps(found, **values)
        result = _result(probe, split)
    written = _write(split, output, light_file, usd, precision)
    result |= written
    warnings = found.warnings() + [f"{probe}: {line}" for line in _doubts(split)]
    if engine is not None:
        from shrm_cli.lights.snippets import snippet

        echo(snippet(engine, split.discs))
        warn(warnings)
        return
    conclude(result, _lines(probe, split, written), warnings)


def _write(
    split: LampSplit,
    output: str | None,
    light_file: str | None,
    usd: str | None,
    precision: Precision,
) -> dict[str, Any]:
    """Write what was asked for, all of it or nothing, and return the names of the files."""
    if output is None:
        return {}
    from shrm_cli.files.whole import together, write_bytes
    from shrm_cli.lights.light_files import light_file_text, relative_name, usd_text, write_residual

    texts = {}
    if light_file is not None:
        texts[light_file] = light_file_text(split, relative_name(output, light_file))
    if usd is not None:
        texts[usd] = usd_text(split, relative_name(output, usd))
    with together():
        pixel_type = write_residual(output, split, precision)
        for path, text in texts.items():
            write_bytes(path, text.encode())
    files = {"residual": output, "light_file": light_file, "usd": usd, "precision": pixel_type}
    return {name: value for name, value in files.items() if value is not None}


def _result(probe: str, split: LampSplit) -> dict[str, Any]:
    proof = split.proof
    return {
        "probe": probe,
        "lamps": [lamp.summary() for lamp in split.lamps],
        "left_in_the_residual": split.left,
        "irradiance": {
            "rms": proof.scale,
            "relative_rms_error": proof.rms,
            "relative_maximum_error": proof.maximum,
            "worst_normal": proof.worst.tolist(),
        },
        "allowed_error": split.error,
    }


def _doubts(split: LampSplit) -> list[str]:
    """Return what a user should know of the lamps, a line each."""
    lines, left = split.clipped, split.left
    if split.refused is not None:
        left -= 1
        lines.append(
            f"the brightest lamp stays in the residual: a disc of {split.refused:g} degrees in its "
            "place changes the irradiance by more than `error` allows; give another `sun_radius`, "
            "or leave it out"
        )
    if left:
        lamps = "lamp stays" if left == 1 else "lamps stay"
        lines.append(
            f"{left} more {lamps} in the residual; `count` takes more, `error` ones that are less "
            "like discs"
        )
    return lines + split.changed


def _lines(probe: str, split: LampSplit, written: dict[str, Any]) -> list[str]:
    lines = [f"{probe}: {counted(len(split.lamps), 'lamp')}"]
    if not split.lamps and not split.left:
        lines.append("  nothing compact gives as much irradiance and is as bright beside the rest")
    for number, lamp in enumerate(split.lamps, 1):
        lines += _lamp_lines(number, lamp)
    proof = split.proof
    lines += [
        f"  irradiance of residual + discs, over all normals: RMS error {proof.rms:.3%}, at most "
        f"{proof.maximum:.3%} (of its RMS; {split.error:.3g} allowed)"
    ]
    names = [str(value) for name, value in written.items() if name != "precision"]
    return lines + ([f"  written: {', '.join(names)}"] if names else [])


def _lamp_lines(number: int, lamp: Lamp) -> list[str]:
    facts = lamp.summary()
    irradiance, radiance = (
        " ".join(f"{each:.4g}" for each in facts[name]) for name in ("irradiance", "radiance")
    )
    shape = f"radius {facts['radius']:.3g} degrees"
    if lamp.is_elongated:
        shape = f"{facts['length']:.3g} x {facts['width']:.3g} degrees, elongated"
    if len(lamp.discs) > 1:
        shape += f", as {len(lamp.discs)} discs"
    elif lamp.is_elongated:
        shape += f", as a disc of radius {facts['radius']:.3g}"
    if not lamp.is_resolved:
        shape += f" (of a pixel: {facts['pixel']:.3g})"
    direction = ", ".join(f"{each:.5f}" for each in facts["direction"])
    return [
        f"  lamp {number}  azimuth {facts['azimuth']:z.2f}, elevation {facts['elevation']:z.2f} "
        f"({direction}), {shape}",
        f"          irradiance {irradiance}  radiance {radiance}  fits to {lamp.error:.2%}",
    ]
