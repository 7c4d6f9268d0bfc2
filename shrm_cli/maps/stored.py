"""One image of a map in an opened file: its part, its attributes, and how it is laid out."""

from collections.abc import Sequence
from typing import Any

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.parts import StoredPart
from shrm_cli.maps.arrangement import Arrangement, stored_arrangement
from shrm_cli.maps.attributes import COLORS, map_info, read_attributes
from shrm_cli.records import record


@record
class StoredImage:
    """A part of a map's file, with its checked attributes.

    Attributes
    ----------
    part : StoredPart
    attributes : dict
        The attributes of the part, as `read_attributes` returns them.
    arrangement : Arrangement
        How the part is laid out.
    size : int
        Texels along an edge of the cube that the part holds.
    """

    part: StoredPart
    attributes: dict[str, Any]
    arrangement: Arrangement
    size: int

    @classmethod
    def of(cls, part: StoredPart) -> "StoredImage":
        """Return the image in a part.

        Raises
        ------
        MapError
            If the part cannot hold a cube, or its attributes are wrong.
        """
        attributes = read_attributes(part)
        return cls(part, attributes, *stored_arrangement(part, attributes))

    @property
    def path(self) -> str:
        """The path of the file, for messages."""
        return self.part.path

    def common(self) -> dict[str, Any]:
        """Return arguments that the constructors of maps have in common."""
        return {
            "center": self.attributes["center"],
            "info": map_info(self.attributes, self.part),
            "sampling": self.arrangement.sampling,
        }

    def check_channels(self, names: Sequence[str], what: str) -> None:
        """Check that the part has exactly these channels.

        Parameters
        ----------
        names : sequence of str
            The names of the channels.
        what : str
            What the channels make up, for the message.

        Raises
        ------
        MapError
            If other channels are there, or some are missing.
        """
        if not self.part.holds(names):
            raise MapError(f"{self.path}: its channels are not those of {what}")

    def check_resampling(self, turns_with_texels: bool) -> None:
        """Refuse a lat-long of values that cannot be interpolated between texels.

        Parameters
        ----------
        turns_with_texels : bool
            Whether the values belong to local axes, which turn from texel to texel.

        Raises
        ------
        MapError
            If the values turn, and the part is a lat-long.
        """
        if self.arrangement.layout == "latlong" and turns_with_texels:
            raise MapError(f"{self.path}: a local map cannot be a lat-long; make it again")

    def stack(self, names: Sequence[str]) -> Array:
        """Read channels as an OpenEXR cube, shape (6N, N, len(names)).

        Raises
        ------
        MapError
            If the file is damaged.
        """
        wanted = self.part.read(names)
        return wanted if self.arrangement.is_plain else self.arrangement.undo(wanted)


def image_channels(image: Array) -> dict[str, Array]:
    """Return the channels of a part that holds an image of shape (H, W, 3)."""
    return {name: image[..., k] for k, name in enumerate(COLORS)}
