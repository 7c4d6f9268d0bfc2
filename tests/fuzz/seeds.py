"""The sound files that the fuzz harness damages, made by the tool itself and by image libraries.

Every kind of file has the commands that read it. In these, ``FILE`` stands for the damaged file,
``OUT`` for an output without its suffix; other names are sound files of the same folder. Where a
command holds ``WORD``, the file is left sound, and a damaged argument is put there.
"""

import base64
import contextlib
import io
import json
import shutil
import struct
import zlib
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO as oiio

from shrm_cli.geometry.load import load_mesh
from shrm_cli.geometry.texels import Texels
from shrm_cli.transfer.file import read_transfer, write_transfer
from tests.brdf.measured.rgl_files import brushed, material, tensor_file
from tests.cli.helpers import noise
from tests.fuzz.others import NEEDED, make_others
from tests.geometry import shapes
from tests.probe import scenes

SOUND = "sound.exr"
"""A probe that commands need beside the damaged file."""
MAP = "sound.shrm.exr"
"""A map of it, to compare others with."""
PAINTED = "painted.obj", "worn.gltf", "paint.png"
"""Meshes whose materials or texture are the damaged file, and the texture of the former."""
LIGHT = "map.splitsum.exr"
"""A map of light alone, which the materials of meshes are shown with."""
MESH = "sound.obj"
"""A mesh that scenes name, and that transfer was baked for."""
IRRADIANCE, PRODUCT = "sound.irradiance.exr", "sound.product.exr"
"""Light and a surface that meshes with transfer are rendered with."""

_PROBE = (
    "info FILE --json --linearize",
    "info FILE",
    "convert FILE --to strip --size 4 -o OUT.exr --linearize",
    "prefilter FILE --to irradiance --size 4 -o OUT.exr --linearize",
    "render sound.shrm.exr --background FILE --size 16 -o OUT.png --linearize",
    "sun FILE -o OUT.exr --light-file OUT.toml --usd OUT.usda --linearize",
    "export FILE --for gltf --size 32 -o OUT --linearize --working rec2020",
    "view sound.shrm.exr --probe FILE --no-truth -o OUT.html --linearize",
    "lookdev FILE --brdf lambertian --eps 0.3 --size 16 -o OUT.png --linearize",
)
_COLORED = (
    "info FILE --json --linearize",
    "info FILE --linearize",
    "convert FILE --to strip --size 4 --working acescg -o OUT.exr --linearize",
    "export FILE --for json -o OUT --linearize --working rec709",
    "view sound.shrm.exr --probe FILE --no-truth -o OUT.html --linearize",
)
_LAMPS = (
    "info FILE --json",
    "sun FILE",
    "sun FILE --json --sun-radius 0.265",
    "sun FILE --for filament",
    "sun FILE -o OUT.exr --light-file OUT.toml --usd OUT.usda",
)
_MIPS = (
    "info FILE --json",
    "convert FILE --to strip --size 4 -o OUT.exr",
    "prefilter FILE --to irradiance --size 4 -o OUT.exr",
    "export FILE --for json -o OUT",
)
_LAYERS = (
    "info FILE",
    "info FILE --json --part 1",
    "render FILE --size 16 -o OUT.png",
    "convert FILE --to strip --part 1 --size 4 -o OUT.exr",
)
_MAP = (
    "info FILE --json",
    "info FILE",
    "render FILE --size 16 -o OUT.png",
    "render FILE --size 16 -o OUT.exr --precision float",
    "compare FILE sound.shrm.exr --size 16 --json --no-flip --view 0,0 -o OUT.exr",
    "compare sound.shrm.exr FILE --size 16 --no-flip --view 0,0 --no-picture",
    "convert FILE --to openexr -o OUT.exr",
    "convert FILE --to shrm -o OUT.exr",
    "convert FILE --to hcross -o OUT.exr",
    "convert FILE --to layers -o OUT.exr",
    "convert FILE --to latlong --view 30,10 --size 4 -o OUT.exr",
    "view FILE -o OUT.html",
    "contact FILE -o OUT.html",
)
_MAP_COMMANDS = {
    "irradiance": (
        "export FILE --for json -o OUT",
        "convert FILE --to irradiance --form zh3 -o OUT.exr",
        "convert FILE --to irradiance --form sh --yaw 20 --working rec2020 -o OUT.exr",
    ),
    "splitsum": (
        "export FILE --for bevy -o OUT",
        "convert FILE --to latlong --mips -o OUT.exr",
    ),
}
"""Commands that take one representation only, by its name."""
_BRDF = (
    "info FILE",
    "reference sound.exr --brdf FILE --size 16 --source-height 2 -o OUT.exr --json",
    "reference sound.exr --brdf 0.5*lambertian+0.5*FILE --size 16 --source-height 2 -o OUT.png",
)
_MATERIAL = (
    "brdf FILE --eps 0.9 --quiet",
    "brdf FILE#paint --eps 0.9 --json",
    "reference sound.exr --brdf FILE#0 --size 16 --source-height 2 -o OUT.exr",
)
_ARGUMENTS = (
    "WORD",
    "info WORD",
    "info FILE --WORD",
    "brdf WORD --quiet --eps 0.5",
    "cache WORD",
    "probe WORD",
    "dfg --size WORD -o OUT.exr",
    "prefilter FILE --brdf WORD --size 4 --order-f 2 --order-p 0 -o OUT.exr",
    "prefilter FILE --brdf ggx:roughness=WORD -o OUT.exr",
    "prefilter FILE --brdf WORD*lambertian -o OUT.exr",
    "prefilter FILE --brdf coated:base=(WORD) --size 4 --order-f 2 --order-p 0 -o OUT.exr",
    "prefilter FILE --to WORD -o OUT.exr",
    "prefilter WORD --to irradiance -o OUT.exr",
    "prefilter FILE --to irradiance --yaw WORD --size 4 -o OUT.exr",
    "prefilter FILE --to irradiance --window WORD --size 4 -o OUT.exr",
    "convert FILE --to strip --size 4 -o WORD.exr",
    "convert FILE --to strip --size 4 --clamp WORD -o OUT.exr",
    "render sound.shrm.exr --size 16 --view WORD -o OUT.png",
    "render sound.shrm.exr --size 16 --exposure WORD -o OUT.png",
    "render sound.shrm.exr --size 16 --background WORD -o OUT.png",
    "compare sound.shrm.exr WORD --size 16 --no-flip --no-picture",
    "render sound.shrm.exr --mesh WORD --size 16 -o OUT.png",
    "render sound.shrm.exr --mesh sound.obj --size 16 --distance WORD -o OUT.png",
    "render sound.shrm.exr --mesh sound.obj --size 16 --brush WORD -o OUT.png",
    "sun FILE --error WORD",
    "sun FILE --sun-radius WORD",
    "info FILE --primaries WORD",
    "export FILE --for WORD -o OUT",
    "export FILE --for json --working WORD -o OUT",
    "contact sound.shrm.exr --title WORD -o OUT.html",
    "view sound.shrm.exr --exposure WORD -o OUT.html",
    "view sound.shrm.exr --max-size WORD -o OUT.html",
    "lookdev FILE --brdf WORD --eps 0.3 --size 16 -o OUT.png",
    "convert sound.shrm.exr --to latlong --view WORD --size 4 -o OUT.exr",
    "convert sound.irradiance.exr --to irradiance --form WORD -o OUT.exr",
)
_PRODUCT = (
    "info FILE --json",
    "render FILE --probe sound.exr --size 16 -o OUT.png",
    "compare FILE --probe sound.exr --size 16 --no-flip --view 0,0 --no-picture",
    "convert FILE --to shrm -o OUT.exr",
)
_LIGHTS = (
    "info FILE",
    "info FILE --json --yaw 20",
    "convert FILE --to strip --size 4 -o OUT.exr",
    "prefilter FILE --to irradiance --size 4 -o OUT.exr",
    "render sound.shrm.exr --background FILE --size 16 -o OUT.png",
    "light edit FILE --set 1,-1=2 --dim 30,20:0.5 --rotate y:30 -o OUT.json",
)
_EDITED = (*_LIGHTS, "light edit FILE --scale 2 --rotate 1/1/0:30 -o OUT.toml")
_MESH = (
    "render sound.shrm.exr --mesh FILE --size 16 -o OUT.png",
    "render sound.shrm.exr --mesh FILE --size 24x16 --brush 1,0,0 --json -o OUT.exr",
    "render map.splitsum.exr --mesh FILE --size 16 --roughness 0.3 -o OUT.png",
)
_OF_OBJ = (
    "render map.splitsum.exr --mesh painted.obj --irradiance sound.irradiance.exr --size 16 "
    "-o OUT.png",
    "render sound.shrm.exr --mesh painted.obj --size 16 --json -o OUT.exr",
)
_OF_GLTF = (
    "render map.splitsum.exr --mesh worn.gltf --size 16 -o OUT.png",
    "render sound.irradiance.exr --mesh worn.gltf --size 16 -o OUT.exr",
)
_ASSET = (
    *_MESH,
    "export sound.exr --for gltf --into FILE --size 32 -o OUT",
    "export sound.exr --for gltf --into FILE --size 32 -o OUT --json",
)
_SCENE = ("render sound.shrm.exr --mesh FILE --size 16 -o OUT.png",)
_KEYS = ("render sound.shrm.exr --mesh FILE --size 16 -o OUT.apng",)
_TRANSFER = (
    "info FILE",
    "info FILE --json",
    "render sound.irradiance.exr --mesh sound.obj --transfer FILE --size 16 -o OUT.png",
    "render --probe sound.exr --mesh sound.obj --transfer FILE --size 16 -o OUT.png",
    "render sound.product.exr --probe sound.exr --mesh sound.obj --transfer FILE --size 16 "
    "-o OUT.exr",
)
_GRID = (
    "info FILE", "info FILE --json", "grid FILE -o OUT.exr", "grid FILE -o OUT.json",
    "render FILE --place 0,0,2 --radius 0.5 --size 16 -o OUT.png",
)  # fmt: skip
_TABLE = ("info FILE", "info FILE --json", "render FILE --size 16 -o OUT.png")


@dataclass(frozen=True)
class Seed:
    """A sound file.

    Attributes
    ----------
    kind : str
        The kind of file, under which cases are counted.
    name : str
        The name of the file in the folder of seeds.
    commands : tuple of str
        The commands that read it.
    """

    kind: str
    name: str
    commands: tuple[str, ...]


def make_seeds(folder: Path) -> list[Seed]:
    """Write all seeds into a folder; the same each time."""
    pixels = noise(8, 16)
    scenes.write(folder / SOUND, pixels)
    with contextlib.chdir(folder):
        probes, maps = _probes(folder, pixels), _maps(folder)
        brdfs = _brdfs(folder)
        _shrm("dfg", "--size", "4", "-o", "dfg.exr")
        _shrm("dfg", "--size", "4", "--moments", "-o", "moments.exr")
        _shrm("product", "lambertian", "--size", "8", "--order", "1", "-o", "product.exr")
    seeds = [
        *(Seed(kind, name, _PROBE) for kind, name in probes),
        *(Seed(kind, name, _COLORED) for kind, name in _colored(folder, pixels)),
        Seed("probe with a lamp", _sunny(folder), _LAMPS),
        *(Seed(kind, name, _map_commands(kind)) for kind, name in maps),
        Seed("mip levels", "mips.exr", _MIPS),
        Seed("layers of a map", "map.layers.exr", _LAYERS),
        *(Seed(kind, name, _BRDF) for kind, name in brdfs),
        *(Seed(kind, name, _MATERIAL) for kind, name in _materials(folder)),
        Seed("product texture", "product.exr", _PRODUCT),
        *(Seed("coefficients of light", name, _LIGHTS) for name in _series(folder)),
        *(Seed("light file", name, _EDITED) for name in _lights(folder)),
        *(Seed("stage of USD", name, _LIGHTS) for name in _stages(folder)),
        Seed("arguments", SOUND, _ARGUMENTS),
        *(Seed(kind, name, _ASSET if "gl" in name else _MESH) for kind, name in _meshes(folder)),
        Seed("materials of OBJ", "m.mtl", _OF_OBJ),
        Seed("texture", "paint.png", _OF_GLTF),
        Seed("scene", "scene.toml", _SCENE),
        Seed("keyframes", "keys.toml", _KEYS),
        *(Seed("transfer", name, _TRANSFER) for name in _transfers(folder)),
        Seed("probe with a box", _captured(folder), _PROBE),
        *(Seed("table of a split sum", name, _TABLE) for name in ("dfg.exr", "moments.exr")),
    ]
    with contextlib.chdir(folder):
        others = [Seed(*row) for row in make_others(folder, _shrm)]
        size = ("--size", "2,1,2", "--samples", "16", "--order", "1")
        _shrm("grid", "lamp.obj", "--probe", SOUND, *size, "-o", "small.grid.npz")
    return [*seeds, *others, Seed("grid of probes", "small.grid.npz", _GRID)]


def _shrm(*arguments: str) -> None:
    """Run a command that must succeed, without what it prints."""
    from shrm_cli.cli.main import main

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            main(list(arguments))
    except SystemExit as stop:
        if stop.code:
            raise AssertionError(f"{arguments}: {said.getvalue()}") from None


def _probes(folder: Path, pixels: np.ndarray) -> list[tuple[str, str]]:
    """Light probes of every format that is read: kinds and names."""
    scenes.write(folder / "scanline.exr", pixels, "half", compression="zip")
    scenes.write(folder / "raw.exr", pixels, compression="none")
    scenes.write(folder / "piz.exr", pixels, "half", compression="piz")
    scenes.write(folder / "tiled.exr", pixels, tile=4, compression="zip")
    scenes.write(folder / "latlong.exr", pixels, textureformat="LatLong Environment")
    scenes.write_exr(folder / "grey.exr", {"Y": pixels[..., 0]})
    scenes.write_exr(folder / "layers.exr", scenes.rgb(pixels, "beauty.{}"))
    _write_parts(folder / "parts.exr", pixels)
    scenes.write(folder / "a.hdr", pixels)
    scenes.write_rgbe(folder / "flat.hdr", pixels)
    scenes.write_old_runs(folder / "runs.hdr", pixels)
    rich = "EXPOSURE=0.5\nCOLORCORR=1 2 1\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329\n"
    text = (folder / "flat.hdr").read_bytes().replace(b"FORMAT", rich.encode() + b"FORMAT", 1)
    (folder / "rich.hdr").write_bytes(text)
    scenes.write_png(folder / "a.png", (pixels * 100).astype(np.uint8))
    scenes.write(folder / "b.png", pixels / 2, "uint16")
    scenes.write(folder / "a.tif", pixels, compression="zip")
    scenes.write(folder / "tiled.tif", pixels, tile=16, compression="none")
    scenes.write_dds_cube(
        folder / "a.dds", (noise(24, 4) * 100).astype(np.uint8).reshape(6, 4, 4, 3)
    )
    _write_half_dds(folder / "half.dds", noise(24, 4))
    scenes.write_pfm(folder / "a.pfm", pixels)
    scenes.write(folder / "a.jpg", pixels / 2, "uint8")
    scenes.write(folder / "a.tga", pixels / 2, "uint8")
    others = ("dpx", "fits", "bmp", "sgi", "webp", "jp2", "jxl", "gif", "rla", "iff", "ico", "pnm")
    written = [f"other.{suffix}" for suffix in others if _is_written(folder, suffix, pixels)]
    exr = ["scanline", "raw", "piz", "latlong", "grey", "layers"]
    return [
        *(("EXR, scanlines", f"{name}.exr") for name in exr),
        ("EXR, tiles", "tiled.exr"),
        ("EXR, parts", "parts.exr"),
        *(("HDR", f"{name}.hdr") for name in ("a", "flat", "rich", "runs")),
        *(("PNG", f"{name}.png") for name in ("a", "b")),
        *(("TIFF", f"{name}.tif") for name in ("a", "tiled")),
        *(("DDS", f"{name}.dds") for name in ("a", "half")),
        ("PFM", "a.pfm"),
        ("JPEG", "a.jpg"),
        ("TGA", "a.tga"),
        *(("other images", name) for name in written),
    ]


def _map_commands(kind: str) -> tuple[str, ...]:
    """The commands for a map of a kind, which begins with the name of its representation."""
    return (*_MAP, *_MAP_COMMANDS.get(kind.split(", ")[1], ()))


def _colored(folder: Path, pixels: np.ndarray) -> list[tuple[str, str]]:
    """Probes that state their primaries, in chunks of a PNG and in ICC profiles."""
    integers = (pixels * 100).astype(np.uint8)
    profile = _profile()
    chunks = {
        "cicp": (b"cICP", bytes([9, 13, 0, 1])),
        "chrm": (
            b"cHRM",
            struct.pack(">8I", 31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000),
        ),
        "srgb": (b"sRGB", b"\0"),
        "icc": (b"iCCP", b"a\0\0" + zlib.compress(profile)),
    }
    for name, chunk in chunks.items():
        scenes.write_png(folder / f"{name}.png", integers, chunk)
    for name in ("icc.tif", "icc.jpg"):
        _write_with_profile(folder / name, integers, profile)
    return [
        *(("PNG with primaries", f"{name}.png") for name in chunks),
        ("ICC profile", "icc.png"),
        ("ICC profile", "icc.tif"),
        ("ICC profile", "icc.jpg"),
    ]


def _write_with_profile(path: Path, integers: np.ndarray, profile: bytes) -> None:
    """Write an 8-bit image that holds an ICC profile, without compression if it can be."""
    height, width, channels = integers.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8)
    if path.suffix == ".tif":
        spec.attribute("compression", "none")
    data = np.frombuffer(profile, np.uint8)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(data)}]"), data)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(integers), output.geterror()
    output.close()


def _profile() -> bytes:
    """An ICC profile of a matrix and curves: Rec.2020 adapted to D50, and a gamma."""

    def numbers(kind: bytes, values: list[float]) -> bytes:
        return kind + struct.pack(f">4x{len(values)}i", *(round(65536 * each) for each in values))

    tags = {
        b"rXYZ": numbers(b"XYZ ", [0.6735, 0.2790, -0.0019]),
        b"gXYZ": numbers(b"XYZ ", [0.1657, 0.6753, 0.0300]),
        b"bXYZ": numbers(b"XYZ ", [0.1251, 0.0456, 0.7969]),
        b"wtpt": numbers(b"XYZ ", [0.9642, 1.0, 0.8249]),
        b"chad": numbers(
            b"sf32", [1.0479, 0.0229, -0.0502, 0.0296, 0.9904, -0.0171, -0.0092, 0.0151, 0.7517]
        ),
        b"rTRC": numbers(b"para", [0]) + struct.pack(">i", round(2.2 * 65536)),
    }
    start, table, body = 132 + 12 * len(tags), b"", b""
    for name, data in tags.items():
        table += struct.pack(">4sII", name, start + len(body), len(data))
        body += data
    head = struct.pack(">I4xI4s4s4s", start + len(body), 0x04300000, b"mntr", b"RGB ", b"XYZ ")
    white = struct.pack(">3i", 0xF6D6, 0x10000, 0xD32D)
    head = (head.ljust(36, b"\0") + b"acsp").ljust(68, b"\0") + white
    return head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + body


def _sunny(folder: Path) -> str:
    """A probe with two lamps; the name of the file. Its pixels are not compressed."""
    pixels = noise(16, 32)
    pixels[4, 9:11] = 4e3, 3e3, 2e3
    pixels[7, 25] = 900
    scenes.write(folder / "sunny.exr", pixels, compression="none")
    return "sunny.exr"


def _lights(folder: Path) -> list[str]:
    """Light files with every way to name a light; the names of the files."""
    (folder / "b.toml").write_text(
        f'working = "rec2020"\n[[probe]]\nfile = "{SOUND}"\nprimaries = "p3"\n'
        f'[[probe]]\nfile = "{SOUND}"\nprimaries = [0.7, 0.3, 0.2, 0.7, 0.14, 0.05, 0.31, 0.33]\n'
        "[[disc]]\nazimuth = 40\nelevation = 30\nradius = 4\nradiance = [9, 8, 7]\n"
        'primaries = "acescg"\n'
    )
    (folder / "a.toml").write_text(
        f'[[probe]]\nfile = "{SOUND}"\nscale = [1, 0.5, 2]\nyaw = 30\nclamp = 2.5\n'
        "[[disc]]\nazimuth = 40\nelevation = -30\nradius = 0.265\nradiance = 1.5e4\n"
        "[[disc]]\ndirection = [1, 0.2, -3]\nsolid_angle = 0.7\nirradiance = [1, 2, 0.5]\n"
    )
    (folder / "c.toml").write_text(
        '[[sh]]\nfile = "light.npy"\nyaw = 30\nscale = [1, 0.5, 2]\nof = "irradiance"\n'
        '[[sh]]\nbasis = "condon-shortley"\ncoefficients = [[1, 2, 3], [0, 1, 0], [1, 1, 0.5], '
        '[-0.1, 0, 0]]\nprimaries = "p3"\n'
    )
    return ["a.toml", "b.toml", "c.toml"]


def _stages(folder: Path) -> list[str]:
    """A stage of USD, where OpenUSD is installed; the name of the file.

    It is text: damaged binary layers crash OpenUSD itself, as docs/usd.md says.
    """
    if find_spec("pxr") is None:
        return []
    (folder / "stage.usda").write_text(
        '#usda 1.0\n(\n upAxis = "Z"\n)\ndef Xform "Rig" {\n float xformOp:rotateZ = 30\n'
        ' uniform token[] xformOpOrder = ["xformOp:rotateZ"]\n def DomeLight_1 "Dome" {\n'
        f"  asset inputs:texture:file = @./{SOUND}@\n  color3f inputs:color = (1, 0.5, 2)\n"
        '  uniform token poleAxis = "scene"\n  float inputs:exposure = 1\n }\n'
        ' def DistantLight "Sun" {\n  float inputs:angle = 0.5\n'
        "  bool inputs:normalize = 1\n }\n}\n"
        'def "Copy" (references = </Rig>) {}\n'
    )
    return ["stage.usda"]


def _series(folder: Path) -> list[str]:
    """Files of coefficients of light; their names."""
    light = np.concatenate([[[3, 2, 1]], np.linspace(-0.2, 0.2, 24).reshape(8, 3)])
    np.save(folder / "light.npy", light)
    three = {"object": {"type": "LightProbe", "intensity": 2, "sh": light.ravel().tolist()}}
    (folder / "light.json").write_text(json.dumps(three))
    rows = "".join(f"({r}, {g}, {b}); // pre-scaled base\n" for r, g, b in light)
    (folder / "light.txt").write_text(rows)
    return ["light.npy", "light.json", "light.txt"]


def _is_written(folder: Path, suffix: str, pixels: np.ndarray) -> bool:
    """Whether this OpenImageIO writes a format, and if so the file `other`."""
    output = oiio.ImageOutput.create(f"a.{suffix}")
    oiio.geterror()
    if output is not None:
        kind = "float" if suffix == "fits" else "uint8"
        scenes.write(folder / f"other.{suffix}", pixels / 2, kind)
    return output is not None


def _write_parts(path: Path, pixels: np.ndarray) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part({**header, "name": name}, scenes.rgb(pixels)) for name in ("beauty", "second")
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(path))


def _write_half_dds(path: Path, cube: np.ndarray) -> None:
    """A cube of half floats as Direct3D 9 writes it (D3DFMT 113)."""
    size = cube.shape[1]
    header = struct.pack("<4sIIIIIII44x", b"DDS ", 124, 0x1007, size, size, 0, 0, 0)
    pixel_format = struct.pack("<IIIIIIII", 32, 4, 113, 0, 0, 0, 0, 0)
    caps = struct.pack("<IIIII", 0x1008, 0xFE00, 0, 0, 0)
    alpha = np.ones((*cube.shape[:2], 1), np.float32)
    data = np.concatenate([cube, alpha], axis=-1).astype("<f2").tobytes()
    path.write_bytes(header + pixel_format + caps + data)


def _maps(folder: Path) -> list[tuple[str, str]]:
    """Maps of every representation, and the same with pixels that are not compressed."""
    glossy = ("--brdf", "ggx:roughness=0.6", "--order-f", "6", "--order-p", "2", "--size", "4")
    made = {
        "shrm": ("--to", "shrm", *glossy, "--frame", "global"),
        "local": ("--to", "shrm", *glossy, "--frame", "local"),
        "sum": (
            "--brdf", "0.5*lambertian+0.5*phong:exponent=4", "--eps", "0.2", "--size", "4",
            "--split",
        ),
        "cabral": ("--to", "cabral", *glossy),
        "kautz-mccool": ("--to", "kautz-mccool", *glossy, "--slices", "4"),
        "lightfield": ("--to", "lightfield", *glossy, "--views", "3"),
        "principal": (
            "--to", "principal", "--brdf", "ggx:roughness=0.6", "--eps", "0.3", "--size", "4",
        ),
        "brushed": (
            "--to", "principal", "--brdf", "ward:ax=0.5,ay=0.3", "--maps", "3", "--size", "4",
        ),
        "irradiance": ("--to", "irradiance", "--size", "4"),
        "splitsum": ("--to", "splitsum", "--size", "8"),
        "mips": ("--to", "splitsum", "--size", "32", "--levels", "3", "--mips"),
        "boxed": ("--to", "splitsum", "--size", "8", "--box", "-1,-1,-1,1,1,1"),
        "she": ("--to", "she",),
    }  # fmt: skip
    _shrm("prefilter", SOUND, *made["shrm"], "-o", MAP)
    found = []
    for name, options in made.items():
        path = f"map.{name}.exr"
        _shrm("prefilter", SOUND, *options, "-o", path)
        kind = f"map, splitsum, {name}" if name in ("mips", "boxed") else f"map, {name}"
        plain = f"plain.{name}.exr"
        _uncompressed(folder / path, folder / plain)
        found += [(kind, path), (kind, plain)]
    for form in ("zh3", "zh3-channel"):
        path = f"map.{form}.exr"
        _shrm("convert", "map.irradiance.exr", "--to", "irradiance", "--form", form, "-o", path)
        _uncompressed(folder / path, folder / f"plain.{form}.exr")
        found += [("map, irradiance, ZH3", path), ("map, irradiance, ZH3", f"plain.{form}.exr")]
    _shrm("convert", MAP, "--to", "hcross", "-o", "map.hcross.exr")
    _shrm("convert", MAP, "--to", "layers", "-o", "map.layers.exr")
    _shrm("convert", "map.mips.exr", "--to", "latlong", "--mips", "-o", "mips.exr")
    return [*found, ("map, shrm", "map.hcross.exr")]


def _uncompressed(source: Path, target: Path) -> None:
    """Copy an EXR without compression, so that what is damaged are pixels and not a checksum."""
    with OpenEXR.File(str(source), separate_channels=True) as file:
        for part in file.parts:
            part.header["compression"] = OpenEXR.NO_COMPRESSION
        file.write(str(target))


def _brdfs(folder: Path) -> list[tuple[str, str]]:
    """Measured BRDFs of every format but MERL's, whose files are 35 MB."""
    from shrm_cli.brdf.measured.table import sample_table, write_table
    from shrm_cli.brdf.spec import parse_spec
    from tests.brdf.measured.goniometer_files import write_goniometer

    rough = parse_spec("ggx:roughness=0.5")
    (folder / "a.bsdf").write_bytes(tensor_file(material()))
    (folder / "brushed.bsdf").write_bytes(tensor_file(brushed(2)))
    write_goniometer(folder / "a.brdf", rough, 2, 2)
    rows = [
        f"{10 * i},0,{20 * j},{60 * k},{0.3 + 0.01 * i * j:.2f}"
        for i in range(4)
        for j in range(4)
        for k in range(4)
    ]
    (folder / "a.csv").write_text("\n".join(["theta_i,phi_i,theta_r,phi_r,r", *rows]) + "\n")
    coefficients = ["1,1,0,0,0,0,0,0.5", "1,1,2,0,0,0,0,-0.05", "1,1,1,1,1,1,0,0.02"]
    (folder / "b.csv").write_text("\n".join(coefficients) + "\n")
    small = sample_table(rough, (6, 4, 3))
    for name in ("table.exr", "table.npz"):
        write_table(folder / name, small)
    _uncompressed(folder / "table.exr", folder / "plain.table.exr")
    tables = ("table.exr", "table.npz", "plain.table.exr")
    return [
        (".bsdf", "a.bsdf"),
        (".bsdf, brushed", "brushed.bsdf"),
        ("goniometer", "a.brdf"),
        *(("Zernike", name) for name in ("a.csv", "b.csv")),
        *(("table of a BRDF", name) for name in tables),
    ]


def _materials(folder: Path) -> list[tuple[str, str]]:
    """Materials with a texture, in files of every format."""
    scenes.write(folder / "paint.png", np.full((2, 3, 3), 0.5), "uint8")
    image = (folder / "paint.png").read_bytes()
    tree = {
        "asset": {"version": "2.0"},
        "images": [{"bufferView": 0}, {"uri": SOUND}],
        "textures": [{"source": 0}, {"source": 1}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": len(image)}],
        "buffers": [{"byteLength": len(image)}],
        "materials": [
            {
                "name": "paint",
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": 0},
                    "metallicRoughnessTexture": {"index": 1},
                    "baseColorFactor": [0.1, 0.1, 0.1, 1],
                    "metallicFactor": 0.1,
                    "roughnessFactor": 0.4,
                },
                "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}},
            }
        ],
    }
    (folder / "material.glb").write_bytes(shapes.glb(tree, image))
    (folder / "material.gltf").write_bytes(shapes.gltf(tree, image))
    (folder / "material.mtlx").write_text(
        '<?xml version="1.0"?>\n<materialx version="1.39" colorspace="lin_rec709">\n'
        '<image name="picture" type="color3">\n<input name="file" type="filename" '
        f'value="{SOUND}" colorspace="srgb_texture"/></image>\n'
        '<multiply name="darker" type="color3"><input name="in1" type="color3" nodename="picture"/>'
        '\n<input name="in2" type="color3" value="0.1, 0.1, 0.1"/></multiply>\n'
        '<open_pbr_surface name="paint" type="surfaceshader">\n'
        '<input name="base_color" type="color3" nodename="darker"/>\n'
        '<input name="specular_roughness" type="float" value="0.8"/>\n'
        "</open_pbr_surface></materialx>\n"
    )
    names = ("material.glb", "material.gltf", "material.mtlx")
    return [(f"material, {Path(name).suffix}", name) for name in names]


def _meshes(folder: Path) -> list[tuple[str, str]]:
    """Meshes of every format, and a scene of one of them."""
    ball = shapes.icosphere(1)
    tree, data = shapes.gltf_tree(*ball, uvs=ball[0][:, :2], material=_worn())
    image = (folder / "paint.png").read_bytes()
    held = base64.b64encode(image).decode()
    tree |= {"textures": [{"source": 0, "sampler": 0}], "samplers": [{"wrapS": 33648}]}
    beside = tree | {"images": [{"uri": "bad.png"}]}
    tree["images"] = [{"uri": f"data:image/png;base64,{held}"}]
    corners = [f"v {x:.6f} {y:.6f} {z:.6f}\nvn {x:.6f} {y:.6f} {z:.6f}" for x, y, z in ball[0]]
    corners += [f"vt {x:.3f} {y:.3f}" for x, y, _ in ball[0]]
    corners += ["f " + " ".join(f"{k + 1}/{k + 1}/{k + 1}" for k in face) for face in ball[1]]
    made = {
        "sound.obj": shapes.obj(*ball),
        "full.obj": "\n".join(corners).encode(),
        "a.ply": shapes.ply(*ball),
        "text.ply": shapes.ply(*ball, binary=False),
        "a.stl": shapes.stl(*ball),
        "text.stl": shapes.stl(*ball, binary=False),
        "a.glb": shapes.glb(tree, data),
        "a.gltf": shapes.gltf(tree, data),
    }
    for name, content in made.items():
        (folder / name).write_bytes(content)
    (folder / "worn.gltf").write_bytes(shapes.gltf(beside, data))
    named = [b"mtllib bad.mtl", b"usemtl paint", made["full.obj"]]
    (folder / "painted.obj").write_bytes(b"\n".join(named))
    (folder / "m.mtl").write_text(
        "newmtl paint\nKd 0.5 0.4 0.3\nNs 30\nPm 0.25\nKe 0 0 0.1\n"
        "map_Kd -o 0.5 0 -s 2 2 -clamp on paint.png\nmap_Pr paint.png\nnorm -bm 0.5 paint.png\n"
    )
    (folder / "scene.toml").write_text(
        f'[[objects]]\nmesh = "{MESH}"\nmap = "{LIGHT}"\nroughness = 0.4\nf0 = "gold"\n'
        f'rotate = [0, 90, 0]\n\n[[objects]]\nmesh = "{MESH}"\nscale = [1, 2, 1]\n'
        "translate = [3, 0, 0]\nbrush = [0, 1, 0]\n"
    )
    (folder / "keys.toml").write_text(
        f'[[objects]]\nmesh = "{MESH}"\n[[key]]\nframe = 1\nturn = 10\nview = [0, 10]\n'
        "[[key]]\nframe = 3\nturn = [90, 5, -5]\nview = [30, -10]\nvary = {}\n"
    )
    return [(f"mesh, {Path(name).suffix}", name) for name in made]


def _worn() -> dict[str, Any]:
    """A glTF material with a texture everywhere."""
    moved = {"offset": [0.5, 0.25], "rotation": 0.5, "scale": [2, 3]}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    return {
        "pbrMetallicRoughness": {
            "baseColorFactor": [1, 0.5, 0, 1],
            "metallicFactor": 0.5,
            "baseColorTexture": texture,
            "metallicRoughnessTexture": texture,
        },
        "normalTexture": {**texture, "scale": 0.5},
        "occlusionTexture": {**texture, "strength": 0.5},
        "emissiveTexture": texture,
        "emissiveFactor": [0.1, 0, 0],
        "alphaMode": "MASK",
    }


def _transfers(folder: Path) -> list[str]:
    """Transfer of the mesh, and what is rendered with it: names."""
    with contextlib.chdir(folder):
        return _bake()


def _captured(folder: Path) -> str:
    """A probe within the mesh, which knows of its box: its name."""
    with contextlib.chdir(folder):
        where = ("--at", "0,0.1,0", "--probe", SOUND, "--size", "8", "--samples", "2")
        _shrm("probe", "capture", MESH, *where, "-o", "captured.exr")
    return "captured.exr"


def _bake() -> list[str]:
    _shrm("prefilter", SOUND, "--to", "irradiance", "--size", "4", "-o", IRRADIANCE)
    _shrm("product", "lambertian", "--order", "2", "--size", "8", "-o", PRODUCT)
    _shrm("transfer", MESH, "--samples", "4", "--bounces", "1", "-o", "diffuse.npz")
    _shrm("transfer", MESH, "--samples", "4", "--order", "2", "--matrices", "-o", "glossy.npz")
    _as_texture("diffuse.npz", "texels.npz")
    return ["diffuse.npz", "glossy.npz", "texels.npz"]


def _as_texture(source: str, target: str) -> None:
    """Write the transfer of vertices as if they were texels: that needs no charts."""
    baked, mesh = read_transfer(source), load_mesh(MESH)
    rows = np.full((8, 8), -1, np.int32)
    rows.flat[: len(mesh.vertices)] = np.arange(len(mesh.vertices))
    corners = np.random.default_rng(1).uniform(0, 1, (*mesh.faces.shape, 2))
    texels = Texels(rows, corners, mesh.vertices)
    write_transfer(target, replace(baked, texels=texels))


def copy_sound(source: Path, target: Path) -> None:
    """Copy what commands need beside the damaged file into the folder of a case."""
    for name in (SOUND, MAP, LIGHT, MESH, IRRADIANCE, PRODUCT, *PAINTED, *NEEDED):
        shutil.copyfile(source / name, target / name)
