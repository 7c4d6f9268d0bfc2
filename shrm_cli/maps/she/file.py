"""Writing spherical harmonic exponentials to files of one part, and reading them again."""

from typing import cast

from shrm_cli.errors import MapError
from shrm_cli.files.parts import Part, StoredFile, StoredPart
from shrm_cli.maps import stored
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
from shrm_cli.vocabulary import LAWS, MAX_EXPONENTIAL_ORDER, Law


def encode(exponential: SphericalHarmonicExponential) -> list[Part]:
    """Make the part of a file, an image of one row with a coefficient in each pixel.

    The (P+1)^2 coefficients of P come first, then those of Q without its constant. The attribute
    ``shrm:ggx_alpha`` is the range of the fit, and ``shrm:law`` says how the degrees are
    attenuated; see `shrm_cli.maps.she.exponential`.
    """
    header = {
        **stored.common_header(exponential, 0),
        "shrm:p_order": exponential.order_p,
        "shrm:q_order": exponential.order_q,
        "shrm:ggx_alpha": tuple(map(float, exponential.ggx_alpha)),
        "shrm:law": exponential.law,
    }
    return [Part(stored.image_channels(exponential.coefficients[None]), header)]


def decode(file: StoredFile) -> SphericalHarmonicExponential:
    """Return the map that a file holds."""
    path, part = file.path, file.first
    attributes = stored.read_attributes(part)
    kind = SphericalHarmonicExponential
    if (attributes["frame"], attributes["center"]) != (kind.frame, kind.center):
        raise MapError(f"{path}: an SH exponential is {kind.frame}, about R; make it again")
    p, q = (_order(part, f"{name}_order") for name in "pq")
    counts = (p + 1) ** 2, (q + 1) ** 2 - 1
    if len(file.parts) != 1:
        raise MapError(f"{path}: an SH exponential is one part, not {len(file.parts)} parts")
    if (part.width, part.height) != (sum(counts), 1):
        raise MapError(
            f"{path}: {part.width} x {part.height} pixels are not the {counts[0]} + {counts[1]} "
            f"coefficients of orders P = {p} and Q = {q}; make it again"
        )
    if not part.holds(stored.COLORS):
        raise MapError(f"{path}: its channels are not those of an SH exponential")
    row = part.read(stored.COLORS)[0].astype(float)
    info = stored.map_info(attributes, part)
    if (law := part.text("shrm:law")) not in LAWS:
        raise MapError.of_attribute(path, "law")
    return kind(row[: counts[0]], row[counts[0] :], _ggx_alpha(part), info, cast(Law, law))


def _order(part: StoredPart, name: str) -> int:
    value = part.attribute(f"shrm:{name}")
    if type(value) is not int or not 0 <= value <= MAX_EXPONENTIAL_ORDER:
        raise MapError.of_attribute(part.path, name)
    return value


def _ggx_alpha(part: StoredPart) -> tuple[float, float]:
    """Read the range of GGX's alpha that the coefficients were fitted to."""
    value = part.attribute("shrm:ggx_alpha")
    is_pair = isinstance(value, tuple) and [type(end) for end in value] == [float, float]
    if not (is_pair and 0 < value[0] <= value[1] <= 1):
        raise MapError.of_attribute(part.path, "ggx_alpha")
    return stored.shortest(value[0]), stored.shortest(value[1])
