"""What `make tables` and `make survey` share: their probes, and how their pages are written."""

from collections.abc import Sequence
from pathlib import Path

from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.latlong import LatLong

ROOT = Path(__file__).resolve().parents[1]
NAMES = "city", "courtyard", "forest", "interior", "night", "studio", "sunrise", "sunset"
"""The real probes that `make probes` fetches into `probes/real`."""
SHIPPED = "studio", "sky"
"""The probes that take their place where they were not fetched."""


def probe_files(folder: Path, names: Sequence[str] = NAMES) -> list[Path]:
    """Return the files of real probes that are in a folder, or as many shipped ones as there are.

    Parameters
    ----------
    folder : Path
        Where `make probes` puts real probes. It need not exist.
    names : sequence of str
        The probes that are wanted.

    Returns
    -------
    list of Path
        At least one, and at most as many as `names`.
    """
    found = [folder / f"{name}.exr" for name in names if (folder / f"{name}.exr").exists()]
    return found or [ROOT / "probes" / f"{name}.exr" for name in SHIPPED[: len(names)]]


def small_probes(probes: Sequence[Probe], rows: int) -> list[Probe]:
    """Average probes down to lat-longs of the same number of rows, and keep their names."""
    return [
        Probe.from_array(to_grid(each, LatLong(rows)), layout="latlong", name=Path(each.name).stem)
        for each in probes
    ]


def equal_probes(files: Sequence[Path], most: int | None = None) -> list[Probe]:
    """Open lat-longs, averaged down to the rows of the smallest one, or to `most` if that is less.

    Those that have this height already stay as they are.
    """
    opened = [open_probe(file) for file in files]
    rows = min(each.height for each in opened)
    rows = rows if most is None else min(rows, most)
    return [
        each if each.height == rows else small
        for each, small in zip(opened, small_probes(opened, rows), strict=True)
    ]


class Page:
    """A page that is on disk as far as it has come, so that a crash leaves what was done before.

    Parameters
    ----------
    path : Path
        The file, which is written anew. Its folder is made.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.parts = path, list[str]()
        path.parent.mkdir(parents=True, exist_ok=True)

    def add(self, part: str) -> None:
        """Add a part, and write the page."""
        self.write([*self.parts, part])

    def write(self, parts: Sequence[str]) -> None:
        """Write the page with these parts in place of those that it had."""
        self.parts = list(parts)
        self.path.write_text("\n".join(self.parts))


def say(line: str) -> None:
    """Tell the user at once what is being made."""
    print(line, flush=True)
