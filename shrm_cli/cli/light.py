"""`shrm light` edits light that is given by coefficients or tables, and shows its basis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude
from shrm_cli.cli.types import COEFFICIENT, DIMMING, FILE, PATH, RADIANCE, STOPS, TURN, option
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.maps.options import counted
from shrm_cli.vocabulary import Precision

if TYPE_CHECKING:
    from shrm_cli.lights.edit import Tables

_WRITTEN = (".txt", ".npy", ".json")


@click.group()
def light() -> None:
    """Edit light by its harmonic coefficients, or the tables of a light file; show their basis."""


@light.command()
@click.argument("file", metavar="LIGHT", type=PATH)
@options.written_to("Coefficients as .txt, .npy or .json, or a light file, .toml.", required=True)
@option(
    "--order N", click.IntRange(0, 32),
    help="Order of the coefficients.  [default: theirs, 4 of light files and images]",
)  # fmt: skip
@option(
    "--set numbers", COEFFICIENT, "Replace the coefficient of degree L and order M.", multiple=True
)
@option("--scale", RADIANCE, "Multiply the light: a number, or three.", multiple=True)
@option(
    "--dim", DIMMING, multiple=True,
    help="Multiply the light about a direction by X, half of the way at W degrees from it (30).",
)  # fmt: skip
@option("--rotate", TURN, "Turn the light about x, y, z or an axis X/Y/Z.", multiple=True)
@option("--add LIGHT", PATH, "Add another light.", multiple=True)
@options.probe_options
@options.report_options
def edit(file: str, output: str, add: tuple[str, ...], order: int | None, **values: Any) -> None:
    """Edit LIGHT: set, scale, dim and rotate it, in this order, and then add others.

    Each may be given several times, and is done as often, one after the other.

    LIGHT is a file of coefficients, an irradiance map, a light file or a light probe. What is
    written beside it as a light file has its images and discs; all else is coefficients, which
    hold a light to their order. The options from --sampling to --working are
    about the files of LIGHT and of --add.

    \b
      shrm light edit room.irradiance.exr --set 1,-1=-2 -o from-below.npy
      shrm light edit sky.exr --order 6 --dim 40,30:0.2 -o sky.json
      shrm light edit dim.exr --scale 1000 -o bright.toml
      shrm light edit studio.toml --rotate y:40 --add lamp.toml -o turned.toml
    """
    from shrm_cli.lights.light_files import write_coefficients, write_light_file

    usage.check_outputs([output], files=[file, *add], suffixes=(*_WRITTEN, ".toml"))
    to_tables = output.lower().endswith(".toml")
    usage.refuse_inapplicable({"order": (not to_tables, "to coefficients")})
    usage.refuse_inapplicable(
        options.reading_rules(not to_tables, "to coefficients; a light file has them")
    )
    wanted = _edit(values)
    if to_tables:
        tables, working = _edited_tables(file, output, add, wanted)
        write_light_file(output, tables, working)
        count = sum(map(len, tables.values()))
        told = f"{output}: {counted(count, 'light')}"
        conclude({"file": output, "lights": count}, [told])
        return
    found, warnings = shrm.edit_light(file, wanted, add, order, options.make_read_options(values))
    write_coefficients(output, found)
    result = {"file": output, "coefficients": found.tolist()}
    conclude(result, [f"{output}: {len(found)} coefficients"], warnings)


def _edit(values: dict[str, Any]) -> shrm.Edit:
    """Return what the options ask for, which are taken out of the values."""
    import numpy as np

    from shrm_cli.sphere.directions import from_azimuth_elevation, turn_about

    scale, turned = np.ones(3), np.eye(3)
    for factor in values.pop("scale"):
        scale = scale * factor
    for axis, degrees in values.pop("rotate"):
        turned = turn_about(axis, degrees) @ turned
    dims = [
        shrm.Dimming(from_azimuth_elevation(*direction), factor, width)
        for direction, factor, width in values.pop("dim")
    ]
    numbers = [(index, np.broadcast_to(rgb, 3)) for index, rgb in values.pop("numbers")]
    return shrm.Edit(numbers, scale, dims, turned)


def _edited_tables(
    file: str, output: str, add: Sequence[str], wanted: shrm.Edit
) -> tuple[Tables, Any]:
    """Return the tables of a light file after the edit, with those of lights that are added."""
    folder = Path(output).absolute().parent.resolve()
    for path in (file, *add):
        if Path(path).absolute().parent.resolve() != folder:
            raise shrm.ProbeError(
                f"{path}: a light file names what lies beside it; write {Path(output).name} into "
                "its folder"
            )
    tables, working = _tables(file, None)
    tables = wanted.of_tables(file, tables)
    for path in add:
        more, own = _tables(path, working)
        if own != working:
            raise shrm.ProbeError(f"{path}: its `working` is not that of {file}; make it the same")
        for kind, some in more.items():
            tables.setdefault(kind, []).extend(some)
    return tables, working


def _tables(path: str, working: Any) -> tuple[Tables, Any]:
    """Return the tables and `working` of a light file; of another file, those that name it."""
    from shrm_cli.probe.image_file import is_light_file
    from shrm_cli.probe.light_file import read_light_tables
    from shrm_cli.probe.series import holds_series

    shrm.open_probe(path)  # what is wrong with it is said
    if is_light_file(path):
        return read_light_tables(path)
    return {"sh" if holds_series(path) else "probe": [{"file": Path(path).name}]}, working


@light.command()
@click.argument("mesh", metavar="[MESH]", required=False, type=FILE)
@option("-o --output", PATH, "PNG or EXR to write.", default="basis.png")
@option("--order", click.IntRange(0, 8), "Largest degree.", default=2)
@options.view_option
@option("--size", click.IntRange(16, 2048), "Width and height of a picture, pixels.", default=192)
@option("--exposure EV", STOPS, "Stops.", default=1.0)
@option("--transfer FILE", PATH, "What shrm transfer baked of the mesh: its own shadows.")
@option("--columns N", click.IntRange(1), "Columns of the sheet.  [default: as square as possible]")
@options.precision_option
@options.report_options
def basis(
    mesh: str | None,
    output: str,
    order: int,
    view: tuple[float, float],
    size: int,
    exposure: float,
    transfer: str | None,
    columns: int | None,
    precision: Precision,
) -> None:
    """Draw what each harmonic of the light alone does to MESH, by default a sphere.

    White and diffuse, green where the light of a coefficient of 1 makes it brighter, blue where
    it makes it darker. Pictures are named by degree and order.

    \b
      shrm light basis bunny.obj -o basis.png --view 20,10
    """
    from shrm_cli.files.image import file_type, write_picture
    from shrm_cli.geometry.load import load_mesh
    from shrm_cli.render.basis import basis_names, basis_subject
    from shrm_cli.render.drawing import Scene
    from shrm_cli.transfer.file import read_transfer

    file_type(output)
    usage.check_outputs([output], files=[each for each in (mesh, transfer) if each], draws=True)
    usage.refuse_inapplicable({"transfer": (mesh is not None, "to a mesh")})
    viewer, names = shrm.Viewer(*view), basis_names(order)
    loaded = None if mesh is None else load_mesh(mesh)
    baked = None if transfer is None else read_transfer(transfer)
    subject, materials = basis_subject(shrm.basis_maps(order), loaded, baked, size, viewer)
    scene = Scene(subject, materials, names, exposure, None, columns)
    picture = scene.picture(viewer)
    recipe = {
        "light basis": None if mesh is None else Path(mesh).name, "order": order,
        "view": list(view), "size": size, "exposure": exposure,
        **({} if transfer is None else {"transfer": Path(transfer).name}),
    }  # fmt: skip
    pixels = write_picture(output, picture, precision, picture_attributes(recipe, []))
    height, width = scene.shape
    result = {"file": output, "names": names, "width": width, "height": height}
    conclude(result, [f"{output}: {len(names)} harmonics, {width} x {height}, {pixels}"])
