"""How the images of a probe and their primaries are to be understood; bad arguments are refused."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from typing import Any, Literal, TypedDict

import numpy as np

from shrm_cli import vocabulary
from shrm_cli.arrays import Array
from shrm_cli.color import are_unset, conversion, fault_of, same_primaries, title_of
from shrm_cli.errors import ProbeError
from shrm_cli.probe.image import ConvertedImage, ProbeImage
from shrm_cli.probe.pixels import PixelPolicy
from shrm_cli.records import record
from shrm_cli.sphere.directions import turn_matrix

_UP = ("y", "z")


@record
class ReadOptions:
    """How a file is to be understood; None leaves it to the file.

    Attributes
    ----------
    layout : Layout, optional
    orientation : {"openexr", "gl"}, optional
        How the faces of a cube are turned.
    sampling : {"center", "border"}, optional
        Where the edge pixels lie.
    yaw : float
        Turn about +Y, degrees, from +Z towards +X.
    mirror : bool
        Mirror x -> -x, before all turns.
    up : {"y", "z"}
        ``z`` means that the file's +Z is up; it is turned to +Y first of all.
    linearize : bool
        Decode integer pixels: as the file says, or else as sRGB.
    pixels : PixelPolicy
        What is done about pixels that cannot be radiance.
    part : str or int, optional
        Name or number, from 0, of the part of a file with several that is the light.
    layer : str, optional
        Name of the layer or view that is the light.
    pitch : float
        Turn about +X, degrees, from +Y towards +Z, before the yaw.
    roll : float
        Turn about +Z, degrees, from +X towards +Y, before the pitch.
    primaries : str or sequence of 8 float, optional
        The primaries of the file's numbers, whatever it says of them: a name of
        `vocabulary.PRIMARIES`, or CIE x and y of red, green, blue and white.
    working : str or sequence of 8 float, optional
        The primaries that the light is converted to when it is read.
    box : sequence of 6 float, optional
        The box that stands for the room around the probe, by two corners, the lesser first, in
        world axes; see `Probe.within`.
    at : sequence of 3 float, optional
        Where in it the probe was captured.

    Raises
    ------
    ProbeError
        If a value is not one of these.

    Examples
    --------
    >>> turned = shrm.open_probe("probes/sky.exr", shrm.ReadOptions(yaw=90))
    >>> given = shrm.open_probe("probes/sky.exr")
    >>> bool(np.allclose(turned.radiance([1, 0.2, 0]), given.radiance([0, 0.2, 1])))
    True
    """

    layout: vocabulary.Layout | None = None
    orientation: vocabulary.Orientation | None = None
    sampling: vocabulary.Sampling | None = None
    yaw: float = 0.0
    mirror: bool = False
    up: Literal["y", "z"] = "y"
    linearize: bool = False
    pixels: PixelPolicy = field(default_factory=PixelPolicy)
    part: str | int | None = None
    layer: str | None = None
    pitch: float = 0.0
    roll: float = 0.0
    primaries: str | Sequence[float] | None = None
    working: str | Sequence[float] | None = None
    box: Sequence[float] | None = None
    at: Sequence[float] | None = None

    def __post_init__(self) -> None:
        check_name("layout", self.layout, (None, *vocabulary.LAYOUTS))
        check_name("orientation", self.orientation, (None, *vocabulary.ORIENTATIONS))
        check_name("sampling", self.sampling, (None, *vocabulary.SAMPLINGS))
        check_name("up", self.up, _UP)
        _check_flag("mirror", self.mirror)
        _check_flag("linearize", self.linearize)
        check_numbers("box", self.box, 6)
        check_numbers("at", self.at, 3)
        if self.part is not None and type(self.part) not in (str, int):
            raise ProbeError(f"`part` must be a name or a number, not {self.part!r:.60}")
        if not (self.layer is None or isinstance(self.layer, str)):
            raise ProbeError(f"`layer` must be a name, not {self.layer!r:.60}")
        for name in ("yaw", "pitch", "roll"):
            angle = getattr(self, name)
            if not _is_finite(angle):
                raise ProbeError(f"`{name}` must be a finite number of degrees, not {angle!r:.60}")
            if abs(angle) > vocabulary.MOST_DEGREES:
                most = vocabulary.MOST_DEGREES
                raise ProbeError(f"`{name}` of {angle:g} degrees is beyond {most:g}; give less")
        for name in ("primaries", "working"):
            chromaticities_of(name, getattr(self, name))
        if not isinstance(self.pixels, PixelPolicy):
            raise ProbeError(f"`pixels` must be a PixelPolicy, not {self.pixels!r}")
        clamp = self.pixels.clamp
        _check_flag("fix_nonfinite", self.pixels.fix_nonfinite)
        if clamp is not None and not (_is_finite(clamp) and clamp > 0):
            raise ProbeError(f"`clamp` must be a positive number, not {clamp!r:.60}")

    def part_name(self) -> str | None:
        """What names the part, as text."""
        return None if self.part is None else str(self.part)

    def matrix(self) -> Array:
        """Orthogonal matrix from the file's axes to world axes, shape (3, 3)."""
        mirror = np.diag([-1.0 if self.mirror else 1.0, 1.0, 1.0])
        up = np.eye(3)
        if self.up == "z":
            up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        return turn_matrix(self.yaw, self.pitch, self.roll) @ mirror @ up


class ReadKeywords(TypedDict, total=False):
    """The keywords of `open_probe`: attributes of `ReadOptions` and of its `PixelPolicy`."""

    layout: vocabulary.Layout | None
    orientation: vocabulary.Orientation | None
    sampling: vocabulary.Sampling | None
    yaw: float
    pitch: float
    roll: float
    mirror: bool
    up: Literal["y", "z"]
    linearize: bool
    pixels: PixelPolicy
    clamp: float | None
    fix_nonfinite: bool
    part: str | int | None
    layer: str | None
    primaries: str | Sequence[float] | None
    working: str | Sequence[float] | None
    box: Sequence[float] | None
    at: Sequence[float] | None


def with_keywords(options: ReadOptions, keywords: ReadKeywords) -> ReadOptions:
    """The options with some of them replaced."""
    of_pixels = {each.name for each in fields(PixelPolicy)}
    known = {each.name for each in fields(ReadOptions)} | of_pixels
    unknown = sorted(keywords.keys() - known)
    if unknown:
        names = ", ".join(f"`{name}`" for name in sorted(known))
        raise ProbeError(f"`{unknown[0]}` says nothing about a probe; give {names}")
    changes: dict[str, Any] = {k: v for k, v in keywords.items() if k not in of_pixels}
    policy: dict[str, Any] = {k: v for k, v in keywords.items() if k in of_pixels}
    options = replace(options, **changes)
    return replace(options, pixels=replace(options.pixels, **policy))


def chromaticities_of(
    argument: str, value: str | Sequence[float] | None
) -> tuple[float, ...] | None:
    """The primaries that an argument means.

    `argument` is its name, for the message. `value` is a name of `vocabulary.PRIMARIES`, or CIE x
    and y of red, green, blue and white.
    """
    if value is None:
        return None
    if isinstance(value, str):
        check_name(argument, value, tuple(vocabulary.PRIMARIES))
        return vocabulary.PRIMARIES[value]
    try:
        numbers = tuple(float(each) for each in value)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != 8 or not np.isfinite(numbers).all():
        raise ProbeError(
            f"`{argument}` {value!r:.100} is neither one of {', '.join(vocabulary.PRIMARIES)} nor "
            "eight numbers, x and y of red, green, blue and white"
        )
    fault = fault_of(numbers)
    if fault is not None:
        known = ", ".join(f"{number:g}" for number in numbers)
        raise ProbeError(f"`{argument}` {known}: no light has such primaries ({fault}); correct it")
    return numbers


def check_name(argument: str, value: object, names: tuple[str | None, ...]) -> None:
    """Refuse a name that is none of those that an argument may have."""
    if not (value is None or isinstance(value, str)) or value not in names:
        known = ", ".join(name for name in names if name is not None)
        raise ProbeError(f"`{argument}` {value!r} is not known; give one of {known}")


def _check_flag(argument: str, value: object) -> None:
    if not isinstance(value, bool | np.bool_):
        raise ProbeError(f"`{argument}` must be True or False, not {value!r}")


def check_numbers(argument: str, value: Any, count: int) -> None:
    """Refuse what is not so many finite numbers, nor None."""
    listed = [] if value is None or isinstance(value, str) or np.ndim(value) != 1 else [*value]
    if value is not None and not (len(listed) == count and all(map(_is_finite, listed))):
        raise ProbeError(f"`{argument}` must be {count} numbers, not {value!r:.60}")


def _is_finite(value: Any) -> bool:
    """Whether a value is a number that a float can hold; whole numbers may be too large for it."""
    is_number = isinstance(value, int | float | np.integer | np.floating)
    try:
        return is_number and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


@record(eq=False)
class ColorReading:
    """How the colors of a probe are understood."""

    chromaticities: tuple[float, ...] | None
    """Those of the light as it leaves the probe; None where nobody tells them."""
    own: tuple[float, ...] | None = None
    """Those of the numbers in the images."""
    matrix: Array | None = None
    """From the images' numbers to that light; None where they are the same, shape (3, 3)."""
    notes: tuple[str, ...] = ()
    """What a user should know, a line each."""
    record: Mapping[str, list[float]] = field(default_factory=dict)
    """What was said beside the images, as `Probe.colors` has it."""

    @classmethod
    def of(cls, stated: tuple[float, ...] | None, options: ReadOptions) -> "ColorReading":
        """Decide how colors are understood.

        `stated` is what the images say. Zeros are a field that nobody has filled in, as of many
        Radiance files, and mean Rec. 709. The `primaries` of `options` overrule them, and its
        `working` is what the light is converted to.
        """
        given = chromaticities_of("primaries", options.primaries)
        working = chromaticities_of("working", options.working)
        if are_unset(stated):
            stated = vocabulary.PRIMARIES["rec709"] if given is None else None
        own = stated if given is None else given
        asked = {"primaries": given, "working": working}
        record = {name: list(each) for name, each in asked.items() if each is not None}
        notes = []
        fault = None if stated is None else fault_of(stated)
        if fault is not None:
            if given is None:
                notes.append(
                    f"no light has the primaries that it says ({fault}); taken for Rec.709, "
                    "`primaries` tells others"
                )
            own, stated = given, None
        if given is not None and stated is not None and not same_primaries(given, stated):
            notes.append(
                f"it says that its primaries are {title_of(stated)}; `primaries` "
                f"{title_of(given)} was obeyed instead"
            )
        if working is None:
            return cls(own, own, None, tuple(notes), record)
        if own is None and fault is None:
            notes.append(
                f"nothing tells its primaries; taken for Rec.709 and converted to "
                f"{title_of(working)}; `primaries` tells others"
            )
        return cls(working, own, conversion(own, working), tuple(notes), record)

    def converted(self, images: tuple[ProbeImage, ...]) -> tuple[ProbeImage, ...]:
        """The images, in the primaries that the light is wanted in."""
        if self.matrix is None:
            return images
        return tuple(ConvertedImage(image, self.matrix) for image in images)
