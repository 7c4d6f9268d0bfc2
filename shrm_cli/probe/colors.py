"""The primaries of a probe: what its file says, what the user says, and what they are made."""

from collections.abc import Mapping
from dataclasses import field

from shrm_cli.arrays import Array
from shrm_cli.color import are_unset, conversion, fault_of, same_primaries, title_of
from shrm_cli.probe.image import ConvertedImage, ProbeImage
from shrm_cli.probe.options import ReadOptions, chromaticities_of
from shrm_cli.records import record
from shrm_cli.vocabulary import PRIMARIES


@record(eq=False)
class ColorReading:
    """How the colors of a probe are understood.

    Attributes
    ----------
    chromaticities : tuple of 8 float, optional
        Of the light as it leaves the probe; None where nobody tells them.
    own : tuple of 8 float, optional
        Of the numbers of the images.
    matrix : ndarray, shape (3, 3), optional
        From the numbers of the images to that light; None where they are the same.
    notes : tuple of str
        What a user should know, a line each.
    record : mapping of str to list of 8 float
        What was said beside the images, as `Probe.colors` has it.
    """

    chromaticities: tuple[float, ...] | None
    own: tuple[float, ...] | None = None
    matrix: Array | None = None
    notes: tuple[str, ...] = ()
    record: Mapping[str, list[float]] = field(default_factory=dict)

    @classmethod
    def of(cls, stated: tuple[float, ...] | None, options: ReadOptions) -> "ColorReading":
        """Decide how colors are understood.

        Parameters
        ----------
        stated : tuple of 8 float, optional
            What the images say. Zeros are a field that nobody has filled in, as of many Radiance
            files, and mean Rec. 709.
        options : ReadOptions
            Its `primaries` overrule them, and its `working` is what the light is converted to.
        """
        given = chromaticities_of("primaries", options.primaries)
        working = chromaticities_of("working", options.working)
        if are_unset(stated):
            stated = PRIMARIES["rec709"] if given is None else None
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
