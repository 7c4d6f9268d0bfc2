"""`shrm prefilter` makes a map from a probe and a BRDF."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli import vocabulary
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, echo, has_terminal, progress_bar
from shrm_cli.cli.types import BOX, PATH, VECTOR, Named, option
from shrm_cli.maps import registry
from shrm_cli.maps.options import all_options, listing, own_options
from shrm_cli.naming import brdf_label, probe_stem
from shrm_cli.progress import using

if TYPE_CHECKING:
    from shrm_cli.files.parts import Storage
    from shrm_cli.maps.request import Prefiltered, Request

_OWN_BRDFS = listing(
    [each.name for each in registry.descriptions().values() if each.why_no_brdf], "and"
)

_PRINTED_WITH = {"textures": "shader", "anisotropy": "shader", "taps": "shader"}
"""Which option each option of more output needs."""
_PRINTS = [name for name, each in all_options(registry.descriptions()).items() if each.prints]
_OWN_OPTIONS = {
    f"Options of --to {listing(names, 'and')}": [option.name for option in own]
    for names, own in own_options(registry.descriptions())
}
MAKING_HEADINGS = {
    "What to make": ["brdf", "to"],
    "How exact": ["eps", "error", "seen", "order_f", "order_p", "max_size", "center", "sun"],
    "Form of the map": [
        "size", "frame", "map_sampling", "domain", "source_height", "precision",
    ],
    **_OWN_OPTIONS,
}  # fmt: skip
"""The options about what is made, under the headings of the help."""
_HEADINGS = {
    **MAKING_HEADINGS,
    "How the probe is read": [*options.READING_NAMES, "probe_sampling", "box", "at"],
    "Output": ["output", "force", "as_json", "quiet"],
}
"""The options under the headings of the help."""


@click.command(cls=options.command_with_headings(_HEADINGS))
@click.argument("probe", metavar="PROBE", type=PATH)
@options.optional_brdf_option
@option(
    "--to", Named([vocabulary.AUTO, *vocabulary.REPRESENTATIONS], registry.installed_names),
    default=vocabulary.AUTO,
    help="Representation to write; auto is the one of the fewest bytes whose picture is right, and "
    f"an SHRM with --eps or orders. {_OWN_BRDFS} have their BRDF.",
)  # fmt: skip
@options.making_options("probe", "cube")
@option("-o --output", PATH, "File to write.  [default: PROBE.BRDF.TO.exr in the current folder]")
@usage.force_option
@option(
    "--box", BOX,
    help="Two corners of the box that stands for the room around the probe, which look-ups with "
    "parallax need.  [default: what the probe says]",
)  # fmt: skip
@option(
    "--at", VECTOR,
    help="Where the probe was captured in that box.  [default: what the probe says, or the middle]",
)  # fmt: skip
@options.read_options
@options.report_options
def prefilter(
    probe: str,
    brdf: str | None,
    to: str,
    precision: vocabulary.Precision,
    output: str | None,
    force: bool,
    sampling: str | None,
    probe_sampling: str | None,
    map_sampling: str | None,
    **values: Any,
) -> None:
    """Prefilter the light probe PROBE for a BRDF.

    What is made by default is the map of the fewest bytes whose picture is right: at most 5 % of
    the pixels are predicted to be wrong by more than 5 %, with an RMS error of 5 % of the light.
    A line says which form that is and why.

    With --eps it is an SHRM: the orders F and P are the least that keep the BRDF's energy within
    it; the error that they make in the reflected light is predicted and printed, and a warning says
    which part of the picture is wrong where that is too much. In the angular domain --eps is the
    part of the BRDF's lobe that may be left out.

    What engines use needs no --brdf: irradiance is of a white Lambertian surface, a split sum
    (splitsum) and an SH exponential (she) are of GGX. A split sum takes another --brdf that has a
    roughness, such as charlie or ward, and has a level for each roughness of it.

    \b
      shrm prefilter probe.exr --brdf ggx:roughness=0.4,f0=gold
      shrm prefilter probe.exr --brdf "0.9*lambertian+0.1*phong" --eps 0.01
      shrm prefilter probe.exr --brdf paint.binary --error 0.05 --to principal
      shrm prefilter probe.exr --to irradiance --shader glsl
      shrm prefilter probe.exr --to splitsum --brdf charlie:color=0.6/0.2/0.1
      shrm prefilter sky_%.png --linearize --to splitsum -o sky.levels.exr
    """
    from shrm_cli.maps.request import check_arguments, resolved_form
    from shrm_cli.maps.stored import store
    from shrm_cli.prefilter import make

    read_as = options.make_read_options(values, probe_sampling or sampling)
    prints = {name: values.pop(name) for name in _PRINTS}
    place = {name: values.pop(name) for name in ("box", "at")}
    to = resolved_form(to, values)
    usage.refuse_inapplicable(_rules_of_printing(to))
    given = {"brdf": brdf, **values}
    if map_sampling or (sampling and "sampling" in registry.description(to).arguments):
        given["sampling"] = map_sampling or sampling
    with usage.renamed(**({"sampling": "map_sampling"} if map_sampling else {})):
        check_arguments(to, [name for name, value in given.items() if value is not None])
    source = shrm.open_probe(probe, read_as).within(**place)
    # What `auto` makes is known when it is made; any of its forms is then kept or replaced.
    forms = vocabulary.AUTO_FORMS if to == vocabulary.AUTO else [to]
    names = [_default_name(probe, brdf, each) for each in forms]
    usage.check_outputs([output] if output else names, specs=[brdf], suffixes=vocabulary.CONTAINERS)
    is_told = usage.wants_json() or not usage.is_quiet()
    with progress_bar("prefiltering") as progress:
        request = _request(to, given, source, prints)
        for name in [] if output or force else names:
            usage.keep_other_map(name, source, request, precision)
        made = make(source, request, progress)
        target = output or _default_name(probe, brdf, made.map.representation)
        printed = _printed(made.map, prints)
        stored = store(target, made.map, precision)
        # What nobody is told need not be found out.
        summary = made.summary() if is_told else made.quick_summary()
    result = {"file": os.fspath(target), **summary, "storage_error": stored.error}
    result |= {"bytes": os.path.getsize(target), "precision": stored.pixel_type}
    warnings = source.warnings()
    if stored.pixel_type == "float" and (precision, made.map.natural_precision) == ("auto", "auto"):
        warnings.append(f"{target}: written as 32-bit float, for {_why_float(stored)}")
    # Whoever says what share may be wrong is told by the search where it is not kept.
    is_chosen = to == vocabulary.AUTO and request.error is None
    is_judged = is_chosen or request.seen is not None
    share = None if is_judged else summary.get("predicted_wrong_share")
    remarks = made.warnings if share is None else _remarks(made, share, request, source)
    warnings += [f"{target}: {line}" for line in remarks]
    for text in [] if usage.wants_json() else printed.values():
        echo(text.rstrip("\n"))
    lines = _report(made, result) if is_told else []
    conclude({**result, **printed}, lines, warnings, err=bool(printed))


def _request(
    to: str, given: Mapping[str, Any], probe: shrm.Probe, prints: Mapping[str, Any]
) -> Request:
    """Return what is asked for, unless it is code that cannot be written, for maps take a while."""
    from shrm_cli.maps.request import Request

    request = Request.of(to, given, probe)
    if prints["taps"] is not None:
        from shrm_cli.maps.kinds import check_tap_count

        check_tap_count(int(prints["taps"]), bool(prints["anisotropy"]))
    for name in ("taps", "anisotropy"):  # of split sums alone
        if prints[name] is not None and request.brdf is not None:
            from shrm_cli.maps.splitsum.prefilter import split_material

            if split_material(request.brdf) is not None:
                raise usage.wrong_usage(
                    f"--{name} applies to split sums of GGX alone; leave it out"
                )
    if prints["textures"] is not None:
        from shrm_cli.maps.shader.code import check_textures

        check_textures(prints["shader"], prints["textures"])
    if prints["shader"] is not None and request.splits:
        from shrm_cli.maps.lamps.lobe import check_has_code

        check_has_code(request.brdf)
    return request


def _printed(made: shrm.Map, prints: Mapping[str, Any]) -> dict[str, str]:
    """Return what is printed of a map besides its numbers, by the names used in JSON."""
    if prints["shader"] is None:
        return {}
    from shrm_cli.maps.shader.code import written_code

    taps = None if prints["taps"] is None else int(prints["taps"])
    brushed, even = (
        (taps or vocabulary.DEFAULT_TAPS, None) if prints["anisotropy"] else (None, taps)
    )
    return {"shader": written_code(made, prints["shader"], prints["textures"], brushed, even).text}


def _remarks(
    made: Prefiltered, share: float, request: Request, source: shrm.Probe
) -> Sequence[str]:
    """Return warnings about a map whose form or error was named, and what its picture is like."""
    from shrm_cli.maps.request import is_wrong_unsaid, with_wrong_share
    from shrm_cli.maps.size import total_error

    error = total_error(made.map.stated_error)
    if not is_wrong_unsaid(made.warnings, share, error, request.error):
        return made.warnings
    instead = _made_by_default(request, source) if has_terminal() else None
    return with_wrong_share(made.warnings, share, error, instead)


def _made_by_default(request: Request, source: shrm.Probe) -> str:
    """Say what --to auto would have made, which takes about as long as to make it.

    Only who waits at a terminal is told, as logs of farms would pay for what nobody reads.
    """
    from shrm_cli.automatic import automatic_choice
    from shrm_cli.maps.request import Request

    known = registry.description(vocabulary.AUTO).arguments - {"error"}
    asked = {name: value for name, value in request.given.items() if name in known}
    asked["brdf"] = request.brdf
    with progress_bar("looking at other forms") as progress, using(progress):
        return automatic_choice(source, Request.of(vocabulary.AUTO, asked, source))


def _why_float(stored: Storage) -> str:
    """Return what half could not keep."""
    if math.isfinite(stored.half_error):
        return f"light so dim that half would add an RMS error of {stored.half_error:.2%}"
    return "values beyond half's range"


def _rules_of_printing(to: str) -> dict[str, usage.Applies]:
    """Return when the options apply that only ask for more output."""
    known = registry.descriptions(*([] if to == vocabulary.AUTO else [to]))
    rules = {}
    for name in _PRINTS:
        of = [each.name for each in known.values() if name in (own.name for own in each.options)]
        holds = name in (own.name for own in registry.description(to).options)
        rules[name] = (holds, f"with --to {listing(of, 'or')}")
    for name, other in _PRINTED_WITH.items():
        if rules[name][0]:
            rules[name] = (other in usage.given_options(), f"with --{other}")
    return rules


def _default_name(probe: str, brdf: str | None, to: str) -> str:
    labels = [probe_stem(probe), *([] if brdf is None else [brdf_label(brdf)]), to]
    return f"{'.'.join(labels)}.exr"


def _report(made: Prefiltered, result: dict[str, Any]) -> list[str]:
    """Return lines about the map, which its representation words, and how it was made."""
    what, *lines = registry.module(made.map.representation, "prefilter").report(result)
    stored = [result["precision"], f"{result['bytes']:,} bytes"]
    if result["storage_error"] >= 5e-4:
        lines.append(f"and            {result['storage_error']:.2%} from half precision")
    lines += [f"{heading:<15}{usage.flags(text)}" for heading, text in made.notes]
    return [f"{result['file']}: {what}, {', '.join(stored)}", *(f"  {line}" for line in lines)]
