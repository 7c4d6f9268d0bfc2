"""`shrm convert` makes other representations of maps, and other layouts of maps and probes."""

from operator import attrgetter
from typing import Any

import click

import shrm_cli as shrm
from shrm_cli import vocabulary
from shrm_cli.cli import options, usage
from shrm_cli.cli.shading import surface_options
from shrm_cli.cli.terminal import conclude, echo, progress_bar
from shrm_cli.cli.types import BYTES, DIRECTION, PATH, Named, flag, option, whole
from shrm_cli.files.whole import keeping
from shrm_cli.maps.options import SHADER, all_options, listing, owners
from shrm_cli.maps.registry import descriptions, installed_names
from shrm_cli.naming import map_stem

_TARGETS = [*vocabulary.REPRESENTATIONS, *vocabulary.LAYOUTS, vocabulary.LAYERS]
_OURS = {"sampling": "to_sampling", "orientation": "to_orientation", "path": "output"}
"""What the command calls arguments of `shrm_cli.convert`."""


_converts = attrgetter("converts")
"""Tells whether an option of prefiltering is one of converting, too."""
_plain_options = options.several(
    option(
        "--view", DIRECTION,
        help="With --to latlong, of a map: the light reflected to a distant viewer there, "
        "degrees, as a plain image.",
    ),
    option(
        "--by", click.Choice(vocabulary.LOOKUPS),
        help="With --view, what a pixel's direction is: the mirror direction, or the normal.  "
        "[default: as the map itself is looked up]",
    ),
    surface_options,
    flag("--mips", "Of split sums made with --mips, to latlong or openexr: one mip-mapped file."),
)  # fmt: skip
"""The options of plain images of `shrm convert`."""


@click.command(cls=options.command_with_headings({}, "Options", _converts))
@click.argument("source", metavar="IN", type=PATH)
@option(
    "--to target", Named(_TARGETS, installed_names), required=True,
    help="Representation (of a map), layout of the images (of a map or a probe), or layers, the "
    "textures that --shader reads.",
)  # fmt: skip
@option(
    "--shader", click.Choice(SHADER.choices),
    help="Print the code that looks the map up, too: with --to layers in them, else in arrays of "
    "cube maps.",
)  # fmt: skip
@option("-o --output", PATH, "File to write.  [default: IN.TO.exr]")
@usage.force_option
@option(
    "--frame", click.Choice(vocabulary.FRAMES),
    help="Axes of the view in an SHRM.  [default: those of IN]",
)  # fmt: skip
@option(
    "--order-p", whole(0, vocabulary.MAX_ORDER_P),
    help="Order P of the SHRM.  [default: as high as IN has it or determines it]",
)  # fmt: skip
@option(
    "--max-size BYTES", BYTES,
    help="Most bytes of the map in half precision, where its views or P are not given.  "
    f"[default: {vocabulary.DEFAULT_MAX_SIZE // 10**6}MB, or those of IN]",
)  # fmt: skip
@options.representation_options(_converts)
@_plain_options
@option(
    "--size", whole(1, 8192),
    help="Texels along a face's edge; height of a lat-long or angular map.  [default: as fine]",
)  # fmt: skip
@option(
    "--to-orientation", click.Choice(vocabulary.ORIENTATIONS),
    help="Orientation of the cube faces to write.  [default: openexr for --to openexr, else gl]",
)  # fmt: skip
@option("--to-sampling", click.Choice(vocabulary.SAMPLINGS), "Where the edge pixels to write lie.")
@options.kept_precision_option
@options.probe_options
@options.report_options
def convert(
    source: str,
    target: str,
    output: str | None,
    force: bool,
    shader: str | None,
    size: int | None,
    to_orientation: vocabulary.Orientation | None,
    to_sampling: vocabulary.Sampling | None,
    view: tuple[float, float] | None,
    mips: bool,
    precision: vocabulary.Precision,
    **values: Any,
) -> None:
    """Convert IN, a map or a light probe.

    A map becomes another representation, exactly at its samples; an SHRM is fitted to explicit
    maps, and what the fit leaves is told. What engines use (irradiance, splitsum, she) is made
    from the probe alone, and converted to itself: other precision, other size of irradiance.
    Irradiance and SH exponentials are turned by --yaw, --pitch and --roll, exactly and without
    their probe, and --working brings linear light into other primaries. Maps and probes are laid
    out anew; with --to layers maps become one array of images, for shaders. The options from
    --sampling to --working say how a probe is to be read. For programs that read plain images,
    --view AZ,EL writes what a map's material reflects to one distant viewer, and --mips the levels
    of a split sum as mip levels.

    \b
      shrm convert probe.microfacet.shrm.exr --to cabral
      shrm convert probe.exr --to hcross --size 256
      shrm convert probe.irradiance.exr --to irradiance --yaw 30 -o turned.exr
      shrm convert probe.ggx.principal.exr --to latlong --view 30,10 --by normal
      shrm convert probe.splitsum.exr --to latlong --mips
    """
    is_plain = view is not None or mips
    by = values.get("by")
    named = _plain_name(source, target, view, by) if is_plain else _default_name(source, target)
    path = output or named
    reading = options.make_read_options(values)
    from_map = shrm.is_map(source)
    usage.refuse_inapplicable(
        _rules(target) | _rules_of_source(from_map) | _plain_rules(target, from_map, view, mips)
    )
    names = [path]
    if target == "faces":
        from shrm_cli.probe.open import face_paths  # which other targets are spared

        names = face_paths(path)
    if not (output or force):
        click.get_current_context().with_resource(keeping(*names))
    usage.check_outputs(names, files=[source], suffixes=vocabulary.CONTAINERS)
    own = {name: values[name] for name in usage.given_options() if name in values}
    with usage.renamed(**_OURS), progress_bar("converting") as progress:
        made = shrm.convert(
            source, target, size=size, orientation=to_orientation, sampling=to_sampling,
            shader=shader, view=view, mips=mips, reading=reading, progress=progress, **own,
        )  # fmt: skip
        written = made.save(path, precision)
    code = written.result.get("shader")
    if code is not None and not usage.wants_json():
        echo(code.rstrip("\n"))
    conclude(written.result, written.lines, written.warnings, err=code is not None)


def _rules_of_source(is_map: bool) -> dict[str, usage.Applies]:
    """Return, for each option of reading, whether it applies to the file that is converted."""
    rules = options.reading_rules(not is_map, "to probes; IN is a map")
    return rules | dict.fromkeys((*options.TURNS, *options.COLORS), (True, "to probes and maps"))


def _rules(target: str) -> dict[str, usage.Applies]:
    """Return, for each option, whether it applies to the representation that is converted to."""
    known = descriptions(*([] if target in (*vocabulary.LAYOUTS, vocabulary.LAYERS) else [target]))
    of_brdf = [name for name, each in known.items() if each.needs_brdf]
    framed = owners(known, "frame")
    rules = {
        "frame": (target in framed, f"with --to {listing(framed, 'or')}"),
        **dict.fromkeys(
            ("order_p", "max_size"), (target in of_brdf, f"with --to {listing(of_brdf, 'or')}")
        ),
        "shader": (target not in vocabulary.LAYOUTS, "to all but images"),
        **dict.fromkeys(
            ("size", "to_orientation", "to_sampling"),
            (target != vocabulary.LAYERS, f"to all but --to {vocabulary.LAYERS}"),
        ),
    }
    for each in filter(_converts, all_options(known).values()):
        of = owners(known, each.name)
        rules.setdefault(each.name, (target in of, f"with --to {listing(of, 'or')}"))
    return rules


def _default_name(source: str, target: str) -> str:
    """Return the name of an output after that of its source, without what it was before."""
    is_form = target not in (*vocabulary.LAYOUTS, vocabulary.LAYERS)
    stem = usage.source_stem(
        source, {*vocabulary.REPRESENTATIONS, target} if is_form else vocabulary.IMAGE_LAYOUTS
    )
    return f"{stem}_%.exr" if target == "faces" else f"{stem}.{target}.exr"


def _plain_rules(target: str, is_map: bool, view: object, mips: bool) -> dict[str, usage.Applies]:
    """Return when the options of plain images apply, and when those of other conversions do not."""
    seen = view is not None
    with_view = (seen, "with --view")
    rules = {
        "view": (is_map and target == "latlong", "with --to latlong, to maps"),
        "mips": (
            is_map and target in vocabulary.MIP_LAYOUTS and not seen,
            "to split sums, with --to latlong or openexr",
        ),
        **dict.fromkeys(("by", "roughness", "f0"), with_view),
    }
    if seen or mips:
        rules["to_orientation"] = (False, "to cubes; OpenEXR's is written here")
    if mips and target == "openexr":
        rules["to_sampling"] = (False, "to lat-longs; cubes have texel centers here")
        rules["size"] = (False, "to lat-longs; the levels of a cube are copied")
    return rules


def _plain_name(source: str, target: str, view: tuple[float, float] | None, by: str | None) -> str:
    """Return the default name of a plain image, with the direction of its pixels, where given."""
    if view is None:
        return f"{map_stem(source)}.{target}.mips.exr"
    azimuth, elevation = view
    over = "" if by is None else f".{by}"
    return f"{map_stem(source)}.latlong.view{azimuth:g}_{elevation:g}{over}.exr"
