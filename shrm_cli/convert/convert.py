"""`convert`: other representations of maps, and other layouts of maps and probes.

What only some conversions need is imported by these: most take less time than imports do.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

import numpy as np

from shrm_cli import vocabulary
from shrm_cli.arrays import Array
from shrm_cli.convert.made import Converted, ConvertedMap, ConvertedProbe, Layers
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.info import in_primaries, with_stated_primaries
from shrm_cli.messages import refuse_arguments
from shrm_cli.probe.options import ColorReading, ReadOptions, with_keywords
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, using


def convert(
    source: Map | Probe | str | os.PathLike[str] | Array,
    to: str,
    *,
    size: int | None = None,
    orientation: vocabulary.Orientation | None = None,
    sampling: vocabulary.Sampling | None = None,
    shader: str | None = None,
    view: tuple[float, float] | None = None,
    by: vocabulary.Lookup | None = None,
    roughness: float | None = None,
    f0: str | None = None,
    mips: bool = False,
    reading: ReadOptions | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Converted:
    """Make another representation of a map, or another layout of a map or a probe.

    Parameters
    ----------
    source : Map, Probe, path-like or ndarray
        An array holds the pixels of a probe.
    to : str
        A representation, of a map; a layout of images; or ``layers``, the textures that the code of
        a map reads.
    size : int, optional
        Texels along a face's edge; the height of a lat-long or an angular map.
    orientation, sampling : str, optional
        How the faces of a cube are turned, and where edge pixels lie, in what is made.
    shader : str, optional
        The language of code that looks the map up: of ``layers`` in them, of representations in
        arrays of cube maps, and of irradiance in no textures at all. C reads layers alone.
    view : tuple of 2 float, optional
        Azimuth and elevation of a distant viewer, degrees: the lat-long is of the light that a map
        reflects there.
    by : {"reflection", "normal"}, optional
        With a view, what the direction of a pixel is.
    roughness, f0 : float and str, optional
        With a view, the surface that maps of light alone are shown as.
    mips : bool
        Whether the levels of a split sum become mip levels of one file.
    reading : ReadOptions, optional
        How the file of a probe is read; maps have their light turned, and their primaries changed.
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **options
        Those of the representation that `Map.converted` takes, and attributes of `ReadOptions`,
        such as `yaw`, which replace those of `reading`.

    Returns
    -------
    Converted
        Its `save` writes it, and returns what `shrm convert` tells.

    Raises
    ------
    ArgumentError
        If an argument does not apply, or `to` is nothing that the source can become.
    MapError, ProbeError

    Examples
    --------
    >>> white = shrm.prefilter("probes/studio.exr", "lambertian", eps=0.01)
    >>> shrm.convert(white, "cabral").save("white.exr").result["maps"]
    12
    """
    if view is None:
        refuse_arguments("what is seen from no `view`", by=by, roughness=roughness, f0=f0)
    others = vocabulary.LAYERS, *vocabulary.LAYOUTS
    if to not in others and (to == vocabulary.AUTO or not registry.is_known(to)):
        known = ", ".join([*registry.names(), *others])
        raise ArgumentError("to", f"{to!r} is none of {known}")
    if to not in (vocabulary.LAYERS, *vocabulary.REPRESENTATIONS):
        refuse_arguments(f"`to` {to}", shader=shader)
    of_probes = {each.name for each in fields(ReadOptions)} & options.keys()
    keywords: Any = {name: options.pop(name) for name in of_probes}
    reading = with_keywords(reading or ReadOptions(), keywords)
    if isinstance(source, Probe | np.ndarray) or not (isinstance(source, Map) or is_map(source)):
        refuse_arguments("probes", view=view, mips=mips or None, **options)
        return _of_probe(source, to, size, orientation, sampling, reading, progress)
    name = source.what if isinstance(source, Map) else os.fspath(source)
    found, notes = _read(source, name, reading)
    if to == vocabulary.LAYERS:
        refuse_arguments(
            "`to` layers", size=size, orientation=orientation, sampling=sampling, **options
        )
        return Layers(found, name, _code(found, shader, vocabulary.LAYERS), notes)
    if view is None and not mips:
        made = _of_map(found, name, to, size, orientation, sampling, notes, options)
        return replace(made, code=_code(made.map, shader))
    if to not in (vocabulary.MIP_LAYOUTS if view is None else ("latlong",)):
        raise ArgumentError("to", f"{to} is no plain image; take latlong")
    refuse_arguments("plain images", orientation=orientation, **options)
    from shrm_cli.convert.plain import mips_of, seen_from

    if view is None:
        plain: Any = mips_of(found, name, to, size, sampling)
    else:
        refuse_arguments("a single `view`", mips=mips or None)
        surface = roughness, f0
        plain = seen_from(found, name, view, by, size, sampling, surface, progress)
    return replace(plain, notes=(*plain.notes, *notes))


def _code(found: Map, language: str | None, textures: str | None = None) -> str | None:
    """Return the code that looks a map up in its textures, if there shall be some."""
    if language is None:
        return None
    from shrm_cli.maps.shader.code import written_code

    return written_code(found, language, textures).text


def _read(
    source: Map | str | os.PathLike[str], name: str, reading: ReadOptions
) -> tuple[Map, tuple[str, ...]]:
    """Read a map, turn its light and bring it into other primaries.

    Returns `found`; and `notes`, what is to be said of its colors.
    """
    turn = reading.matrix()
    found = source if isinstance(source, Map) else open_map(source)
    colors = ColorReading.of(found.info.chromaticities, reading)
    if reading.primaries is not None:
        found = with_stated_primaries(found, colors.own)  # type: ignore[arg-type]
    if not np.array_equal(turn, np.eye(3)):
        found = found.turned(turn)
    if reading.working is not None:
        found = in_primaries(found, colors.chromaticities)  # type: ignore[arg-type]
    return found, tuple(f"{name}: {line}" for line in colors.notes)


def _of_map(
    found: Map,
    name: str,
    to: str,
    size: int | None,
    orientation: vocabulary.Orientation | None,
    sampling: vocabulary.Sampling | None,
    notes: tuple[str, ...],
    options: dict[str, Any],
) -> ConvertedMap:
    """Make a map of another representation, or lay the same one out anew."""
    if to not in vocabulary.LAYOUTS:
        made = found.converted(to, size, sampling, **options)
        return ConvertedMap(
            made, "openexr", orientation or vocabulary.default_orientation("openexr"), notes
        )
    if not found.cube_count:
        words = f"applies to maps with images; {name} holds coefficients and no images"
        raise ArgumentError("to", f"{to} {words}{_plain_instead(found, name, to)}")
    if to == "latlong" and not found.is_rearrangeable:
        raise MapError(f"{name}: {found.what} is no single image{_plain_instead(found, name, to)}")
    refuse_arguments(f"`to` {to}", **options)
    made = found.resampled(size, sampling)
    return ConvertedMap(made, to, orientation or vocabulary.default_orientation(to), notes)


def _plain_instead(found: Map, name: str, to: str) -> str:
    """Say what makes a lat-long of a map that is none itself, for the end of a message."""
    from shrm_cli.maps.kinds import MaterialMap
    from shrm_cli.maps.splitsum.mips import mip_chain

    if to != "latlong" or isinstance(found, MaterialMap):
        return ""
    with suppress(MapError):
        mip_chain(found, name)
        return "; give `mips` for its levels as mip levels, or `view` for what a viewer sees"
    return "; give `view` for what a viewer sees"


def _of_probe(
    source: Probe | str | os.PathLike[str] | Array,
    to: str,
    size: int | None,
    orientation: vocabulary.Orientation | None,
    sampling: vocabulary.Sampling | None,
    reading: ReadOptions,
    progress: Progress | None,
) -> ConvertedProbe:
    """Lay a probe out anew."""
    from shrm_cli.probe.open import as_probe
    from shrm_cli.probe.resample import to_layout

    probe = as_probe(source, reading)
    name = probe.name
    if to == vocabulary.LAYERS:
        raise ArgumentError("to", f"{to}: {name} is no map; make one by shrm prefilter")
    if to not in vocabulary.LAYOUTS:
        words = f"{name} is no map; a probe becomes {to} by shrm prefilter"
        raise ArgumentError("to", f"{to}: {words}")
    sampled, turned = sampling or "center", orientation or vocabulary.default_orientation(to)
    with using(progress):
        image = to_layout(probe, to, turned, size, sampled)
    return ConvertedProbe(probe, image, to, turned, sampled)
