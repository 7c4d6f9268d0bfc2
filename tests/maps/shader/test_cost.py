"""The cost of shaders: the code that is printed is run as C++ whose numbers count their work."""

import re
import shutil
import subprocess

import pytest

from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.shader import cost
from shrm_cli.maps.shader.code import written_code
from shrm_cli.vocabulary import EVEN_TAP_COUNTS, TAP_COUNTS
from tests.maps.scenes import make_info, make_shrm
from tests.maps.shader import cases

HEAD = r"""
#include <cmath>
#include <cstdio>
static long work, fetched;
struct F { double v; F(double x = 0) : v(x) {} explicit operator int() const { return int(v); } };
static F operator*(F a, F b) { ++work; return a.v * b.v; }
static F operator/(F a, F b) { ++work; return a.v / b.v; }
static F operator+(F a, F b) { return a.v + b.v; }
static F operator-(F a, F b) { return a.v - b.v; }
static F operator-(F a) { return -a.v; }
static bool operator<(F a, F b) { return a.v < b.v; }
static bool operator>(F a, F b) { return a.v > b.v; }
static bool operator==(F a, F b) { return a.v == b.v; }
static F &operator*=(F &a, F b) { return a = a * b; }
static F &operator+=(F &a, F b) { return a = a + b; }
static F max(F a, F b) { return a.v < b.v ? b : a; }
static F min(F a, F b) { return a.v < b.v ? a : b; }
static int max(int a, int b) { return a < b ? b : a; }
static F abs(F a) { return std::fabs(a.v); }
static F sqrt(F a) { ++work; return std::sqrt(a.v); }
static F exp(F a) { ++work; return std::exp(a.v); }
static F log(F a) { ++work; return std::log(a.v); }
static F atan(F a, F b) { ++work; return std::atan2(a.v, b.v); }
struct vec3 { F x, y, z; vec3() {} vec3(F a, F b, F c) : x(a), y(b), z(c) {} };
static vec3 operator*(F s, vec3 a) { return vec3(s * a.x, s * a.y, s * a.z); }
static vec3 operator*(vec3 a, F s) { return s * a; }
static vec3 operator*(vec3 a, vec3 b) { return vec3(a.x * b.x, a.y * b.y, a.z * b.z); }
static vec3 operator+(vec3 a, vec3 b) { return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
static vec3 operator-(vec3 a, vec3 b) { return vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
static vec3 &operator+=(vec3 &a, vec3 b) { return a = a + b; }
static F dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static F length(vec3 a) { return sqrt(dot(a, a)); }
static vec3 mix(vec3 a, vec3 b, F t) { return a + t * (b - a); }
struct vec4 { vec3 rgb; vec4(vec3 a, F) : rgb(a) {} };
struct ivec3 { ivec3(int, int, int) {} };
struct samplerCubeArray {}; struct sampler2DArray {};
static vec4 look() { ++fetched; return vec4(vec3(.3, .4, .5), 1); }
static vec4 textureLod(samplerCubeArray, vec4, F) { return look(); }
static vec4 texelFetch(sampler2DArray, ivec3, int) { return look(); }
#define uniform static
#define highp
#define float F
"""
BRUSHED = "0.5, 0.6, vec3(1.0, 0.8, 0.4)"
POINT = "vec3(0.6, 0.0, 0.8), vec3(-0.28, 0.576, 0.768)"

MADE = {
    **{
        f"principal {degrees}": (
            lambda degrees=degrees, center=center: PrincipalMap(
                (cases.lobe(0, center, degrees),), make_info(4, 3)
            ),
            "",
            cost.principal_cost(degrees, center),
        )
        for degrees, center in [((3, 1, 0), "reflection"), ((6,), "normal"), ((2, 2), "tangent")]
    },
    "principal sum": (
        cases.FORMS["principal sum"],
        "",
        cost.principal_cost((2, 0), "normal")
        + cost.principal_cost((6,), "reflection")
        + cost.principal_cost((3, 1, 0), "tangent"),
    ),
    **{
        f"shrm {p} {center}": (
            lambda p=p, center=center: make_shrm(4, p, 4, center),
            "",
            cost.shrm_cost(p, center),
        )
        for p, center in [(0, "normal"), (3, "reflection"), (2, "tangent")]
    },
    "splitsum": (
        cases.FORMS["splitsum linear"],
        ", 0.5, vec3(.04, .04, .04)",
        cost.split_sum_cost(),
    ),
    "splitsum single": (
        cases.FORMS["splitsum single"],
        ", 0.5, vec3(.04, .04, .04)",
        cost.split_sum_cost(),
    ),
    **{
        f"splitsum, {taps} taps": (cases.FORMS["splitsum linear"], taps, cost.brushed_cost(taps))
        for taps in TAP_COUNTS
    },
    **{
        f"splitsum even, {taps} taps": (cases.FORMS["splitsum linear"], -taps, cost.even_cost(taps))
        for taps in EVEN_TAP_COUNTS
    },
    "she grey": (
        cases.FORMS["she lobe"],
        ", 0.5, vec3(.04, .04, .04)",
        cost.exponential_cost(4, 2, True),
    ),
    "she gold": (
        cases.FORMS["she lobe"],
        ", 0.5, vec3(1., .8, .4)",
        cost.exponential_cost(4, 2, False),
    ),
    "cabral": (cases.FORMS["cabral"], "", cost.cabral_cost("reflection")),
    **{
        f"irradiance {order}": (
            lambda order=order: cases.irradiance(order),
            "",
            cost.irradiance_cost(order),
        )
        for order in (0, 1, 2, 4, 8)
    },
}


def as_cpp(code):
    """Arrays of constants are written in another way in C++; all else of the code is C++ too."""
    return re.sub(
        r"= vec3\[\d+\]\((.*?)\n\);", lambda found: f"= {{{found[1]}}};", code, flags=re.S
    )


@pytest.mark.proof
@pytest.mark.skipif(shutil.which("g++") is None, reason="no compiler of C++")
def test_costs_are_those_of_the_code(tmp_path):
    parts, calls = [HEAD], []
    for number, (make, surface, _) in enumerate(MADE.values()):
        made = make()
        is_diffuse = made.representation == "irradiance"
        # Taps of surfaces that are not brushed are negative.
        taps = surface if isinstance(surface, int) else 0
        code = as_cpp(
            written_code(made, "glsl", None, max(taps, 0) or None, max(-taps, 0) or None).text
        )
        parts.append(f"namespace n{number} {{\n{code}}}\n")
        point = POINT if not is_diffuse else POINT.partition("), ")[0] + ")"
        call = f"n{number}::shrm_{'ir' if is_diffuse else ''}radiance({point}{surface})"
        if taps < 0:
            call = f"n{number}::shrm_even({POINT}, 0.5, vec3(1.0, 0.8, 0.4))"
        elif taps:
            normal, view = POINT.split(", v")
            call = f"n{number}::shrm_brushed({normal}, vec3(0.8, 0.0, -0.6), v{view}, {BRUSHED})"
        call = f"vec3(1., .5, .2) * {call}" if is_diffuse else call  # times the albedo
        calls.append(f'work = fetched = 0; {call}; printf("%ld %ld\\n", fetched, work);')
    main = "#undef float\nint main() {\n" + "\n".join(calls) + "\nreturn 0; }\n"
    (tmp_path / "count.cpp").write_text("".join(parts) + main)
    subprocess.run(["g++", "-w", "-O0", "count.cpp", "-o", "count"], cwd=tmp_path, check=True)
    told = subprocess.run([tmp_path / "count"], capture_output=True, text=True, check=True).stdout
    found = [tuple(map(int, line.split())) for line in told.splitlines()]
    expected = [(each.look_ups, each.multiply_adds) for *_, each in MADE.values()]
    assert dict(zip(MADE, found, strict=True)) == dict(zip(MADE, expected, strict=True))


def test_maps_of_view_functions_tell_their_costs():
    for name, (make, _, expected) in MADE.items():
        made = make()
        is_told = made.representation in ("shrm", "principal")
        assert cost.cost_of(made) == (expected if is_told else None), name
