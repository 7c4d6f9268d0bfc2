"""What `shrm convert` makes for programs that read plain images: a material seen from one side as
a lat-long, and the levels of a split sum as one mip-mapped file.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from shrm_cli.cli.conversion import Converted, open_source
from shrm_cli.cli.options import several
from shrm_cli.cli.shading import refuse_surface, surface_options
from shrm_cli.cli.terminal import progress_bar
from shrm_cli.cli.types import DIRECTION
from shrm_cli.cli.usage import Applies, map_stem, picture_attributes
from shrm_cli.vocabulary import LOOKUPS

if TYPE_CHECKING:
    from shrm_cli.cli.conversion import Conversion
    from shrm_cli.vocabulary import Lookup, Sampling

_LEAST_ROWS = 256
"""The least height of a lat-long of a material, where --size does not say it. Seen over the normal,
or under a dim map of few texels, a material has finer detail than its map."""
_IMAGES = ("latlong", "openexr")
"""The layouts of mip-mapped files."""


plain_options = several(
    click.option(
        "--view", type=DIRECTION,
        help="With --to latlong, of a map: the light reflected to a distant viewer there, "
        "degrees, as a plain image.",
    ),
    click.option(
        "--by", type=click.Choice(LOOKUPS),
        help="With --view, what a pixel's direction is: the mirror direction, or the normal.  "
        "[default: as the map itself is looked up]",
    ),
    surface_options,
    click.option(
        "--mips", is_flag=True,
        help="Of split sums made with --mips, to latlong or openexr: one mip-mapped file.",
    ),
)  # fmt: skip
"""The options of plain images of `shrm convert`."""


def plain_rules(target: str, is_map: bool, view: object, mips: bool) -> dict[str, Applies]:
    """Return when the options of plain images apply, and when those of other conversions do not."""
    seen = view is not None
    with_view = Applies(seen, "with --view")
    rules = {
        "view": Applies(is_map and target == "latlong", "with --to latlong, to maps"),
        "mips": Applies(
            is_map and target in _IMAGES and not seen, "to split sums, with --to latlong or openexr"
        ),
        **dict.fromkeys(("by", "roughness", "f0"), with_view),
    }
    if seen or mips:
        rules["to_orientation"] = Applies(False, "to cubes; OpenEXR's is written here")
    if mips and target == "openexr":
        rules["to_sampling"] = Applies(False, "to lat-longs; cubes have texel centers here")
        rules["size"] = Applies(False, "to lat-longs; the levels of a cube are copied")
    return rules


def plain_name(source: str, target: str, view: tuple[float, float] | None) -> str:
    """Return the default name of a plain image."""
    if view is None:
        return f"{map_stem(source)}.{target}.mips.exr"
    azimuth, elevation = view
    return f"{map_stem(source)}.latlong.view{azimuth:g}_{elevation:g}.exr"


def convert_to_view(
    job: Conversion,
    view: tuple[float, float],
    by: Lookup | None,
    roughness: float | None,
    f0: str | None,
) -> Converted:
    """Write the light that a map reflects to a distant viewer, as a lat-long.

    Parameters
    ----------
    view : tuple of 2 float
        Azimuth and elevation of the viewer, in degrees.
    by, roughness, f0
        The values of the options.

    Raises
    ------
    MapError
        If the map holds no light.
    OutputError
        If the file cannot be written.
    """
    from shrm_cli.errors import MapError
    from shrm_cli.files.image import without_negative, write_image
    from shrm_cli.maps.kinds import MaterialMap
    from shrm_cli.render.camera import Viewer
    from shrm_cli.render.lit import shaded_maps
    from shrm_cli.render.oneview import ignores_views, lookup_of, one_view

    found, notes = open_source(job)
    if isinstance(found, MaterialMap):
        raise MapError(
            f"{job.source}: a product texture that holds no light; make one with light by shrm "
            "prefilter PROBE --brdf SPEC --to product"
        )
    refuse_surface([found])
    shown, surface, warnings = shaded_maps([found], [job.source], roughness, f0)
    chosen, sampled = by or lookup_of(found), job.sampling or "center"
    rows = job.size or max(2 * found.size, _LEAST_ROWS)
    with progress_bar("converting") as progress:
        picture = one_view(
            shown[0], Viewer(*view).direction, rows, chosen, ignores_views(found), sampled, progress
        )
    (picture,), told = without_negative(job.path, [picture])
    said = {"view": list(view), "by": chosen, **surface}
    attributes = picture_attributes(
        {"convert": Path(job.source).name, "to": "latlong", **said}, [found.info.chromaticities]
    )
    if sampled == "border":
        attributes["envmap"] = "latlong"
    pixels = write_image(job.path, picture, job.precision, attributes)
    result = {
        "file": job.path, "kind": "view", "representation": found.representation, **said,
        "width": 2 * rows, "height": rows, "sampling": sampled, "precision": pixels,
    }  # fmt: skip
    azimuth, elevation = view
    what = {"reflection": "mirror direction", "normal": "normal"}[chosen]
    report = (
        f"{job.path}: lat-long over the {what}, seen from {azimuth:g},{elevation:g}, "
        f"{2 * rows} x {rows}, {pixels}"
    )
    return Converted(result, report, [*warnings, *told, *notes])


def convert_to_mips(job: Conversion) -> Converted:
    """Write the levels of a split sum as one mip-mapped file.

    Raises
    ------
    MapError
        If the map is no split sum whose levels halve.
    OutputError
        If the file cannot be written.
    """
    from shrm_cli.files.image import without_negative
    from shrm_cli.files.mipmap import write_mipmap
    from shrm_cli.maps.splitsum.mips import cube_mips, latlong_mips, mip_chain

    made, notes = open_source(job)
    found = mip_chain(made, job.source)
    sampled: Sampling = job.sampling or "center"
    if job.target == "openexr":
        levels = cube_mips(found)
    else:
        levels = latlong_mips(found, job.size or 2 * found.size, sampled)
    levels, warnings = without_negative(job.path, levels)
    # Levels beyond a split sum's own have the roughness of its last.
    known = (*found.roughness, *[found.roughness[-1]] * (len(levels) - len(found.roughness)))
    roughness = [round(value, 6) for value in known]
    recipe = {"convert": Path(job.source).name, "to": job.target, "roughness": roughness}
    attributes = picture_attributes(recipe, [found.info.chromaticities])
    if sampled == "border":
        attributes["envmap"] = "latlong"
    pixels = write_mipmap(job.path, levels, job.precision_of(found), attributes)
    height, width, _ = levels[0].shape
    result = {
        "file": job.path, "kind": "mips", "layout": job.target, "sampling": sampled, "width": width,
        "height": height, "levels": len(levels), "roughness": roughness, "precision": pixels,
    }  # fmt: skip
    listed = ", ".join(f"{value:.3g}" for value in roughness)
    report = (
        f"{job.path}: {job.target} in {len(levels)} mip levels from {width} x {height}, {pixels}\n"
        f"  roughness      {listed}"
    )
    return Converted(result, report, [*warnings, *notes])
