"""Explicit maps as source code: the images of the samples around a view, and their weights."""

from functools import partial
from math import isqrt

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.maps.explicit.views import TRIANGLES, VERTICES
from shrm_cli.maps.shader.source import (
    Source,
    Words,
    central_direction,
    tangent_function,
    view_angle,
)


def source(made: ExplicitMap, textures: str) -> Source:
    """Return what the shader of an explicit map consists of; the cubes of all views are a stack."""
    if made.representation not in _BLENDS:
        raise MapError(f"{made.what} has no shader; look it up by shrm render")
    return Source(
        "The light of a probe as a BRDF reflects it, tabulated for some views.",
        partial(_functions, made),
        [np.moveaxis(made.images, 0, 2)],
        made.sampling,
    )


def _functions(made: ExplicitMap, words: Words) -> list[str]:
    """Write the blending of images, whose sum is the radiance."""
    speech = words.language
    return [
        *tangent_function([made.center]),
        *(_cabral_tables(words) if made.representation == "cabral" else []),
        "vec3 shrm_radiance(vec3 n, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(made.center, speech)};",
        f"    vec3 place = {words.place(0, 'c')};",
        *_BLENDS[made.representation](made, words),
        "}",
    ]


def _kautz_mccool(made: ExplicitMap, words: Words) -> list[str]:
    """Write the mixture of the slices on both sides of the angle between the view and c."""
    last = made.count - 1
    if not last:
        return [f"    return {words.cube(0, 'place', '0')};"]
    speech = words.language
    step = speech.number(last / np.pi)
    low, high = (words.cube(0, "place", each) for each in ("first", "first + 1"))
    return [
        f"    float position = min({view_angle(speech)} * {step}, {last}.0);",
        f"    int first = int(min(position, {last - 1}.0));",
        f"    return mix({low}, {high}, position - float(first));",
    ]


def _light_field(made: ExplicitMap, words: Words) -> list[str]:
    """Write the bilinear mixture of four views; beyond a pole the grid goes on half a turn away."""
    side, speech = isqrt(made.count), words.language
    step = speech.number(side / np.pi)
    half = speech.number(side / (2 * np.pi))
    low, high = (
        words.cube(0, "place", f"at * {side} + (column{each}) % {side}") for each in ("", " + 1")
    )
    mixed = f"mix({low}, {high}, along - float(column))"
    share = "(k == 0 ? 1.0 - (down - float(row)) : down - float(row))"
    return [
        f"    float down = atan(sqrt(v.x * v.x + v.y * v.y), v.z) * {step} + 0.5, along;",
        "    int row = int(down), k, at, column;",
        "    vec3 sum = vec3(0.0, 0.0, 0.0);",
        "    for (k = 0; k < 2; ++k) {",
        "        at = row - 1 + k;",
        # The azimuth grows by a whole turn and a half at most, so that numbers stay positive.
        f"        along = atan(v.y, v.x) * {half} + {speech.number(1.5 * side - 0.5)};",
        f"        if (at < 0 || at >= {side}) {{",
        f"            at = at < 0 ? 0 : {side - 1};",
        f"            along = along + {speech.number(0.5 * side)};",
        "        }",
        "        column = int(along);",
        "        " + speech.grow("sum", speech.scale(share, mixed)),
        "    }",
        "    return sum;",
    ]


def _cabral_tables(words: Words) -> list[str]:
    """Write the vertices of the icosahedron, its triangles, and the solid angle of a triangle."""
    speech = words.language
    cross = (
        "a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) "
        "+ a.z * (b.x * c.y - b.y * c.x)"
    )
    return [
        *speech.colors("shrm_vertices", VERTICES),
        *speech.colors("shrm_triangles", TRIANGLES.astype(float)),
        "float shrm_volume(vec3 a, vec3 b, vec3 c)",
        "{",
        f"    return {cross};",
        "}",
        "float shrm_solid_angle(vec3 a, vec3 b, vec3 c)",
        "{",
        "    float sides = 1.0 + dot(a, b) + dot(b, c) + dot(c, a);",
        "    return max(2.0 * atan(shrm_volume(a, b, c), sides), 0.0);",
        "}",
    ]


def _cabral(made: ExplicitMap, words: Words) -> list[str]:
    """Write the mixture of the corners of the triangle that holds the view.

    That triangle's least barycentric coordinate is the largest of all. The coordinates are volumes
    here, which differ from them by the same factor in every triangle.
    """
    speech = words.language
    cubes = [words.cube(0, "place", f"int(at.{each})") for each in "xyz"]
    factors = [f"({each} / (wa + wb + wc))" for each in ("wa", "wb", "wc")]
    return [
        "    vec3 at = shrm_triangles[0], a, b, d;",
        "    float most = -2.0, least, wa, wb, wc;",
        "    int k;",
        f"    for (k = 0; k < {len(TRIANGLES)}; ++k) {{",
        *(
            f"        {name} = shrm_vertices[int(shrm_triangles[k].{each})];"
            for name, each in zip("abd", "xyz", strict=True)
        ),
        "        least = min(min(shrm_volume(v, b, d), shrm_volume(a, v, d)), "
        "shrm_volume(a, b, v));",
        "        if (least > most) {",
        "            most = least;",
        "            at = shrm_triangles[k];",
        "        }",
        "    }",
        *(
            f"    {name} = shrm_vertices[int(at.{each})];"
            for name, each in zip("abd", "xyz", strict=True)
        ),
        "    wa = shrm_solid_angle(v, b, d);",
        "    wb = shrm_solid_angle(a, v, d);",
        "    wc = shrm_solid_angle(a, b, v);",
        f"    return {speech.combined(factors, cubes)};",
    ]


_BLENDS = {"cabral": _cabral, "kautz-mccool": _kautz_mccool, "lightfield": _light_field}
