"""`product`: the product texture of a BRDF without light, which may vary over the surface."""

from collections.abc import Callable

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.base import Map
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.product.prefilter import product_texture, varying_texture, varying_values
from shrm_cli.progress import Progress, using
from shrm_cli.vocabulary import DEFAULT_PRODUCT_ORDER, DEFAULT_PRODUCT_SIZE


def product(
    brdf: Brdf | str,
    order: int = DEFAULT_PRODUCT_ORDER,
    size: int = DEFAULT_PRODUCT_SIZE,
    vary: tuple[str, float, float] | None = None,
    steps: int | None = None,
    *,
    progress: Progress | None = None,
) -> Map:
    """Make the product texture of a BRDF, whose light is chosen when it is used.

    Parameters
    ----------
    brdf : Brdf or str
    order : int
        The largest degree of the light's harmonics.
    size : int
        Texels along the edge of the parabolic map of views.
    vary : tuple of str and 2 float, optional
        A parameter that varies over the surface, with its range: a texture for each of its values.
    steps : int, optional
        How many values; by default as many as miss 1 % between them.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    Map
        `Map.lit` gives it light.

    Raises
    ------
    BrdfError, MapError
        If the BRDF cannot be used, or the textures would be too large.

    Examples
    --------
    >>> texture = shrm.product("ward:ax=0.5,ay=0.15", order=2, size=16)
    >>> light = shrm.Probe.from_array(np.ones((16, 32, 3), np.float32), layout="latlong")
    >>> texture.lit(shrm.project(light, 2).coefficients).radiance([0, 1, 0], [0, 1, 0]).shape
    (3,)
    """
    return product_with_facts(brdf, order, size, vary, steps, progress=progress)[0].map


def product_with_facts(
    brdf: Brdf | str,
    order: int,
    size: int,
    vary: tuple[str, float, float] | None,
    steps: int | None,
    *,
    begin: Callable[[tuple[str, list[float]] | None], object] = lambda varying: None,
    progress: Progress | None = None,
) -> tuple[Prefiltered, float]:
    """Make a product texture, and keep what is known of how it was made, for reports.

    Parameters are those of `product`; `begin` is called with the values of the parameter that
    varies, before the work begins. The second result is what is missed between two values.
    """
    material = parse_spec(brdf) if isinstance(brdf, str) else brdf
    varying, step_error = None, 0.0
    if vary is not None:
        values, step_error = varying_values(material, *vary, order, steps)
        varying = vary[0], values
    begin(varying)
    with using(progress):
        if varying is None:
            return product_texture(material, order, size), 0.0
        return varying_texture(material, *varying, order, size, step_error), step_error
