"""The names, limits and defaults that the library, its files and the command line share.

This module imports neither numpy nor anything else that takes time, so that ``shrm --help`` may
load it. Each name is defined here once, and every module that needs it imports it.

The last part is the layouts of the sphere in an image. A new arrangement of a cube's faces is one
row of `CUBES`; a new grid is one module of `shrm_cli.sphere.grid` and one row of `GRIDS`.
"""

from typing import Literal, get_args

from shrm_cli.records import record

# ---- names ---------------------------------------------------------------------------------------

Center = Literal["reflection", "normal", "tangent"]
"""The central direction, by which a map is looked up: the mirror direction of the view, the
normal, or the tangent."""
Frame = Literal["global", "local"]
"""The axes of the view in a map: those of the world, or those of each texel's own direction."""
Sampling = Literal["center", "border"]
"""Where the outermost pixels of an image lie: half a pixel inside its edge, or on the edge."""
Lookup = Literal["reflection", "normal"]
"""The direction that a lat-long of a material is over: the mirror direction R, or the normal N."""
Orientation = Literal["openexr", "gl"]
"""How the faces of a cube are turned: as OpenEXR defines it, or as graphics APIs do."""
Domain = Literal["frequency", "angular"]
"""How a map is prefiltered: by its spherical harmonic coefficients, or by integrals over
directions."""
Precision = Literal["auto", "half", "float"]
"""The pixel type that is asked for; ``auto`` is half unless a value exceeds the range of half."""
PixelType = Literal["half", "float"]
"""The pixel type of a written image: floating point of 16 or 32 bits."""
LevelMapping = Literal["linear", "filament", "unreal"]
"""How roughness rises with the levels of a split sum: linearly, or as in one of the engines
Filament and Unreal."""
Law = Literal["lobe", "paper"]
"""The attenuation of the degrees of a spherical harmonic exponential: that of GGX's lobe, or the
one that its paper published."""

LARGEST_HALF = 65504.0
"""The largest number that half floats hold."""

# The same names as tuples, for checks and choices at run time.
CENTERS: tuple[str, ...] = get_args(Center)
FRAMES: tuple[str, ...] = get_args(Frame)
SAMPLINGS: tuple[str, ...] = get_args(Sampling)
LOOKUPS: tuple[str, ...] = get_args(Lookup)
ORIENTATIONS: tuple[str, ...] = get_args(Orientation)
DOMAINS: tuple[str, ...] = get_args(Domain)
PRECISIONS: tuple[str, ...] = get_args(Precision)
LEVEL_MAPPINGS: tuple[str, ...] = get_args(LevelMapping)
LAWS: tuple[str, ...] = get_args(Law)

REPRESENTATIONS: dict[str, str] = {
    "shrm": "shrm.shrm",
    "cabral": "explicit.views",
    "kautz-mccool": "explicit.views",
    "lightfield": "explicit.views",
    "principal": "principal.principal",
    "irradiance": "irradiance.irradiance",
    "splitsum": "splitsum.split_sum",
    "she": "she.exponential",
    "product": "product.product",
}
"""Each representation's name, as ``--to`` takes it, and the module of `shrm_cli.maps` that defines
its class."""

AUTO = "auto"
"""What ``--to`` takes in place of a representation: the one whose picture is right in few bytes."""
AUTO_FORMS = ("shrm", "principal")
"""The representations that ``auto`` may be."""
EXPANDED = "shrm"
"""The representation that ``auto`` is where orders are given, or the energy they are chosen by."""
COMPARED = ("shrm", "principal", "splitsum", "she", "cabral")
"""The representations that `shrm compare --representations` compares."""

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".gltf", ".glb")
"""The suffixes of meshes, in lower case."""
CONTAINERS: dict[str, str] = {".exr": "exr"}
"""Each suffix of files that hold maps, and the module of `shrm_cli.files` that writes them."""

PRIMARIES: dict[str, tuple[float, ...]] = {
    "rec709": (0.640, 0.330, 0.300, 0.600, 0.150, 0.060, 0.3127, 0.3290),
    "rec2020": (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),
    "p3": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),
    "dci-p3": (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3140, 0.3510),
    "adobe": (0.640, 0.330, 0.210, 0.710, 0.150, 0.060, 0.3127, 0.3290),
    "acescg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),
    "aces2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
    "xyz": (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3),
}
"""Primaries and white by name, CIE x and y of red, green, blue and white: Rec.709 and sRGB,
Rec.2020, P3 with the white of screens (Display P3) and of cinemas, Adobe RGB (1998), ACES AP1 and
AP0 (SMPTE ST 2065-1), and CIE XYZ as OpenEXR writes it, whose numbers are relative to D65."""

EXPORT = "export"
"""What batches call the making of files that engines load, beside representations."""
ENGINES: dict[str, str] = {
    "filament": "filament",
    "bevy": "bevy",
    "three": "three",
    "babylon": "babylon",
    "gltf-sample-viewer": "gltf_sample_viewer",
    "model-viewer": "model_viewer",
    "cesium": "cesium",
    "playcanvas": "playcanvas",
    "unity": "unity",
    "unreal": "unreal",
    "godot": "godot",
    "realitykit": "realitykit",
    "blender": "blender",
    "usd": "usd",
    "gltf": "gltf",
    "directx": "directx",
    "json": "coefficients",
}
"""Each engine that light is exported for, and its module of `shrm_cli.export.engines`."""

RECIPE_ATTRIBUTE = "shrm:recipe"
"""The attribute of a picture that says how it was made."""
PROXY_ATTRIBUTE = "shrm:proxy"
"""The attribute of a probe's file that holds the record of the box around its place, as JSON."""

TEXEL_FORMATS: tuple[str, ...] = (
    "auto", "r11g11b10", "rgb9e5", "rgba16f", "bc6h", "uastc", "astc4x4", "astc6x6", "rgbd", "rgbp"
)  # fmt: skip
"""The texels of exported cubes, as `shrm_cli.export.pixels` and `shrm_cli.export.blocks` write
them; auto is the smallest that keeps the error."""

# ---- limits --------------------------------------------------------------------------------------

MAX_ORDER_F = 512
"""The largest order F of a map: the degree to which the light is kept."""
MAX_ORDER_P = 32
"""The largest order P of a map: the degree of the harmonics of the view."""
MAX_GRID_ORDER = 4
"""The largest order of a grid of probes."""
MIN_CUBE_SIZE = 4
"""The least size of the cubes of a map that is made; conversions go down to 1."""
MAX_SOURCE_HEIGHT = 8192
"""The most rows that a probe is averaged down to for integrals over its pixels."""
MAX_LATLONG_HEIGHT = 8192
"""The most rows of a lat-long."""
MAX_PICTURE_SIZE, MAX_STOPS = 8192, 32
MAX_SAMPLES, MAX_JOBS = 65536, 1024
"""The largest width or height of a picture, pixels, and its largest exposure of either sign."""
MAX_CUBE_SIZE = 4096
"""The most texels along the edge of a map's face."""
MAX_PRINCIPAL_MAPS = 128
"""The most cubes of one lobe of a map with a BRDF's own functions of the view."""
MAX_PRODUCT_ORDER = 16
"""The largest order of a product texture, which then has 289 coefficients."""
MAX_PRODUCT_SIZE = 1024
"""The most texels along the edge of a product texture."""
MAX_PRODUCT_PARAMETERS = 2
"""The most parameters that vary in product textures."""
MAX_EXPONENTIAL_ORDER = 16
"""The largest order of the factors P and Q of a spherical harmonic exponential."""
TAP_COUNTS, EVEN_TAP_COUNTS = (3, 5, 8), (1, 2, 3)
"""How many look-ups of a split sum may stand for a brushed surface, and for one that is not."""
NO_TAPS = 0
"""A single look-up about the mirror direction in place of those, as engines do."""
EVEN_LOOK_UPS = (NO_TAPS, *EVEN_TAP_COUNTS)
"""What may be asked for of surfaces that are not brushed."""
DEFAULT_TAPS, DEFAULT_EVEN_TAPS = 5, 3
DEFAULT_FRAMES, DEFAULT_FPS = 48, 24.0
"""Frames of a moving picture, and how many of them are shown in a second."""
MIN_ROUGHNESS = 0.05
"""The least perceptual roughness of GGX, at which its lobe is 0.3 degrees wide."""
MAX_LEVELS = 64
"""The most levels of a split sum."""
MAX_TRANSFER_ORDER, MAX_MATRIX_ORDER = 16, 8
"""The largest order of precomputed transfer, and that of its matrices, which have (order + 1)^4
numbers a vertex."""
TRANSFER_TEXTURES = 16, 2048
"""The fewest and the most texels along the edge of a texture of transfer."""
ALBEDO = 0.5
"""What triangles without a material reflect, where light goes from one to another."""

MAX_TERMS = 16
"""The most terms of a sum of BRDFs, and the most factors before one. Each term takes as long as a
BRDF of its own, and fits of measured materials have ten or fewer."""
MAX_COLLECTED_ORDER = 64
"""The largest degree of the coefficients that a batch gathers of its probes, 4225 of each."""

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear R, G and B in the luminance (ITU-R BT.709).

They serve pictures of any primaries, which differ little in it: metrics are no colorimetry.
"""

WRONG = 0.05
"""Relative error of the luminance above which a pixel counts as wrong."""
SEEN_FLOOR = 0.02
"""Least truth that an error of the luminance is divided by, as a fraction of the mean truth.

It keeps pixels that are all but black, whose error nobody sees, from having the largest ones.
"""
COARSE_ROWS = 128
"""Probes of so many rows have as many degrees as maps of narrow lobes carry."""
NEGATIVE_SHARE = 1e-3
"""The share of what is visible with a negative luminance that nobody needs to be told of."""
NEGATIVE_FROM_A_SIDE = 5e-3
"""The same of what is visible from one side. Of a sphere of 128 pixels it is an eighth of the rim,
two pixels wide: where more was negative of `microfacet` under a bare sun or a sunrise, a bright rim
had blue and black gaps."""

# ---- defaults ------------------------------------------------------------------------------------

LAMP_ERROR = 0.001
"""The relative RMS error of the irradiance that discs in place of lamps may make."""
LAMP_COUNT = 8
"""The most lamps that are taken out of a probe."""
DIMMED_WIDTHS = 1e-3, 180.0
"""The least and the most width of light that is dimmed about a direction, degrees: a hundredth of
the least is lost in the rounding of cosines."""
LARGEST_COORDINATE = 1e30
"""That of meshes and places, so that products of three are finite."""
MOST_DEGREES = 1e6
"""The largest angle of what is turned: of much larger ones rounding leaves no digit."""
LIGHT_ENGINES = ("three", "filament", "bevy", "godot", "blender", "gltf")
"""The programs that `shrm sun` prints lines for."""
DEFAULT_EPS = 0.03
"""The fraction of a BRDF's energy that a map may miss, where no other is asked for."""
DEFAULT_ERROR = 0.05
"""The relative RMS error of the reflected light, with bilinear look-ups and half precision, that a
chosen form may have, where no other is asked for."""
DEFAULT_SEEN = 0.05
"""The share of what is visible whose luminance may be wrong by more than `WRONG` then."""
DEFAULT_MAX_SIZE = 32 * 10**6
"""The most bytes that the cubes of a map take in half precision, where its orders are chosen."""
DEFAULT_ROUGHNESS = 0.5
"""The perceptual roughness of the GGX surface as which split sums and spherical harmonic
exponentials are shown, where no other is asked for."""
DEFAULT_FITTED_ROUGHNESS = (0.45, 1.0)
"""The range of perceptual roughness that a spherical harmonic exponential is fitted to, as in its
paper."""
DEFAULT_PRODUCT_ORDER = 4
"""The order of a product texture, as in its paper: 25 coefficients."""
DEFAULT_PRODUCT_SIZE = 128
"""Texels along the edge of a product texture, as in its paper."""
DEFAULT_FACTOR_ORDERS = (4, 2)
"""The orders P and Q of the factors of a spherical harmonic exponential, as in its paper."""


# ---- layouts -------------------------------------------------------------------------------------

Layout = str
"""A name out of `LAYOUTS`."""

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
"""The faces of a cube, in the order in which OpenEXR stacks them."""

GRIDS = {
    "latlong": "shrm_cli.sphere.grid.latlong:LatLong",
    "cube": "shrm_cli.sphere.grid.cube:Cube",
    "angular": "shrm_cli.sphere.grid.angular:Angular",
}
"""The grids by their names, and the module and class of each, imported when it is used."""


@record
class CubeArrangement:
    """Where the faces of a cube lie in an image."""

    columns: int
    rows: int
    """`columns` and `rows`: the size of the image, in faces."""
    places: tuple[tuple[int, int, bool], ...]
    """For each face of `FACES`: the column and the row where it lies, and whether it is turned by
    half a turn there."""
    orientation: Orientation
    """How the faces are turned in a file that does not tell."""
    in_six_files: bool
    """Whether each face is a file of its own. The arrangement is then that of the six images
    together."""

    @classmethod
    def drawn(
        cls, *lines: str, orientation: Orientation = "gl", in_six_files: bool = False
    ) -> "CubeArrangement":
        """Make an arrangement from a picture of it.

        `*lines` is a line for each row, with the names of its faces. A dot stands for an unused
        cell, and a name in small letters for a face that is turned by half a turn. `orientation`
        and `in_six_files` are the attributes of the same names.
        """
        cells = [line.split() for line in lines]
        found = {
            cell.upper(): (column, row, cell.islower())
            for row, names in enumerate(cells)
            for column, cell in enumerate(names)
            if cell != "."
        }
        if found.keys() != set(FACES) or len({len(names) for names in cells}) != 1:
            raise ValueError(f"{lines} does not show each face of a cube in a rectangle")
        places = tuple(found[face] for face in FACES)
        return cls(len(cells[0]), len(cells), places, orientation, in_six_files)

    @property
    def is_cross(self) -> bool:
        """Whether some cells of the image hold no face."""
        return self.columns * self.rows > len(FACES)

    def unused(self) -> list[tuple[int, int]]:
        """Column and row of each cell that holds no face."""
        used = {place[:2] for place in self.places}
        cells = [(column, row) for row in range(self.rows) for column in range(self.columns)]
        return [cell for cell in cells if cell not in used]

    def face_size(self, width: int, height: int) -> int | None:
        """Texels along a face's edge in an image of this size; None if it cannot be one."""
        size = width // self.columns
        return size if size and (width, height) == (self.columns * size, self.rows * size) else None


CUBES = {
    "openexr": CubeArrangement.drawn("+X", "-X", "+Y", "-Y", "+Z", "-Z", orientation="openexr"),
    "strip": CubeArrangement.drawn("+X -X +Y -Y +Z -Z"),
    "hcross": CubeArrangement.drawn(
        " .  +Y  .  . ",
        "-X  +Z +X -Z ",
        " .  -Y  .  . ",
    ),
    "vcross": CubeArrangement.drawn(
        " .  +Y  . ",
        "-X  +Z +X ",
        " .  -Y  . ",
        " .  -z  . ",
    ),
    "faces": CubeArrangement.drawn("+X", "-X", "+Y", "-Y", "+Z", "-Z", in_six_files=True),
}  # fmt: skip
"""The arrangements of a cube by their names, in the order in which users see them."""


_CUBES_IN_ONE = [name for name, cube in CUBES.items() if not cube.in_six_files]
IMAGE_LAYOUTS: tuple[Layout, ...] = tuple(
    name for grid in GRIDS for name in (_CUBES_IN_ONE if grid == "cube" else [grid])
)
"""The layouts that are one image."""

LAYERS = "layers"
"""What `shrm convert` calls the textures that the code of a map reads, beside layouts."""
MIP_LAYOUTS: tuple[Layout, ...] = ("latlong", "openexr")
"""The layouts of mip-mapped files."""

LAYOUTS: tuple[Layout, ...] = (
    *IMAGE_LAYOUTS,
    *(name for name, cube in CUBES.items() if cube.in_six_files),
)
"""Every layout."""


def grid_name(layout: Layout) -> str:
    """The name of the grid, out of `GRIDS`, whose pixels a layout arranges."""
    return "cube" if layout in CUBES else layout


def default_orientation(layout: Layout) -> Orientation:
    """How the faces of a layout are turned where nothing tells.

    It is ``openexr`` for the stacked cube, which OpenEXR defines, and the orientation of graphics
    APIs for the others. A layout without faces has ``openexr``, as has all that is written.
    """
    return CUBES[layout].orientation if layout in CUBES else "openexr"
