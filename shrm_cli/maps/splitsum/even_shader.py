"""Even GGX under a split sum as source code: what `TappedSplitSum` computes, step by step.

The taps need nothing but ``shrm_light(d, roughness)``, so that engines with levels of their own can
use them; `even_taps_code` writes them alone.
"""

from shrm_cli.brdf.environment.taps import LEAST_FITTED, even_polynomials
from shrm_cli.maps.shader.language import Language, filled
from shrm_cli.vocabulary import MIN_ROUGHNESS

_HEAD = """\
float shrm_lean(vec3 q, vec3 a, vec3 b)
{
    return a.x + a.y * q.x + a.z * q.y + q.x * (b.x * q.x + b.y * q.y) + b.z * q.z;
}
/* The light alone, where the lobe of a surface that is not brushed lies. */
vec3 shrm_even_taps(vec3 n, vec3 v, float roughness)
{
    float z = max(dot(n, v), 1e-5);
    float across = 1.0 - z * z;
    float square = roughness * roughness * roughness * roughness;
    float slope = square / sqrt(square * across + z * z);
    vec3 q = vec3(max(roughness, LEAST_P), z, z * z);
    vec3 beside = BESIDE;
    vec3 sum = vec3(0.0, 0.0, 0.0);
    float total = 0.0;
    vec3 h;
    vec3 l;
    float lean;
    float facing;
    float part;"""
_TAP = """\
    lean = slope * TILT;
    h = HALF;
    facing = z + lean * across;
    part = PART * max(facing, 0.0);
    facing = 2.0 * facing / (1.0 + lean * lean * across);
    l = LIGHT;
    total += part;
    GROW"""
_TAIL = """\
    return SUM;
}"""
_SURFACE = """\
vec3 shrm_even(vec3 n, vec3 v, float roughness, vec3 f0)
{
    float rough = max(roughness, LEAST);
    vec3 dfg = shrm_between(dot(n, v), rough, 0);
    return PRODUCT;
}"""


def even_functions(count: int, language: Language) -> list[str]:
    """Write ``shrm_even(n, v, roughness, f0)``, and what it uses."""
    albedo = language.add(language.scale("dfg.x", "f0"), "vec3(dfg.y, dfg.y, dfg.y)")
    words = {
        "LEAST": language.number(MIN_ROUGHNESS),
        "PRODUCT": language.times("shrm_even_taps(n, v, rough)", albedo),
    }
    return [*_taps(count, language), *filled(_SURFACE, words)]


def even_taps_code(count: int, language: str) -> str:
    """Write ``shrm_even_taps(n, v, roughness)`` for an engine with a ``shrm_light`` of its own.

    `count` is one of `vocabulary.EVEN_TAP_COUNTS`. In the `language` C the code begins with the
    vectors that it needs.
    """
    speech = Language(language)
    return "\n".join(speech.translated(_taps(count, speech))) + "\n"


def _taps(count: int, language: Language) -> list[str]:
    """Write the functions that look up the light."""
    numbers = {
        kind: [_polynomial(row, language) for row in rows.tolist()]
        for kind, rows in even_polynomials(count).items()
    }
    words = {
        "LEAST_P": language.number(LEAST_FITTED[0]),
        "BESIDE": language.minus("v", language.scale("z", "n")),
    }
    lines = filled(_HEAD, words)
    for tap, (width, tilt) in enumerate(zip(numbers["r"], numbers["t"], strict=True)):
        looked_up = f"shrm_light(l, min(roughness * {width}, 1.0))"
        words = {
            "TILT": tilt,
            "HALF": language.add("n", language.scale("lean", "beside")),
            "PART": f"max({numbers['w'][tap - 1]}, 0.0)" if tap else "1.0",
            "LIGHT": language.minus(language.scale("facing", "h"), "v"),
            "GROW": language.grow("sum", language.scale("part", looked_up)),
        }
        lines += filled(_TAP, words)
    return [*lines, *filled(_TAIL, {"SUM": language.scale("(1.0 / total)", "sum")})]


def _polynomial(row: list[float], language: Language) -> str:
    """Write a polynomial, whose numbers are in the order of `taps.EVEN_MONOMIALS`."""
    first = list(map(language.number, row))
    vectors = [f"vec3({', '.join(first[k : k + 3])})" for k in (0, 3)]
    return f"shrm_lean(q, {', '.join(vectors)})"
