"""A table of all engines under one probe: ``python -m tests.web.table [PROBE] [-o FOLDER]``.

Without a probe it takes one that is made, without any symmetry. In the folder lie pictures: what
the engine showed on the left, what its documented shading makes of our levels on the right.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.probe.open import open_probe
from tests.web import others, proofs, viewer
from tests.web.browser import absent, launched, served

ROUGHNESSES = (0.0, 0.2, 0.5, 1.0)
_ROWS = 256
"""Rows of the lat-long that PlayCanvas, CesiumJS and <model-viewer> are compared with sums of."""


def lines(made, dds):
    """Lines of Markdown: RMS, and the largest difference of a pixel."""
    yield (
        "| engine | mirrored light would be off by | diffuse | mirror | roughness .2 | .5 | 1 "
        "| `shrm render`, mirror / .2 |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for proof in made:
        rows = {row.what: row for row in proof.rows}
        balls = [rows.get(f"{roughness:g}") for roughness in ROUGHNESSES]
        diffuse = [row for what, row in rows.items() if what.startswith("diffuse")]
        cells = [
            proof.engine,
            f"x {min(row.turned for row in proof.rows):.0f}",
            " / ".join(map(_differences, diffuse)),
            *map(_differences, balls),
            " / ".join(f"{100 * row.to_shrm:.1f} %" for row in balls[:2] if row and row.to_shrm),
        ]
        yield f"| {' | '.join(cells)} |"
    yield f"\nTexels of a DDS cube as Babylon.js reads them: within {100 * dds:.3f} %."


def _differences(row):
    """What a ball showed; nothing where it was not looked at."""
    return "" if row is None else f"{100 * row.rms:.2f} %, {100 * row.largest:.1f} %"


def _other(browser, folder, address, name, probe, size):
    """One of the engines of `others`, beside sums over the probe's pixels; it has no pictures."""
    # The finer its panorama is, the less <model-viewer>'s own filter errs.
    size = 1024 if name == "model-viewer" else size
    opened = others.Opened(browser, folder, address, name, probe, size, 192)
    rows = others.rows(opened, probe, ROUGHNESSES, _ROWS)
    opened.page.close()
    return proofs.Proof(name, rows, opened.page.errors, opened.page.requests)


def main(arguments=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("probe", nargs="?", help="by default one that is made")
    parser.add_argument("-o", "--output", type=Path, help="a folder for pictures")
    parser.add_argument("--size", type=int, default=256, help="texels of level 0")
    given = parser.parse_args(arguments)
    why = absent()
    if why is not None:
        sys.exit(f"Error: {why}")
    probe = open_probe(given.probe) if given.probe else proofs.made_probe(256)
    with tempfile.TemporaryDirectory() as name, launched() as browser, served(name) as address:
        folder = Path(name)
        for script in ("three", "babylon"):
            proofs.prepare(folder, script)
        common = browser, folder, address, probe, given.size, ROUGHNESSES
        made = [
            proofs.filament(*common),
            proofs.three(*common),
            proofs.babylon(*common),
            proofs.babylon(*common, form="gltf"),
            viewer.gltf_viewer(*common[:4], 256, (0.0,), pixels=1024, samples=8),
        ]
        for build in ("webgl", "webgpu"):
            proofs.prepare_three(folder, build)
            proof = proofs.three(*common, texels="uastc", build=build)
            made.append(replace(proof, engine=f"three.js, its own loader, {build}"))
        made += [_other(browser, folder, address, name, probe, given.size) for name in others.NAMES]
        dds, _, _ = proofs.directx(browser, folder, address, probe, given.size)
    print("\n".join(lines(made, dds)))
    if given.output:
        given.output.mkdir(parents=True, exist_ok=True)
        for proof in made:
            for what, pair in proof.pictures.items():
                stem = f"{proof.engine}-{what}".replace(" ", "-").replace(",", "")
                write_png(given.output / f"{stem}.png", encode_srgb(np.concatenate(pair, axis=1)))


if __name__ == "__main__":
    main()
