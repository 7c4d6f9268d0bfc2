"""Opening probes: files of any kind, or pixels in memory, as the probe that they hold.

Files that nothing here reads may be read by an installed package: an entry point of the group
`plugins.READERS` is called what their suffix is, in small letters and without its dot, and names a
function. It gets the path of the file, and returns its pixels and what they are.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import PluginError, ProbeError
from shrm_cli.files.exr_header import says_map
from shrm_cli.messages import explained
from shrm_cli.probe.image import ArrayImage, detect_layout
from shrm_cli.probe.image_file import ImageFile, is_image_name, is_light_file, is_stage
from shrm_cli.probe.options import ReadKeywords, ReadOptions, with_keywords
from shrm_cli.probe.probe import Probe, make_probe
from shrm_cli.probe.reader import check_file
from shrm_cli.records import record
from shrm_cli.vocabulary import FACES, Layout, Sampling

if TYPE_CHECKING:
    from shrm_cli.probe.dds_file import DdsFile

_DDS = b"DDS "
"""The bytes that a DDS file begins with."""
_SQUARE = 0.01
"""How far the aspect ratio of a square pixel may be from 1."""


def open_probe(
    path: str | os.PathLike[str],
    options: ReadOptions | None = None,
    **keywords: Unpack[ReadKeywords],
) -> Probe:
    """Open a probe of any layout; its pixels are read when they are needed.

    Parameters
    ----------
    path : path-like
        An image file, six of them with ``%`` in place of ``+X``, ``-X``, ..., a light file
        (``.toml``), which names probes and circular lights, a stage of USD (``.usda``, ``.usdz``,
        ...), or a file of harmonic coefficients, see `shrm_cli.probe.series`.
    options : ReadOptions, optional
        How the file is to be understood.
    **keywords
        Attributes of `ReadOptions`, or `clamp` and `fix_nonfinite` of its `PixelPolicy`; they
        replace those of `options`.

    Raises
    ------
    ProbeError
        If it is no usable image, its layout is unknown, or a keyword or its value is.
    ArgumentError
        If it is no path.

    Examples
    --------
    >>> probe = shrm.open_probe("probes/studio.exr", yaw=30)
    >>> probe.layout, probe.height
    ('latlong', 256)
    """
    options = with_keywords(options or ReadOptions(), keywords)
    return _opened(str(path), options).within(options.box, options.at)


def _opened(name: str, options: ReadOptions) -> Probe:
    """Open a probe, whose box is the one that its file tells."""
    # Few probes are sums of others, and are opened by these modules.
    if is_light_file(name):
        from shrm_cli.probe.light_file import open_light_file

        return open_light_file(name, options, open_probe)
    if is_stage(name):
        from shrm_cli.probe.usd import open_stage

        return open_stage(name, options, open_probe)
    if _may_hold_series(name):
        from shrm_cli.probe.series import holds_series, open_series

        if holds_series(name):
            return open_series(name, options)
    if "%" in os.path.basename(name) and not os.path.exists(name):
        if options.layout not in (None, "faces"):
            raise ProbeError(f"{name}: six files are not {options.layout}; leave `layout` out")
        files = _open_faces(name, options)
        layout: Layout = "faces"
    elif options.layout == "faces":
        raise ProbeError(f"{name}: write % in place of +X, -X, ... to name the files of six faces")
    elif not is_image_name(name) and (probe := _open_by_package(name, options)) is not None:
        return probe
    else:
        files = (_open_file(name, options),)
        layout = options.layout or _layout_of(files[0])
    first = files[0]
    sampling: Sampling = "border" if first.border_sampled else "center"
    return make_probe(name, files, layout, sampling, options, first.chromaticities, first.proxy)


def _may_hold_series(name: str) -> bool:
    """Whether a file may hold coefficients of light, which is found out by more modules."""
    suffix = Path(name).suffix.lower()
    if suffix != ".exr":
        return suffix in (".txt", ".npy", ".json")
    return os.path.isfile(name) and says_map(name)


def _open_file(name: str, options: ReadOptions) -> ImageFile | DdsFile:
    path = check_file(name)
    dds = _open_dds(path)
    if dds is None:
        return ImageFile.open(path, options.linearize, options.part_name(), options.layer)
    if options.part is not None or options.layer is not None:
        raise ProbeError(f"{name}: a DDS file has no parts or layers; leave `part` and `layer` out")
    return dds


def _open_by_package(name: str, options: ReadOptions) -> Probe | None:
    """Open a file that an installed package reads; None where none does."""
    read = read_by_package(name)
    if read is None:
        return None
    image, said = read
    layout = options.layout or said.get("layout")
    layout = layout or detect_layout(name, image.width, image.height, "")
    options = replace(options, orientation=options.orientation or said.get("orientation"))
    sampling: Sampling = said.get("sampling", "center")
    return make_probe(name, (image,), layout, sampling, options, said.get("chromaticities"))


def _open_dds(path: Path) -> DdsFile | None:
    """Open a file as a DDS file; None where it is none that is read here."""
    with open(path, "rb") as stream:
        if stream.read(len(_DDS)) != _DDS:
            return None
    from shrm_cli.probe.dds_file import DdsFile  # most probes are none

    return DdsFile.open(path)


def _layout_of(file: ImageFile | DdsFile) -> Layout:
    """The layout of a file that nobody named, which follows from its shape."""
    aspect = file.encoding.pixel_aspect
    if not file.envmap and abs(aspect - 1) > _SQUARE:
        raise ProbeError(
            f"{file.name}: its pixels are not square (aspect {aspect:.3g}), so that "
            f"{file.width} x {file.height} does not tell its layout; give `layout`, or resample it"
        )
    return detect_layout(file.name, file.width, file.height, file.envmap)


def face_paths(name: str) -> list[str]:
    """Names of the six files that a name with ``%`` stands for, in the order of `FACES`."""
    folder, pattern = os.path.split(name)
    return [os.path.join(folder, pattern.replace("%", face)) for face in FACES]


def _open_faces(name: str, options: ReadOptions) -> tuple[ImageFile | DdsFile, ...]:
    """Open the six files that a name with ``%`` stands for, which must be of one size."""
    files = tuple(_open_file(path, options) for path in face_paths(name))
    for file in files:
        if (file.width, file.height) != (files[0].width, files[0].height):
            raise ProbeError(
                f"{file.path}: {file.width} x {file.height} pixels, but {files[0].path} has "
                f"{files[0].width} x {files[0].height}; make all six the same"
            )
    return files


AnyProbe = Probe | str | os.PathLike[str] | NDArray[np.floating]
"""A probe, the name of its file, or its pixels."""


def as_probe(probe: AnyProbe, options: ReadOptions | None = None) -> Probe:
    """A probe from itself, from the name of its file, read by options, or from its pixels."""
    if isinstance(probe, Probe):
        return probe
    if isinstance(probe, np.ndarray):
        return Probe.from_array(probe)
    return open_probe(probe, options)


_KEYS = {"layout", "orientation", "sampling", "chromaticities"}


@record(eq=False)
class ReadImage(ArrayImage):
    """Pixels that a package has read from a file."""

    path: Path  # type: ignore[assignment]
    file_format: str


def read_by_package(name: str) -> tuple[ReadImage, Mapping[str, Any]] | None:
    """Read a file by the package that names its suffix; None where none does.

    Returns the image, and what the package says of it: `Probe.from_array` has these arguments.
    """
    from shrm_cli import plugins  # rarely needed

    suffix = Path(name).suffix.lower().removeprefix(".")
    point = plugins.installed(plugins.READERS).get(suffix)
    if point is None:
        return None
    function, where = plugins.load(point), plugins.where(point)
    if not callable(function):
        raise PluginError(f"{where} is no function; make it one")
    path = check_file(name)
    try:
        pixels, description = function(path)
        unknown = sorted(description.keys() - _KEYS)
    except ProbeError:
        raise
    except Exception as error:
        raise PluginError(f"{name}: {where} failed: {explained(error)}") from error
    if unknown:
        known = ", ".join(sorted(_KEYS))
        raise PluginError(f"{where} describes {unknown[0]!r:.60}; it may tell {known}")
    return ReadImage(ArrayImage.copy_of(pixels, name).pixels, name, path, suffix), description
