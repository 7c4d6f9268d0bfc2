"""`product`: the product texture of a BRDF without light, which may vary over the surface."""

from collections.abc import Callable, Sequence
from typing import cast

from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.options import Option
from shrm_cli.maps.product.prefilter import product_texture, varying_steps, varying_texture
from shrm_cli.maps.product.steps import MOST_STEPS, Steps
from shrm_cli.maps.request import Prefiltered
from shrm_cli.progress import Progress, Rising, using
from shrm_cli.vocabulary import (
    DEFAULT_PRODUCT_ORDER,
    DEFAULT_PRODUCT_SIZE,
    MAX_PRODUCT_ORDER,
    MAX_PRODUCT_SIZE,
)

Varied = tuple[str, float, float]
"""A parameter and its range."""
_ORDER = Option("order", "", "integer", limits=(0, MAX_PRODUCT_ORDER))
_SIZE = Option("size", "", "integer", limits=(2, MAX_PRODUCT_SIZE))
_STEPS = Option("steps", "", "integer", limits=(2, MOST_STEPS))


def product(
    brdf: AnyBrdf,
    order: int = DEFAULT_PRODUCT_ORDER,
    size: int = DEFAULT_PRODUCT_SIZE,
    vary: Varied | Sequence[Varied] | None = None,
    steps: int | None = None,
    *,
    progress: Progress | None = None,
) -> Map:
    """Make the product texture of a BRDF, whose light is chosen when it is used.

    Parameters
    ----------
    brdf : Brdf, str or path-like
    order : int
        The largest degree of the light's harmonics.
    size : int
        Texels along the edge of the parabolic map of views.
    vary : tuple of str and 2 float, or two of them, optional
        A parameter that varies over the surface, with its range: a texture for each of its values.
        Of two parameters there are fewer textures, of which all others are sums.
    steps : int, optional
        How many values of each; by default as many as miss 1 % between them.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Map
        `Map.lit` gives it light.

    Raises
    ------
    BrdfError, MapError, ArgumentError
        If the BRDF cannot be used, or the textures would be too large.

    Examples
    --------
    >>> texture = shrm.product("ward:ax=0.5,ay=0.15", order=2, size=16)
    >>> light = shrm.Probe.from_array(np.ones((16, 32, 3), np.float32), layout="latlong")
    >>> texture.lit(shrm.project(light, 2).coefficients).radiance([0, 1, 0], [0, 1, 0]).shape
    (3,)
    """
    return product_with_facts(brdf, order, size, vary, steps, progress=progress).map


def product_with_facts(
    brdf: AnyBrdf,
    order: int,
    size: int,
    vary: Varied | Sequence[Varied] | None,
    steps: int | None,
    *,
    begin: Callable[[Steps | None], object] = lambda steps: None,
    progress: Progress | None = None,
) -> Prefiltered:
    """Make a product texture, and keep what is known of how it was made, for reports.

    Parameters are those of `product`; `begin` is called with the values of parameters that vary,
    before the work begins.
    """
    order, size = _ORDER.checked(order), _SIZE.checked(size)
    steps = None if steps is None else _STEPS.checked(steps)
    material = as_brdf(brdf)
    if vary is None:
        begin(None)
        with using(progress):
            return product_texture(material, order, size)
    ranges = _ranges(vary)
    with using(work := Rising(progress)):  # nobody knows how many values there will be
        found, points = varying_steps(material, ranges, order, steps)
        begin(found)
        made = varying_texture(material, found, points, order, size)
    work.end()
    return made


def _ranges(vary: Varied | Sequence[Varied]) -> dict[str, tuple[float, float]]:
    """Return the ranges of parameters by their names."""
    try:
        if not len(vary):
            raise ArgumentError("vary", "names no parameter; leave it out")
        several = cast(Sequence[Varied], [vary] if isinstance(vary[0], str) else vary)
        found = {name: (float(low), float(high)) for name, low, high in several}
    except (TypeError, ValueError, LookupError):
        raise ArgumentError(
            "vary", f"is {vary!r:.80}; give names with their ranges, such as ('ax', 0.1, 0.5)"
        ) from None
    return found
