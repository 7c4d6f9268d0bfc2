"""A map of every form, and what code must compute from it.

Cubes and tables are filtered here; what is done with them, the maps tell. That they tell what the
page of engines says is tested by code that shares nothing with them.
"""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from research.bilinear import AXES
from shrm_cli.brdf.environment.material_albedo import material_albedo
from shrm_cli.brdf.library import find_model
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.explicit import explicit
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.lamps.lobe import LobeTable
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.principal import principal
from shrm_cli.maps.principal.brushed import BrushedLobe
from shrm_cli.maps.principal.functions import TABLES
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.product.product import ProductTexture, VaryingProduct
from shrm_cli.maps.product.steps import Steps
from shrm_cli.maps.shader.source import ggx_moments
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential, exponent_series
from shrm_cli.maps.shrm import shrm as shrm_module
from shrm_cli.maps.shrm.shrm import CompressedShrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.splitsum import split_sum
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.probe.disc import Disc
from shrm_cli.vocabulary import NO_TAPS
from tests.brute_force import unit
from tests.maps.scenes import EXPLICIT, make_info, make_shrm

SURFACES = ((0.62, (0.9, 0.5, 0.04)), (0.3, (1.0, 1.0, 1.0)), (1.0, (0.04, 0.04, 0.04)))
"""Roughness and f0 of the surfaces that light for any surface is shown with."""


class Bilinear:
    """Bilinear filtering of a cube without seams, in place of `CubeSampler`.

    A texel beyond an edge is the one that touches the edge on the other side. Beyond a corner it
    is the mean of the three that touch the corner.
    """

    def __init__(self, image, sampling="center"):
        self.size = image.shape[1]
        self.faces = np.asarray(image, dtype=float).reshape(6, self.size, self.size, -1)
        border = sampling == "border" and self.size > 1
        self.scale, self.shift = ((self.size - 1) / 2, 0.0) if border else (self.size / 2, 0.5)

        wide = [
            [[self._texel(face, row, column) for column in range(-1, self.size + 1)]
             for row in range(-1, self.size + 1)]
            for face in range(6)
        ]  # fmt: skip
        self.wide = np.array(wide)

    def __call__(self, directions):
        shape = np.shape(directions)[:-1]
        d = np.asarray(directions, dtype=float).reshape(-1, 3)
        face = np.argmax(d @ AXES[:, 0].T, axis=1)
        s, t = (np.sum(d * AXES[face, k], axis=1) for k in (1, 2))
        forward = np.sum(d * AXES[face, 0], axis=1)
        x, y = ((k / forward + 1) * self.scale - self.shift for k in (s, t))
        column, row = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - column)[:, None], (y - row)[:, None]
        at = lambda i, j: self.wide[face, row + i + 1, column + j + 1]  # noqa: E731
        above = (1 - fx) * at(0, 0) + fx * at(0, 1)
        below = (1 - fx) * at(1, 0) + fx * at(1, 1)
        return ((1 - fy) * above + fy * below).reshape(*shape, -1)

    def _texel(self, face, row, column):
        last = self.size - 1
        inside = [min(max(k, 0), last) for k in (row, column)]
        if (row, column) == tuple(inside):
            return self.faces[face, row, column]
        if row != inside[0] and column != inside[1]:
            near = self.faces[face, inside[0], inside[1]]
            beside = self._texel(face, row, inside[1]) + self._texel(face, inside[0], column)
            return (near + beside) / 3
        # Go a little beyond the edge, at the place of the texel along it.
        s, t = ((2 * inside[k] + 1) / self.size - 1 for k in (1, 0))
        s = np.sign(column - inside[1]) * 1.000001 if column != inside[1] else s
        t = np.sign(row - inside[0]) * 1.000001 if row != inside[0] else t
        point = AXES[face, 0] + s * AXES[face, 1] + t * AXES[face, 2]
        other = int(np.argmax(AXES[:, 0] @ point))
        s, t = AXES[other, 1:] @ point
        place = [min(max(int(np.floor((k + 1) * self.size / 2)), 0), last) for k in (t, s)]
        return self.faces[other, place[0], place[1]]


def filter_bilinearly(monkeypatch):
    """Let all maps filter their cubes as shaders do."""
    for module in (explicit, principal, shrm_module, split_sum):
        monkeypatch.setattr(module, "CubeSampler", Bilinear)
    exact, step = BrushedLobe.parts, np.pi / 48  # a 24th of a quarter turn

    def stepped(lobe, theta, psi):
        low = np.floor(psi / step)
        share = (psi / step - low)[:, None, None]
        below, above = (exact(lobe, theta, (low + k) * step) for k in (0, 1))
        return (1 - share) * below + share * above

    monkeypatch.setattr(BrushedLobe, "parts", stepped)
    values = ProductTexture.values
    monkeypatch.setattr(
        ProductTexture, "values", lambda made, *given: values(made, *given, linear=True)
    )


def cube(rng, size, count):
    return rng.normal(size=(6 * size, size, count, 3))


def lobe(seed, center="reflection", degrees=(3, 1, 0), size=4, albedo=True):
    rng = np.random.default_rng(seed)
    functions = rng.standard_normal((sum(p + 1 for p in degrees), TABLES[0], 3))
    # Where the view is the central direction there is no azimuth, nor any part of q > 0.
    orders = np.concatenate([np.arange(p + 1) for p in degrees])
    functions[orders > 0, 0] = 0.0
    divided = rng.random((TABLES[0], 3)) + 0.5 if albedo else None
    cubes = cube(rng, size, sum(2 * p + 1 for p in degrees))
    return Lobe(cubes, degrees, functions, center, divided)


def brushed_lobe(seed, waves, center="reflection", degrees=(3, 1, 0), size=4):
    """A lobe with functions of the azimuth, those of q = 0 without imaginary parts."""
    rng = np.random.default_rng(seed)
    functions = rng.standard_normal((sum(p + 1 for p in degrees), len(waves), 31, 3))
    cubes = cube(rng, size, sum(2 * p + 1 for p in degrees))
    return BrushedLobe(cubes, degrees, functions, center, None, np.array(waves))


def split_sum_of(mapping, roughness, sizes, sampling="center"):
    rng = np.random.default_rng(len(sizes))
    levels = [np.abs(cube(rng, size, 1))[:, :, 0] for size in sizes]
    info = replace(make_info(4, 0), brdf={})
    return SplitSum(tuple(levels), roughness, mapping, info, sampling)


def of_material(name, parameters):
    plain = split_sum_of("linear", (0.2, 0.6, 1.0), (8, 4, 2))
    info = replace(plain.info, brdf={"name": name, "parameters": parameters})
    center = "normal" if name == "disney-diffuse" else "reflection"
    return replace(plain, info=info, level_info=(info,) * 3, center=center)


def exponential(law):
    rng = np.random.default_rng(9)
    p, q = 0.3 * rng.normal(size=(25, 3)), 0.3 * rng.normal(size=(8, 3))
    return SphericalHarmonicExponential(p, q, (0.2, 1.0), make_info(4, 0), law)


def summed():
    terms = (
        make_shrm(3, 1, 4, "normal", seed=4),
        CompressedShrm.from_shrm(make_shrm(4, 3, 6, seed=5), 3),
        make_shrm(3, 2, 8, seed=6),
    )
    return SummedShrm(terms, make_info(4, 3))


parsed = cache(parse_spec)
"""It keeps layers, which take seconds to tabulate."""


def lamps(spec, within):
    """A map with three discs beside it, one of them large; some of the points mirror them."""
    normals, views = points(60)
    mirrored = 2 * np.sum(normals * views, axis=1)[:, None] * normals - views
    axes = mirrored[[10, 20, 30]] + [[0.01, 0, 0], [0, 0.005, 0], [0, 0, 0.02]]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    lights = np.array([[90.0, 70.0, 20.0], [1.0, 2.0, 3.0], [0.0, 40.0, 7.0]])
    discs = tuple(map(Disc, axes, (0.01, 0.08, 0.02), lights))
    return LampMap(within, discs, 0.5, 0.0, parsed(spec))


def lamps_of_table(spec, within):
    """A map whose lamps are reflected as a table of a BRDF says."""
    return replace(lamps(spec, within), known=LobeTable.of(parsed(spec)))


def product(channels, order, size=9):
    rng = np.random.default_rng(order)
    count = (order + 1) ** 2
    table = rng.normal(size=(size, size, count, channels))
    return ProductTexture(table, make_info(order, 0)).lit(rng.normal(size=(count, 3)))


def varying(channels, axes, textures, order=2, size=9):
    """Random textures with random weights, or one for each value of a single parameter."""
    rng = np.random.default_rng(textures)
    count = (order + 1) ** 2
    tables = rng.normal(size=(textures, size, size, count, channels))
    shape = [len(own) for own in axes.values()]
    weights = np.eye(textures) if len(axes) == 1 else rng.normal(size=(*shape, textures))
    each = [ProductTexture(table, make_info(order, 0)) for table in tables]
    return VaryingProduct.of(each, Steps(axes, weights)).lit(rng.normal(size=(count, 3)))


def explicit_map(name, center="reflection"):
    count = {"cabral": 12, "kautz-mccool": 5, "lightfield": 16}[name]
    rng = np.random.default_rng(count)
    images = np.moveaxis(cube(rng, 4, count), 2, 0)
    return EXPLICIT[name](images, center, make_info(4, 2))


FORMS = {
    "principal": lambda: PrincipalMap((lobe(0),), make_info(4, 3)),
    "principal sum": lambda: PrincipalMap(
        (lobe(1, "normal", (2, 0), 8, albedo=False), lobe(2, degrees=(6,)), lobe(3, "tangent")),
        make_info(4, 3),
    ),
    "principal fine": lambda: PrincipalMap((lobe(5, degrees=(12, 2, 2)),), make_info(4, 3)),
    "principal border": lambda: PrincipalMap((lobe(4, size=5),), make_info(4, 3), "border"),
    "principal brushed": lambda: PrincipalMap(
        (brushed_lobe(6, [(-2, 0), (0, 0), (4, 0)]),), make_info(4, 3)
    ),
    "principal brushed sum": lambda: PrincipalMap(
        (
            brushed_lobe(7, [(-3, 0), (0, 0), (1, 1)], "normal", (5, 2)),
            lobe(8, "normal", (2, 0), 8, albedo=False),
            brushed_lobe(9, [(2, 0), (0, 0)], degrees=(12, 0)),
        ),
        make_info(4, 3),
    ),
    "shrm": lambda: make_shrm(4, 3, 6),
    "shrm normal": lambda: make_shrm(4, 2, 5, "normal", seed=2, sampling="border"),
    "shrm tangent": lambda: make_shrm(4, 2, 4, "tangent", seed=3),
    "shrm local": lambda: make_shrm(4, 2, 8, frame="local"),
    "shrm compressed": lambda: CompressedShrm.from_shrm(make_shrm(4, 4, 6), 5),
    "shrm compressed local": lambda: CompressedShrm.from_shrm(make_shrm(4, 2, 6, frame="local"), 3),
    "shrm sum": summed,
    "splitsum linear": lambda: split_sum_of("linear", (0.0, 0.4, 0.7, 1.0), (16, 9, 4, 2)),
    "splitsum filament": lambda: split_sum_of("filament", (0.1, 0.5, 1.0), (8, 8, 4), "border"),
    "splitsum unreal": lambda: split_sum_of("unreal", (0.1, 0.3, 1.0), (8, 4, 1)),
    "splitsum single": lambda: split_sum_of("linear", (1.0,), (4,)),
    "splitsum cloth": lambda: of_material("charlie", {"roughness": 1.0, "color": [0.9, 0.6, 0.2]}),
    "splitsum about the normal": lambda: of_material("disney-diffuse", {"roughness": 1.0}),
    "she lobe": lambda: exponential("lobe"),
    "she paper": lambda: exponential("paper"),
    "product": lambda: product(1, 4),
    "product colored": lambda: product(3, 3),
    "product constant": lambda: product(3, 0),
    "product of many orders": lambda: product(1, 16),
    "product varying": lambda: varying(1, {"ay": (0.1, 0.2, 0.25, 0.7)}, 4),
    "product varying colored": lambda: varying(3, {"a": (0.0, 3.0)}, 2),
    "product varying by many values": lambda: varying(1, {"a": tuple(np.arange(30) ** 2.0)}, 30),
    "product of two parameters": lambda: varying(
        1, {"ax": (0.1, 0.3, 0.4), "ay": (0.1, 0.2, 0.8, 0.9)}, 5
    ),
    "product of two parameters colored": lambda: varying(
        3, {"ax": (0.0, 1.0), "ay": (0.0, 0.1, 1.0)}, 40
    ),
    **{name: lambda name=name: explicit_map(name) for name in EXPLICIT},
    "lamps": lambda: lamps(
        "0.3*ggx:roughness=0.3,f0=0.9/0.5/0.04+0.6*lambertian:albedo=0.5/0.4/0.3",
        make_shrm(4, 3, 6),
    ),
    "lamps of brushed": lambda: lamps(
        "ggx:roughness=0.3,anisotropy=0.6,f0=0.9/0.5/0.04+0.6*lambertian:albedo=0.5/0.4/0.3",
        FORMS["principal brushed"](),
    ),
    "lamps with a film": lambda: lamps(
        "ggx:roughness=0.3,f0=0.04/0.1/0.3,film=500", make_shrm(2, 2, 4)
    ),
    "lamps beside the normal": lambda: lamps("lambertian", make_shrm(2, 0, 4, "normal", seed=2)),
    "lamps of lobes": lambda: lamps(
        "phong:exponent=60+2*blinn-phong:exponent=90,color=0.5/0.6/0.7+microfacet:sigma=0.1"
        "+0.1*cook-torrance:f0=gold+0.1*oren-nayar+0.1*disney-diffuse",
        explicit_map("cabral"),
    ),
    "lamps of brushed lobes": lambda: lamps(
        "0.5*ward:ax=0.1,ay=0.3,color=gold"
        "+ashikhmin-shirley:nu=200,nv=20,specular=0.5/0.4/0.3,diffuse=0.2/0.3/0.4",
        FORMS["principal brushed"](),
    ),
    "lamps of a coat": lambda: lamps(
        "coated:roughness=0.4,color=0.9/0.6/0.3,base=(0.4*ggx:roughness=0.5,f0=gold+lambertian)",
        make_shrm(2, 2, 4),
    ),
    # Most of these points are beyond reach of the lobe, where few steps are taken.
    "lamps of a polished metal": lambda: lamps("ggx:roughness=0.1", make_shrm(2, 2, 4)),
    "lamps of a table": lambda: lamps_of_table("lafortune:fit=primer", make_shrm(2, 2, 4)),
    "lamps of a table beside the normal": lambda: lamps_of_table(
        "oren-nayar:sigma=0.5", make_shrm(2, 0, 4, "normal", seed=2)
    ),
    "lamps of layers": lambda: lamps(
        "openpbr:base_diffuse_roughness=0.6,base_metalness=0.4,specular_color=0.9/1/0.8,"
        "specular_roughness=0.5,coat_weight=0.6,coat_roughness=0.4,fuzz_weight=0.4",
        make_shrm(2, 2, 4),
    ),
}
"""A maker of a map of each form, with random values, which hide no mistake."""


def points(count, seed=3):
    """Normals and visible views; some normals are axes, edges and corners of cubes."""
    rng = np.random.default_rng(seed)
    normals, views = unit(rng, count), unit(rng, count)
    special = np.array([[1, 0, 0], [0, -1, 0], [1, 1, 0], [0, 1, -1], [1, 1, 1], [-1, 1, -1]])
    normals[: len(special)] = special / np.linalg.norm(special, axis=1, keepdims=True)
    views[:3] = normals[:3]
    views *= np.where(np.sum(normals * views, axis=1) < 0, -1.0, 1.0)[:, None]
    return normals, views


def expected(made, normals, views, roughness=0.5, f0=(1.0, 1.0, 1.0), taps=NO_TAPS):
    """The radiance with cubes filtered bilinearly; call `filter_bilinearly` before it."""
    if made.representation == "splitsum" and not made.is_ggx:
        mirror = 2 * np.sum(normals * views, axis=1)[:, None] * normals - views
        table = _filtered(albedos(made.info.brdf["name"]), normals, views, roughness)
        centers = normals if made.center == "normal" else mirror
        return made.prefiltered(roughness, centers) * table
    if made.representation == "splitsum":
        mirror = 2 * np.sum(normals * views, axis=1)[:, None] * normals - views
        table = _filtered(tables()[0], normals, views, roughness)
        light = made.prefiltered(roughness, mirror)
        if taps != NO_TAPS:
            shown = made.shaded(roughness, taps=taps)
            light = shown.radiance(normals, views) / shown._albedo(np.sum(normals * views, axis=1))
        return light * (f0 * table[:, :1] + table[:, 1:])
    if made.representation == "she":
        across = np.sum(normals * views, axis=1)[:, None] * normals - views
        moments = _filtered(tables()[1], normals, views, roughness).reshape(-1, 2, 3)
        moments[..., 2] *= np.linalg.norm(across, axis=1)[:, None]
        moments = np.moveaxis(moments, 0, -1)
        found = np.empty(normals.shape)
        for channel, one in enumerate(f0):
            series = exponent_series(made, normals, views, roughness, moments, one)
            exponent = series.exponent(made.coefficients[:, channel : channel + 1])[:, 0]
            found[:, channel] = series.albedo * np.exp(np.minimum(exponent, 80))
        return found
    return made.radiance(normals, views)


@cache
def albedos(name):
    """The table of another BRDF, each entry integrated on its own; rows beside no surface are 0."""
    centers = (np.arange(64) + 0.5) / 64
    color = [0.9, 0.6, 0.2] if name == "charlie" else 1.0
    brdf = find_model(name)(color=color)
    beside = {k for p, _ in SURFACES for k in range(64) if abs(64 * p - 0.5 - k) < 2}
    rows = {k: material_albedo(brdf.at_roughness(float(centers[k])), centers) for k in beside}
    return np.stack([rows.get(k, np.zeros_like(rows[min(rows)])) for k in range(64)])


def tables():
    """The tables of GGX: scale and bias, and the moments, which take seconds to compute."""
    moments = ggx_moments()
    return moments[..., [0, 3]] @ [[1.0, 0.0], [-1.0, 1.0]], moments


def _filtered(table, normals, views, roughness):
    """Entries of a table, bilinear between texel centres, clamped to its edge."""
    nodes = (np.arange(len(table)) + 0.5) / len(table)
    cosines = np.clip(np.sum(normals * views, axis=1), nodes[0], nodes[-1])
    rows = np.full(len(cosines), np.clip(roughness, nodes[0], nodes[-1]))
    return RegularGridInterpolator((nodes, nodes), table)(np.stack([rows, cosines], axis=1))


def irradiance(order):
    rng = np.random.default_rng(order)
    return Irradiance(rng.normal(size=((order + 1) ** 2, 3)), replace(make_info(order, 0)))
