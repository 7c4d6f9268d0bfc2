"""Seeds of what is no light by itself: rooms, photographs, tables of probes, manifests, textures.

`seeds` says what ``FILE``, ``OUT`` and ``WORD`` stand for in the commands, and has the meshes.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.cli.helpers import noise
from tests.geometry import shapes
from tests.probe import scenes

NEEDED = "lamp.obj", "lamp.mtl", "lit.obj", "darker.png"
"""A mesh that is a lamp and its materials, one whose materials are damaged, and a photograph."""

_FROM_PROBE = (
    "choose FILE --brdf lambertian --json",
    "choose FILE --brdf ggx:roughness=0.8 --budget 9kB --map OUT.exr",
    "report FILE --brdf ggx:roughness=0.8 --to shrm --size 4 --picture-size 8 --no-flip --no-view "
    "-o OUT.html",
    "reference FILE --brdf ggx:roughness=0.5 --size 8 -o OUT.exr --json",
    "analyze --brdf lambertian --no-plots --probe FILE --size 16 --json",
    "prefilter FILE --brdf ggx:roughness=0.4 --json -o OUT.exr",
    "prefilter FILE --brdf ggx:roughness=0.4 --sun split -o OUT.exr",
    "prefilter FILE --to she -o OUT.exr",
    "prefilter FILE --to product --brdf lambertian -o OUT.exr",
    "export FILE --for filament --size 32 -o OUT --firefly-safe",
    "export FILE --for babylon --size 32 -o OUT --sun split --json",
    "export FILE --for bevy --size 32 -o OUT --dfg --skybox 16",
    "export FILE --for godot -o OUT --size 8",
    "batch FILE --to irradiance --dry-run --json",
    "probe unclip FILE --ratio 3 -o OUT.exr",
    "lookdev FILE --brdf lambertian --eps 0.3 --size 16 -o OUT.html",
    "compare --representations --probe FILE --steps 1 --size 8 --no-flip --view 0,0 --no-picture",
)
_PHOTO = (
    "probe brackets FILE darker.png --times 4,1 -o OUT.exr",
    "probe brackets darker.png FILE --times 1,4 --linear -o OUT.exr --json",
    "probe ball FILE --linearize --size 8 -o OUT.exr",
    "probe ball FILE --linearize --circle 8,8,7 --distance 9 --size 8 -o OUT.exr --json",
)
_ROOM = (
    "grid FILE --size 2,1,2 --samples 16 --order 1 -o OUT.npz",
    "grid FILE --probe sound.exr --size 2,1,2 --samples 16 --light reflected -o OUT.ktx2 --json",
    "probe capture FILE --at 0,0.1,0 --size 8 --samples 2 -o OUT.exr",
    "transfer FILE --samples 4 --bounces 1 --albedo mesh -o OUT.npz",
    "transfer FILE --samples 4 --order 2 -o OUT.glb --json",
    "transfer FILE --samples 4 --order 2 -o OUT.ply",
    "transfer FILE --samples 4 --order 2 --texture 16 -o OUT.npz",
    "light basis FILE --order 1 --size 16 -o OUT.png",
    "view sound.shrm.exr --mesh FILE -o OUT.html",
)
_OF_ROOM = tuple(each.replace("FILE", "lit.obj") for each in _ROOM[:4])
_PROBES = ("grid FILE --order 1 -o OUT.npz", "grid FILE --order 2 -o OUT.json --json")
_MANIFEST = ("batch FILE --dry-run", "batch FILE --dry-run --json", "batch FILE --commands -")
_SURFACE = (
    "product FILE --order 2 --size 8 -o OUT.exr",
    "dfg --brdf FILE --quiet --size 4 -o OUT.exr",
    "prefilter sound.exr --brdf FILE --to principal --eps 0.3 --size 4 -o OUT.exr",
    "analyze --brdf FILE --no-plots --json --eps 0.5",
    "lookdev sound.exr --brdf FILE --eps 0.3 --size 16 -o OUT.png",
)
_MORE_ARGUMENTS = (
    "probe sky --sun WORD -o OUT.exr --size 8",
    "probe sky --turbidity WORD -o OUT.exr --size 8",
    "probe ball FILE --circle WORD -o OUT.exr",
    "probe capture lamp.obj --at WORD --size 8 --samples 2 -o OUT.exr",
    "probe brackets FILE FILE --times WORD -o OUT.exr",
    "probe unclip FILE --card WORD -o OUT.exr",
    "grid lamp.obj --size WORD --samples 16 -o OUT.npz",
    "grid lamp.obj --box WORD --size 2,1,2 --samples 16 -o OUT.npz",
    "grid lamp.obj --emit WORD --size 2,1,2 --samples 16 -o OUT.npz",
    "transfer sound.obj --albedo WORD --samples 4 -o OUT.npz",
    "transfer WORD --samples 4 -o OUT.npz",
    "light edit FILE --set WORD -o OUT.json",
    "light edit FILE --dim WORD -o OUT.json",
    "light edit FILE --rotate WORD -o OUT.json",
    "light edit FILE --add WORD -o OUT.json",
    "choose FILE --brdf lambertian --budget WORD",
    "product ward --vary WORD --order 1 --size 8 -o OUT.exr",
    "product WORD --order 1 --size 8 -o OUT.exr",
    "dfg --brdf WORD --size 4 -o OUT.exr",
    "batch WORD --to irradiance --commands -",
    "batch FILE --to irradiance --share WORD --dry-run",
    "export FILE --for gltf --into WORD --size 32 -o OUT",
    "export FILE --for three --size 32 --max-error WORD -o OUT",
    "render sound.irradiance.exr --mesh sound.obj --transfer WORD --size 16 -o OUT.png",
    "render sound.shrm.exr --turn-light WORD --size 16 -o OUT.png",
    "render sound.shrm.exr --blend-to WORD --blend 0.5 --size 16 -o OUT.png",
    "prefilter FILE --to splitsum --size 8 --levels WORD -o OUT.exr",
    "prefilter FILE --to splitsum --size 8 --box WORD -o OUT.exr",
    "prefilter FILE --compress WORD --order-f 2 --order-p 1 --size 4 -o OUT.exr",
)

Row = tuple[str, str, tuple[str, ...]]
"""The kind of a file, its name, and the commands that read it."""


def make_others(folder: Path, run: Callable[..., None]) -> list[Row]:
    """Write the files beside those of `seeds`, in the current folder; `run` runs a command."""
    photo = np.sqrt(np.clip(noise(16, 16) / 4, 0, 1))
    for name, share in (("photo.png", 1), ("photo.jpg", 1), ("darker.png", 0.5)):
        scenes.write(folder / name, photo * share, "uint8")
    scenes.write(folder / "photo.exr", photo, "half")
    ball = Path("full.obj").read_text()
    Path("lamp.mtl").write_text("newmtl lamp\nKe 2 2 2\nKd 0.5 0.4 0.3\nmap_Kd paint.png\n")
    Path("lamp.obj").write_text(f"mtllib lamp.mtl\nusemtl lamp\n{ball}")
    Path("lit.obj").write_text(f"mtllib bad.mtl\nusemtl lamp\n{ball}")
    tree, data = shapes.gltf_tree(*shapes.icosphere(1), material={"emissiveFactor": [1, 1, 1]})
    Path("room.glb").write_bytes(shapes.glb(tree, data))
    places = [(x, z) for x in (0, 1) for z in (0, 2)]
    rows = "".join(f"{x},0,{z},sound.exr\n" for x, z in places)
    Path("probes.csv").write_text(f"x,y,z,file\n{rows}")
    tables = (f'[[probe]]\nfile = "sound.exr"\nat = [{x}, 0, {z}]\n' for x, z in places)
    Path("probes.toml").write_text("".join(tables))
    Path("batch.toml").write_text(
        'probes = ["sound.exr"]\nbrdfs = ["phong:exponent=9"]\nto = ["shrm", "irradiance"]\n'
        'output = "made/{folder}/{probe}.{brdf}.{to}.exr"\neps = 0.2\n[irradiance]\n'
        'form = "zh3"\n[reading]\nyaw = 20\nclamp = 3\n[[entry]]\n[[entry]]\nto = "export"\n'
        'for = ["three", "bevy"]\noutput = "made/{engine}"\nsize = 32\n'
    )
    run("dfg", "--size", "4", "-o", "dfg.ktx2")
    probes = ("sound.exr", "sunny.exr", "a.hdr", "a.toml")
    measured = ("a.bsdf", "a.brdf", "a.csv", "table.exr", "material.gltf", "material.mtlx")
    return [
        *(("what is made of a probe", name, _FROM_PROBE) for name in probes),
        *(("photograph", name, _PHOTO) for name in ("photo.png", "photo.jpg", "photo.exr")),
        *(("room", name, _ROOM) for name in ("lamp.obj", "room.glb", "a.gltf", "text.ply")),
        ("materials of a room", "lamp.mtl", _OF_ROOM),
        *(("table of probes", name, _PROBES) for name in ("probes.csv", "probes.toml")),
        ("manifest", "batch.toml", _MANIFEST),
        ("KTX 2", "dfg.ktx2", ("info FILE", "info FILE --json")),
        *(("what is made of a BRDF", name, _SURFACE) for name in measured),
        ("more arguments", "sound.exr", _MORE_ARGUMENTS),
    ]
