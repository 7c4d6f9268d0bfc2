"""Which part and layer of an image file is the light.

Files of renderers hold many pictures: parts, layers (``albedo.R``), views. One of them may be the
light beyond doubt; where none is, all are listed, and the user names one.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from shrm_cli.errors import ProbeError
from shrm_cli.files.openimageio import quiet
from shrm_cli.records import record

_COLORS = (("R", "G", "B"), ("RED", "GREEN", "BLUE"))
_ALPHA = ("A", "ALPHA")
_DEPTH = ("Z", "ZBACK", "DEPTH")
_LIGHT = ("beauty", "combined", "rgba", "rgb", "color", "colour", "c", "main", "default")
"""Names that renderers give to the picture itself."""
_NO_LIGHT = (
    "albedo", "depth", "id", "mask", "matte", "motion", "n", "normal", "normals", "p", "position",
    "uv", "vector", "velocity", "z",
)  # fmt: skip
"""Names of what is no light, whatever its channels are called."""
_MOST_PARTS = 256
_MOST_LISTED = 12


@record
class Layer:
    """Three channels, or one that serves as three, of a part of a file.

    Attributes
    ----------
    index : int
        Of the part.
    part, layer : str
        Their names; empty where they have none.
    channels : tuple of 3 int
        Indices of red, green and blue among the part's channels.
    names : tuple of str
        What the file calls them, each once.
    is_color : bool
        Whether their names say that they are colors or luminance.
    """

    index: int
    part: str
    layer: str
    channels: tuple[int, int, int]
    names: tuple[str, ...]
    is_color: bool

    @property
    def label(self) -> str:
        """What tells it from the others of its file, for messages."""
        words = [f"part {self.part}"] if self.part else []
        return " ".join([*words, f"layer {self.layer}"] if self.layer else words) or "no name"

    @property
    def words(self) -> set[str]:
        """The components of its part's and layer's names, in small letters."""
        return {word for name in (self.part, self.layer) for word in name.lower().split(".")}


@quiet
def choose_layer(path: Path, source: Any, part: str | None, layer: str | None) -> Layer:
    """The light of a file that was opened, which is left at its part.

    Parameters
    ----------
    path : Path
    source : OpenImageIO.ImageInput
    part : str, optional
        Name or number, from 0, of the part that is wanted.
    layer : str, optional
        Name of the layer or view that is wanted.

    Raises
    ------
    ProbeError
        If nothing is light, or what is cannot be told from the rest, or there is no such part or
        layer.
    """
    found = list(_layers(path, source, part))
    found = [each for each in found if each.is_color] or found
    chosen = _named(path, found, layer) if layer is not None else _unambiguous(path, found)
    source.seek_subimage(chosen.index, 0)
    return chosen


def _layers(path: Path, source: Any, part: str | None) -> Iterator[Layer]:
    """All layers with colors of all parts, or of the one that is wanted."""
    is_exr = source.format_name() == "openexr"
    known, specs = [], []
    any_layer = False
    index = 0
    while index < _MOST_PARTS and source.seek_subimage(index, 0):
        spec = source.spec()
        name = spec.get_string_attribute("oiio:subimagename") if is_exr else ""
        known.append(name or str(index))
        if part is None or part in (name, str(index)):
            layers = list(_of_part(index, name, spec))
            any_layer = any_layer or bool(layers)
            yield from layers
            specs.append(spec)
        index += 1
        if not is_exr and part is None:
            break  # the pages of other files are thumbnails, or steps of an animation
    with suppress(UnicodeDecodeError):  # it may quote the file's bytes
        source.geterror()  # of the part that is not there
    if not specs:
        raise ProbeError(f"{path}: no part {part}; it has {_listed(known)}")
    if not any_layer:
        raise _no_color(path, [name for spec in specs for name in spec.channelnames])


def _texts(value: object) -> tuple[str, ...]:
    """The texts of an attribute; none if it is anything else than a list of texts."""
    if isinstance(value, str):
        return (value,)
    is_list = isinstance(value, tuple) and all(isinstance(each, str) for each in value)
    return value if is_list else ()  # type: ignore[return-value]


def _of_part(index: int, part: str, spec: Any) -> Iterator[Layer]:
    """The layers with colors of a part."""
    names = spec.channelnames
    views = _texts(spec.getattribute("multiView"))
    layers: dict[str, dict[str, int]] = {"": {}}
    lone = []
    for number, name in enumerate(names):
        prefix, _, channel = name.rpartition(".")
        layers.setdefault(prefix, {}).setdefault(channel.upper(), number)
        if channel.upper() not in (*_ALPHA, *_DEPTH):
            lone.append(number)
    for prefix, channels in layers.items():
        # OpenEXR leaves the name of the first view out of its channels' names.
        own = views[0] if len(views) > 1 and not prefix else prefix
        indices = _colors(channels)
        if indices is not None:
            chosen = tuple(dict.fromkeys(names[k] for k in indices))
            yield Layer(index, part, own, indices, chosen, True)
    if len(lone) == 1 and _colors({names[lone[0]].upper().rpartition(".")[2]: 0}) is None:
        only = lone[0]
        yield Layer(index, part, "", (only, only, only), (names[only],), False)


def _colors(channels: dict[str, int]) -> tuple[int, int, int] | None:
    """Indices of red, green and blue of a layer, or of its luminance three times."""
    for red, green, blue in _COLORS:
        if channels.keys() >= {red, green, blue}:
            return channels[red], channels[green], channels[blue]
    if "Y" in channels and not channels.keys() & {"X", "RY", "BY"}:
        return channels["Y"], channels["Y"], channels["Y"]
    return None


def _named(path: Path, found: list[Layer], name: str) -> Layer:
    """The layer of a name."""
    same = [each for each in found if each.layer == name]
    same = same or [each for each in found if each.layer.lower() == name.lower()]
    if not same:
        raise ProbeError(f"{path}: no layer {name}; it has {_listed(e.label for e in found)}")
    if len(same) > 1:
        raise ProbeError(
            f"{path}: several parts have a layer {name}: {_listed(e.label for e in same)}; give "
            "`part`"
        )
    return same[0]


def _unambiguous(path: Path, found: list[Layer]) -> Layer:
    """The layer that is light beyond doubt."""
    candidates = found
    if len(candidates) > 1:
        candidates = [each for each in found if not each.words & set(_NO_LIGHT)]
    for narrower in (
        [each for each in candidates if not each.part and not each.layer],
        [each for each in candidates if each.words & set(_LIGHT)],
    ):
        if len(candidates) > 1 and narrower:
            candidates = narrower
    if len(candidates) == 1:
        return candidates[0]
    raise ProbeError(
        f"{path}: its light may be any of {_listed(each.label for each in found)}; give "
        f"{_what_tells(found)}"
    )


def _what_tells(found: list[Layer]) -> str:
    """The arguments by which a user tells layers from each other."""
    parts = len({each.index for each in found}) > 1
    layers = len(found) > len({each.index for each in found})
    return " and ".join(["`part`"] * parts + ["`layer`"] * layers)


def _no_color(path: Path, names: list[str]) -> ProbeError:
    """Why channels hold no light."""
    channels = {name.upper().rpartition(".")[2] for name in names}
    if channels >= {"RY", "BY"}:
        return ProbeError(f"{path}: luminance-chroma pixels (Y, RY, BY); convert it to RGB")
    if channels & set(_DEPTH) and channels <= {*_DEPTH, *_ALPHA}:
        return ProbeError(f"{path}: {_listed(names)} is depth, not light; name the picture itself")
    return ProbeError(
        f"{path}: no R, G and B channels, nor a single one, among {_listed(names)}; export it as "
        "RGB"
    )


def _listed(names: Iterable[str]) -> str:
    """Names with commas between, not too many."""
    listed = list(names)
    more = len(listed) - _MOST_LISTED
    return ", ".join(listed[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
