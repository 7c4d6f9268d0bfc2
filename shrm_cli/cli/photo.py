"""`shrm probe brackets`, `ball` and `unclip` make light probes of photographs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import CIRCLE, DIRECTION, PATH, RADIANCE, Parsed, flag, option, within
from shrm_cli.maps.options import counted
from shrm_cli.progress import using
from shrm_cli.vocabulary import MAX_LATLONG_HEIGHT, Precision

if TYPE_CHECKING:
    from shrm_cli.arrays import Array
    from shrm_cli.photo.brackets import Merged
    from shrm_cli.probe.proxy import ProxyBox

_DIFFERENT = 0.1
"""Photographs that differ by more, in the median, show other scenes or are turned otherwise."""


def _times(text: str) -> tuple[float, ...]:
    from fractions import Fraction  # slow to load, and rarely needed

    try:
        return tuple(float(Fraction(part.strip())) for part in text.split(","))
    except (ValueError, ZeroDivisionError, OverflowError):
        raise ValueError(f"{text!r} is not a list of times such as 1/1000,1/60,0.25") from None


_photo_options = options.several(
    option("-o --output", PATH, "OpenEXR file to write.", required=True),
    options.precision_option,
    options.report_options,
)  # fmt: skip


@click.command()
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=PATH)
@option(
    "--times", Parsed("T,T,...", _times),
    help="What each let in, such as its shutter's seconds.  [default: what its Exif says of time, "
    "aperture and sensitivity]",
)  # fmt: skip
@flag(
    "--linear",
    help="Integers are linear, as developers of raw files write them.  [default: find the curve]",
)  # fmt: skip
@_photo_options
def brackets(photos: tuple[str, ...], output: str, precision: Precision, **merging: Any) -> None:
    """Merge exposures of a scene that does not move into one linear picture.

    The camera's curve is found from the photographs themselves (Debevec and Malik 1997). Take them
    from a tripod, with the same white balance and aperture, one to three stops apart.

    \b
      shrm probe brackets ball_*.jpg -o ball.exr
      shrm probe brackets a.tif b.tif c.tif --linear --times 1/1000,1/60,1/4 -o ball.exr
    """
    usage.check_outputs([output], files=photos, suffixes=[".exr"])
    with progress_bar("merging") as progress, using(progress):
        made = shrm.merge_brackets(photos, **merging)
    exposures = made.exposures.tolist()
    differences = [each if each == each else None for each in made.differences.tolist()]
    facts = {
        "photos": list(made.paths), "exposures": exposures, "differences": differences,
        "clipped": made.clipped, "stuck": made.stuck, "white": made.white,
    }  # fmt: skip
    told = ", ".join("?" if each is None else f"{each:.1%}" for each in differences[1:])
    lines = [
        f"  exposures      {', '.join(f'{each:.3g}' for each in exposures)} of the middle one",
        f"  differences    {told} of each from the one before, in the median",
    ]
    if made.white < 1:
        lines.append(f"  white          {made.white:.1%} of the largest number")
    warnings = _disagreements(made.paths, differences) + _white_pixels(output, made)
    recipe = {"probe": "brackets", "photos": _names(made.paths), "exposures": exposures}
    write_probe(output, made.pixels, precision, made.chromaticities, recipe, facts, lines, warnings)


def _disagreements(paths: Sequence[str], differences: Sequence[float | None]) -> list[str]:
    """Return warnings about exposures that do not show what the ones before show."""
    warnings = []
    for before, path, difference in zip(paths, paths[1:], differences[1:], strict=False):
        if difference is None:
            warnings.append(
                f"{path}: shows next to nothing that is neither black nor white in it and in "
                f"{before}; check the --times, or take exposures one to three stops apart"
            )
        elif difference > _DIFFERENT:
            warnings.append(
                f"{path}: differs by {difference:.0%} from {before} in the median, where neither "
                "is black or white; check the --times, and that nothing moved"
            )
    return warnings


def _white_pixels(output: str, made: Merged) -> list[str]:
    """Return warnings about pixels that are white in the shortest exposure, too."""
    warnings = []
    if made.stuck:
        warnings.append(
            f"{output}: {counted(made.stuck, 'pixel')} white in all exposures and alone in it, as "
            "stuck ones of a sensor are, show what is around them"
        )
    if made.clipped:
        count = round(made.clipped * made.pixels.shape[0] * made.pixels.shape[1])
        are = "1 pixel is" if count == 1 else f"{count:,} pixels are"
        warnings.append(
            f"{output}: {are} white in the shortest exposure, too; take a shorter one, or give a "
            "reading to shrm probe unclip"
        )
    return warnings


@click.command()
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=PATH)
@option(
    "--camera cameras", DIRECTION, multiple=True,
    help="Where the camera stood for each, seen from the ball: 90,0 is to the right of 0,0. May be "
    "repeated.  [default: 0,0 and then every 90 degrees]",
)  # fmt: skip
@option(
    "--circle circles", CIRCLE, multiple=True,
    help="Middle, from the left and the top, and radius of the ball in each, in pixels. May be "
    "repeated.  [default: the picture is cropped to the ball]",
)  # fmt: skip
@option(
    "--distance", within(2, 1e6),
    help="From the camera to the ball's middle, in radii of the ball.  [default: from afar]",
)  # fmt: skip
@option(
    "--reflectance", within(0.01, 1), default=1.0,
    help="The part of the light that the ball reflects; chrome has about 0.6.",
)  # fmt: skip
@option(
    "--size", click.IntRange(2, MAX_LATLONG_HEIGHT),
    help="Height of the probe in pixels.  [default: as fine as the ball]",
)  # fmt: skip
@flag("--linearize", "Decode integers, as sRGB where a file names no curve.")
@_photo_options
def ball(
    photos: tuple[str, ...],
    cameras: tuple[tuple[float, float], ...],
    circles: tuple[tuple[float, float, float], ...],
    distance: float | None,
    output: str,
    precision: Precision,
    **unwrapping: Any,
) -> None:
    """Unwrap photographs of a mirror ball into a lat-long probe.

    One photograph shows the camera in its middle, and smears what lies behind the ball. Of two, a
    quarter turn apart, each direction is taken from where it is seen best. Photographs are linear
    and upright: shrm probe brackets makes them.

    \b
      shrm probe ball front.exr right.exr -o probe.exr
      shrm probe ball front.exr --circle 1210,804,522 --distance 12 -o probe.exr
    """
    import numpy as np

    usage.check_outputs([output], files=photos, suffixes=[".exr"])
    with progress_bar("unwrapping") as progress, using(progress):
        made = shrm.unwrap_balls(
            photos, cameras or None, circles or None, distance or np.inf, **unwrapping
        )
    facts = {"gains": made.gains.tolist(), "differences": list(made.differences)}
    lines, warnings = [], []
    for photo, gain, difference in list(zip(photos, made.gains, made.differences, strict=True))[1:]:
        gains = ", ".join(f"{each:.3g}" for each in gain)
        lines.append(f"  {photo}: times {gains}; {difference:.1%} from {photos[0]} in the median")
        if difference > _DIFFERENT:
            warnings.append(
                f"{photo}: differs by {difference:.0%} from {photos[0]} in the median, where both "
                "see the same; check `camera` and `circle`"
            )
    recipe = {"probe": "ball", "photos": _names(photos), "cameras": made.cameras}
    write_probe(output, made.pixels, precision, made.chromaticities, recipe, facts, lines, warnings)


@click.command()
@click.argument("source", metavar="PROBE", type=PATH)
@option("--irradiance", RADIANCE, "What a surface receives from all light, in the probe's units.")
@option("--card", RADIANCE, "Instead, the radiance of a grey card, photographed as the probe was.")
@option("--albedo", within(0.01, 1), "What the card reflects.", default=0.18)
@option(
    "--ratio", within(1, 1e6),
    help="Instead, the reading of a light meter over its reading in the lamp's shadow.",
)  # fmt: skip
@option(
    "--facing", DIRECTION, "Where the card or the meter faced, degrees; 0,90 is up.", default="0,90"
)
@options.probe_options
@_photo_options
def unclip(
    source: str,
    irradiance: tuple[float, ...] | None,
    card: tuple[float, ...] | None,
    albedo: float,
    ratio: float | None,
    facing: tuple[float, float],
    output: str,
    precision: Precision,
    **reading: Any,
) -> None:
    """Make the sun of a probe, which its camera clipped, as bright as a reading says.

    What a card or a light meter receives from the rest of the probe is known; the remainder is the
    sun's. The brightest place of the probe is multiplied so that it gives as much.

    \b
      shrm probe unclip probe.exr --card 3.1,2.9,2.6 -o sunny.exr
      shrm probe unclip probe.exr --ratio 6.5 -o sunny.exr
      shrm probe unclip panorama.jpg --linearize --ratio 6.5 -o sunny.exr
    """
    import numpy as np

    from shrm_cli.sphere.directions import from_azimuth_elevation, to_azimuth_elevation

    for one, other in (("irradiance", "card"), ("irradiance", "ratio"), ("card", "ratio")):
        usage.exclude(one, other)
    if irradiance is None and card is None and ratio is None:
        raise shrm.ArgumentError("card", "or `ratio` or `irradiance` must be given")
    usage.check_outputs([output], files=[source], suffixes=[".exr"])
    given = irradiance if card is None else np.pi / albedo * np.asarray(card)
    received = None if given is None else np.broadcast_to(given, 3)
    normal = from_azimuth_elevation(*facing)
    probe = shrm.open_probe(source, options.make_read_options(reading))
    with progress_bar("reading") as progress, using(progress):
        try:
            made = shrm.unclip(probe, received, ratio, normal)
        except shrm.ArgumentError as error:
            if card is None:
                raise
            raise shrm.ArgumentError("card", f"gives an irradiance that {error.message}") from error
    azimuth, elevation = to_azimuth_elevation(made.direction)
    times = ", ".join(f"{each:.4g}" for each in made.factors)
    facts = {
        "factors": made.factors.tolist(), "direction": made.direction.tolist(),
        "solid_angle": made.solid_angle,
    }  # fmt: skip
    lines = [
        f"  lamp           at {azimuth:z.1f}, {elevation:z.1f}, {made.solid_angle:.3g} sr: "
        f"times {times}"
    ]
    recipe = {
        "probe": "unclip", "source": Path(source).name, "factors": made.factors.tolist(),
        "radiance": made.radiance.tolist(),
    }  # fmt: skip
    write_probe(
        output, made.pixels, precision, made.probe.chromaticities, recipe, facts, lines,
        probe.warnings(white=False),
    )  # fmt: skip


def _names(photos: Sequence[str]) -> list[str]:
    return [Path(each).name for each in photos]


def write_probe(
    output: str,
    pixels: Array,
    precision: Precision,
    chromaticities: tuple[float, ...] | None,
    recipe: dict[str, Any],
    facts: dict[str, Any],
    lines: Sequence[str],
    warnings: Sequence[str],
    proxy: ProxyBox | None = None,
) -> None:
    """Write a probe that was made, with what it was made of, and tell it."""
    from shrm_cli.files.image import write_image
    from shrm_cli.files.recipe import picture_attributes
    from shrm_cli.probe.proxy import box_attributes

    attributes = picture_attributes(recipe, [chromaticities]) | box_attributes(proxy)
    pixel_type = write_image(output, pixels, precision, attributes)
    height, width, _ = pixels.shape
    result = {"file": output, "width": width, "height": height, "precision": pixel_type, **facts}
    conclude(result, [f"{output}: {width} x {height}, {pixel_type}", *lines], warnings)
