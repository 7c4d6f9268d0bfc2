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
    """A texture over a mesh.

    Attributes
    ----------
    picture : Path or bytes or str
        The file of its pixels, or the content of one, or a text that says why there is none.
    is_srgb : bool
        Whether its colours are encoded as sRGB has it.
    uv_set : {0, 1}
        The texture coordinates that it lies over.
    matrix : tuple of 6 float
        Two rows that multiply columns (u, 1 - v, 1), and give the place in shares of the width
        from the left and of the height from the top.
    wrap : tuple of 2 {"repeat", "clamp", "mirror"}
        What is to the left and right, and above and below.
    is_nearest : bool
        Whether its pixels are seen as squares where they are larger than those of the picture.
    """

    picture: Path | bytes | str
    is_srgb: bool = False
    uv_set: int = 0
    matrix: Matrix = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    is_nearest: bool = False


@record
class SurfaceMaterial:
    """A surface, whose numbers are factors of its textures.

    Attributes
    ----------
    name : str
        Empty if it has none.
    base_color : tuple of 3 float
        Linear RGB, 0 .. 1.
    metallic, roughness : float
        0 .. 1; GGX's alpha is the square of the roughness.
    color_map : Texture, optional
        Base colour, and opacity in alpha.
    metallic_map, roughness_map : Texture, optional
        Of which the channels `metallic_channel` and `roughness_channel` count.
    metallic_channel, roughness_channel : int
    normal_map : Texture, optional
        Normals in the tangent frame, x along u and y along v: each channel 0 .. 1 for -1 .. 1.
    normal_scale : float
        Factor of x and y of the normals.
    occlusion_map : Texture, optional
        In red the share of the light that reaches the surface.
    occlusion_strength : float
        0 .. 1, how far it counts.
    emission : tuple of 3 float
        What the surface emits, linear RGB, at least 0.
    emission_map : Texture, optional
    colored : {"", "linear", "srgb"}
        How vertex colours are encoded that multiply the base colour; empty where none do.
    opacity : float
        Factor of the opacity.
    cutoff : float, optional
        The least opacity that is seen; None where all of it is.
    unread : tuple of str
        What else the file says of it, which is not drawn.
    """

    name: str = ""
    base_color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metallic: float = 1.0
    roughness: float = 1.0
    color_map: Texture | None = None
    metallic_map: Texture | None = None
    metallic_channel: int = 2
    roughness_map: Texture | None = None
    roughness_channel: int = 1
    normal_map: Texture | None = None
    normal_scale: float = 1.0
    occlusion_map: Texture | None = None
    occlusion_strength: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_map: Texture | None = None
    colored: Literal["", "linear", "srgb"] = ""
    opacity: float = 1.0
    cutoff: float | None = None
    unread: tuple[str, ...] = ()

    @property
    def textures(self) -> tuple[Texture, ...]:
        """All textures of the material."""
        maps = (
            self.color_map, self.metallic_map, self.roughness_map, self.normal_map,
            self.occlusion_map, self.emission_map,
        )  # fmt: skip
        return tuple(each for each in maps if each is not None)
