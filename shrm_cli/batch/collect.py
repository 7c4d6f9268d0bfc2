"""Coefficients of many probes in one file, for programs that learn from light rather than draw it.

The file is an archive of numpy's (``.npz``) or a table of Apache Parquet (``.parquet``, by the
package pyarrow of the extra `parquet`). Both say in which basis the coefficients are and what they
are coefficients of, in JSON: the text ``settings`` of the archive, and the entry ``shrm`` of the
table's metadata.
"""

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from shrm_cli import __release__, messages
from shrm_cli.arrays import Array
from shrm_cli.errors import MapError, OrderError, OutputError
from shrm_cli.extras import install
from shrm_cli.files import npz, remote
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.whole import check_target, replacing
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.maps.irradiance.window import make_window, parse_window
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.vocabulary import MAX_ORDER_F

if TYPE_CHECKING:
    from shrm_cli.batch.work import Result

What = Literal["radiance", "irradiance"]

SUFFIXES = (".npz", ".parquet")

_VERSION = 1
_BASIS = (
    "real spherical harmonics, orthonormal over the sphere, without the Condon-Shortley sign; "
    "index l(l+1)+m; polar axis +Z of right-handed world axes with +Y up: "
    "Y_1,-1 = 0.488603 y, Y_10 = 0.488603 z, Y_11 = 0.488603 x"
)
_UNITS = {
    "radiance": "scene-linear radiance of the probe, in its own primaries, times the square root "
    "of a steradian",
    "irradiance": "irradiance of the normal, without a factor 1/pi: the probe's scene-linear "
    "radiance times steradians, times the square root of a steradian",
}
_SAID = ("version", "shrm", "what", "order", "window", "shape", "channels", "basis", "units")
_DIGEST = 64
"""The characters of a SHA-256 digest."""


@record(eq=False)
class Collection:
    """The coefficients of many probes."""

    names: Sequence[str]
    """The paths or URLs of the probes; those of URLs without passwords."""
    digests: Sequence[str]
    """SHA-256 of each probe's bytes, in hexadecimal digits."""
    coefficients: Array
    """Of each probe over the real harmonics of world axes, index l(l+1)+m, shape (N, (order+1)^2,
    3)."""
    what: What
    """What they are coefficients of, see `lighting_of`."""
    order: int
    """The largest degree."""
    window: str = "none"
    """The window that they were multiplied with, as it was asked for."""

    def __post_init__(self) -> None:
        count = len(self.names)
        if len(self.digests) != count or self.coefficients.shape != (count, *_shape(self.order)):
            raise ValueError(
                f"{count} names, {len(self.digests)} digests and coefficients of shape "
                f"{self.coefficients.shape} for order {self.order}"
            )

    @classmethod
    def of(
        cls, found: "Iterable[Result]", what: What, order: int, window: str = "none"
    ) -> "Collection":
        """Gather what was found of each probe, in this order, where it has coefficients."""
        kept = [each for each in found if each.coefficients is not None]
        coefficients = np.zeros((len(kept), *_shape(order)))
        for index, each in enumerate(kept):
            coefficients[index] = each.coefficients
        names = [_printable(each.probe) for each in kept]
        return cls(names, [each.digest for each in kept], coefficients, what, order, window)

    def settings(self) -> dict[str, Any]:
        """Return what a file says of the coefficients."""
        said = (
            _VERSION, __release__, self.what, self.order, self.window, list(_shape(self.order)),
            ["R", "G", "B"], _BASIS, _UNITS[self.what],
        )  # fmt: skip
        return dict(zip(_SAID, said, strict=True))


def lighting_of(probe: Probe, order: int, what: What = "radiance", window: str = "none") -> Array:
    """Return the coefficients of a probe's light, or of the irradiance that it makes.

    `what` is l_lm, or ``E_lm = A_l L_lm`` (Ramamoorthi 2002, eq. 4.8), without a factor 1/pi.
    `window` holds factors of the degrees, as `maps.irradiance.window.make_window` takes them. They
    are found for the irradiance, and multiply both alike, as in the map of ``prefilter``.

    Returns an array of shape ((order+1)^2, 3), over the real harmonics of world axes, index
    l(l+1)+m.
    """
    if not 0 <= order <= MAX_ORDER_F:
        raise OrderError(f"order {order} is outside 0 .. {MAX_ORDER_F}")
    parse_window(window)
    light = project(probe, order).coefficients
    series = lambert_factors(order)[degrees(order)][:, None] * light
    return make_window(window, series).apply(light if what == "radiance" else series)


def check_collection(path: str | os.PathLike[str]) -> None:
    """Check, before the work begins, that a collection can be written."""
    said = _printable(path)
    if Path(path).suffix.lower() not in SUFFIXES:
        raise OutputError(f"{said}: collections are .npz or .parquet; name it so")
    if messages.is_remote(path):
        remote.exists(os.fspath(path))
    else:
        check_target(path)
    if Path(path).suffix.lower() == ".parquet":
        _parquet(path)


def write_collection(path: str | os.PathLike[str], collection: Collection) -> None:
    """Write a collection to a path or a URL, whole or not at all; its bytes are always the same.

    An archive holds the arrays ``coefficients``, ``names`` and ``sha256``, and the text
    ``settings``. A table has a row for each probe, with the columns ``probe``, ``sha256`` and
    ``coefficients``: a list of fixed length, the three channels of the first coefficient first.
    """
    check_collection(path)
    if not collection.names:
        said = _printable(path)
        raise OutputError(f"{said}: no probe has coefficients, so that nothing is written")
    settings = json.dumps(collection.settings())
    with remote.written(path) as target:
        if target.suffix.lower() == ".parquet":
            _write_parquet(target, collection, settings)
            return
        arrays = {
            "coefficients": np.ascontiguousarray(collection.coefficients, "<f8"),
            "names": np.array(collection.names, dtype=np.str_),
            "sha256": np.array(collection.digests, dtype=f"<U{_DIGEST}"),
            "settings": settings,
        }
        npz.write_npz(target, arrays)


def is_collection(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is an ``.npz`` of coefficients; reading tells whether it is sound."""
    return npz.holds(path, {"coefficients", "names", "sha256", "settings"})


def read_collection(path: str | os.PathLike[str]) -> Collection:
    """Read a collection from an ``.npz``."""
    missing, again = "name one that shrm batch wrote", "collect it again with shrm batch"
    with npz.checked_archive(Path(path), MapError, missing, again) as archive:
        what, order, window = _settings(parse_json(archive.text("settings")))
        names, digests = archive.texts("names"), archive.texts("sha256")
        coefficients = archive.numbers("coefficients", 3)
        return Collection(names, digests, coefficients, what, order, window)


def _settings(said: Any) -> tuple[What, int, str]:
    """Return what is collected, the order and the window that the settings of a file say.

    Raises ValueError if they are others than `Collection.settings` gives.
    """
    if not isinstance(said, dict) or said.get("version") != _VERSION:
        raise ValueError("not a collection of this version")
    what: Any = said.get("what")
    order, window = said.get("order"), said.get("window")
    if what not in get_args(What) or type(order) is not int or type(window) is not str:
        raise ValueError("its settings are damaged")
    return what, order, window


def _shape(order: int) -> tuple[int, int]:
    return (order + 1) ** 2, 3


def _printable(name: str | os.PathLike[str]) -> str:
    """Return a name that every reader takes: bytes that are no text as escapes, no passwords."""
    return messages.shown(os.fspath(name).encode("utf-8", "backslashreplace").decode())


def _parquet(path: str | os.PathLike[str]) -> tuple[Any, Any]:
    """Return pyarrow and its module for Parquet."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise OutputError(
            f"{_printable(path)}: tables need the package pyarrow; "
            f"{install('parquet')}, or write .npz"
        ) from error
    return pyarrow, pyarrow.parquet


def _write_parquet(path: str | os.PathLike[str], collection: Collection, settings: str) -> None:
    arrow, parquet = _parquet(path)
    rows = collection.coefficients.reshape(len(collection.names), -1).astype("f8")
    lists = arrow.FixedSizeListArray.from_arrays(arrow.array(rows.reshape(-1)), rows.shape[1])
    columns = {
        "probe": arrow.array(list(collection.names), arrow.string()),
        "sha256": arrow.array(list(collection.digests), arrow.string()),
        "coefficients": lists,
    }
    table = arrow.table(columns).replace_schema_metadata({"shrm": settings})
    with replacing(path) as temporary:
        parquet.write_table(table, temporary)
