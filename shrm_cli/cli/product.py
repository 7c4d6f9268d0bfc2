"""`shrm product` makes a BRDF's product texture, for light that is chosen later."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.completion import Spec
from shrm_cli.cli.kept import force_option
from shrm_cli.cli.options import conclude, precision_option, progress_bar, report_options
from shrm_cli.cli.outputs import brdf_label, check_outputs
from shrm_cli.vocabulary import (
    CONTAINERS,
    DEFAULT_PRODUCT_ORDER,
    DEFAULT_PRODUCT_SIZE,
    MAX_PRODUCT_ORDER,
    MAX_PRODUCT_SIZE,
    Precision,
)

if TYPE_CHECKING:
    from shrm_cli.brdf.base import Brdf


@click.command()
@click.argument("spec", metavar="BRDF", type=Spec())
@click.option(
    "--order", type=click.IntRange(0, MAX_PRODUCT_ORDER), default=DEFAULT_PRODUCT_ORDER,
    show_default=True, help="Largest degree of the light's harmonics.",
)  # fmt: skip
@click.option(
    "--size", type=click.IntRange(8, MAX_PRODUCT_SIZE), default=DEFAULT_PRODUCT_SIZE,
    show_default=True, help="Texels along the edge of the parabolic map of views.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(),
    help="OpenEXR file to write.  [default: BRDF.product.exr in the current folder]",
)  # fmt: skip
@force_option
@precision_option
@report_options
def product(
    spec: str,
    order: int,
    size: int,
    output: str | None,
    force: bool,
    precision: Precision,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make the product texture of a BRDF: its harmonics over the light, for every view.

    Any BRDF will do, brushed and measured ones too. The file holds no light: `shrm render` and
    `shrm compare` take it with --probe, and a shader multiplies it with the light's coefficients,
    turned into the frame of the surface. `shrm prefilter --to product` makes the same texture
    with the light of a probe in it.

    \b
      shrm product ward:ax=0.5,ay=0.15 -o brushed.exr
      shrm render brushed.exr --probe probe.exr --view 30,20
    """
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.maps.file import store
    from shrm_cli.maps.product.prefilter import product_texture
    from shrm_cli.maps.product.report import report

    brdf = parse_spec(spec)
    target = output or f"{brdf_label(spec)}.product.exr"
    check_outputs([target], specs=[spec], suffixes=CONTAINERS)
    if not (output or force):
        _keep_other_texture(target, brdf, order, size)
    with progress_bar("integrating", quiet) as progress:
        made = product_texture(brdf, order, size, progress)
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
    conclude(result, [title, *(f"  {line}" for line in lines)], [], as_json, quiet)


def _keep_other_texture(target: str, brdf: Brdf, order: int, size: int) -> None:
    """Refuse to replace a file that is not the texture of this BRDF, order and size."""
    from shrm_cli.errors import MapError
    from shrm_cli.files.inputs import protecting
    from shrm_cli.files.whole import kept
    from shrm_cli.maps.file import open_map
    from shrm_cli.maps.product.product import ProductTexture
    from shrm_cli.maps.provenance import record_of, same_brdf

    if not os.path.lexists(target):
        return
    found = None
    with suppress(MapError), protecting():  # what is only looked at is no input
        found = open_map(target)
    if not isinstance(found, ProductTexture) or found.lighting is not None:
        raise kept(target, "it is no product texture without light that can be read")
    if not same_brdf(found.info.brdf, record_of(brdf)):
        raise kept(target, "it is for another BRDF")
    if (found.order, found.size) != (order, size):
        raise kept(target, f"it has order {found.order} and {found.size} texels")
