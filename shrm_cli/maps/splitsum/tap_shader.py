"""GGX under a split sum that is looked up where its lobe lies, as source code, step by step.

Brushed surfaces are computed as by `BrushedSplitSum`, even ones as by `TappedSplitSum`. The taps
need nothing but ``shrm_light(d, roughness)``, so that engines with levels of their own can use
them; `taps_code` and `even_taps_code` write them alone.
"""

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.taps import LEAST_FITTED, even_polynomials, polynomials
from shrm_cli.maps.shader.language import Language, filled
from shrm_cli.maps.shader.source import CROSS
from shrm_cli.maps.splitsum.split_sum import TURNS
from shrm_cli.vocabulary import MIN_ROUGHNESS

_TAIL = """\
    return SUM;
}"""


def _calls(function: str, fitted: dict[str, Array], language: Language) -> dict[str, list[str]]:
    """Write calls of the function of q that computes each of some polynomials, by their letters.

    Its arguments are vectors of their numbers, in the order of `taps.MONOMIALS` or
    `EVEN_MONOMIALS`, behind the constant where that leaves no vector whole.
    """

    def call(row: list[float]) -> str:
        numbers = list(map(language.number, row))
        first = len(row) % 3
        vectors = [f"vec3({', '.join(numbers[k : k + 3])})" for k in range(first, len(row), 3)]
        return f"{function}(q, {', '.join([*numbers[:first], *vectors])})"

    return {letter: list(map(call, rows.tolist())) for letter, rows in fitted.items()}


# ---- brushed surfaces ---------------------------------------------------------------------------

_HEAD = """\
float shrm_fit(vec3 q, float a, vec3 b, vec3 c, vec3 d)
{
    vec3 e = vec3(q.x * q.x, q.x * q.y, q.x * q.z);
    vec3 f = vec3(q.y * q.y, q.y * q.z, q.z * q.z);
    return a + dot(b, q) + dot(c, e) + dot(d, f);
}
vec3 shrm_tap(vec3 n, vec3 t, vec3 b, vec3 w, vec3 h, float roughness)
{
    float twice = 2.0 * dot(h, w) / dot(h, h);
    vec3 l = LIGHT;
    return shrm_light(WORLD, roughness);
}
/* The light alone, of alphas ax >= ay; t runs along x, across the brush marks. */
vec3 shrm_taps(vec3 n, vec3 t, vec3 v, float ax, float ay)
{
    vec3 b = shrm_cross(n, t);
    vec3 w = vec3(dot(t, v), dot(b, v), max(dot(n, v), 1e-5));
    float masking = sqrt(ax * ax * w.x * w.x + ay * ay * w.y * w.y + w.z * w.z);
    float x = ax * ax * w.x / masking;
    float y = ay * ay * w.y / masking;
    float wide = sqrt(max(ax * ax - ay * ay, 0.0));
    float rough = sqrt(ay);
    vec3 q = vec3(max(sqrt(ay / ax), LEAST_S), max(rough, LEAST_P), w.z);
    vec3 h;
    vec3 sum = vec3(0.0, 0.0, 0.0);
    float total = 0.0;
    float weight;
    float part;
    float width;
    float tilt;"""
_TAP = """\
    part = weight * max(dot(h, w), 0.0);
    total += part;
    GROW"""
_SURFACE = """\
float shrm_equal(vec3 w, float ax, float ay, float turn)
{
    float square = ax * ax + ay * ay + turn * (w.x * w.x - w.y * w.y) * (ax * ax - ay * ay);
    return sqrt(sqrt(min(max(0.5 * square, 0.0), 1.0)));
}
/* Roughness and anisotropy are those of glTF. */
vec3 shrm_brushed(vec3 n, vec3 t, vec3 v, float roughness, float anisotropy, vec3 f0)
{
    float a = max(roughness, LEAST), ay = a * a, ax = ay + (1.0 - ay) * anisotropy * anisotropy;
    vec3 w = vec3(dot(t, v), dot(shrm_cross(n, t), v), max(dot(n, v), 1e-5));
    vec3 dfg = shrm_between(w.z, shrm_equal(w, ax, ay, TOTAL), 0);
    float bias = shrm_between(w.z, shrm_equal(w, ax, ay, BIAS), 0).y;
    float scale = dfg.x + dfg.y - bias;
    return PRODUCT;
}"""


def brushed_functions(count: int, language: Language) -> list[str]:
    """Write ``shrm_brushed(n, t, v, roughness, anisotropy, f0)``, and what it uses."""
    albedo = language.add(language.scale("scale", "f0"), "vec3(bias, bias, bias)")
    total, bias = (
        f"{language.number(c)} + {language.number(d)} * w.z"
        for c, d in (TURNS[part] for part in ("total", "bias"))
    )
    words = {
        "LEAST": language.number(MIN_ROUGHNESS), "TOTAL": total, "BIAS": bias,
        "PRODUCT": language.times("shrm_taps(n, t, v, ax, ay)", albedo),
    }  # fmt: skip
    return [*_taps(count, language), *filled(_SURFACE, words)]


def taps_code(count: int, language: str) -> str:
    """Write ``shrm_taps(n, t, v, ax, ay)`` for an engine with a function ``shrm_light`` of its own.

    `count` is one of `vocabulary.TAP_COUNTS`. In the `language` C the code begins with the vectors
    that it needs.
    """
    speech = Language(language)
    return "\n".join(speech.translated(_taps(count, speech))) + "\n"


def _taps(count: int, language: Language) -> list[str]:
    """Write the functions that look up the light."""
    least_p, least_s = (language.number(each) for each in LEAST_FITTED)
    tapped = "shrm_tap(n, t, b, w, h, width)"
    words = {
        "LEAST_P": least_p, "LEAST_S": least_s,
        "LIGHT": language.minus(language.scale("twice", "h"), "w"),
        "WORLD": language.combined(("l.x", "l.y", "l.z"), ("t", "b", "n")),
        "GROW": language.grow("sum", language.scale("part", tapped)),
        "SUM": language.scale("(1.0 / total)", "sum"),
    }  # fmt: skip
    return [*CROSS, *filled("\n".join([_HEAD, *_all_taps(count, language), _TAIL]), words)]


def _all_taps(count: int, language: Language) -> list[str]:
    numbers = _calls("shrm_fit", polynomials(count), language)
    odd = count % 2
    lines = []
    for tap, (width, tilt) in enumerate(zip(numbers["r"], numbers["t"], strict=True)):
        weight = f"max({numbers['w'][tap - 1]}, 0.0)" if tap else "1.0"
        lines += [f"    weight = {weight};", f"    width = min(rough * {width}, 1.0);"]
        lines += [f"    tilt = {tilt};"]
        if tap < odd:
            lines += ["    h = vec3(tilt * x, tilt * y, 1.0);", _TAP]
            continue
        spread = f"wide * {numbers['u'][tap - odd]}"
        lines += [f"    h = vec3(tilt * x + {spread}, tilt * y, 1.0);", _TAP]
        lines += ["    h.x = 2.0 * tilt * x - h.x;", _TAP]
    return lines


# ---- even surfaces ------------------------------------------------------------------------------

_EVEN_HEAD = """\
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
_EVEN_TAP = """\
    lean = slope * TILT;
    h = HALF;
    facing = z + lean * across;
    part = PART * max(facing, 0.0);
    facing = 2.0 * facing / (1.0 + lean * lean * across);
    l = LIGHT;
    total += part;
    GROW"""
_EVEN_SURFACE = """\
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
    return [*_even_taps(count, language), *filled(_EVEN_SURFACE, words)]


def even_taps_code(count: int, language: str) -> str:
    """Write ``shrm_even_taps(n, v, roughness)`` for an engine with a ``shrm_light`` of its own.

    `count` is one of `vocabulary.EVEN_TAP_COUNTS`. In the `language` C the code begins with the
    vectors that it needs.
    """
    speech = Language(language)
    return "\n".join(speech.translated(_even_taps(count, speech))) + "\n"


def _even_taps(count: int, language: Language) -> list[str]:
    """Write the functions that look up the light."""
    numbers = _calls("shrm_lean", even_polynomials(count), language)
    words = {
        "LEAST_P": language.number(LEAST_FITTED[0]),
        "BESIDE": language.minus("v", language.scale("z", "n")),
    }
    lines = filled(_EVEN_HEAD, words)
    for tap, (width, tilt) in enumerate(zip(numbers["r"], numbers["t"], strict=True)):
        looked_up = f"shrm_light(l, min(roughness * {width}, 1.0))"
        words = {
            "TILT": tilt,
            "HALF": language.add("n", language.scale("lean", "beside")),
            "PART": f"max({numbers['w'][tap - 1]}, 0.0)" if tap else "1.0",
            "LIGHT": language.minus(language.scale("facing", "h"), "v"),
            "GROW": language.grow("sum", language.scale("part", looked_up)),
        }
        lines += filled(_EVEN_TAP, words)
    return [*lines, *filled(_TAIL, {"SUM": language.scale("(1.0 / total)", "sum")})]
