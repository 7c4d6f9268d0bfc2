"""The wheel and the source distribution: complete, without tests, and usable where nothing else is.

The environments that the tests make hold the distribution alone; what it depends on is lent to
them by a path to this environment's packages, which does not lend this checkout's own code.
"""

import email
import io
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

from shrm_cli import __release__
from tests.archives import unpack

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = {
    path.relative_to(ROOT).as_posix()
    for path in ROOT.glob("shrm_cli/**/*")
    if path.is_file() and path.suffix != ".pyc"
} | {"shrm_cli/_version.py"}  # which is written as it is built
PAGES = ["README.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "SECURITY.md"]
BUILD = (sys.executable, "-m", "build", "--no-isolation")
VERSION = "import shrm_cli as s; print(s.__version__)"


def run(*command, environment=(), **options):
    hidden = ("PYTHONPATH", "VIRTUAL_ENV", "SETUPTOOLS_SCM_PRETEND_VERSION")
    kept = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(
        [str(part) for part in command],
        capture_output=True, text=True, env=kept | dict(environment), **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="session")
def distributions(tmp_path_factory):
    """The wheel and the source distribution of a copy of the tracked files."""
    source = tmp_path_factory.mktemp("source")
    files = [*PAGES, "pyproject.toml", "LICENSE", "MANIFEST.in", ".git_archival.txt"]
    for folder in ("shrm_cli", "docs", "examples", "research", "tests", "probes"):
        files += [path.relative_to(ROOT) for path in ROOT.glob(f"{folder}/**/*") if path.is_file()]
    for name in map(Path, files):
        if (
            name.name != "_version.py"
            and name.suffix != ".pyc"
            and "node_modules" not in name.parts
        ):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    out = tmp_path_factory.mktemp("dist")
    run(*BUILD, "--outdir", out, source)
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
    assert {name for name in names if name.startswith("shrm_cli/")} == PACKAGE
    assert len({name for name in names if not name.endswith(".py")}) > 10
    others = {name.split("/")[0] for name in names} - {"shrm_cli"}
    assert all(name.endswith(".dist-info") for name in others)


@pytest.mark.proof
def test_the_source_distribution_is_complete_and_clean(distributions):
    with tarfile.open(distributions[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert names >= PACKAGE
    assert {*PAGES, "pyproject.toml", "LICENSE", "docs/library.md", "examples/library.py"} <= names
    assert not {name for name in names if name.startswith(("research", "tests", "probes", "."))}


def test_metadata_tell_what_it_is(distributions):
    with zipfile.ZipFile(distributions[0]) as wheel:
        (name,) = [each for each in wheel.namelist() if each.endswith(".dist-info/METADATA")]
        said = email.message_from_bytes(wheel.read(name))
        (name,) = [each for each in wheel.namelist() if each.endswith("entry_points.txt")]
        assert "shrm = shrm_cli.__main__:main" in wheel.read(name).decode()
    assert said["Name"] == "shrm-cli"
    assert said["License-Expression"] == "BSD-3-Clause"
    assert said["Requires-Python"] == ">=3.11"
    assert said["Project-URL"].startswith("Homepage, https://")
    assert said["Version"] == f"{__release__}.dev0"
    kinds = {each.partition(" :: ")[0] for each in said.get_all("Classifier")}
    assert kinds >= {"Development Status", "Operating System", "Programming Language"}


def git(folder, *arguments):
    who = {f"GIT_{role}_{what}": "a@b" for role in ("AUTHOR", "COMMITTER")
           for what in ("NAME", "EMAIL")}  # fmt: skip
    configuration = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
    return run("git", "-C", folder, *arguments, environment=who | configuration).strip()


def counted(folder):
    """The version that setuptools-scm finds for a tree, without writing it."""
    code = (
        "from setuptools_scm import Configuration, _get_version as get; "
        "print(get(Configuration.from_file('pyproject.toml'), force_write_version_files=False))"
    )
    return run(sys.executable, "-W", "ignore", "-c", code, cwd=folder).strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="no git")
def test_the_version_tells_builds_apart(tmp_path):
    """In clones with tags and without, and in archives of git's, which have no history."""
    tree, out = tmp_path / "tree", tmp_path / "out"
    tree.mkdir()
    (tree / "shrm_cli").mkdir()
    for name in ("pyproject.toml", ".git_archival.txt", ".gitattributes"):
        shutil.copy(ROOT / name, tree)

    def archive():
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        with tarfile.open(fileobj=io.BytesIO(archive_of(tree))) as packed:
            unpack(packed, out)
        return counted(out)

    git(tree, "init", "--quiet")
    git(tree, "add", ".")
    for _ in range(2):
        git(tree, "commit", "--quiet", "--allow-empty", "--message", "one more")
    commit = git(tree, "rev-parse", "HEAD")
    version, _, node = counted(tree).partition("+g")
    assert version == f"{__release__}.dev2"
    assert len(node) >= 7
    assert commit.startswith(node)
    assert archive() == f"{__release__}.dev0"
    git(tree, "tag", f"v{__release__}")
    assert counted(tree) == archive() == __release__
    git(tree, "commit", "--quiet", "--allow-empty", "--message", "after it")
    commit = git(tree, "rev-parse", "HEAD")
    for after in (counted(tree), archive()):
        version, _, node = after.partition("+g")
        assert re.fullmatch(r"\d+\.\d+\.\d+\.dev1", version)
        assert commit.startswith(node)


def archive_of(tree):
    done = subprocess.run(["git", "-C", tree, "archive", "HEAD"], capture_output=True, check=True)
    return done.stdout


@pytest.mark.proof
def test_a_source_distribution_knows_its_version(distributions, tmp_path):
    """It can be made again from itself, where there is no git."""
    version = "0.2.7.dev8+gabcdef0"
    (tree,) = extracted(distributions[1], tmp_path / "first").iterdir()
    run(
        *BUILD, "--sdist", "--outdir", tmp_path, tree,
        environment={"SETUPTOOLS_SCM_PRETEND_VERSION": version},
    )  # fmt: skip
    (tree,) = extracted(tmp_path / f"shrm_cli-{version}.tar.gz", tmp_path / "second").iterdir()
    assert counted(tree) == version
    assert f"version = '{version}'" in (tree / "shrm_cli" / "_version.py").read_text()


def extracted(path, folder):
    with tarfile.open(path) as archive:
        unpack(archive, folder)
    return folder


@pytest.mark.proof
def test_the_wheel_works_where_nothing_else_of_the_project_is(installed, tmp_path):
    run(installed / "shrm", "probe", "studio", "-o", "studio.exr", "--size", "32", cwd=tmp_path)
    out = run(installed / "shrm", "prefilter", "studio.exr", "--brdf", "phong", cwd=tmp_path)
    assert "studio.phong.shrm.exr: global SHRM" in out
    code = "import shrm_cli as s; print(s.open_map('studio.phong.shrm.exr').size, s.__file__)"
    size, path = run(installed / "python", "-c", code, cwd=tmp_path).split()
    assert int(size) >= 16
    assert not Path(path).is_relative_to(ROOT)
    version = run(installed / "python", "-c", VERSION, cwd=tmp_path).strip()
    assert version == f"{__release__}.dev0"
    assert run(installed / "shrm", "--version", cwd=tmp_path) == f"shrm, version {version}\n"


@pytest.mark.proof
def test_the_example_of_a_package_works(installed, tmp_path):
    """A BRDF, a command and an engine by entry points, in an environment of their own."""
    shutil.copytree(ROOT / "examples" / "plugin", tmp_path / "plugin")
    install(installed / "python", tmp_path / "plugin")
    assert "  mean " in run(installed / "shrm", "--help", cwd=tmp_path)
    run(installed / "shrm", "probe", "furnace", "-o", "white.exr", "--size", "16", cwd=tmp_path)
    assert run(installed / "shrm", "mean", "white.exr", cwd=tmp_path) == "1 1 1\n"
    out = run(
        installed / "shrm", "prefilter", "white.exr", "--brdf", "lommel-seeliger:albedo=1",
        cwd=tmp_path,
    )  # fmt: skip
    assert "white.lommel-seeliger-albedo-1." in out
    out = run(installed / "shrm", "export", "white.exr", "--for", "ambient-cube", cwd=tmp_path)
    assert "white_cube.json" in out
