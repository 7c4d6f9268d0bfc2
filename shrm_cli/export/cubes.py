"""From our cubes to those that an engine looks up, and to KTX 2 files, as engines read them.

An engine looks up its cube at ``T d``, where d is the direction in world axes, and T is its own
habit: it exchanges or mirrors axes. The graphics interface then finds face and texel as OpenGL
defines it, faces +X -X +Y -Y +Z -Z, the first row on top. What is written is a permutation of
texels, so that nothing is lost.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.export.blocks import astc, uastc
from shrm_cli.export.dds import dds_image
from shrm_cli.export.engine import Engine, Package
from shrm_cli.export.ktx import can_compress, ktx2
from shrm_cli.export.pixels import PICTURES, RGBD, TexelFormat, encoded, loss
from shrm_cli.extras import install
from shrm_cli.files.openimageio import image_of
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.sphere.cube import CubeSampler, cube_directions, face_axes, turned_face

DIFFUSE_SIZE = 64
"""Texels along an edge of a cube of E / pi, which is smooth."""
LARGE = f"not compressed, for want of the package zstandard: {install('export')}"
"""What is told of a file that could be smaller."""


def mirrored(*signs: int) -> Array:
    """Return the matrix T that multiplies x, y and z by signs: shape (3, 3)."""
    return np.diag(np.array(signs, dtype=float))


WORLD = mirrored(1, 1, 1)
"""Lookups at the world direction itself."""


def to_lookup(cube: Array, lookup: ArrayLike = WORLD) -> Array:
    """Return the faces that an engine must have so that it finds the light of a cube.

    `cube`, of shape (6N, N, ...), is an OpenEXR cube in world axes, sampled at texel centers.
    `lookup`, of shape (3, 3), is the matrix T of the engine, a permutation of the axes with signs.

    Returns an array of shape (6, N, N, ...): faces in OpenGL's order and orientation, whose texel
    at the lookup direction c holds the light from ``T^-1 c``.
    """
    back = np.asarray(lookup, dtype=float).T  # the inverse of a signed permutation
    images = cube.reshape(6, -1, *cube.shape[1:])
    result = np.empty_like(images)
    for face, axes in enumerate(face_axes("gl")):
        # The right, down and forward axes of the engine's face, seen from our world.
        turned = axes @ back.T
        axis = int(np.abs(turned[2]).argmax())
        source = 2 * axis + int(turned[2][axis] < 0)  # faces are +X -X +Y -Y +Z -Z
        result[face] = turned_face(images[source], turned, source)
    return result


def diffuse_cube(irradiance: Irradiance, size: int = DIFFUSE_SIZE) -> Array:
    """Return E / pi, the light that a white diffuse surface reflects, as an OpenEXR cube.

    Shape (6 size, size, 3). Where the coefficients ring below 0 it is 0, as light cannot be less.
    """
    return np.maximum(irradiance.resampled(size, "center").cube(), 0) / np.pi


def ktx2_file(
    made: Package,
    name: str,
    levels: Sequence[Array],
    texels: TexelFormat,
    lookup: Array,
    reads_zstd: bool = True,
) -> None:
    """Add a KTX 2 cube to a package, and tell what was clipped or could not be compressed.

    `levels`, each of shape (6 N_k, N_k, 3), are OpenEXR cubes in world axes. `lookup`, of shape (3,
    3), is how the engine looks its cubes up; see the top of this module. `reads_zstd` tells whether
    the engine reads levels that Zstandard has compressed.
    """
    packed = packed_levels(made, name, levels, texels, lookup)
    compress = reads_zstd and can_compress()
    if reads_zstd and not compress and LARGE not in made.told:
        made.told.append(LARGE)
    size = levels[0].shape[1]
    made.add_bytes(name, ktx2(packed, (size, size, 0), texels, compress, faces=6))


def packed_levels(
    made: Package, name: str, levels: Sequence[Array], texels: TexelFormat, lookup: Array = WORLD
) -> list[bytes]:
    """Return the texels of the levels of a file, and tell what was clipped and what is lost."""
    cubes = ((f"level {k}", to_lookup(cube, lookup)) for k, cube in enumerate(levels))
    return packed_images(made, name, cubes, texels)


def packed_images(
    made: Package, name: str, images: Iterable[tuple[str, Array]], texels: TexelFormat
) -> list[bytes]:
    """Do so with other images of a file, shape (count, N, N, 3) each, and what they are called."""
    packed, clips, losses = [], [], []
    for what, image in images:
        data, clipped = encoded(image, texels, what)
        packed.append(data)
        clips.append(clipped)
        losses.append(loss(what, image, decoded(data, texels, *image.shape[:2])))
    made.tell_clipped(name, texels, clips)
    made.tell_lost(name, losses)
    return packed


def decoded(data: bytes, texels: TexelFormat, count: int, size: int) -> Array:
    """Return the light of packed images as a decoder sees it, shape (count, size, size, 3).

    Other code than what packs them reads them: of BC6H this is OpenImageIO, of ASTC Arm's decoder.
    UASTC HDR is rewritten as BC6H first, which has coarser ends.
    """
    if texels.name in ("bc6h", "uastc"):
        data = uastc.to_bc6h(data) if texels.name == "uastc" else data
        image = image_of(dds_image(data, count * size, size), ".dds")
        return image.reshape(count, size, size, 3)
    if texels.edge > 1:
        each = len(data) // count
        images = (data[at : at + each] for at in range(0, len(data), each))
        return np.stack([astc.decode(image, size, size, texels.edge) for image in images])
    if texels.name == "rgba16f":
        values = np.frombuffer(data, "<f2").reshape(count, size, size, 4)[..., :3]
        return values.astype(float)
    if texels.name in PICTURES:
        pixels = np.frombuffer(data, np.uint8).reshape(count, size, size, 4) / 255
        colors, alpha = pixels[..., :3], pixels[..., 3:]
        return colors**2.2 / alpha if texels is RGBD else (colors * (8 - 7 * alpha)) ** 2
    words = np.frombuffer(data, "<u4").reshape(count, size, size)
    if texels.name == "rgb9e5":
        mantissas = np.stack([words >> shift & 511 for shift in (0, 9, 18)], axis=-1)
        return np.ldexp(mantissas.astype(float), (words >> 27).astype(int)[..., None] - 24)
    # Unsigned floats are half floats without a sign and without their last bits.
    channels = [(words & 2047) << 4, (words >> 11 & 2047) << 4, (words >> 22) << 5]
    return np.stack(channels, axis=-1).astype(np.uint16).view(np.float16).astype(float)


# ---- the levels of a split sum, as an engine looks them up ---------------------------------------
# The levels of a file are taken where they fit the engine's law, and refused where they do not,
# with the command that makes the right ones.


_SAME = 5e-4
"""Roughnesses that differ by this much are the same: files name them with few digits."""


def levels_of_map(
    split: SplitSum, path: str, engine: Engine, size: int | None
) -> tuple[tuple[Array, ...], tuple[float, ...], list[str]]:
    """Take the levels of a split sum for an engine.

    `size` is the number of texels along an edge of level 0, by default those of the file.

    Returns OpenEXR cubes of shape (6 N_k, N_k, 3) in world axes, their roughnesses, and a sentence
    about each level that was interpolated to the engine's sizes.
    """
    wanted = split.size if size is None else size
    sizes = engine.sizes(wanted)
    roughness = engine.roughness(sizes)
    # A map of few texels is not worth an environment of as few levels.
    advised = max(split.size, engine.default_size) if size is None else size
    command = _command(engine, advised, split.lobe)
    if len(roughness) != len(split.roughness) or not np.allclose(
        roughness, split.roughness, rtol=0, atol=_SAME
    ):
        raise MapError(
            f"{path}: its levels have roughness {_listed(split.roughness)}; {engine.title} looks "
            f"up {_listed(roughness)} at size {wanted}; make it by {command}, or "
            "export the probe itself"
        )
    if split.size != wanted:
        raise MapError(
            f"{path}: its level 0 has {split.size} texels along an edge, not {wanted}; make it by "
            f"{command}, or export the probe itself"
        )
    levels, changed = [], []
    for k, (cube, texels) in enumerate(zip(split.levels, sizes, strict=True)):
        same = cube.shape[1] == texels and split.sampling == "center"
        levels.append(cube if same else _interpolated(cube, split, texels))
        changed += [] if same else [f"{k} (from {cube.shape[1]} to {texels})"]
    told = [f"levels {', '.join(changed)} were interpolated"] if changed else []
    return tuple(levels), roughness, told


def _interpolated(cube: Array, split: SplitSum, size: int) -> Array:
    """Return a level with other texels; levels are smooth, so that this hardly changes them."""
    values = CubeSampler(cube, split.sampling)(cube_directions(size))
    return np.maximum(values, min(float(cube.min()), 0.0))  # a cubic filter overshoots


def _command(engine: Engine, size: int, lobe: str) -> str:
    """Return the command that makes the levels of an engine."""
    sizes = engine.sizes(size)
    to = "--to splitsum" if lobe == "ggx" else f"--to splitsum --brdf {lobe}"
    if engine.mapping is None:
        levels = f"--levels {','.join(f'{value:.6g}' for value in engine.roughness(sizes))}"
    else:
        levels = f"--mapping {engine.mapping} --levels {len(sizes)}"
    return f"shrm prefilter PROBE {to} {levels} --mips --size {size}"


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
