"""The makers of single forms, with the arguments of `shrm_cli.prefilter.prefilter`, and of what the
table beside a split sum holds.
"""

from dataclasses import replace

from shrm_cli.brdf.environment.environment_brdf import lobe_moments
from shrm_cli.maps import registry
from shrm_cli.maps.request import Request
from shrm_cli.progress import using


def maker(to, *names):
    """A function of a probe and of arguments, of which the first have these names."""

    def make(probe, *values, progress=None, error=None, **given):
        request = Request.of(to, dict(zip(names, values, strict=False)) | given, probe)
        request = replace(request, error=error)  # of a split sum: that of each level
        with using(progress):
            return registry.module(to, "prefilter").prefilter(probe, request)

    return make


prefilter_irradiance = maker("irradiance", "order_f", "window")
prefilter_split_sum = maker("splitsum", "levels", "mapping")
prefilter_exponential = maker("she", "p_order", "q_order", "roughness", "law")
prefilter_product = maker("product", "brdf", "order", "texels", "window")


def environment_brdf(roughness, cosines):
    """Scale and bias of GGX's directional albedo, ``f0 * scale + bias``, from its moments."""
    total, bias = lobe_moments(roughness, cosines)[:, 0]
    return total - bias, bias
