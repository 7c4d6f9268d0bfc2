"""Exported light in the engines themselves, beside what `shrm` makes of the same split sum.

Each proof exports a probe for an engine, lets the engine load the files and shade balls with them,
and compares the linear pixels with two pictures: the engine's documented shading evaluated in numpy
on our levels, and the split sum as `shrm render` shades it.
"""

import base64
import shutil
from dataclasses import dataclass, field, replace

import numpy as np

from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.brdf.environment.taps import taps
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.export.cubes import diffuse_cube
from shrm_cli.export.engine import engine
from shrm_cli.export.make import Asked, Source, gather
from shrm_cli.export.packing import ALL
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.reference import Reference
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.vocabulary import DEFAULT_TAPS, NO_TAPS
from tests.web import ball
from tests.web.browser import HERE, MODULES, Page, bundle
from tests.web.glb import ball_file

VIEW = (0.3, 0.2, 1.0)
FACING = 0.2
"""Pixels where N.V is less are left out: there a pixel sees a large part of the sphere."""
WHITE = (1.0, 1.0, 1.0)


@dataclass
class Row:
    """What one ball showed.

    Attributes
    ----------
    what : str
        ``"diffuse"``, with what it is lit by, or the roughness of a white metal.
    largest, rms : float
        The largest difference to the documented shading, as a part of the largest value, and the
        RMS of the differences, relative to that of the values.
    to_shrm : float or None
        The same RMS to the picture of `shrm render`.
    turned : float
        How much larger the RMS is against the same picture of a mirrored or turned light, at least.
    """

    what: str
    largest: float
    rms: float
    to_shrm: float | None
    turned: float


@dataclass
class Proof:
    """All balls of an engine, what the page logged, and its pictures beside ours."""

    engine: str
    rows: list[Row]
    errors: list[str]
    requests: list[str]
    pictures: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    facts: dict[str, object] = field(default_factory=dict)


def made_probe(rows=64):
    """A lat-long without any symmetry: a gradient, and coloured discs all over."""
    v, u = np.meshgrid(np.arange(rows) + 0.5, np.arange(2 * rows) + 0.5, indexing="ij")
    theta, phi = np.pi * v / rows, np.pi * (1 - u / rows)
    x, y, z = np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)
    pixels = 0.3 + 0.1 * np.stack([x, y, z], axis=-1)
    lamps = [
        ((1, 0.2, 0.3), (6, 1, 1)), ((-1, 0.5, 0.1), (1, 5, 1)), ((0.1, 1, -0.3), (1, 1, 7)),
        ((0.4, -1, 0.2), (4, 4, 0)), ((-0.3, 0.1, 1), (0, 4, 4)), ((0.2, -0.4, -1), (5, 0, 5)),
    ]  # fmt: skip
    for direction, color in lamps:
        direction = np.array(direction) / np.linalg.norm(direction)
        cosine = x * direction[0] + y * direction[1] + z * direction[2]
        pixels += np.exp(12 * (cosine - 1))[..., None] * np.array(color)
    return Probe.from_array(pixels, "latlong")


def exported(folder, name, probe, size, texels=None):
    """Write what `shrm export --for NAME` writes of a probe; returns its light and its package."""
    chosen = engine(name)
    light, _, _ = gather(Source("light", "light.exr", probe=probe), chosen, Asked(size=size))
    package = chosen.pack(light, ALL[texels or (chosen.formats or ("rgba16f",))[0]])
    folder.mkdir(parents=True, exist_ok=True)
    for file in package.files:
        file.write(folder / file.name)
    return light, package


def prepare(folder, script):
    """Bundle a script of pages/ into the folder that is served."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / "pages" / "blank.html", folder / "blank.html")
    bundle(HERE / "pages" / f"{script}.js", folder / f"{script}.bundle.js")


def prepare_three(folder, build):
    """The page of three.js with its build for WebGL or WebGPU, and the transcoder it ships."""
    folder.mkdir(parents=True, exist_ok=True)
    package = MODULES / "three"
    shutil.copytree(package / "examples/jsm/libs/basis", folder / "basis", dirs_exist_ok=True)
    shutil.copy(HERE / "pages" / "blank.html", folder / "blank.html")
    name = {"webgl": "three.module.js", "webgpu": "three.webgpu.js"}[build]
    bundle(
        HERE / "pages" / "three.js", folder / f"{build}.bundle.js",
        f"--alias:three={package}/build/{name}", f"--alias:three/addons={package}/examples/jsm",
    )  # fmt: skip


def three(browser, folder, address, probe, size, roughnesses, pixels=256, texels=None, build=None):
    """Balls in three.js; with a build of `prepare_three`, by three.js' own loader.

    The facts are what packing loses of each level, and what blocks three.js' own loader made.
    """
    light, package = exported(folder / "three", "three", probe, size, texels or "rgba16f")
    page = Page(browser, address, f"{build or 'three'}.bundle.js")
    page.call("start", pixels, VIEW)
    loaded = None
    if build is None:
        page.call("environment", f"{address}/three/light.ktx2")
    else:
        loaded = page.call("stock", f"{address}/three/light.ktx2", f"{address}/basis/")
    normals, used, facing = shown(pixels)
    last = len(light.levels) - 1
    edge = light.levels[-1].shape[1]
    diffuse = diffuse_cube(light.diffuse, edge)
    light = replace(light, levels=(*light.levels[:-1], diffuse))
    pictures = {}
    for roughness in roughnesses:
        # The shader adds what the normal changes from pixel to pixel, and stays above 0.045.
        added = np.minimum(ball.change(pixels), 0.3)
        rough = np.minimum(max(roughness, 0.045) + added, 1.0)

        albedo = DirectionalAlbedo(max(roughness, 0.045))(facing, WHITE)

        def documented(levels, rough=rough, albedo=albedo):
            mixed = rough[..., None] ** 4
            bent = ball.mirrored(normals, VIEW) * (1 - mixed) + normals * mixed
            bent /= np.linalg.norm(bent, axis=-1, keepdims=True)
            single = albedo * ball.trilinear(levels, bent, last * rough * (2 - rough))
            return single + (1 - albedo) * ball.trilinear(levels, normals, last)

        found = ball.decoded(page.call("shade", roughness), pixels)
        pictures[f"{roughness:g}"] = found, documented
    white = ball.decoded(page.call("shade", "environment"), pixels)
    pictures["diffuse, by the environment"] = (
        white,
        lambda levels: ball.trilinear(levels, normals, last),
    )
    page.call("lightProbe", f"{address}/three/light_sh.json")
    pictures["diffuse"] = ball.decoded(page.call("shade", None), pixels), None
    made = compare("three.js", page, light, "filament", pictures, normals, used)
    made.facts |= {"losses": package.losses, "loaded": loaded, "light": light}
    return made


def three_filtered(browser, folder, address, probe, size, build, pixels=12):
    """Light of each level's roughness from our file and from three.js' own filter.

    Returns
    -------
    list of tuple
        The roughness, and by ``"ours"`` and ``"three"`` the RMS differences to sums over the
        probe's pixels: each to the lobe that it has, and ``"both"`` to each other.
    errors : list of str
    """
    light, _ = exported(folder / "three", "three", probe, size, "rgba16f")
    page = Page(browser, address, f"{build}.bundle.js")
    page.call("start", pixels, VIEW)
    # three.js' panoramas have +X in the middle.
    image = to_grid(probe, LatLong(probe.grid.size))
    panorama = np.ones((*image.shape[:2], 4), dtype=np.float16)
    panorama[..., :3] = np.roll(image, len(image) // 2, axis=1)
    text = base64.b64encode(panorama.tobytes()).decode()
    pictures = {}
    for name, call in (
        ("ours", ("environment", f"{address}/three/light.ktx2")),
        ("three", ("filtered", text, panorama.shape[1])),
    ):
        page.call(*call)
        pictures[name] = [
            ball.decoded(page.call("background", (1, 0, 0), rough), pixels)
            for rough in light.roughness
        ]
    s = (np.arange(pixels) + 0.5) * 2 / pixels - 1
    column, row = np.meshgrid(s, -s)
    rays = np.stack([np.ones_like(row), row, column], axis=-1).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    rows = []
    image = to_grid(probe, LatLong(256))  # fine enough for the narrowest lobe
    for k, rough in enumerate(light.roughness[1:], 1):
        found = {name: each[k].reshape(-1, 3) for name, each in pictures.items()}
        # The last level of both is E / pi.
        shadowed = k < len(light.roughness) - 1
        off = {
            "ours": relative(found["ours"], lobe(image, rays, rough, shadowed)),
            "three": relative(found["three"], lobe(image, rays, rough, False)),
            "both": relative(found["ours"], found["three"]),
        }
        rows.append((rough, off))
    errors = page.errors
    page.close()
    return rows, errors


def lobe(image, directions, roughness, is_shadowed):
    """Means of the pixels of a lat-long by GGX's lobe where normal, view and reflection are one.

    Its shadowing is that of Smith; three.js has the cosine of the light in its place.
    """
    rows = len(image)
    v, u = np.meshgrid(np.arange(rows) + 0.5, np.arange(2 * rows) + 0.5, indexing="ij")
    theta, phi = np.pi * v / rows, np.pi * (1 - u / rows)
    towards = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=-1
    ).reshape(-1, 3)
    cosine = np.clip(directions @ towards.T, 0, 1)
    half = (1 + cosine) / 2  # the squared cosine of the microfacet's normal
    alpha2 = roughness**4
    weight = 1 / (half * (alpha2 - 1) + 1) ** 2 * np.sin(theta).ravel()
    if is_shadowed:
        root = np.sqrt(alpha2 + (1 - alpha2) * cosine**2)
        weight = weight * 2 * cosine / np.maximum(cosine + root, 1e-9)
    else:
        weight = weight * cosine
    return weight @ image.reshape(-1, 3) / weight.sum(axis=1, keepdims=True)


def three_brushed(browser, folder, address, probe, size, surface, patch, code, pixels=192):
    """A brushed ball in three.js as it is and patched, and what it would show of the true light.

    `surface` is its roughness and anisotropy. All pictures have three.js' own reflectance, which
    is that of an even surface, with the light that meets several facets.

    Returns
    -------
    pictures : dict of ndarray, shape (pixels, pixels, 3)
        Those of three.js, ``bent`` and ``taps``, the look-ups evaluated in numpy, ``documented``,
        and ``truth``.
    used : ndarray of bool
        The pixels to compare.
    errors : list of str
        What the pages complained about.
    """
    light, _ = exported(folder / "three", "three", probe, size, "rgba16f")
    found, errors = {}, []
    for name, patches in {"bent": (), "taps": ((patch, code),)}.items():
        page = Page(browser, address, "three.bundle.js")
        for each in patches:
            page.call("patch", *each)
        page.call("start", pixels, VIEW)
        page.call("environment", f"{address}/three/light.ktx2")
        found[name] = ball.decoded(page.call("brush", *surface), pixels)
        errors += page.errors
        page.close()
    normals, used, facing = shown(pixels)
    last = len(light.levels) - 1
    diffuse = diffuse_cube(light.diffuse, light.levels[-1].shape[1])
    levels = (*light.levels[:-1], diffuse)
    view = np.broadcast_to(np.array(VIEW) / np.linalg.norm(VIEW), normals.shape)
    brdf = Ggx(roughness=surface[0], anisotropy=surface[1])
    normals_used, views = normals[used], view[used]
    albedo = DirectionalAlbedo(surface[0])(facing[used], WHITE)
    several = (1 - albedo) * ball.trilinear(levels, normals_used, last)
    frames = surface_frames(normals_used, horizontal_tangents(normals_used))
    tapped = taps(brdf.alphas, np.einsum("nij,nj->ni", frames, views), DEFAULT_TAPS)
    rough = tapped.roughness
    each = ball.trilinear(levels, tapped.directions @ frames, last * rough * (2 - rough))
    white = Probe.from_array(np.ones((64, 128, 3)), "latlong")
    lit, furnace = (Reference(x, brdf).radiance(normals_used, views) for x in (probe, white))
    for name, light_alone in {
        "documented": np.einsum("nk,nkc->nc", tapped.weights, each),
        "truth": lit / furnace,
    }.items():
        found[name] = np.zeros((pixels, pixels, 3))
        found[name][used] = albedo * light_alone + several
    return found, used, errors


def babylon(browser, folder, address, probe, size, roughnesses, pixels=256, form="babylon"):
    """Balls in Babylon.js, under an .env, or under a glTF file with an image-based light."""
    light, _ = exported(folder / form, form, probe, size)
    page = Page(browser, address, "babylon.bundle.js")
    page.call("start", pixels, True, VIEW)
    if form == "gltf":
        page.call("environmentOfGltf", f"{address}/gltf/light.gltf")
        steps, scale = len(light.levels) - 1, np.log2(size)
        lod_scale = steps / scale
    else:
        page.call("environment", f"{address}/babylon/light.env")
        lod_scale = 0.8
    normals, used, facing = shown(pixels)
    reflected = ball.mirrored(normals, ball.views(normals, VIEW, 1000))
    pictures = {}
    for roughness in roughnesses:
        lod = lod_scale * np.log2(size * (roughness**2 + 0.0005))

        albedo = DirectionalAlbedo(max(roughness, 0.05))(facing, WHITE)

        def documented(levels, lod=lod, albedo=albedo):
            clipped = [np.clip(level, 0, 255) for level in levels]  # RGBD's largest value
            # The shader writes no more than 30 before a tone mapping that comes after it.
            return np.minimum(albedo * ball.trilinear(clipped, reflected, lod), 30)

        found = ball.decoded(page.call("shade", roughness), pixels)
        pictures[f"{roughness:g}"] = found, documented
    pictures["diffuse"] = ball.decoded(page.call("shade", None), pixels), None
    title = "Babylon.js .env" if form == "babylon" else "Babylon.js glTF"
    return compare(title, page, light, "linear", pictures, normals, used)


def filament(browser, folder, address, probe, size, roughnesses, pixels=256):
    """Balls in Filament, from glTF files, with the materials that its library brings.

    These widen the roughness by what normals change from pixel to pixel, which is left out here: at
    half as many pixels along an edge a mirror is three times as far from the documented shading.
    """
    page, light, read = open_filament(browser, folder, address, probe, size, roughnesses, pixels)
    files = [f"metal{k}.glb" for k in range(len(roughnesses))]
    normals, used, facing = shown(pixels)
    last = len(light.levels) - 1

    def prefiltered(levels, rough):
        mixed = rough**4
        bent = ball.mirrored(normals, VIEW) * (1 - mixed) + normals * mixed
        bent /= np.linalg.norm(bent, axis=-1, keepdims=True)
        return ball.trilinear(levels, bent, last * rough * (2 - rough))

    pictures = {}
    for file, roughness in zip(files, roughnesses, strict=False):
        rough = max(roughness, 0.089)  # the least where numbers may have 16 bits
        # Scale and compensation for several facets cancel for a white metal.
        pictures[f"{roughness:g}"] = (
            _exposed(page, file, pixels),
            lambda levels, rough=rough: np.minimum(prefiltered(levels, rough), 1 / _EXPOSURES[0]),
        )
    found = _exposed(page, "diffuse.glb", pixels)
    # A plastic of roughness 1: what its surface of f0 0.04 reflects, the rest is diffuse.
    total = DirectionalAlbedo(1.0)(facing, WHITE)
    reflected = DirectionalAlbedo(1.0)(facing, (0.04,) * 3)
    surface = reflected * (1 + 0.04 * (1 / total - 1)) * prefiltered(light.levels, 1.0)
    pictures["diffuse"] = (found - surface) / (1 - reflected), None
    made = compare("Filament", page, light, "filament", pictures, normals, used)
    made.facts["sh"] = float(np.abs(read - ball.polynomials(light.nine())).max())
    return made


def open_filament(browser, folder, address, probe, size, roughnesses, pixels):
    """Filament's page with an exported light and balls, the light, and the coefficients it read."""
    light, package = exported(folder / "filament", "filament", probe, size)
    _prepare_filament(folder / "filament", roughnesses)
    page = Page(browser, address, "filament/filament.bundle.js")
    cubes = [file.name for file in package.files if file.name.endswith(".ktx")]
    balls = [f"metal{k}.glb" for k in range(len(roughnesses))]
    page.call("start", pixels, VIEW, [*cubes, *balls, "diffuse.glb"])
    return page, light, np.reshape(page.call("environment", "light_ibl.ktx"), (9, 3))


_EXPOSURES = 1 / 16, 1 / 4, 1.0
"""What light is multiplied with; the canvas is white where a product is above 1."""


def _prepare_filament(folder, roughnesses):
    package = MODULES / "filament"
    shutil.copy(package / "filament.wasm", folder)
    prepare(folder, "filament")
    script = folder / "filament.bundle.js"
    script.write_text((package / "filament.js").read_text() + ";\n" + script.read_text())
    for k, roughness in enumerate(roughnesses):
        (folder / f"metal{k}.glb").write_bytes(ball_file(1.0, roughness))
    (folder / "diffuse.glb").write_bytes(ball_file(0.0, 1.0))


def _exposed(page, file, pixels):
    """A picture of 8 bits at several exposures, each pixel from the brightest that holds it."""
    result = None
    for intensity in _EXPOSURES:
        text = page.call("shade", file, intensity)
        image = np.frombuffer(base64.b64decode(text), np.uint8).reshape(pixels, pixels, 4)
        image = image[::-1, :, :3]
        known = (image < 255).all(axis=-1, keepdims=True)
        image = image / 255 / intensity
        result = image if result is None else np.where(known, image, result)
    return result


def directx(browser, folder, address, probe, size):
    """The texels of a DDS file as Babylon.js reads it: the largest relative difference."""
    light, _ = exported(folder / "directx", "directx", probe, size)
    page = Page(browser, address, "babylon.bundle.js")
    page.call("start", 16, True, VIEW)
    page.call("environment", f"{address}/directx/light.dds")
    from shrm_cli.export.cubes import to_lookup

    worst = 0.0
    for k, level in enumerate(light.levels):
        for face, ours in enumerate(to_lookup(level)):
            text = page.call("texels", face, k)
            found = ball.decoded(text, ours.shape[0])[::-1]
            worst = max(worst, float(np.abs(found - ours).max() / np.abs(ours).max()))
    errors, requests = page.errors, page.requests
    page.close()
    return worst, errors, requests


def shown(pixels):
    """Normals of the ball, which pixels are compared, and N.V of all."""
    normals, inside = ball.seen(pixels, VIEW)
    facing = normals @ (np.array(VIEW) / np.linalg.norm(VIEW))
    return normals, inside & (facing > FACING), np.clip(facing, 1e-3, 1)


def compare(title, page, light, mapping, pictures, normals, used, ours=None):
    """Compare pictures, and close the page.

    `pictures` has pairs of what the engine showed and of a function of levels, the engine's
    documented shading, by the roughness of a white metal or what begins with "diffuse"; where the
    function is None it is E / pi of nine coefficients. Where the engine has levels of its own,
    `ours` are those that were exported, looked up in the same way in place of `shrm render`.
    """
    info = replace((light.irradiance or light.diffuse).info, brdf={"name": "ggx-lobe"})
    split = SplitSum(light.levels[: len(light.roughness)], light.roughness, mapping, info)
    view = np.array(VIEW) / np.linalg.norm(VIEW)
    rows, kept = [], {}
    for what, (found, documented) in pictures.items():
        if documented is None:
            wrong = [ball.lambert(light.nine(), normals * signs) for signs in TURNS]
            want, to_shrm = ball.lambert(light.nine(), normals), None
        else:
            wrong = [documented([_turned(level, k) for level in light.levels]) for k in range(3)]
            want = documented(light.levels)
            to_shrm = None
            if ours is not None:
                to_shrm = relative(found[used], documented(ours)[used])
            elif not what.startswith("diffuse"):
                shown = split.shaded(float(what), WHITE, taps=NO_TAPS)
                radiance = shown.radiance(normals[used], view)
                to_shrm = relative(found[used], radiance)
        rms = relative(found[used], want[used])
        turned = min(relative(found[used], each[used]) for each in wrong) / rms
        largest = float(np.abs(found - want)[used].max() / want[used].max())
        rows.append(Row(what, largest, rms, to_shrm, turned))
        kept[what] = found, want
    errors, requests = page.errors, page.requests
    page.close()
    return Proof(title, rows, errors, requests, kept)


TURNS = [np.array([-1, 1, 1]), np.array([1, -1, 1]), np.array([1, 1, -1])]
"""Mirrorings that wrong conventions would make."""


def _turned(level, axis):
    """The same light mirrored along an axis, by another way than the package's."""
    from research.bilinear import centers, look_up

    size = level.shape[1]
    directions = centers(size).reshape(-1, 3) * TURNS[axis]
    return look_up(level, directions).reshape(level.shape)


def relative(found, want):
    return float(np.sqrt(np.mean((found - want) ** 2) / np.mean(want**2)))
