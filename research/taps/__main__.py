"""The program of `make taps`: writes the table of taps, and tells what the taps miss."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from research.inputs import probe_files
from research.taps.fit import fitted, kinds, nodes
from research.taps.lobes import Norm, mean_spectrum
from research.taps.table import table
from shrm_cli.brdf.environment.taps import MONOMIALS
from shrm_cli.vocabulary import TAP_COUNTS

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "shrm_cli" / "brdf" / "environment" / "taps.csv"


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit all taps to the light of the probes of a folder; it takes ten minutes."""
    parser = argparse.ArgumentParser(prog="python -m research.taps", description=__doc__)
    parser.add_argument("--probes", type=Path, default=ROOT / "probes" / "real")
    parser.add_argument("--output", type=Path, default=TABLE)
    parser.add_argument("--table", action="store_true", help="measure what the taps miss instead")
    parser.add_argument("--levels", type=int, help="of the split sums of the table")
    given = parser.parse_args(arguments)
    if given.table:
        more = {} if given.levels is None else {"levels": given.levels}
        print("\n".join(table(probe_files(given.probes), **more)))
        return
    norm = Norm(mean_spectrum(probe_files(given.probes)))
    among = nodes(norm)
    lines = ["taps,number," + ",".join(MONOMIALS)]
    for count in TAP_COUNTS:
        rows = zip(kinds(count), fitted(count, norm, among).tolist(), strict=True)
        lines += [f"{count},{kind},{','.join(f'{x:.5g}' for x in row)}" for kind, row in rows]
    given.output.write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
