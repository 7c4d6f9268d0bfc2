"""What files say of surfaces: numbers and textures in the terms of glTF's metallic-roughness model.

Textures are named here, and are read only where a picture is drawn of them.
"""

from pathlib import Path
from typing import Literal

from shrm_cli.records import record

Wrap = Literal["repeat", "clamp", "mirror"]
Matrix = tuple[float, float, float, float, float, float]


@record
class Texture:
    """A texture over a mesh."""

    picture: Path | bytes | str
    """The file of its pixels, or the content of one, or a text that says why there is none."""
    is_srgb: bool = False
    """Whether its colours are encoded as sRGB has it."""
    uv_set: int = 0
    """The texture coordinates that it lies over. One of 0 and 1."""
    matrix: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    """Two rows that multiply columns (u, 1 - v, 1), and give the place in shares of the width from
    the left and of the height from the top."""
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    """What is to the left and right, and above and below."""
    is_nearest: bool = False
    """Whether its pixels are seen as squares where they are larger than those of the picture."""


@record
class SurfaceMaterial:
    """A surface, whose numbers are factors of its textures."""

    name: str = ""
    """Empty if it has none."""
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Linear RGB, 0 .. 1."""
    metallic: float = 1.0
    roughness: float = 1.0
    """`metallic` and `roughness`: 0 .. 1; GGX's alpha is the square of the roughness."""
    color_map: Texture | None = None
    """Base colour, and opacity in alpha."""
    metallic_map: Texture | None = None
    metallic_channel: int = 2
    roughness_map: Texture | None = None
    """`metallic_map` and `roughness_map`: of which the channels `metallic_channel` and
    `roughness_channel` count."""
    roughness_channel: int = 1
    normal_map: Texture | None = None
    """Normals in the tangent frame, x along u and y along v: each channel 0 .. 1 for -1 .. 1."""
    normal_scale: float = 1.0
    """Factor of x and y of the normals."""
    occlusion_map: Texture | None = None
    """In red the share of the light that reaches the surface."""
    occlusion_strength: float = 1.0
    """0 .. 1, how far it counts."""
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What the surface emits, linear RGB, at least 0."""
    emission_map: Texture | None = None
    colored: Literal["", "linear", "srgb"] = ""
    """How vertex colours are encoded that multiply the base colour; empty where none do."""
    opacity: float = 1.0
    """Factor of the opacity."""
    cutoff: float | None = None
    """The least opacity that is seen; None where all of it is."""
    unread: tuple[str, ...] = ()
    """What else the file says of it, which is not drawn."""

    @property
    def textures(self) -> tuple[Texture, ...]:
        maps = (
            self.color_map, self.metallic_map, self.roughness_map, self.normal_map,
            self.occlusion_map, self.emission_map,
        )  # fmt: skip
        return tuple(each for each in maps if each is not None)
