"""`render`: a picture of maps, as a distant viewer sees them on a sphere or on a mesh."""

import os
from collections.abc import Sequence

import numpy as np

from shrm_cli.errors import ArgumentError
from shrm_cli.files.image import Picture
from shrm_cli.geometry.load import load_mesh
from shrm_cli.maps.base import Map
from shrm_cli.messages import refuse_arguments, several, whole_number
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.render.camera import Viewer
from shrm_cli.render.drawing import Film, Lit, on_sphere, on_stage
from shrm_cli.render.lit import lit_maps, refuse_surface
from shrm_cli.render.moving import Moment
from shrm_cli.render.scene_file import Shown, is_scene_name, read_scene
from shrm_cli.render.stage import Stage
from shrm_cli.rooms.grid import ProbeGrid, as_grid
from shrm_cli.rooms.lit import open_lit
from shrm_cli.vocabulary import MAX_PICTURE_SIZE, MAX_STOPS


def render(
    maps: Sequence[Map | str | os.PathLike[str]] | Map | str | os.PathLike[str],
    view: tuple[float, float] = (0.0, 0.0),
    size: int | tuple[int, int] = 512,
    *,
    mesh: str | os.PathLike[str] | None = None,
    probe: AnyProbe | ProbeGrid | None = None,
    background: AnyProbe | None = None,
    exposure: float = 0.0,
    roughness: float | None = None,
    f0: str | float | Sequence[float] | None = None,
    anisotropy: float | None = None,
    taps: int | None = None,
    fov: float | None = None,
    target: tuple[float, float, float] | None = None,
    distance: float | None = None,
    place: tuple[float, float, float] | None = None,
    radius: float | None = None,
    no_box: bool = False,
    progress: Progress | None = None,
) -> Picture:
    """Draw a sphere or a mesh of a map, or a sheet of them of several maps.

    Parameters
    ----------
    maps : Map, path-like, or a sequence of them
        A path may be that of a grid of probes, which lights white diffuse surfaces.
    view : tuple of 2 float
        Azimuth and elevation of the viewer, degrees.
    size : int or tuple of 2 int
        Width and height of a picture, pixels; those of spheres are equal.
    mesh : path-like, optional
        A mesh with its materials, or a scene, in place of the sphere.
    probe : Probe, ProbeGrid, path-like or array, optional
        The light of product textures that hold none: of one place, or of a grid of probes.
    background : Probe, path-like or array, optional
        What is seen behind; black by default.
    exposure : float
        Stops.
    roughness, f0, anisotropy, taps
        The surface that maps of light alone are shown as, see `shrm_cli.render.lit.shaded_maps`.
    fov, target, distance
        Of the camera before a mesh, see `shrm_cli.render.camera`.
    place, radius
        Where the sphere is within the proxy boxes of its maps, and how large.
    no_box : bool
        Whether a mesh leaves the proxy boxes of the maps out.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    ndarray of float32, shape (height, width, 3)
        Linear, in the primaries of the first map.

    Raises
    ------
    MapError, MeshError, ProbeError, BrdfError

    Examples
    --------
    >>> white = shrm.prefilter("probes/studio.exr", to="irradiance")
    >>> shrm.render(white, view=(30, 10), size=64).shape
    (64, 64, 3)
    """
    shape = _shape(size, mesh is None)
    if np.shape(view) != (2,) or not np.isfinite(view).all():
        raise ArgumentError("view", f"is {view!r}; give azimuth and elevation, degrees")
    if not abs(exposure) <= MAX_STOPS:
        raise ArgumentError("exposure", f"is {exposure!r}; give {MAX_STOPS:g} stops at most")
    unused = (
        {"fov": fov, "target": target, "distance": distance, "no_box": no_box or None}
        if mesh is None
        else {"place": place, "radius": radius}
    )
    refuse_arguments("a sphere" if mesh is None else "a mesh", **unused)
    if place is None:
        refuse_arguments("a sphere that is at no `place`", radius=radius)
    is_scene = mesh is not None and is_scene_name(os.fspath(mesh))  # which names maps itself
    given = several(maps, "" if is_scene else "maps")
    names = [each.representation if isinstance(each, Map) else os.fspath(each) for each in given]
    opened = [each if isinstance(each, Map) else open_lit(each) for each in given]
    opened, _ = lit_maps(opened, names, _light(probe), None)
    lit, moments = Lit(opened, names, (), ()), [Moment(Viewer(*view))]
    surface = {
        "roughness": roughness, "f0": f0, "anisotropy": anisotropy, "taps": taps,
        "place": place, "radius": radius,
    }  # fmt: skip
    if mesh is None:
        refuse_surface(opened, roughness=roughness, f0=f0, anisotropy=anisotropy, taps=taps)
        drawing = on_sphere(lit, shape[0], surface)
    else:
        name = os.fspath(mesh)
        if is_scene:
            stage = Stage.of(read_scene(name, opened))
        else:
            shown = Shown(roughness=roughness, f0=f0, anisotropy=anisotropy, taps=taps)
            stage = Stage.of([shown.actor(load_mesh(name), opened[0].info.chromaticities)])
        camera = {"fov": fov, "target": target, "distance": distance, "no_box": no_box}
        drawing = on_stage(lit, stage, shape, moments, camera)
    sky = None if background is None else as_probe(background)
    (picture,) = Film(drawing, moments, names, exposure, (sky, None)).pictures(progress)
    return picture


def _shape(size: int | tuple[int, int], is_sphere: bool) -> tuple[int, int]:
    """Return the width and the height of a picture, which are within limits."""
    both = tuple(np.broadcast_to(size, 2).tolist()) if np.shape(size) in ((), (2,)) else ()
    if len(both) != 2 or (is_sphere and both[0] != both[1]):
        raise ArgumentError("size", f"is {size!r}; give {'one number' if is_sphere else 'two'}")
    width, height = (whole_number("size", each, 1, MAX_PICTURE_SIZE) for each in both)
    return width, height


def _light(probe: AnyProbe | ProbeGrid | None) -> Probe | ProbeGrid | None:
    """Return a probe or a grid of probes, from the name of its file or from itself."""
    if probe is None or isinstance(probe, ProbeGrid):
        return probe
    grid = as_grid(probe) if isinstance(probe, str | os.PathLike) else None
    return as_probe(probe) if grid is None else grid
