"""The names, limits and defaults that the library, its files and the command line share.

This module imports neither numpy nor anything else of the package, so that ``shrm --help`` may
load it. Each name stands here once; whoever needs it imports it.
"""

from typing import Literal, get_args

# ---- names ---------------------------------------------------------------------------------------

Center = Literal["reflection", "normal", "tangent"]
"""What a map is looked up with: the mirror direction of the view, the normal, or the tangent."""
Frame = Literal["global", "local"]
"""Axes of the view in a map: those of the world, or those of each texel's own direction."""
Sampling = Literal["center", "border"]
"""Where the pixels at the edge of an image lie: half a pixel inside it, or on it."""
Orientation = Literal["openexr", "gl"]
"""How the faces of a cube are turned."""
Domain = Literal["frequency", "angular"]
"""Where a map is prefiltered."""
Precision = Literal["auto", "half", "float"]
"""Pixel type of a written image; ``auto`` is half unless a value exceeds its range."""
LevelMapping = Literal["linear", "filament", "unreal"]
"""How roughness rises with the levels of a split sum."""
Law = Literal["lobe", "paper"]
"""What attenuates the degrees of a spherical harmonic exponential."""

CENTERS: tuple[str, ...] = get_args(Center)
FRAMES: tuple[str, ...] = get_args(Frame)
SAMPLINGS: tuple[str, ...] = get_args(Sampling)
ORIENTATIONS: tuple[str, ...] = get_args(Orientation)
DOMAINS: tuple[str, ...] = get_args(Domain)
PRECISIONS: tuple[str, ...] = get_args(Precision)
LEVEL_MAPPINGS: tuple[str, ...] = get_args(LevelMapping)
LAWS: tuple[str, ...] = get_args(Law)

REPRESENTATIONS: dict[str, str] = {
    "shrm": "shrm",
    "cabral": "explicit",
    "kautz-mccool": "explicit",
    "lightfield": "explicit",
    "irradiance": "irradiance",
    "splitsum": "splitsum",
    "she": "she",
}
"""What ``--to`` names, and the folder of `shrm_cli.maps` that makes, writes and reads it."""

# ---- limits --------------------------------------------------------------------------------------

MAX_ORDER_F = 512
MAX_ORDER_P = 32
MAX_CUBE_SIZE = 4096
"""Texels along the edge of a map's face."""
MAX_EXPONENTIAL_ORDER = 16
"""Of the factors P and Q of a spherical harmonic exponential."""
MIN_ROUGHNESS = 0.05
"""The least perceptual roughness of GGX, whose lobe is then 0.3 degrees wide."""
MAX_LEVELS = 64
"""Levels of a split sum."""

# ---- defaults ------------------------------------------------------------------------------------

DEFAULT_EPS = 0.03
"""The fraction of a BRDF's energy that a map may miss."""
DEFAULT_ROUGHNESS = 0.5
"""Perceptual roughness of the surface that maps of light alone are shown as."""
DEFAULT_FITTED_ROUGHNESS = (0.45, 1.0)
"""Perceptual roughness that a spherical harmonic exponential is fitted to, as in its paper."""
DEFAULT_FACTOR_ORDERS = (4, 2)
"""Orders P and Q of a spherical harmonic exponential, as in its paper."""
