"""The wheel and the source distribution: complete, without tests, and usable where nothing else is.

The environments that the tests make hold the distribution alone; what it depends on is lent to
them by a path to this environment's packages, which does not lend this checkout's own code.
"""

import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob("shrm_cli/**/*.py"))

PLUGIN = """
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"
[project]
name = "minnaert"
version = "1"
[project.entry-points."shrm.brdf"]
minnaert = "minnaert:Minnaert"
[tool.setuptools]
py-modules = ["minnaert"]
"""
MODEL = '''
import numpy as np
import shrm_cli as shrm
class Minnaert(shrm.Brdf):
    """Diffuse, with a limb that is darker than Lambert's."""
    name = "minnaert"
    summary = "a darkened limb"
    center = "normal"
    parameters = (shrm.Parameter("k", 1.3, 1.0, 2.0, "1 is Lambert's law"),)
    def evaluate(self, light, view):
        cosines = np.maximum(light[..., 2] * view[..., 2], 1e-6)
        value = cosines ** (self.number("k") - 1) / np.pi
        return np.repeat(value[..., None], 3, axis=-1)
'''


def run(*command, **options):
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, env=environment, **options
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="session")
def distributions(tmp_path_factory):
    """The wheel and the source distribution of a copy of the tracked files."""
    source = tmp_path_factory.mktemp("source")
    names = [
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        "MANIFEST.in",
    ]
    for name in names:
        (source / name).write_bytes((ROOT / name).read_bytes())
    for folder in ("shrm_cli", "docs", "examples", "tests", "probes"):
        for path in ROOT.glob(f"{folder}/**/*"):
            kept = path.suffix != ".pyc" and "node_modules" not in path.parts
            if kept and path.is_file():
                target = source / path.relative_to(ROOT)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(path.read_bytes())
    out = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, source)
    (wheel,), (archive,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, archive


@pytest.fixture(scope="session")
def installed(distributions, tmp_path_factory):
    """An environment with the wheel in it: its folder of programs."""
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / "bin" / "python"
    install(python, distributions[0])
    (packages,) = folder.glob("lib/python*/site-packages")
    (packages / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder / "bin"


def install(python, *what):
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python)
    run(*pip, "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", *what)


def test_the_wheel_holds_the_package_and_nothing_else(distributions):
    names = set(zipfile.ZipFile(distributions[0]).namelist())
    assert {name for name in names if name.endswith(".py")} == set(PACKAGE)
    assert "shrm_cli/py.typed" in names
    assert "shrm_cli/brdf/measured/reading/cie_1931_d65.csv" in names
    others = {name.split("/")[0] for name in names} - {"shrm_cli"}
    assert all(name.endswith(".dist-info") for name in others)


def test_the_source_distribution_is_complete_and_clean(distributions):
    with tarfile.open(distributions[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert set(PACKAGE) <= names
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "docs/library.md"} <= names
    assert not {name for name in names if name.startswith(("tests", "probes", ".ci"))}


def test_the_wheel_works_where_nothing_else_of_the_project_is(installed, tmp_path):
    run(installed / "shrm", "probe", "studio", "-o", "studio.exr", "--size", "32", cwd=tmp_path)
    out = run(installed / "shrm", "prefilter", "studio.exr", "--brdf", "phong", cwd=tmp_path)
    assert "studio.phong.shrm.exr: global SHRM" in out
    code = "import shrm_cli as s; print(s.open_map('studio.phong.shrm.exr').size, s.__file__)"
    size, path = run(installed / "python", "-c", code, cwd=tmp_path).split()
    assert int(size) >= 16
    assert not Path(path).is_relative_to(ROOT)


def test_an_installed_entry_point_is_a_brdf(installed, tmp_path):
    plugin = tmp_path / "plugin"
    plugin.mkdir()
    (plugin / "pyproject.toml").write_text(PLUGIN)
    (plugin / "minnaert.py").write_text(MODEL)
    install(installed / "python", plugin)
    assert "minnaert" in run(installed / "shrm", "brdf", cwd=tmp_path)
    run(installed / "shrm", "probe", "furnace", "-o", "white.exr", "--size", "16", cwd=tmp_path)
    out = run(
        installed / "shrm", "prefilter", "white.exr", "--brdf", "minnaert:k=1.2", "--eps", "0.1",
        cwd=tmp_path,
    )  # fmt: skip
    assert "white.minnaert-k-1.2.shrm.exr" in out
