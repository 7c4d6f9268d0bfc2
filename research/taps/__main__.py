"""The program of `make taps`: writes the table of taps, and tells what the taps miss."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from research.inputs import probe_files, say
from research.taps.fit import even_fitted, even_kinds, even_nodes, fitted, kinds, nodes
from research.taps.lobes import Norm, mean_spectrum
from research.taps.table import even_table, table
from shrm_cli.brdf.environment.taps import EVEN_MONOMIALS, MONOMIALS
from shrm_cli.vocabulary import EVEN_TAP_COUNTS, TAP_COUNTS

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "shrm_cli" / "brdf" / "environment"


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit all taps to the light of the probes of a folder, which takes five minutes."""
    parser = argparse.ArgumentParser(prog="python -m research.taps", description=__doc__)
    parser.add_argument("--probes", type=Path, default=ROOT / "probes" / "real")
    parser.add_argument("--output", type=Path, default=TABLES, help="a folder")
    parser.add_argument("--table", action="store_true", help="measure what the taps miss instead")
    parser.add_argument("--levels", type=int, help="of the split sums of the table")
    given = parser.parse_args(arguments)
    if given.table:
        more = {} if given.levels is None else {"levels": given.levels}
        files = probe_files(given.probes)
        print("\n".join([*even_table(files, **more), "", *table(files, **more)]))
        return
    say("lobes")
    norm = Norm(mean_spectrum(probe_files(given.probes)))
    even, brushed = even_nodes(norm), nodes(norm)
    _write(
        given.output / "even_taps.csv", EVEN_MONOMIALS,
        ((n, even_kinds(n), even_fitted(n, norm, even)) for n in EVEN_TAP_COUNTS),
    )  # fmt: skip
    _write(
        given.output / "taps.csv", MONOMIALS,
        ((n, kinds(n), fitted(n, norm, brushed)) for n in TAP_COUNTS),
    )  # fmt: skip


def _write(
    path: Path, monomials: Sequence[str], found: Iterable[tuple[int, str, np.ndarray]]
) -> None:
    """Write the polynomials of some numbers of taps."""
    lines = ["taps,number," + ",".join(monomials)]
    for count, letters, rows in found:
        for kind, row in zip(letters, rows.tolist(), strict=True):
            lines.append(f"{count},{kind},{','.join(f'{x:.5g}' for x in row)}")
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    say(f"The polynomials are {path.resolve()}")


if __name__ == "__main__":
    main()
