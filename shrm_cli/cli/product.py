"""`shrm product` makes a BRDF's product texture, for light that is chosen later."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli import vocabulary
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import Spec, option, way, whole
from shrm_cli.naming import brdf_label

if TYPE_CHECKING:
    from shrm_cli.maps.product.steps import Steps


@click.command()
@click.argument("spec", metavar="BRDF", type=Spec())
@option(
    "--order", whole(0, vocabulary.MAX_PRODUCT_ORDER),
    default=vocabulary.DEFAULT_PRODUCT_ORDER, help="Largest degree of the light's harmonics.",
)  # fmt: skip
@option(
    "--size", whole(8, vocabulary.MAX_PRODUCT_SIZE),
    default=vocabulary.DEFAULT_PRODUCT_SIZE,
    help="Texels along the edge of the parabolic map of views.",
)  # fmt: skip
@option(
    "--vary NAME=LOW..HIGH", str, multiple=True,
    help="A parameter of the BRDF that varies over the surface: a texture for each of --steps "
    "values. Two may vary, by few textures of which all others are sums.",
)  # fmt: skip
@option(
    "--steps N", whole(2, 64),
    help="Values of each --vary, closest where the BRDF changes most.  [default: as many as miss "
    "1% between them]",
)  # fmt: skip
@options.written_to("OpenEXR file to write.  [default: BRDF.product.exr in the current folder]")
@usage.force_option
@options.precision_option
@options.report_options
def product(
    spec: str,
    order: int,
    size: int,
    vary: tuple[str, ...],
    steps: int | None,
    output: str | None,
    force: bool,
    precision: vocabulary.Precision,
) -> None:
    """Make the product texture of a BRDF: its harmonics over the light, for every view.

    Any BRDF will do, brushed and measured ones too. The file holds no light: `shrm render` and
    `shrm compare` take it with --probe, and a shader multiplies it with the light's coefficients,
    turned into the frame of the surface. `shrm prefilter --to product` makes the same texture
    with the light of a probe in it.

    \b
      shrm product ward:ax=0.5,ay=0.15 -o brushed.exr
      shrm render brushed.exr --probe probe.exr --view 30,20
      shrm product ward:ax=0.5 --vary ay=0.1..0.5 -o worn.exr
      shrm product ward --vary ax=0.1..0.5 --vary ay=0.1..0.5 -o worn.exr
    """
    from shrm_cli.maps.product.make import product_with_facts
    from shrm_cli.maps.product.prefilter import report
    from shrm_cli.maps.product.steps import ENOUGH
    from shrm_cli.maps.stored import store

    brdf = shrm.parse_spec(spec)
    usage.refuse_inapplicable({"steps": (bool(vary), "with --vary")})
    ranges = _ranges(vary) or None
    label = brdf_label(",".join([spec, *vary]))
    target = output or f"{label}.product.exr"
    usage.check_outputs([target], specs=[spec], suffixes=vocabulary.CONTAINERS)

    def begin(chosen: Steps | None) -> None:
        if not (output or force):
            _keep_other_texture(target, brdf, order, size, chosen)

    with progress_bar("integrating") as progress:
        made = product_with_facts(brdf, order, size, ranges, steps, begin=begin, progress=progress)
    stored = store(target, made.map, precision)
    result: dict[str, Any] = {
        "file": os.fspath(target),
        **made.summary(),
        "storage_error": stored.error,
        "bytes": os.path.getsize(target),
        "precision": stored.pixel_type,
    }
    what, *lines = report(result)
    title = f"{target}: {what}, {stored.pixel_type}, {result['bytes']:,} bytes"
    warnings = []
    missed = result.get("step_error", 0.0)
    if missed > ENOUGH:
        warnings.append(
            f"{target}: between two of {steps} values {missed:.1%} is missed; leave `steps` out, "
            "or give more"
        )
    conclude(result, [title, *(f"  {line}" for line in lines)], warnings)


def _ranges(texts: tuple[str, ...]) -> list[tuple[str, float, float]]:
    """Return the names and the ends of the ranges that --vary means."""
    found: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, *ends = way(text) or ("", 0.0, 0.0)
        if not ends[0] < ends[1]:
            raise usage.wrong_usage(f"--vary {text!r} is not NAME=LOW..HIGH, such as ay=0.1..0.5")
        if name in found:
            raise usage.wrong_usage(f"--vary is given twice for {name}; give one of them")
        found[name] = ends[0], ends[1]
    if len(found) > vocabulary.MAX_PRODUCT_PARAMETERS:
        raise usage.wrong_usage(
            f"--vary is given for {len(found)} parameters, and "
            f"{vocabulary.MAX_PRODUCT_PARAMETERS} can vary; leave some out"
        )
    return [(name, *ends) for name, ends in found.items()]


def _keep_other_texture(
    target: str, brdf: shrm.Brdf, order: int, size: int, chosen: Steps | None
) -> None:
    """Refuse to replace a file that is not the texture of this BRDF, order, size and variation."""
    from shrm_cli.files.whole import exists_error
    from shrm_cli.maps.info import record_of, same_brdf
    from shrm_cli.maps.product.product import ProductMap, VaryingProduct

    if not os.path.lexists(target):
        return
    if usage.keep_edited(target):
        return
    found = usage.readable_map(target)
    if not isinstance(found, ProductMap):
        raise exists_error(target, "it is no product texture without light that can be read")
    if (found.order, found.size) != (order, size):
        raise exists_error(target, f"it has order {found.order} and {found.size} texels")
    there = found.steps.values if isinstance(found, VaryingProduct) else None
    if there != (chosen and chosen.values):
        raise exists_error(target, "another parameter varies in it, or over another range")
    if chosen is None and not same_brdf(found.info.brdf, record_of(brdf)):
        raise exists_error(target, "it is for another BRDF")
