"""--roughness and --f0: the surface that split sums and SH exponentials are shown as."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.types import Within

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shrm_cli.brdf.models.ggx import Ggx
    from shrm_cli.render.shading import KnownMap

ROUGHNESS = 0.5
"""What is shown if none is said: every kind of map is made for it by default."""


class Reflectance(click.ParamType):  # type: ignore[type-arg]
    """A reflectance as specifications of BRDFs have it: ``0.04``, ``1/0.78/0.34`` or ``gold``."""

    name = "F0"

    def convert(
        self,
        value: str | tuple[float, float, float],
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> tuple[float, float, float]:
        """Linear RGB, each within 0 .. 1."""
        if isinstance(value, tuple):
            return value
        from shrm_cli.brdf.spec import parse_spec
        from shrm_cli.errors import BrdfError

        if not value.strip() or set(value) & set(",:+*="):
            self.fail(f"{value!r} is not a colour such as 0.04, 1/0.78/0.34 or gold", param, ctx)
        try:
            return parse_spec(f"ggx:f0={value}").color("f0")
        except BrdfError as error:
            self.fail(str(error).removeprefix("ggx: "), param, ctx)


roughness_option = click.option(
    "--roughness", type=Within(0.05, 1), metavar="R",
    help="Perceptual roughness of the GGX surface that split sums and SH exponentials are shown "
    f"as.  [default: {ROUGHNESS:g}]",
)  # fmt: skip
f0_option = click.option(
    "--f0", type=Reflectance(),
    help="Its reflectance at normal incidence: a number, R/G/B or a metal's name.  [default: 1]",
)  # fmt: skip


def shaded_maps(
    maps: Sequence[Any],
    names: Sequence[str],
    roughness: float | None,
    f0: tuple[float, float, float] | None,
) -> tuple[list[KnownMap], Ggx | None, list[str]]:
    """Maps as what reflects, the surface that some of them are shown as, and warnings.

    Raises
    ------
    click.UsageError
        If a surface is asked for, and no map needs one.
    """
    from shrm_cli.render.shading import ggx_surface, needs_surface, outside_range, shade

    if not any(map(needs_surface, maps)):
        for option, value in (("--roughness", roughness), ("--f0", f0)):
            if value is not None:
                raise click.UsageError(
                    f"{option} is for split sums and SH exponentials, and no MAP is one",
                    click.get_current_context(),
                )
        return list(maps), None, []
    surface = ggx_surface(ROUGHNESS if roughness is None else roughness, f0)
    warnings = outside_range(dict(zip(names, maps, strict=True)), surface.number("roughness"))
    return [shade(each, surface) for each in maps], surface, warnings


def surface_values(surface: Ggx | None) -> dict[str, Any]:
    """Roughness and reflectance as results have them; nothing where no map is shown so."""
    if surface is None:
        return {}
    return {"roughness": surface.number("roughness"), "f0": list(surface.color("f0"))}
