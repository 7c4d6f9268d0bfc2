"""The program of `make gallery`: every form of some materials under the shipped probes.

Each pair of a probe and a material gets its maps, one picture of them beside the truth, a page of
`shrm view`, and a table of bytes and errors. `shrm` itself makes all of it, and the commands of the
page are those that were run.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from shrm_cli.records import record

ROOT = Path(__file__).parents[2]
_PROCESSES = 2
_WEB = "principal"
"""The form that pages of `view` show beside the truth."""
_KEPT = ("--error", "0.05")


@record
class Material:
    """A material of the gallery.

    Attributes
    ----------
    spec : str
        Its BRDF.
    forms : tuple of str
        The forms of maps that are made of it.
    shown : tuple of str
        Options of `compare` and `view` that make forms of many materials this one.
    """

    spec: str
    forms: tuple[str, ...]
    shown: tuple[str, ...] = ()


MATERIALS = {
    "chalk": Material("lambertian", ("irradiance", "shrm")),
    "lacquer": Material(
        "0.9*lambertian:albedo=0.8/0.1/0.05+0.1*phong:exponent=64", ("shrm", "principal")
    ),
    "gold": Material(
        "ggx:roughness=0.5,f0=gold",
        ("she", "splitsum", "principal", "shrm", "cabral", "kautz-mccool"),
        ("--roughness", "0.5", "--f0", "gold"),
    ),
    "steel": Material(
        "ggx:roughness=0.3,f0=0.6",
        ("she", "splitsum", "principal"),
        ("--roughness", "0.3", "--f0", "0.6"),
    ),
    "felt": Material("charlie:roughness=0.5,color=0.2/0.4/0.7", ("principal", "shrm")),
    "microfacet": Material("microfacet:sigma=0.2", ("principal", "shrm", "cabral", "kautz-mccool")),
}
"""The materials, and what the gallery calls them."""
OF_ALL_MATERIALS = {"irradiance": ("--order-f", "2"), "splitsum": ("--size", "64"), "she": ()}
"""Forms that are made without a BRDF, and their options."""
PROBES = {"studio": "-2", "sky": "-5.5"}
"""The probes, and the exposures that suit them, in stops."""


@record
class Extent:
    """How much is made: the materials, and the pixels along the edge of a picture."""

    materials: tuple[str, ...]
    pixels: int


FULL = Extent(tuple(MATERIALS), 128)
SHORT = Extent(("chalk", "lacquer"), 48)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the page `gallery.md`, its pictures and its pages of `view` into a folder."""
    parser = argparse.ArgumentParser(prog="python -m tests.site.gallery", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--short", action="store_true", help="two materials, small pictures")
    given = parser.parse_args(arguments)
    extent = SHORT if given.short else FULL
    shutil.rmtree(given.folder, ignore_errors=True)
    given.folder.mkdir(parents=True)
    pairs = [(probe, name) for name in extent.materials for probe in PROBES]
    with ThreadPoolExecutor(_PROCESSES) as pool:
        done = pool.map(lambda pair: section(given.folder, *pair, extent.pixels), pairs)
        parts = dict(zip(pairs, done, strict=True))
    text = [_INTRODUCTION]
    for name in extent.materials:
        text.append(f"## {name.capitalize()}\n\n`{MATERIALS[name].spec}`\n")
        text += [parts[probe, name] for probe in PROBES]
    (given.folder / "gallery.md").write_text("\n".join(text), encoding="utf-8")
    print(f"The page is {(given.folder / 'gallery.md').resolve()}; make site shows it")


def section(folder: Path, probe: str, name: str, pixels: int) -> str:
    """Make the maps of a pair, its picture and its page; return the Markdown that shows them."""
    material, light = MATERIALS[name], f"probes/{probe}.exr"
    work = folder / f"{probe}-{name}"
    work.mkdir()
    files, commands = [], []
    for form in material.forms:
        files.append(os.path.relpath(work / f"{form}.exr", ROOT))
        commands.append(["prefilter", light, "--to", form, *_options(material, form)])
        _run(*commands[-1], "-o", files[-1], "--quiet", "--force")
    whole = any(form not in OF_ALL_MATERIALS for form in material.forms)
    brdf = () if whole else ("--brdf", material.spec)
    picture = f"{probe}-{name}.png"
    told = _run(
        "compare", *files, "--probe", light, *brdf, *material.shown, "--view", "30,15",
        "--size", str(pixels), "--exposure", PROBES[probe], "--no-flip", "--json",
        "-o", os.path.relpath(folder / picture, ROOT),
    )  # fmt: skip
    page = f"{probe}-{name}.html"
    shown = files[material.forms.index(_WEB)] if _WEB in material.forms else files[-1]
    _run("view", shown, "--probe", light, *brdf, "--truth-size", str(pixels // 2), "--quiet",
         "--exposure", PROBES[probe], "-o", os.path.relpath(folder / page, ROOT))  # fmt: skip
    sizes = [(ROOT / file).stat().st_size for file in files]
    shutil.rmtree(work)
    print(f"{name} under {probe}", flush=True)
    found = json.loads(told)["summary"]
    rows = [_row(*each) for each in zip(material.forms, sizes, found, strict=True)]
    return _SECTION.format(
        probe=probe, name=name, picture=picture, page=page, rows="\n".join(rows),
        commands="\n".join(f"shrm {shlex.join(each)}" for each in commands),
    )  # fmt: skip


def _options(material: Material, form: str) -> tuple[str, ...]:
    if form in OF_ALL_MATERIALS:
        return OF_ALL_MATERIALS[form]
    return ("--brdf", material.spec, *_KEPT)


def _row(form: str, size: int, found: dict[str, float]) -> str:
    shares = [f"{found[key]:.1%}" for key in ("relative_rmse", "p95_relative_error", "wrong_share")]
    return f"| {form} | {size:,} | {' | '.join(shares)} |"


def _run(*command: str) -> str:
    """Run `shrm` in the repository with one thread; return what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "shrm_cli", *command, "--threads", "1"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode != 0:
        raise SystemExit(f"shrm {shlex.join(command)}: {done.stderr.strip()}")
    return done.stdout


_INTRODUCTION = f"""# Gallery

Forms of maps beside the truth, a sum over all pixels of the probe for each point of the ball, and
their differences from it. `make gallery` makes this page from the shipped probes. Forms of one
material are asked for an RMS error of 5 % (`{" ".join(_KEPT)}`); those of all roughnesses, and
irradiance, are as they are. Bytes are those of the file, errors those of this picture: RMS, 95th
percentile (p95) of the relative error, and the share of pixels that are wrong by more than 5 %.
"""
_SECTION = """### {name}, {probe}

[![{name} under {probe}: truth, forms, differences](gallery/{picture})](gallery/{picture})

[Turn it in a browser](gallery/{page}).

| form | bytes | RMS | p95 | wrong |
|---|---|---|---|---|
{rows}

```text
{commands}
```
"""


if __name__ == "__main__":
    main()
