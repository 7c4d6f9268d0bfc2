"""Writing the code of a map in a language, with the textures that it reads laid out in some way."""

from collections.abc import Callable, Sequence
from functools import partial

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.options import counted
from shrm_cli.maps.shader.boxed import box_function, boxed_functions
from shrm_cli.maps.shader.language import Language, harmless
from shrm_cli.maps.shader.pages import Pages, Run, arrange
from shrm_cli.maps.shader.source import Source, Table, Words
from shrm_cli.records import record

_MOST_SAMPLERS = 14
"""The most arrays of cubes; a table and one of lamps' BRDF may be two more samplers, of the 16 that
all devices have."""

# Functions of the layout `layers`, in GLSL. A place is column and row in the face with its rim,
# from 0.5 to size + 1.5, and the number of the face.
_PLACE = """\
vec3 shrm_place(vec3 d, float size)
{
    float x = abs(d.x), y = abs(d.y), z = abs(d.z);
    float s, t, most, face;
    if (x >= y && x >= z) {
        most = x;
        face = d.x > 0.0 ? 0.0 : 1.0;
        s = d.x > 0.0 ? d.z : -d.z;
        t = -d.y;
    } else if (y >= z) {
        most = y;
        face = d.y > 0.0 ? 2.0 : 3.0;
        s = d.x;
        t = d.y > 0.0 ? -d.z : d.z;
    } else {
        most = z;
        face = d.z > 0.0 ? 4.0 : 5.0;
        s = d.z > 0.0 ? -d.x : d.x;
        t = -d.y;
    }
    return vec3(s / most * SCALE + 0.5 * (size + 1.0), t / most * SCALE + 0.5 * (size + 1.0), face);
}
vec3 shrm_filtered(vec3 place, int layer, int left, int top, int edge)
{
    int column = int(place.x), row = int(place.y), face = int(place.z);
    int x = left + face / 2 * edge + column, y = top + face % 2 * edge + row;
    float across = place.x - float(column), down = place.y - float(row);
    return mix(
        mix(shrm_texel(x, y, layer), shrm_texel(x + 1, y, layer), across),
        mix(shrm_texel(x, y + 1, layer), shrm_texel(x + 1, y + 1, layer), across), down);
}"""
# How the texel of an array is read, and how the array is declared.
_TEXEL = {
    "glsl": (
        "uniform highp sampler2DArray {name};",
        "texelFetch({name}, ivec3(x, y, layer), 0).rgb",
    ),
    "hlsl": ("Texture2DArray {name};", "{name}.Load(int4(x, y, layer, 0)).rgb"),
    "wgsl": (
        "var {name}: texture_2d_array<f32>;",
        "textureLoad({name}, vec2i(x, y), layer, 0).rgb",
    ),
    "c": (
        "static const float *{name};",
        "shrm_vec({name}[at], {name}[at + 1], {name}[at + 2])",
    ),
}
_CUBES = {
    "glsl": (
        "uniform samplerCubeArray {name};",
        "textureLod({name}, vec4(d, float(cube)), 0.0).rgb",
    ),
    "hlsl": (
        "TextureCubeArray {name};",
        "{name}.SampleLevel(shrm_sampler, float4(d, cube), 0).rgb",
    ),
    "wgsl": (
        "var {name}: texture_cube_array<f32>;",
        "textureSampleLevel({name}, shrm_sampler, d, cube, 0.0).rgb",
    ),
}
_SAMPLERS = {"hlsl": "SamplerState shrm_sampler;", "wgsl": "var shrm_sampler: sampler;"}
_VERSIONS = {
    ("glsl", "layers"): "GLSL 3.30, and GLSL ES 3.00 (WebGL2)",
    ("glsl", "cube-array"): "GLSL 4.00",
    ("hlsl", "layers"): "HLSL, shader model 4",
    ("hlsl", "cube-array"): "HLSL, shader model 5",
    ("wgsl", "layers"): "WGSL; textures hold RGBA, whose alpha is not read",
    ("wgsl", "cube-array"): "WGSL; textures hold RGBA, whose alpha is not read",
    ("c", "layers"): "C89",
}


@record
class Code:
    """The code of a map, and which of its functions programs call.

    `text` is the code; its last line ends with a newline too. `is_irradiance` tells whether it has
    ``shrm_irradiance(n)``, and no ``shrm_radiance``. `takes_tangent` tells whether it has
    ``shrm_brushed_radiance(n, t, v)`` besides ``shrm_radiance(n, v)``. `is_boxed` tells whether
    there is one that takes a point, too, whose name ends in ``_at``.
    """

    text: str
    is_irradiance: bool = False
    takes_tangent: bool = False
    is_boxed: bool = False


def check_textures(language: str, textures: str) -> None:
    """Raise an `ArgumentError`, if a language reads no such textures."""
    if (language, textures) not in _VERSIONS:
        raise ArgumentError("textures", f"{language} reads no {textures}; take layers")


def written_code(
    made: Map,
    language: str,
    textures: str | None = None,
    taps: int | None = None,
    even_taps: int | None = None,
) -> Code:
    """Write the function of a map for a shader or a program, and say which it is.

    It is ``shrm_radiance(n, v)``, ``shrm_radiance(n, v, roughness, f0)`` for light of any GGX
    surface, ``shrm_radiance(n, v, roughness)`` for that of another BRDF, and
    ``shrm_irradiance(normal)`` for irradiance. Where the map knows of a box, ``shrm_radiance_at``
    takes a point p after v, and ``shrm_irradiance_at`` after the normal. Where parameters of a
    product texture vary, ``shrm_varied_radiance(n, t, v, first, second)`` takes where they are on
    their ways. All names begin with ``shrm_``.

    `language` is one of ``glsl``, ``hlsl``, ``wgsl``, ``c``. `textures`, one of ``cube-array``,
    ``layers``, are where cubes are read: from arrays of cube maps, whose faces are turned as the
    graphics API wants them, or from the arrays of images that `file.pack` returns. Code in C reads
    the latter; for the other languages, arrays of cube maps are the default. `taps`, one of 3, 5,
    8, are those of a split sum of GGX: add ``shrm_brushed(n, t, v, roughness, anisotropy, f0)``,
    the light of brushed GGX, by so many look-ups. `even_taps`, one of 1, 2, 3, add
    ``shrm_even(n, v, roughness, f0)``, that of GGX which is not brushed.
    """
    speech = Language(language)
    if (snippet := whole_code(made)) is not None:
        return _irradiance(made, snippet, speech)
    chosen = textures or ("layers" if speech.is_c else "cube-array")
    check_textures(language, chosen)
    source = source_of(made, chosen)
    write = _with_layers if chosen == "layers" else _with_cube_arrays
    head, words, comment = write(source, speech)
    comment += [*_declare_own(source, speech, head), *source.notes]
    if (lobe := lobe_of(made)) is not None:
        comment += _declare_table("shrm_lobe", "shrm_of_lobe", lobe, speech, head)
    functions = [*source.functions(words), *_tapped(made, taps, even_taps, speech)]
    takes_tangent = source.takes_tangent
    if made.stored is not made:
        functions, takes_tangent = _with_lamps(made, functions, speech, takes_tangent)
        comment = [*comment, "shrm_lamps: the lamps beside the map, integrated over their discs."]
    boxed = boxed_functions(made, functions, speech, takes_tangent)
    if boxed:
        functions = [*functions, *boxed]
        comment = [*comment, "shrm_radiance_at: looked up where rays from p meet the probe's box."]
    lines = [
        *_comment(made, source, _VERSIONS[language, chosen], comment),
        *speech.translated([*head, *functions]),
    ]
    text = "\n".join(lines) + "\n"
    return Code(text, takes_tangent=takes_tangent, is_boxed=bool(boxed))


def whole_code(made: Map) -> Callable[[Map, str], str] | None:
    """Return what writes the code of a map that holds all numbers: of irradiance."""
    shader = registry.module(made.representation, "shader")
    return getattr(shader, "irradiance_snippet", None)


def _irradiance(made: Map, snippet: Callable[[Map, str], str], language: Language) -> Code:
    """Write the function of irradiance; in C, which takes arrays, without parallax."""
    text = snippet(made, language.name)
    if made.info.proxy is None or language.is_c:
        return Code(text, is_irradiance=True)
    looked_up = "{ return shrm_irradiance(shrm_box(p, normal)); }"
    lines = [
        *box_function(made.info.proxy, language),
        f"vec3 shrm_irradiance_at(vec3 normal, vec3 p) {looked_up}",
    ]
    text += "\n".join(language.translated(lines)) + "\n"
    return Code(text, is_irradiance=True, is_boxed=True)


def _with_lamps(
    made: Map, functions: Sequence[str], language: Language, takes_tangent: bool
) -> tuple[list[str], bool]:
    """Write the functions of a map, and those of the lamps beside it.

    Returns the functions, and whether they take a tangent, as of `Code`: discs are brushed where
    the map itself is not.
    """
    from shrm_cli.maps.lamps.map import LampMap
    from shrm_cli.maps.lamps.shader import with_lamps

    assert isinstance(made, LampMap)
    found = with_lamps(functions, made.lamps, language, takes_tangent)
    return found, not made.lamps.brdf.isotropic


def _tapped(made: Map, taps: int | None, even: int | None, language: Language) -> list[str]:
    """Write the functions of surfaces whose lobes are looked up with taps: brushed, and even."""
    name = "anisotropy" if taps is not None else "taps"
    if "anisotropy" not in made.surface_arguments and (taps, even) != (None, None):
        raise MapError(f"{made.what}: only split sums of GGX have code for `{name}`")
    if (taps, even) == (None, None):
        return []
    from shrm_cli.maps.splitsum.tap_shader import brushed_functions, even_functions

    brushed = [] if taps is None else brushed_functions(taps, language)
    return brushed + ([] if even is None else even_functions(even, language))


def lobe_of(made: Map) -> Table | None:
    """Return the table of what the BRDF of lamps beside a map reflects, where there is one."""
    if made.stored is made:
        return None
    from shrm_cli.maps.lamps.map import LampMap

    assert isinstance(made, LampMap)
    return None if made.table is None else made.table.texture()


def source_of(made: Map, textures: str) -> Source:
    """Return what the shader of a map consists of; the cubes may depend on where they are read."""
    return registry.module(made.representation, "shader").source(made.stored, textures)


def _comment(made: Map, source: Source, version: str, textures: Sequence[str]) -> list[str]:
    """Write the comment that says what the code is, and what it reads."""
    lines = [
        source.title,
        "World axes: right-handed, +Y up; n and v are unit, v points to the viewer. Linear RGB.",
        f"Probe: {harmless(made.info.probe) or 'unknown'}",
        f"Language: {version}.",
        *textures,
    ]
    return [f"{'/*' if k == 0 else ' *'} {line}" for k, line in enumerate(lines)] + [" */"]


# ---- one array of images -------------------------------------------------------------------------


def _with_layers(source: Source, language: Language) -> tuple[list[str], Words, list[str]]:
    """Return declarations, words and comment for textures that are arrays of images."""
    lines: list[str] = []
    comment: list[str] = []
    cube = _nothing
    if source.stacks:
        pages = arrange([(stack.shape[2], stack.shape[1]) for stack in source.stacks])
        width, height = pages.width, pages.height
        lines += _array("shrm_layers", "shrm_texel", width, height, language)
        # Border-sampled faces hold their edges, and so end half a texel further in.
        scale = "0.5 * max(size - 1.0, 1.0)" if source.sampling == "border" else "0.5 * size"
        lines += _PLACE.replace("SCALE", scale).split("\n")
        cube = partial(_filtered, pages)
        comment = _about_layers(pages)
    if source.table is not None:
        comment += _declare_table("shrm_table", "shrm_cell", source.table, language, lines)
    words = Words(
        language,
        lambda stack, d: (
            f"shrm_place({d}, {language.number(float(source.stacks[stack].shape[1]))})"
        ),
        cube,
    )
    return lines, words, comment


def _array(name: str, function: str, width: int, height: int, language: Language) -> list[str]:
    """Write the declaration of an array of images, and the function that reads a texel of it."""
    declared, texel = (text.format(name=name) for text in _TEXEL[language.name])
    index = f"    int at = 3 * ((layer * {height} + y) * {width} + x);"
    return [
        declared,
        f"vec3 {function}(int x, int y, int layer)",
        "{",
        *([index] if language.is_c else []),
        f"    return {texel};",
        "}",
    ]


def _declare_table(
    name: str, function: str, table: Table, language: Language, lines: list[str]
) -> list[str]:
    """Add what declares a table that is a texture to lines of code, and return the comment."""
    layers, height, width = table.shape
    lines += _array(name, function, width, height, language)
    return [
        f"{name}: {table.about}.",
        f"It has {counted(layers, 'layer')} of {width} x {height} texels, RGB floats.",
    ]


def _declare_own(source: Source, language: Language, lines: list[str]) -> list[str]:
    """Declare what few forms have, as `_declare_table` does: images, and light that may change."""
    comment: list[str] = []
    if source.images is not None:
        comment += _declare_table("shrm_product", "shrm_own", source.images, language, lines)
    if source.lighting is not None:
        count = len(source.lighting)
        lines += language.colors_given("shrm_lighting", source.lighting)
        comment += [
            f"shrm_lighting: {count} coefficients of the light in world axes, index l (l + 1) + m;",
            "set and change them. The map's own are shrm:lighting_coefficients of its file.",
        ]
    return comment


def _table_in_code(table: Table, language: Language) -> list[str]:
    """Write a table as an array of constants.

    A single function reads it, because compilers copy the array to wherever it is indexed.
    """
    numbers = table.make()
    _, height, width, _ = numbers.shape
    return [
        *language.colors("shrm_table", numbers.reshape(-1, 3)),
        "vec3 shrm_cell(int x, int y, int layer)",
        "{",
        f"    return shrm_table[(layer * {height} + y) * {width} + x];",
        "}",
    ]


def _filtered(pages: Pages, stack: int, place: str, index: str) -> str:
    """Write the look-up of a cube of a stack."""
    run = pages.runs[stack]
    layer, left, top = _corner(run, index)
    return f"shrm_filtered({place}, {layer}, {left}, {top}, {run.edge})"


def _corner(run: Run, index: str) -> tuple[str, str, str]:
    """Write what `Run.corner` computes."""
    if run.count == 1:
        return str(run.layer), str(run.left), str(run.top)
    cells, columns = run.columns * run.rows, run.columns
    if cells == 1:
        return f"{run.layer} + ({index})", str(run.left), str(run.top)
    return (
        f"{run.layer} + ({index}) / {cells}",
        f"({index}) % {cells} % {columns} * {3 * run.edge}",
        f"({index}) % {cells} / {columns} * {2 * run.edge}",
    )


def _about_layers(pages: Pages) -> list[str]:
    """Write what the comment says of the array of cubes."""
    count = counted(pages.layers, "layer")
    return [
        f"shrm_layers: {count} of {pages.width} x {pages.height} texels, RGB; shrm",
        "convert MAP --to layers writes them. A cube is 3 x 2 faces (+X +Y +Z above -X -Y -Z) in",
        "OpenEXR's orientation, each with a rim of one texel of the faces beside it. The code",
        "filters by itself, so that the texture needs no filter.",
    ]


# ---- arrays of cube maps -------------------------------------------------------------------------


def _with_cube_arrays(source: Source, language: Language) -> tuple[list[str], Words, list[str]]:
    """Return declarations, words and comment for textures that are arrays of cube maps."""
    if source.stacks and source.sampling == "border":
        raise MapError(
            "graphics hardware samples cubes at texel centres; make the map with `sampling` center "
            "or take the textures layers"
        )
    sizes = sorted({stack.shape[1] for stack in source.stacks}, reverse=True)
    if len(sizes) > _MOST_SAMPLERS:
        raise ArgumentError(
            "textures", f"{len(sizes)} sizes of cubes take more than 16 samplers; take layers"
        )
    lines: list[str] = []
    comment: list[str] = []
    if sizes and language.name in _SAMPLERS:
        lines.append(_SAMPLERS[language.name])
    first: list[int] = []
    held = dict.fromkeys(sizes, 0)
    for stack in source.stacks:
        first.append(held[stack.shape[1]])
        held[stack.shape[1]] += stack.shape[2]
    for number, (size, count) in enumerate(held.items()):
        declared, texel = (t.format(name=_name(number)) for t in _CUBES[language.name])
        lines += [declared, f"vec3 shrm_look{number}(vec3 d, int cube) {{ return {texel}; }}"]
        comment.append(f"{_name(number)}: {counted(count, 'cube')} of 6 x {size} x {size} texels.")
    if sizes:
        comment += [
            "Cubes are in the order of the file's channels and parts; turn their faces as the API",
            "wants them (shrm convert MAP --to openexr --to-orientation gl), and filter linearly.",
        ]
    if source.table is not None and source.table.in_code:
        lines += _table_in_code(source.table, language)
    elif source.table is not None:
        comment += _declare_table("shrm_table", "shrm_cell", source.table, language, lines)
    words = Words(
        language,
        lambda stack, d: d,
        lambda stack, place, index: (
            f"shrm_look{sizes.index(source.stacks[stack].shape[1])}({place}, "
            f"{f'{first[stack]} + ' if first[stack] else ''}{index})"
        ),
    )
    return lines, words, comment


def _name(number: int) -> str:
    return f"shrm_cubes{number or ''}"


def _nothing(*texts: object) -> str:
    raise AssertionError("the form has no such texture")
