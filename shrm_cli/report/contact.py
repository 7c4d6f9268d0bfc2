"""A page over many maps: a grid of probes and materials with small pictures."""

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError, ShrmError
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import is_map, open_map
from shrm_cli.maps.info import MapInfo, spec_of
from shrm_cli.maps.kinds import LightMap, MaterialMap
from shrm_cli.maps.options import bytes_text, counted
from shrm_cli.messages import several, shown, without_name
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer, whole_coverage
from shrm_cli.render.image import suitable_exposure
from shrm_cli.render.lit import ggx_surface, shown_as
from shrm_cli.render.sphere import render_sphere
from shrm_cli.report import pictures, words
from shrm_cli.report.markup import Html, joined, spec, tag, whole_page
from shrm_cli.vocabulary import LUMINANCE

SIZE = 96
"""Width and height of the pictures, pixels."""
MOST_MAPS = 2000
"""The most maps of a page, which then takes about 40 MB."""
_VIEWER = Viewer(30, 15)


@record(eq=False)
class Thumbnail:
    """A map as the page shows it."""

    file: str
    """The path of the probe."""
    form: str
    """The representation."""
    brdf: str
    """The specification of the BRDF; empty of light alone, which is shown as GGX."""
    info: MapInfo
    bytes: int
    """The size of the file."""
    error: float | None
    """The predicted relative RMS error; None where it is not known: that of a split sum's levels
    says nothing of what one look-up for all views misses."""
    picture: Array
    """Linear radiance, premultiplied by the coverage of the sphere, shape (SIZE, SIZE, 3)."""
    seconds: float
    """How long it took to read and to draw it."""

    @property
    def probe(self) -> tuple[str, str]:
        """Name and digest of the probe, which tell probes apart."""
        return self.info.probe or "unknown probe", self.info.probe_sha256

    @property
    def column(self) -> tuple[str, str]:
        """The BRDF, where the map is for one, and the form."""
        return self.brdf, self.form


@dataclass
class Contacts:
    """What a page over maps shows."""

    maps: list[Thumbnail] = field(default_factory=list)
    failures: list[tuple[str, str]] = field(default_factory=list)
    """Files that could not be drawn, and why; or outputs that could not be made."""


def found_maps(names: Iterable[str]) -> list[str]:
    """Return the files that are named, and the maps in folders and the folders below.

    Files in folders that are no maps, such as probes and pictures, are passed over, and so are
    files and folders whose names begin with a dot, as of maps that are being written.
    """
    found: dict[str, None] = {}
    for name in names:
        if not os.path.isdir(name):
            found[name] = None
            continue
        for folder, folders, files in os.walk(name):
            folders[:] = sorted(each for each in folders if not each.startswith("."))
            seen = sorted(each for each in files if not each.startswith("."))
            paths = (os.path.join(folder, each) for each in seen)
            found |= {path: None for path in paths if path.endswith(".exr") and is_map(path)}
    return list(found)


def draw_contacts(
    files: Sequence[str | os.PathLike[str]] | str | os.PathLike[str],
    progress: Progress | None = None,
) -> Contacts:
    """Draw a small sphere of each map.

    Parameters
    ----------
    files : sequence of path-like, or one
        One after the other is read, drawn, and forgotten.
    progress : callable, optional
        Called with the maps that are done and their number.

    Returns
    -------
    Contacts
        A map that cannot be drawn is among the failures.

    Raises
    ------
    MapError
        If there is no map, or there are more than `MOST_MAPS`.

    Examples
    --------
    >>> shrm.prefilter("probes/studio.exr", to="irradiance").save("white.exr")
    'half'
    >>> len(shrm.draw_contacts(["white.exr"]).maps)
    1
    """
    names = [os.fspath(each) for each in several(files)]
    if not 1 <= len(names) <= MOST_MAPS:
        raise MapError(
            f"{len(names):,} maps are there to be shown; name 1 to {MOST_MAPS:,} of them, or "
            "folders that hold so many"
        )
    found = Contacts()
    for done, file in enumerate(names, start=1):
        try:
            found.maps.append(_drawn(file))
        except ShrmError as error:
            found.failures.append((file, str(error)))
        tell(progress, done, len(names))
    return found


def _drawn(file: str) -> Thumbnail:
    start = time.perf_counter()
    opened: Map = open_map(file)
    info, size = opened.info, os.path.getsize(file)
    brdf = "" if isinstance(opened, LightMap) or not info.brdf else spec_of(info.brdf)
    if isinstance(opened, MaterialMap):
        raise MapError(f"{file}: holds no light of its own, so that there is nothing to draw")
    picture = np.nan_to_num(render_sphere(shown_as(opened, ggx_surface()), _VIEWER, SIZE))
    seconds = time.perf_counter() - start
    # Levels of a split sum state errors of their own, and nothing of the model's.
    is_known = bool(info.fit_residual) or not isinstance(opened, LightMap)
    error = opened.stated_error if is_known else None
    return Thumbnail(file, opened.representation, brdf, info, size, error, picture, seconds)


def contact_page(
    contacts: Contacts, target: str, title: str = "Maps", worded: Callable[[str], str] = str
) -> str:
    """Return the page: a row for each probe, a column for each BRDF and form.

    Parameters
    ----------
    contacts : Contacts
    target : str
        The path of the page, from whose folder its links to the files lead.
    title : str
    worded : callable
        How messages of the library, which name its arguments in backticks, are shown.

    Returns
    -------
    str
        HTML, to be written as UTF-8. It holds the pictures; the maps are linked.

    Examples
    --------
    >>> shrm.prefilter("probes/studio.exr", to="irradiance").save("white.exr")
    'half'
    >>> page = shrm.contact_page(shrm.draw_contacts(["white.exr"]), "index.html")
    >>> "white.exr" in page
    True
    """
    columns = _columns(contacts.maps)
    rows: dict[tuple[str, str], dict[tuple[str, str], list[Thumbnail]]] = {}
    for each in contacts.maps:
        rows.setdefault(each.probe, {}).setdefault(columns[each.column], []).append(each)
    folder = Path(target).absolute().parent
    heads = list(dict.fromkeys(columns.values()))
    body = [_line(name, rows[name], heads, folder) for name in rows]
    titles = [joined(spec(brdf), Html("<br>"), form) if brdf else form for brdf, form in heads]
    head = tag("tr", tag("th", "Probe"), [tag("th", each) for each in titles])
    total = sum(each.bytes for each in contacts.maps)
    what = (
        f"{counted(len(contacts.maps), 'map')} of {counted(len(rows), 'probe')}, "
        f"{bytes_text(total)}. Each "
        f"picture is a sphere seen from azimuth {_VIEWER.azimuth:g}\u00b0, elevation "
        f"{_VIEWER.elevation:g}\u00b0, at one exposure a row; the number in percent is the "
        "predicted RMS error of the reflected light, which split sums do not know."
    )
    return whole_page(
        title,
        tag("header", tag("p.kind", "Contact sheet"), tag("h1", title), tag("p.quiet", what)),
        [
            tag(
                "p.failure",
                tag("b", tag("code", shown(name)), ": "),
                worded(without_name(why, name)),
            )
            for name, why in contacts.failures
        ],
        tag("div.scroll.sheet", tag("table", tag("thead", head), tag("tbody", body)), tabindex="0"),
    )


def _columns(maps: Sequence[Thumbnail]) -> dict[tuple[str, str], tuple[str, str]]:
    """Return the column of each BRDF and form.

    Forms that were chosen for each probe share the column of their BRDF, which then has no form.
    """
    found = dict.fromkeys(each.column for each in maps)
    chosen = {(each.probe, each.brdf): each.form for each in maps}
    apart = {each.brdf for each in maps if chosen[each.probe, each.brdf] != each.form}
    forms = Counter(brdf for brdf, _ in found)
    shared = {brdf for brdf in forms if brdf and forms[brdf] > 1 and brdf not in apart}
    return {(brdf, form): (brdf, "" if brdf in shared else form) for brdf, form in found}


def _line(
    probe: tuple[str, str],
    cells: Mapping[tuple[str, str], Sequence[Thumbnail]],
    columns: Sequence[tuple[str, str]],
    folder: Path,
) -> Html:
    """Return the row of a probe; its pictures share an exposure."""
    drawn = np.array([each.picture for maps in cells.values() for each in maps])
    inside = whole_coverage(SIZE) == 1
    stops = suitable_exposure(drawn[:, inside] @ LUMINANCE)
    heading = tag(
        "th", words.base_name(probe[0]), Html("<br>"), tag("span.quiet", words.stops(stops))
    )
    found = [
        tag("td", [_cell(each, stops, folder, not form) for each in cells.get((brdf, form), [])])
        for brdf, form in columns
    ]
    return tag("tr", heading, found)


def _cell(each: Thumbnail, stops: float, folder: Path, names_form: bool) -> Html:
    colors = pictures.shown(pictures.unmultiplied(each.picture), stops, each.info.chromaticities)
    picture = pictures.image(pictures.on_sphere(colors), words.base_name(each.file))
    orders = f"F {each.info.order_f}" + (f", P {each.info.order_p}" if each.info.order_p else "")
    orders = f"{each.form}, {orders}" if names_form else orders
    size = bytes_text(each.bytes)
    told = size if each.error is None else f"{size}, {words.percent(each.error)}"
    return tag(
        "a.map", picture, tag("span", told),
        tag("span", orders), href=_link(each.file, folder), title=words.base_name(each.file),
    )  # fmt: skip


def _link(file: str, folder: Path) -> str:
    """Return the address of a file from the page's folder."""
    try:
        path = os.path.relpath(file, folder)
    except ValueError:  # another drive
        path = words.base_name(file)
    address = quote(path.replace(os.sep, "/").encode("utf-8", "surrogateescape"))
    return address if address.startswith(".") else f"./{address}"
