"""How much `make tables` and `make survey` make: everything, or a short form that takes seconds."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Extent:
    """Which cases are made, and how large their pictures are.

    Attributes
    ----------
    face_sizes : tuple of int
        Texels along a face's edge in tables 5.4 and 5.5.
    exponents, sigmas : tuple of float
        The Phong lobes of table 5.4, and the microfacet lobes of table 5.5.
    repeats : int
        How often the frequency side of these tables is timed.
    picture : int
        Width and height of the spheres in the figures, pixels.
    source_rows : int
        The height that probes are averaged down to for the truth of tables and figures.
    known : tuple of int
        The orders F and P to which the reflected light of figures 5.8 and 5.9 counts as known, and
        the texels along a face's edge of its maps.
    materials : tuple of str
        The BRDFs that stand for those of figure 5.7.
    roughnesses : tuple of float
        The perceptual roughnesses at which SH exponentials and split sums are compared.
    glossy_probes : int
        The most probes under which they are compared.
    glossy_pictures : tuple of int
        Width and height of these spheres: of the one from the front, of those from other sides,
        and of those that are shown.
    seen, seen_rows, seen_picture, seen_pairs
        The BRDFs of the page on what is seen, the height of its probes (twice that for sharp
        lobes), the width and height of its spheres, and the number of pairs of a mirror direction
        and a view for predicted errors.
    cube : int
        Texels along a face's edge of the Phong cubes beside cmft.
    survey : tuple of str
        The BRDFs of the survey; empty for all.
    survey_rows, survey_picture : int
        The height of its probes, whose pixels are to be narrower than the lobes, and the width and
        height of its spheres.
    product_texels : int
        Texels along an edge of product textures.
    product_exponents : tuple of float
        The exponents at which the textures of figure 4 of product textures are made.
    product_lobes, product_most
        The exponents nu and nv of the models in figure 6, and its most coefficients.
    product_models : tuple of str
        The models of figure 8.
    product_picture, product_small : int
        The width and height of the pictures of meshes, and of the spheres of figure 6.
    product_source : int
        The height that probes are averaged down to for the truth of product textures.
    product_points : int
        How many points are drawn at random to measure errors of product textures.
    product_rows : int
        How finely surfaces that are made in code are divided: the knot has 10 rows^2 vertices.
    product_rays : int
        Rays a vertex of baked transfer; there are four times as many for the truth.
    product_probes : tuple of 3 int
        Probes along the edges of the room of the incident light field.
    product_looks : int
        Directions along which a probe looks; there are four times as many for the truth.
    """

    face_sizes: tuple[int, ...] = (128, 52)
    exponents: tuple[float, ...] = (8, 16, 32, 64, 128, 256, 512)
    sigmas: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5)
    repeats: int = 15
    picture: int = 128
    source_rows: int = 128
    known: tuple[int, int, int] = (48, 16, 64)
    materials: tuple[str, ...] = (
        "lafortune:fit=bluepaint", "lafortune:fit=brushedmetal", "lafortune:fit=clay",
        "lafortune:fit=felt", "lafortune:fit=primer", "lafortune:fit=skin",
        "oren-nayar:sigma=0.7", "disney-diffuse", "charlie", "blinn-phong", "ashikhmin-shirley",
        "cook-torrance", "ward", "ggx:roughness=0.6", "microfacet:sigma=0.5", "kajiya-kay",
    )  # fmt: skip
    roughnesses: tuple[float, ...] = tuple(np.linspace(0.5, 1.0, 12).tolist())
    glossy_probes: int = 8
    glossy_pictures: tuple[int, int, int] = (64, 32, 128)
    seen: tuple[str, ...] = (
        "lambertian", "phong:exponent=32", "phong:exponent=64", "phong:exponent=512",
        "microfacet:sigma=0.1", "microfacet:sigma=0.2", "microfacet:sigma=0.5", "oren-nayar",
        "ggx:roughness=0.3,f0=1", "ggx:roughness=0.5,f0=1", "ggx:roughness=0.7,f0=1",
        "ggx:roughness=0.3,f0=0.04", "ggx:roughness=0.5,f0=0.04", "ggx:roughness=0.7,f0=0.04",
    )  # fmt: skip
    seen_rows: int = 128
    seen_picture: int = 40
    seen_pairs: int = 4000
    cube: int = 128
    survey: tuple[str, ...] = ()
    survey_rows: int = 256
    survey_picture: int = 20
    product_texels: int = 64
    product_exponents: tuple[float, ...] = (2, 8, 16, 32, 64)
    product_lobes: tuple[tuple[int, int], ...] = ((12, 4), (24, 8), (48, 16))
    product_most: int = 225
    product_models: tuple[str, ...] = (
        "ashikhmin-shirley:nu=48,nv=4", "poulin-fournier:distance=2,exponent=20",
    )  # fmt: skip
    product_picture: int = 256
    product_small: int = 96
    product_source: int = 64
    product_points: int = 400
    product_rows: int = 32
    product_rays: int = 1024
    product_probes: tuple[int, int, int] = (12, 6, 8)
    product_looks: int = 1024


FULL = Extent()
SHORT = Extent(
    face_sizes=(16,),
    exponents=(32,),
    sigmas=(0.5,),
    repeats=1,
    picture=16,
    source_rows=16,
    known=(12, 11, 16),
    materials=("lafortune:fit=clay",),
    roughnesses=(0.6, 1.0),
    glossy_probes=1,
    glossy_pictures=(8, 6, 16),
    seen=("phong:exponent=32", "microfacet:sigma=0.5"),
    seen_rows=32,
    seen_picture=8,
    seen_pairs=50,
    cube=16,
    survey=("lambertian", "microfacet:sigma=0.5"),
    survey_rows=32,
    survey_picture=8,
    product_texels=8,
    product_exponents=(4, 8),
    product_lobes=((12, 4),),
    product_most=9,
    product_models=("ashikhmin-shirley:nu=48,nv=4",),
    product_picture=48,
    product_small=32,
    product_source=16,
    product_points=30,
    product_rows=12,
    product_rays=64,
    product_probes=(6, 4, 4),
    product_looks=64,
)
