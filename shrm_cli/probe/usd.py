"""Stages of USD in place of a probe: the sum of their dome lights and distant lights.

OpenUSD reads them (the package `usd-core`, used by this module alone). Files may come from
anywhere: every layer and every texture has to lie in the folder of the file that is named or below
it, and what a stage grows to by its references is counted before it is composed.

References: OpenUSD, pxr/usd/usdLux/schema.usda: a lat-long of a dome lies as OpenEXR defines it,
which is ours. Where the pole of a `DomeLight_1` is +Z, the centre of the lat-long looks along -Y.
Distant lights shine along their own -Z.
"""

import hashlib
import os
import re
import stat
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.extras import install
from shrm_cli.files.openimageio import caught
from shrm_cli.files.texture import referenced_file
from shrm_cli.files.whole import note, scratch_folder
from shrm_cli.probe.disc import LEAST_RADIUS, Disc, facing_factor
from shrm_cli.probe.image import ArrayImage
from shrm_cli.probe.light_sum import LightSum, SumImage, Term, in_one_color
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.reader import check_file
from shrm_cli.sphere.directions import normalize

_MOST_BYTES = 2**28
"""The most bytes of a layer."""
_MOST_LAYERS, _MOST_PRIMS, _MOST_LIGHTS, _MOST_PLACES = 256, 10**6, 1000, 2**16
_Z_UP = ReadOptions(up="z").matrix()
"""The turn from a stage whose +Z is up to our axes; its inverse turns a dome from +Y to +Z."""
_PLACE = re.compile(r"([^/\\:'\n]{1,255}):(\d+):\d+: ")
"""Where OpenUSD says that the text of a layer is wrong. It quotes what may be a line of 100 kB."""
_ANIMATED = "is animated, and is as in its first frame"
_LAYOUTS = {"latlong": "latlong", "angular": "angular", "cubeMapVerticalCross": "vcross"}


def open_stage(name: str, options: ReadOptions, opening: Callable[..., Probe]) -> LightSum:
    """Open the lights of a stage that are infinitely far away, as one probe.

    `name` is a file that ends with .usda, .usdc, .usd or .usdz. `options` are what turns a probe
    turns the stage, after its up axis was turned to +Y; all else is said of the textures. `opening`
    opens the textures, as `open_probe` does.
    """
    with _opened(name, opening) as (lights, content):
        return lights.sum(options, content)


def open_domes(name: str, opening: Callable[..., Probe]) -> list[tuple[Array, LightSum]]:
    """Open each dome light of a stage by itself, and where it stands in our axes, shape (3,).

    Programs write so what probes saw in several places. All other lights are left out.
    """
    with _opened(name, opening) as (lights, content):
        return lights.domes(content)


@contextmanager
def _opened(name: str, opening: Callable[..., Probe]) -> Iterator[tuple["_Lights", bytes]]:
    """Yield the lights of a stage, and the digest of its layers; refuse what cannot be read."""
    try:
        import pxr.Tf
    except ImportError as error:
        said = f"{name}: stages of USD need the package usd-core; {install('usd')}"
        raise ProbeError(said) from error
    path = check_file(name)
    try:
        with _unpacked(path) as root, caught():
            content = _check_layers(root)
            yield _Lights(name, path, root, opening), content
    except pxr.Tf.ErrorException as error:
        place = None
        with suppress(UnicodeDecodeError):  # it quotes the layer, whose bytes may be no text
            place = _PLACE.search(str(error))
        where = f": see line {place[2]} of {place[1]}" if place else ""
        said = f"{name}: its lights cannot be read (damaged, or no USD{where})"
        raise ProbeError(said) from error
    except (ValueError, OSError, RecursionError, zipfile.BadZipFile) as error:
        why = " ".join(str(error).split())[:200]
        if isinstance(error, RecursionError):
            why = "nested too deeply; flatten its lights"
        raise ProbeError(f"{name}: its lights cannot be read ({why})") from error


@contextmanager
def _unpacked(path: Path) -> Iterator[Path]:
    """Yield the layer that a stage begins with; a package's files are in a folder meanwhile."""
    if not zipfile.is_zipfile(path):
        yield path
        return
    with zipfile.ZipFile(path) as package, scratch_folder() as folder:
        files = [each for each in package.infolist() if not each.is_dir()]
        if not 1 <= len(files) <= _MOST_LAYERS * 16:
            raise ValueError(f"a package of {len(files):,} files")
        unpacked = []  # the names are the package's own, and may have led out of the folder
        for each in files:
            if each.compress_type != zipfile.ZIP_STORED or stat.S_ISLNK(each.external_attr >> 16):
                raise ValueError("packages of USD hold files as they are; make it by usdzip")
            unpacked.append(package.extract(each, folder))
        yield Path(unpacked[0])


class _Layers:
    """The layers of a stage, none of which leads out of the folder of the first, `root`."""

    def __init__(self, root: Path) -> None:
        self.digest = hashlib.sha256()
        """The digest of the bytes of all layers that were opened."""
        self.found: dict[str, Any] = {}
        self._root = root
        self._counts: dict[tuple[str, str], int] = {}

    def opened(self, path: Path) -> Any:
        """Open a layer, and those that lie below it."""
        from pxr import Sdf

        real = os.path.realpath(path)
        if real not in self.found:
            if path.stat().st_size > _MOST_BYTES or len(self.found) == _MOST_LAYERS:
                raise ValueError("its layers are too large, or too many; flatten its lights")
            note(path)
            self.digest.update(path.read_bytes())
            self.found[real] = layer = Sdf.Layer.FindOrOpen(os.fspath(path))
            layer.Reload(True)  # it may be in memory as it was
            for each in layer.subLayerPaths:
                self._named(layer, each)
        return self.found[real]

    def _named(self, layer: Any, asset: str) -> Any:
        """The layer that another one names; without a name it is that one."""
        if not asset:
            return layer
        path = os.path.relpath(Path(layer.realPath).parent / asset, self._root.parent)
        return self.opened(referenced_file(os.fspath(self._root), path, "layer"))

    def prims(self, layer: Any, path: Any) -> int:
        """At most how many prims a prim adds to a stage, with what it refers to."""
        key = layer.realPath, str(path)
        spec = layer.GetPrimAtPath(path)
        if spec is None or key in self._counts:
            return self._counts.get(key, 0)
        self._counts[key] = 0  # what refers to itself is no prim
        if spec.HasInfo("clips"):
            raise ValueError("value clips are not read; flatten its lights")
        found = 1
        for each in (spec.referenceList, spec.payloadList):
            for arc in each.GetAddedOrExplicitItems():
                target = self._named(layer, arc.assetPath)
                home = arc.primPath or f"/{target.defaultPrim.lstrip('/')}"
                found += self.prims(target, home) if home != "/" else 0
        for each in (spec.inheritPathList, spec.specializesList):
            found += sum(self.prims(layer, arc) for arc in each.GetAddedOrExplicitItems())
        variants = [v.primSpec for s in spec.variantSets.values() for v in s.variants.values()]
        below = *spec.nameChildren, *variants
        found += sum(self.prims(layer, each.path) for each in below if each)
        self._counts[key] = found
        return found


def _check_layers(root: Path) -> bytes:
    """Return the digest of all layers of a stage, none of which leads out of its folder.

    How many prims the stage may have is counted without composing it: each reference adds all
    that it refers to, and few of them within each other would fill the memory.
    """
    layers = _Layers(root)
    layers.opened(root)
    total = done = 0
    while done < len(layers.found):  # which may become more by what is found
        layer = [*layers.found.values()][done]
        total += sum(layers.prims(layer, each.path) for each in layer.rootPrims if each)
        done += 1
    if total > _MOST_PRIMS:
        raise ValueError(f"{total:,} prims; write its lights into a layer of their own")
    return layers.digest.digest()


class _Lights:
    """The lights of a stage, and what is said about them.

    `name` is what messages call the stage. `path` is the file that was named, `root` the layer that
    the stage begins with. `opening` opens the textures.
    """

    def __init__(self, name: str, path: Path, root: Path, opening: Callable[..., Probe]) -> None:
        from pxr import Usd, UsdGeom

        self.name, self.path, self.root, self.opening = name, path, root, opening
        self.stage = Usd.Stage.Open(os.fspath(root))
        is_z_up = UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z
        self.axes = _Z_UP if is_z_up else np.eye(3)
        self.notes: list[str] = []

    def sum(self, options: ReadOptions, content: bytes) -> LightSum:
        """The sum of the lights that are far and are seen."""
        from pxr import UsdLux

        terms, distant, near = [], [], 0
        for prim in self._seen():
            if self._is_dome(prim):
                terms.append(self._dome(prim, options))
            elif prim.IsA(UsdLux.DistantLight):
                distant.append(prim)
            elif not prim.IsA(UsdLux.PortalLight):
                near += 1
            if len(terms) + len(distant) > _MOST_LIGHTS:
                raise ValueError(f"more than {_MOST_LIGHTS:,} lights")
        if not terms and not distant:
            raise ValueError("it has no DomeLight, DomeLight_1 or DistantLight that is visible")
        if near:
            self.notes.append(f"near lights are left out: {near}")
        colors = next((t.probe.chromaticities for t in terms if t.probe.chromaticities), None)
        converted, told = in_one_color(terms, colors, options.working is not None)
        discs = tuple(self._disc(each) for each in distant)
        notes = (*dict.fromkeys(self.notes), *told)
        image = SumImage(
            self.name, self.path, content, converted, discs, notes, file_format="USD stage"
        )
        return LightSum.of(image, options.matrix(), colors)

    def domes(self, content: bytes) -> list[tuple[Array, LightSum]]:
        """The dome lights that are seen, a light each, and where they stand."""
        found: list[tuple[Array, LightSum]] = []
        for prim in filter(self._is_dome, self._seen()):
            if len(found) == _MOST_PLACES:
                raise ValueError(f"more than {_MOST_PLACES:,} dome lights")
            term = self._dome(prim, ReadOptions())
            name = f"{self.name}, {prim.GetPath()}"
            own, notes = content + str(prim.GetPath()).encode(), (*dict.fromkeys(self.notes),)
            image = SumImage(name, self.path, own, (term,), (), notes, file_format="USD stage")
            light = LightSum.of(image, np.eye(3), term.probe.chromaticities)
            found.append((np.asarray(self.axes @ self._world(prim)[3, :3]), light))
            self.notes.clear()
        return found

    def _seen(self) -> Iterator[Any]:
        """Yield the lights that are visible."""
        from pxr import UsdGeom, UsdLux

        for prim in self.stage.Traverse():
            if not prim.HasAPI(UsdLux.LightAPI):
                continue
            if UsdGeom.Imageable(prim).ComputeVisibility() == UsdGeom.Tokens.invisible:
                self.notes.append(f"{prim.GetName()} is invisible, and is left out")
            else:
                yield prim

    def _is_dome(self, prim: Any) -> bool:
        from pxr import UsdLux

        return bool(prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1))

    def _dome(self, prim: Any, options: ReadOptions) -> Term:
        from pxr import Sdf, UsdLux

        matrix, scale = self._matrix(prim), self._color(prim)
        pole = prim.GetAttribute("poleAxis").Get() if prim.IsA(UsdLux.DomeLight_1) else "Y"
        if pole == "Z" or (pole == "scene" and self.axes is _Z_UP):
            matrix = matrix @ _Z_UP.T
        if prim.GetRelationship("portals").GetTargets():
            self.notes.append(f"{prim.GetName()}: its portals are ignored; all of it is seen")
        file, kind = (self._value(prim, f"inputs:texture:{each}") for each in ("file", "format"))
        if not isinstance(file, Sdf.AssetPath) or not file.path:
            white = Probe.from_array(np.ones((16, 32, 3)), name=prim.GetName())
            return Term(white, scale)
        if kind not in (*_LAYOUTS, "automatic"):
            raise ValueError(f"{prim.GetName()}: a {kind} is no layout that is read; convert it")
        layout = options.layout or _LAYOUTS.get(kind)
        reading = replace(options, yaw=0, pitch=0, roll=0, mirror=False, up="y", layout=layout)
        folder = self.root.parent
        found = os.path.relpath(file.resolvedPath or folder / file.path, folder)
        probe = self.opening(referenced_file(os.fspath(self.root), found), reading)
        if self.root != self.path:  # the files of a package are gone when pixels are read
            images = [(each.read(0, each.height), found) for each in probe.images]
            arrays = tuple(ArrayImage.copy_of(*each) for each in images)
            probe = replace(probe, name=found, images=arrays)
        return Term(replace(probe, matrix=matrix), scale)

    def _disc(self, prim: Any) -> Disc:
        """A distant light; one without a size is as small as discs can be."""
        angle = self._value(prim, "inputs:angle")
        radius = max(np.radians(angle) / 2, LEAST_RADIUS)
        color = self._color(prim)
        if self._value(prim, "inputs:normalize") or angle <= 0:
            color = color / facing_factor(radius)
        return Disc(normalize(self._matrix(prim)[:, 2]), radius, color)

    def _matrix(self, prim: Any) -> Array:
        """What turns the axes of a light to ours, shape (3, 3)."""
        rows = self._world(prim)[:3, :3]
        if not np.isfinite(rows).all() or np.linalg.matrix_rank(rows) < 3:
            raise ValueError(f"{prim.GetName()}: its transform is no rotation")
        left, sizes, right = np.linalg.svd(rows.T)
        if np.ptp(sizes) > 1e-4 * sizes[0]:
            self.notes.append(f"{prim.GetName()}: its transform scales unevenly, and only turns it")
        return np.asarray(self.axes @ left @ right)

    def _world(self, prim: Any) -> Array:
        """What takes row vectors of a light to the stage, as OpenUSD has it, shape (4, 4)."""
        from pxr import Usd, UsdGeom

        if UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            self.notes.append(f"{prim.GetName()} {_ANIMATED}")
        placed = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.EarliestTime())
        return np.array(placed)

    def _color(self, prim: Any) -> Array:
        """What the texture of a light is multiplied by, or its own radiance, shape (3,)."""
        from pxr import UsdLux

        names = ("color", "intensity", "exposure")
        color, intensity, exposure = (
            np.array(self._value(prim, f"inputs:{each}"), dtype=float) for each in names
        )
        with np.errstate(over="ignore", invalid="ignore"):  # it is refused below
            color = color * intensity * np.exp2(exposure)
        if self._value(prim, "inputs:enableColorTemperature"):
            kelvin = self._value(prim, "inputs:colorTemperature")
            color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
        if any(self._value(prim, f"inputs:{each}") != 1 for each in ("diffuse", "specular")):
            self.notes.append(f"{prim.GetName()}: its diffuse and specular factors are ignored")
        if prim.GetRelationship("light:filters").GetTargets():
            self.notes.append(f"{prim.GetName()}: its filters are ignored")
        if not (np.isfinite(color).all() and color.min() >= 0 and color.max() <= 1e30):
            raise ValueError(f"{prim.GetName()}: its color, intensity and exposure give no light")
        return np.asarray(color)

    def _value(self, prim: Any, attribute: str) -> Any:
        from pxr import Usd

        found = prim.GetAttribute(attribute)
        if found.ValueMightBeTimeVarying():
            self.notes.append(f"{prim.GetName()} {_ANIMATED}")
        value = found.Get(Usd.TimeCode.EarliestTime())
        usual = prim.GetPrimDefinition().GetAttributeFallbackValue(attribute)
        if usual is not None and type(value) is not type(usual):
            raise ValueError(f"{prim.GetName()}: {attribute} has no value of its type")
        return value
