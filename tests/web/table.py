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
from shrm_cli.render.image import expose, shown_at
from tests.web import ball, others, proofs, viewer
from tests.web.browser import absent, launched, served

ROUGHNESSES = (0.0, 0.2, 0.5, 1.0)
_ROWS = 256
"""Rows of the lat-long that PlayCanvas, CesiumJS and <model-viewer> are compared with sums of."""


HEAD = """\
| engine | mirrored light would be off by | diffuse | mirror | roughness .2 | .5 | 1 \
| `shrm render`, mirror / .2 |
|---|---|---|---|---|---|---|---|"""


def line(proof):
    """A line of Markdown: RMS, and the largest difference of a pixel."""
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
    return f"| {' | '.join(cells)} |"


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


def proven(browser, folder, address, probe, size):
    """Yield what each engine showed, one after the other, as each takes up to half a minute."""
    common = browser, folder, address, probe, size, ROUGHNESSES
    for script in ("three", "babylon"):
        proofs.prepare(folder, script)
    yield proofs.filament(*common)
    yield proofs.three(*common)
    yield proofs.babylon(*common)
    yield proofs.babylon(*common, form="gltf")
    yield viewer.gltf_viewer(*common[:4], 256, (0.0,), pixels=1024, samples=8)
    for build in ("webgl", "webgpu"):
        proofs.prepare_three(folder, build)
        proof = proofs.three(*common, texels="uastc", build=build)
        yield replace(proof, engine=f"three.js, its own loader, {build}")
    for name in others.NAMES:
        yield _other(browser, folder, address, name, probe, size)


def draw(folder, proof):
    """Write the pictures of an engine beside ours, at an exposure at which they are not white."""
    folder.mkdir(parents=True, exist_ok=True)
    for what, (found, ours) in proof.pictures.items():
        stem = f"{proof.engine}-{what}".replace(" ", "-").replace(",", "")
        path = folder / f"{stem}.png"
        _, inside = ball.seen(len(ours), proofs.VIEW)
        pair = np.concatenate([found, np.where(inside[..., None], ours, 0)], axis=1)
        write_png(path, encode_srgb(expose(pair, shown_at(path.name, pair))))


def main(arguments=None):
    """Print the table, a line as soon as it is known, and write the pictures."""
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
        print(HEAD, flush=True)
        for proof in proven(browser, folder, address, probe, given.size):
            print(line(proof), flush=True)
            if given.output:
                draw(given.output, proof)
        dds, _, _ = proofs.directx(browser, folder, address, probe, given.size)
    print(f"\nTexels of a DDS cube as Babylon.js reads them: within {100 * dds:.3f} %.")
    if given.output:
        print(f"Pictures, the engine's on the left: {given.output.resolve()}")


if __name__ == "__main__":
    main()
