"""Materials of MaterialX files: constants of their surface nodes, and the means of textures.

The package `MaterialX` reads the files, and is used by this module alone. Files may come from
anywhere: how deep they are nested is counted before, and no other file is included in them.
"""

from collections.abc import Callable
from typing import Any
from xml.parsers import expat

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.imported.surfaces import SURFACES, Material, chosen
from shrm_cli.color import conversion, mix_channels, srgb_to_linear
from shrm_cli.errors import BrdfError
from shrm_cli.extras import install
from shrm_cli.files.texture import mean_color, referenced_file
from shrm_cli.messages import first_of
from shrm_cli.vocabulary import PRIMARIES

_MOST_BYTES = 2**24
_MOST_ELEMENTS = 2**16
_MOST_DEPTH = 32
"""The most elements within each other, and the most nodes one after the other."""
_LINEAR = ("", "none", "raw", "lin_rec709", "lin_rec709_scene")
_ACESCG = ("acescg", "lin_ap1", "lin_ap1_scene")
_FACTORS = {
    "image": (), "tiledimage": (), "gltf_image": ("factor",),
    "gltf_colorimage": ("color", "geomcolor"),
}  # fmt: skip
"""The nodes of textures, and the inputs that these are multiplied by."""
_PASSING = "convert", "dot"
_COLORS = "emissive", "opacity"
"""Inputs that are colors, besides those whose names end so."""
_FILMS = {"open_pbr_surface": 1e-6}
"""The meters that a surface counts the thickness of its film in, where these are no nanometers."""
_METERS = {
    "nanometer": 1e-9, "micron": 1e-6, "micrometer": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2,
    "inch": 0.0254, "foot": 0.3048, "yard": 0.9144, "meter": 1.0, "kilometer": 1e3,
    "mile": 1609.344,
}  # fmt: skip
"""The units of lengths."""
_PLACES = {"x": 0, "y": 1, "z": 2, "r": 0, "g": 1, "b": 2, "a": 3}


def read_materialx(name: str, data: bytes, wanted: str) -> Material:
    """A material of a MaterialX file, by its name or its number.

    Textures are looked for in its folder. `wanted` is the name of a material, or of a surface;
    empty for the only material.
    """
    try:
        import MaterialX
    except ImportError as error:
        needed = "materials of MaterialX need the package MaterialX"
        raise BrdfError(f"{name}: {needed}; {install('materialx')}") from error
    damaged: tuple[type[Exception], ...] = (
        ValueError, LookupError, expat.ExpatError, MaterialX.Exception,
        MaterialX.ExceptionParseError,
    )  # fmt: skip
    try:
        _check(data)
        document, options = MaterialX.createDocument(), MaterialX.XmlReadOptions()
        options.readXIncludeFunction = None
        text = data.decode("utf-8-sig")
        MaterialX.readFromXmlString(document, text, MaterialX.FileSearchPath(), options)
        shaders, others = _shaders(MaterialX, document)
        if wanted not in shaders and (wanted in others or (not shaders and others)):
            which = wanted if wanted in others else next(iter(others))
            raise BrdfError(
                f"{name}: the material {which[:40]!r} is of the kind {others[which][:40]!r}, which "
                f"is not read; those that are: {first_of(list(SURFACES), len(SURFACES))}"
            )
        shader = list(shaders.values())[chosen(name, list(shaders), wanted)]
        return _material(name, shader)
    except damaged as error:
        why = " ".join(str(error).split())[:160]
        raise BrdfError(f"{name}: its material cannot be used ({why})") from error


def _check(data: bytes) -> None:
    """Refuse files that are nested too deeply, too long, or that include others."""
    if len(data) > _MOST_BYTES:
        raise ValueError(f"more than {_MOST_BYTES:,} bytes")
    depth = count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > _MOST_DEPTH or count > _MOST_ELEMENTS:
            raise ValueError("too many elements, or nested too deeply")
        if tag.endswith(":include"):
            raise ValueError("it includes other files; write it as one")

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: Any) -> None:
        raise ValueError("it declares a document type; leave it out")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    parser.Parse(data, True)


def _shaders(package: Any, document: Any) -> tuple[dict[str, Any], dict[str, str]]:
    """The surfaces that are read, and the kinds of those that are not.

    Both are by the names of their materials or, without any that is read, by their own.
    """
    found, others = {}, {}
    surfaces = [each for each in document.getNodes() if each.getType() == "surfaceshader"]
    named = [
        (material.getName(), shader)
        for material in document.getMaterialNodes()
        for shader in package.getShaderNodes(material)
    ]
    for pairs in named, [(each.getName(), each) for each in surfaces]:
        for called, shader in pairs:
            if shader.getCategory() in SURFACES:
                found[called] = shader
            else:
                others[called] = shader.getCategory()
        if found:
            break
    return found, others


def _material(name: str, shader: Any) -> Material:
    averaged: list[str] = []
    unread: list[str] = []
    values = {}
    for given in shader.getInputs():
        if given.getType() in ("vector3", "string", "filename"):
            if given.getConnectedNode() is not None:
                unread.append(given.getName())
            continue
        is_film = given.getName().endswith("_thickness")
        meters = _FILMS.get(shader.getCategory(), 1e-9) if is_film else None
        found, is_texture = _Value(name, meters).of(given)
        if is_texture:
            averaged.append(given.getName())
        is_color = given.getName().endswith("color") or given.getName() in _COLORS
        values[given.getName()] = tuple(map(float, found[:3])) if is_color else float(found[0])
    return Material(shader.getCategory(), values, averaged, unread)


class _Value:
    """Follows the nodes that an input is connected to, and multiplies constants and textures.

    `meters` is the unit that the surface counts a length in; None for what is no length.
    """

    def __init__(self, name: str, meters: float | None = None) -> None:
        self.name, self._meters, self._steps = name, meters, 0

    def of(self, given: Any) -> tuple[Array, bool]:
        """The value of an input, four channels, and whether it is the mean of a texture."""
        self._steps += 1
        if self._steps > _MOST_DEPTH:
            raise ValueError("too many nodes one after the other")
        given = given.getInterfaceInput() or given
        node = given.getConnectedNode()
        if node is None:
            if given.getValue() is None:
                raise ValueError(f"the input {given.getName()!r} has no value")
            return _constant(given) * self._of_unit(given), False
        link = given.getConnectedOutput() if given.getNodeGraphString() else given
        return self._of_node(node, link.getOutputString())

    def _of_node(self, node: Any, output: str) -> tuple[Array, bool]:
        kind = node.getCategory()
        if kind in _FACTORS:
            found = self._image(node) * self._of_unit(_input(node, "file"))
            for factor in filter(None, map(node.getInput, _FACTORS[kind])):
                found = found * self._constant_factor(node, factor)
            return np.full(4, found[3]) if output == "outa" else found, True
        if kind == "constant":
            return self.of(_input(node, "value"))
        if kind == "multiply":
            one, first = self.of(_input(node, "in1"))
            other, second = self.of(_input(node, "in2"))
            if first and second:
                raise ValueError(_of_two(node))
            return one * other, first or second
        if kind in _PASSING:
            return self.of(_input(node, "in"))
        if kind == "extract" or kind.startswith("separate"):
            found, is_texture = self.of(_input(node, "in"))
            place = _PLACES[output[-1:]] if output else _input(node, "index").getValue()
            return np.full(4, found[place]), is_texture
        raise ValueError(f"it is computed by a node {kind!r}; bake it to a texture")

    def _constant_factor(self, node: Any, given: Any) -> Array:
        """The value of an input that a texture is multiplied by."""
        found, is_texture = self.of(given)
        if is_texture:
            raise ValueError(_of_two(node))
        return found

    def _of_unit(self, given: Any) -> float:
        """What makes numbers of the unit of an input those of the surface."""
        unit = given.getUnit()
        if self._meters is None or not unit:
            return 1.0
        if unit not in _METERS:
            raise ValueError(f"its unit {unit[:40]!r} is no length that is read")
        return _METERS[unit] / self._meters

    def _image(self, node: Any) -> Array:
        file = _input(node, "file")
        own, file = file.getColorSpace(), file.getInterfaceInput() or file
        named = own or file.getActiveColorSpace()
        # The outputs of a `gltf_colorimage` are several, which its type says, and of a color.
        is_color = node.getType().startswith("color") or node.getCategory() == "gltf_colorimage"
        space = _curve(named) if is_color else None
        path = referenced_file(self.name, str(file.getValue()))
        if space is srgb_to_linear:
            return mean_color(path, True)
        mean = mean_color(path, False)
        return mean if space is None else np.append(space(mean[:3]), mean[3])


def _input(node: Any, name: str) -> Any:
    found = node.getInput(name)
    if found is None:
        raise ValueError(f"the node {node.getName()!r} has no input {name!r}")
    return found


def _of_two(node: Any) -> str:
    return f"{node.getName()} multiplies two textures; bake them into one"


def _constant(given: Any) -> Array:
    value = given.getValue()
    if given.getType() in ("color3", "color4"):
        curve = _curve(given.getActiveColorSpace())
        color = np.array(value.asTuple(), dtype=float)
        color[:3] = color[:3] if curve is None else curve(color[:3])
        return np.append(color, 1.0)[:4]
    if isinstance(value, str):
        raise ValueError(f"the input {given.getName()!r} is no number")
    if not isinstance(value, bool | int | float):
        values = np.array(value.asTuple(), dtype=float)
        return np.append(values, np.ones(4))[:4]
    return np.full(4, float(value))


def _curve(space: str) -> Callable[[Array], Array] | None:
    """What makes values of a color space linear Rec.709; None where they are so."""
    if space in _LINEAR:
        return None
    if space in ("srgb_texture", "srgb_rec709_scene"):
        return srgb_to_linear
    if space in _ACESCG:
        matrix = conversion(PRIMARIES["acescg"], None)
        return lambda values: values if matrix is None else mix_channels(values, matrix)
    raise ValueError(f"its color space {space[:40]!r} is not read; convert it to lin_rec709")
