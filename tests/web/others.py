"""Light in PlayCanvas, CesiumJS and <model-viewer>, beside sums over the pixels of the probe.

Balls of white metal reflect the light by GGX's lobe of their roughness, seen from R. CesiumJS and
<model-viewer> scale it with the albedo, and add what meets several facets, as diffuse light.
"""

import base64

import numpy as np

from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.latlong import LatLong
from tests.brute_force import latlong_samples
from tests.ggx import lobe
from tests.web import ball, proofs
from tests.web.browser import MODULES, Page
from tests.web.glb import ball_file

NAMES = ("playcanvas", "cesium", "model-viewer")
SHARPEST = 0.2
"""Less roughness is that of a mirror here, whose light is that of a cube looked up bilinearly."""
_AWAY = {"playcanvas": 1000, "cesium": 1000, "model-viewer": 100}
_EXPOSURES = 1 / 16, 1 / 4, 1.0
_PLACES = 200


class Opened:
    """The page of an engine with an exported light.

    Parameters
    ----------
    browser, folder, address
        As the fixtures of the tests make them.
    name : str
        One of `NAMES`.
    probe : Probe
    size : int
        Texels of level 0, or rows of the panorama.
    pixels : int
        Along an edge of pictures.
    """

    def __init__(self, browser, folder, address, name, probe, size, pixels):
        self.name, self.pixels = name, pixels
        self._folder, self._address = folder / name, f"{address}/{name}"
        proofs.exported(self._folder, name, probe, size)
        proofs.prepare(self._folder, name.replace("-", "_"))
        if name == "cesium":
            _add_cesium(self._folder)
        self.page = Page(browser, self._address, f"{name.replace('-', '_')}.bundle.js")
        if name == "model-viewer":
            self.page.call("start", pixels, f"{self._address}/light.hdr")
            return
        self.page.call("start", pixels)
        files = {"cesium": ("light.ktx2", "light_sh.js"), "playcanvas": ("light_envAtlas.png",)}
        self.page.call("environment", *(f"{self._address}/{file}" for file in files[name]))

    def metal(self, roughness, view=proofs.VIEW):
        """A picture of a ball of white metal, seen from a direction."""
        if self.name == "playcanvas":
            return ball.decoded(self.page.call("shade", roughness, view), self.pixels)
        return self._file(f"metal{roughness:g}.glb", ball_file(1.0, roughness), view)

    def diffuse(self, view=proofs.VIEW):
        """A picture of a diffuse white ball."""
        if self.name == "playcanvas":
            return ball.decoded(self.page.call("shade", None, view), self.pixels)
        return self._file("diffuse.glb", ball_file(0.0, 1.0, glossy=False), view)

    def ahead(self, direction):
        """The light 90 degrees across around a horizontal direction, as a mirror ball shows it."""
        towards = np.array(direction, dtype=float)
        right = np.cross(towards, [0, 1, 0])
        s = (np.arange(self.pixels) + 0.5) * 2 / self.pixels - 1
        across, down = np.meshgrid(s, s)
        rays = towards + across[..., None] * right - down[..., None] * np.array([0, 1, 0])
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        normals = rays + towards
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        # The camera looks back along the direction, so that its right is the other way.
        column, row = ((1 + x) / 2 * self.pixels for x in (-normals @ right, -normals[..., 1]))
        picture = self.metal(0.0, direction)
        return picture[row.astype(int), column.astype(int)]

    def _file(self, name, data, view):
        (self._folder / name).write_bytes(data)
        url = f"{self._address}/{name}"
        if self.name == "cesium":
            return ball.decoded(self.page.call("shade", url, view), self.pixels)
        result = None
        for exposure in _EXPOSURES:
            width, text = self.page.call("shade", url, view, exposure)
            assert width == self.pixels
            image = np.frombuffer(base64.b64decode(text), np.uint8)
            image = image.reshape(self.pixels, self.pixels, 4)[..., :3]
            known = (image < 255).all(axis=-1, keepdims=True)
            found = _linear(image / 255) / exposure
            result = found if result is None else np.where(known, found, result)
        return result


def _add_cesium(folder):
    """Put the engine before the script of its page, and beside it what it loads by itself."""
    build = MODULES / "cesium" / "Build" / "Cesium"
    (folder / "engine").unlink(missing_ok=True)
    (folder / "engine").symlink_to(build)
    script = folder / "cesium.bundle.js"
    base = 'globalThis.CESIUM_BASE_URL = "/cesium/engine/";\n'
    script.write_text(f"{base}{(build / 'Cesium.js').read_text()};\n{script.read_text()}")


def _linear(value):
    """Light of a value of sRGB."""
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def rows(opened, probe, roughnesses, rows_of_light=64):
    """Compare balls with sums at some of their pixels: rows as those of `proofs.compare`.

    The largest difference is that of those pixels. Nothing is compared with `shrm render`.
    """
    normals, used, facing = proofs.shown(opened.pixels)
    places = np.random.default_rng(1).choice(int(used.sum()), _PLACES, replace=False)
    normals, facing = normals[used][places], facing[used][places]
    views = ball.views(normals, proofs.VIEW, _AWAY[opened.name])
    reflected = ball.mirrored(normals, views)
    light = _Sums(np.asarray(to_grid(probe, LatLong(rows_of_light))))
    result = []
    for roughness in roughnesses:
        found = opened.metal(roughness)[used][places]
        wanted = [
            _metal(opened.name, light, roughness, reflected * turn, normals * turn, facing)
            for turn in (np.ones(3), *proofs.TURNS)
        ]
        result.append(_row(f"{roughness:g}", found, wanted))
    found = opened.diffuse()[used][places]
    wanted = [light.diffuse(normals * turn) for turn in (np.ones(3), *proofs.TURNS)]
    result.append(_row("diffuse", found, wanted))
    return result


def _row(what, found, wanted):
    rms, *turned = (proofs.relative(found, each) for each in wanted)
    largest = float(np.abs(found - wanted[0]).max() / wanted[0].max())
    return proofs.Row(what, largest, rms, None, min(turned) / rms)


def _metal(name, light, roughness, reflected, normals, facing):
    """What a white metal shows."""
    if name == "model-viewer":  # three.js bends R towards N
        mixed = roughness**4
        reflected = reflected * (1 - mixed) + normals * mixed
        reflected /= np.linalg.norm(reflected, axis=-1, keepdims=True)
    single = light.filtered(roughness, reflected)
    if name == "playcanvas":
        return single
    albedo = DirectionalAlbedo(max(roughness, 0.05))(facing, proofs.WHITE)
    return albedo * single + (1 - albedo) * light.diffuse(normals)


class _Sums:
    """Sums over the pixels of a lat-long."""

    def __init__(self, pixels):
        self._pixels = pixels
        self._directions, self._areas = map(np.asarray, latlong_samples(pixels.shape[0]))
        self._radiance = pixels.reshape(-1, 3)

    def filtered(self, roughness, directions):
        """Means by the lobe for N = V = R; of a mirror the light itself."""
        if roughness < SHARPEST:
            return self._looked_up(directions)
        return np.array([self._mean(roughness, each) for each in directions])

    def _mean(self, roughness, axis):
        above = self._directions @ axis > 0
        weights = lobe(roughness, axis, axis, self._directions[above])[0] * self._areas[above]
        return weights @ self._radiance[above] / weights.sum()

    def diffuse(self, normals):
        """E / pi."""
        cosines = np.maximum(normals @ self._directions.T, 0)
        return (cosines * self._areas) @ self._radiance / np.pi

    def _looked_up(self, directions):
        """The bilinear look-up by the words of docs/conventions.md."""
        height = self._pixels.shape[0]
        x, y, z = directions.T
        row = np.arccos(np.clip(y, -1, 1)) / np.pi * height - 0.5
        column = (0.5 - np.arctan2(x, z) / (2 * np.pi)) * 2 * height - 0.5
        top, left = np.floor(row).astype(int), np.floor(column).astype(int)
        result = 0
        for i, down in ((0, 1 - row + top), (1, row - top)):
            for j, across in ((0, 1 - column + left), (1, column - left)):
                texels = self._pixels[np.clip(top + i, 0, height - 1), (left + j) % (2 * height)]
                result = result + (down * across)[:, None] * texels
        return result
