"""`shrm` itself: help, versions, exit codes, and what becomes of errors."""

import os
import platform
import re
import signal
import subprocess
import sys
import tomllib

import click
import numpy as np
import pytest
from click.testing import CliRunner

from shrm_cli import __version__, errors
from shrm_cli.cli.main import cli
from shrm_cli.maps import registry
from shrm_cli.vocabulary import REPRESENTATIONS
from tests.cli.helpers import MAIN, ROOT, assert_refused, done, environment, process, run, start
from tests.probe import scenes

COMMANDS = ["prefilter", "render", "info", "brdf", "probe"]
# Reports what a run has imported, after its own output.
REPORTING = """
import atexit, sys
heavy = {"numpy", "OpenImageIO", "OpenEXR", "tqdm", "click"}
atexit.register(lambda: print("loaded", *sorted(heavy & sys.modules.keys())))
"""


def test_help_lists_every_command():
    text = done("--help")
    for command in COMMANDS:
        assert re.search(rf"^  {command} +\w", text, re.M)
    assert text == done("-h")


@pytest.mark.parametrize("command", COMMANDS)
def test_list_says_what_each_command_says_of_itself(command):
    """The list is written by hand, so that no command needs to be loaded for it."""
    listed = re.search(rf"^  {command} +(\w.*)$", done("--help"), re.M)[1].rstrip(".")
    own = cli.get_command(None, command).get_short_help_str(200)
    assert listed.split()[0] == own.split()[0]


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_fit_into_80_columns(command):
    """Other lines are wrapped, but those of `\\b` blocks are shown as they are."""
    examples = re.findall(r"^ +shrm .*$", done(command, "--help"), re.M)
    assert max(map(len, examples), default=0) <= 80


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        ("prefilter", "--compress pca:K|pca:X "),
        ("render", "--brush uv|X,Y,Z "),
        ("render", "--size N|WxH "),
        ("transfer", "--albedo X|R,G,B|mesh|vertex "),
        ("export", "--yaw FLOAT "),
    ],
)
def test_words_of_values_are_shown_as_they_are_written(command, shown):
    """In capitals, as click shows types, they would be refused."""
    assert shown in done(command, "--help")


def test_prefilter_lists_each_option_once_under_a_heading():
    text = done("prefilter", "--help")
    headings = re.findall(r"^(\S.*):$", text, re.M)
    assert headings[:3] == ["What to make", "How exact", "Form of the map"]
    assert headings[-3:] == ["How the probe is read", "Output", "Running"]
    for name in REPRESENTATIONS:
        own = registry.description(name).options
        assert bool(own) == any(name in each for each in headings if "--to" in each)
    for param in cli.get_command(None, "prefilter").params:
        if isinstance(param, click.Option):
            flag = re.escape(max(param.opts, key=len))
            assert len(re.findall(rf"^  (-o, )?{flag}(?![-a-z])", text, re.M)) == 1
    assert text.count("    shrm prefilter ") >= 4


def test_the_module_is_the_command():
    code = "import runpy; runpy.run_module('shrm_cli', run_name='__main__')"
    assert process("--version", code=code).out == done("--version")
    assert_refused(process("prefilte", code=code), 2, "No such command 'prefilte'")


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], *([c, "--help"] for c in COMMANDS)]
)
def test_help_imports_nothing_heavy(arguments):
    result = process(*arguments, code=REPORTING + MAIN)
    assert (result.code, result.err) == (0, "")
    assert result.out.splitlines()[-1] == "loaded click"


def test_reporting_of_imports_works():
    result = process("brdf", "lambertian", "--quiet", code=REPORTING + MAIN)
    assert result.out == "loaded click numpy\n"


def test_version():
    assert done("--version") == f"shrm, version {__version__}\n"
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+)?(\+[a-z0-9.]+)?", __version__)


def test_a_run_asks_nobody_for_the_version(tmp_path):
    """It is looked up where it is printed, and metadata are left alone."""
    code = f"""
import atexit, shrm_cli, sys
def tell():
    print("__version__" in vars(shrm_cli), "importlib.metadata" in sys.modules)
atexit.register(tell)
{MAIN}"""
    arguments = (ROOT / "probes" / "sky.exr", "--brdf", "phong", "-o", tmp_path / "a.exr")
    assert process("prefilter", *arguments, "--quiet", code=code).out == "False False\n"
    assert process("--version", code=code).out.endswith("\nTrue False\n")
    # Nor are metadata parsed to find that nobody offers forms.
    assert process("prefilter", "--help", code=code).out.endswith("\nFalse False\n")


def test_without_arguments_it_helps():
    result = run()
    assert result.err + result.out == done("--help")
    assert result.code == 2


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["prefliter"], ["'prefliter'", "Did you mean 'prefilter'?"]),
        (["xyz"], ["'xyz'", "shrm --help"]),
        (["--bogus"], ["--bogus", "shrm --help"]),
        (["prefilter"], ["PROBE", "shrm prefilter --help"]),
        (["prefilter", "x.exr"], ["--brdf", "shrm prefilter --help"]),
        (["prefilter", "x.exr", "--siez", "3"], ["--siez", "--size"]),
        (["prefilter", "x.exr", "--brdf"], ["--brdf", "argument"]),
        (["prefilter", "x.exr", "y.exr", "--brdf", "phong"], ["y.exr"]),
        (["info"], ["FILE", "shrm info --help"]),
        (["info", "x", "--threads", "0"], ["--threads", "1<=x<=1024"]),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(arguments, parts):
    assert_refused(run(*arguments), 2, *parts)


def test_works_under_clicks_own_runner():
    result = CliRunner().invoke(cli, ["brdf", "phong", "--eps", "0.01"])
    assert result.exit_code == 0
    assert "F = 12" in result.output
    assert CliRunner().invoke(cli, ["brdf", "--eps", "2"]).exit_code == 2
    failed = CliRunner().invoke(cli, ["brdf", "phnog"])
    assert isinstance(failed.exception, errors.BrdfError)


@pytest.mark.parametrize(
    "name", ["ProbeError", "BrdfError", "OrderError", "MapError", "OutputError"]
)
def test_every_error_of_ours_is_one_line_and_code_1(monkeypatch, name):
    def fail(*_):
        raise getattr(errors, name)("x.exr: two\nlines;   do this")

    monkeypatch.setattr("shrm_cli.parse_spec", fail)
    result = run("brdf", "phong")
    assert (result.code, result.out, result.err) == (1, "", "Error: x.exr: two lines; do this\n")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "out of memory; lower --size or the orders"),
        (OSError(28, "No space left on device"), "standard output: No space left on device"),
        (PermissionError(13, "Permission denied", "x.exr"), "x.exr: Permission denied"),
        (
            ModuleNotFoundError("No module named 'OpenEXR'", name="OpenEXR"),
            "shrm needs the package OpenEXR, which this Python has not; install it",
        ),
        (
            ModuleNotFoundError("No module named 'shrm_cli.x'", name="shrm_cli.x"),
            "internal error, please report it (ModuleNotFoundError: No module named 'shrm_cli.x'); "
            "shrm --debug ... tells more",
        ),
        (
            ZeroDivisionError("by\nzero"),
            "internal error, please report it (ZeroDivisionError: by zero); "
            "shrm --debug ... tells more",
        ),
    ],
)
def test_other_errors_show_no_traceback(monkeypatch, error, message):
    def fail(*_):
        raise error

    monkeypatch.setattr("shrm_cli.parse_spec", fail)
    result = run("brdf", "phong")
    assert (result.code, result.out, result.err) == (1, "", f"Error: {message}\n")
    with pytest.raises(type(error)):
        run("--debug", "brdf", "phong")


def test_debug_shows_the_traceback_of_a_process():
    result = process("--debug", "brdf", "phnog")
    assert result.code == 1
    assert result.err.startswith("Traceback")
    assert "BrdfError: no BRDF is called 'phnog'" in result.err
    assert (
        process("brdf", "phnog").err
        == "Error: no BRDF is called 'phnog'; did you mean phong or blinn-phong?\n"
    )


def test_interrupted_is_130(monkeypatch):
    def fail(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("shrm_cli.parse_spec", fail)
    result = run("brdf", "phong")
    assert (result.code, result.out, result.err) == (130, "", "\nError: interrupted\n")


def test_the_end_of_a_file_is_no_interruption(monkeypatch):
    """Click takes EOFError for Ctrl-D on a terminal, of which no command reads."""

    def fail(*_):
        raise EOFError("cut off")

    monkeypatch.setattr("shrm_cli.parse_spec", fail)
    result = run("brdf", "phong")
    assert (result.code, result.out) == (1, "")
    assert "Error: internal error, please report it (EOFError: cut off)" in result.err


def test_a_reader_that_goes_away_is_no_news():
    """As in ``shrm brdf | head -0``."""
    with start("brdf") as child:
        child.stdout.close()
        child.wait(timeout=30)
        assert child.stderr.read() == ""
        assert child.returncode == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full to print to")
def test_results_that_cannot_be_printed_are_an_error():
    with open("/dev/full", "w") as full:
        child = subprocess.run(
            [sys.executable, "-c", MAIN, "brdf"],
            env=environment(),
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert child.returncode == 1
    assert child.stderr == "Error: standard output: No space left on device\n"


@pytest.mark.parametrize(("count", "images"), [("3", "3"), (None, None)])
def test_threads_limits_every_pool(count, images):
    """BLAS stays at one thread: shared products round differently."""
    code = f"""
import atexit, os
names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS")
atexit.register(lambda: print(*(os.environ.get(name) for name in names)))
{MAIN}"""
    options = ["--threads", count] if count else []
    result = process("brdf", "lambertian", "--quiet", *options, code=code)
    assert result.out == f"1 1 1 {images}\n"


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="no /proc to count threads with")
def test_threads_reach_the_libraries(tmp_path):
    """Read, multiply and write, then let the system count the threads that are left.

    The probe has tiles, so that OpenImageIO reads it.
    """
    code = f"""
import atexit, os
atexit.register(lambda: print(len(os.listdir("/proc/self/task"))))
{MAIN}"""

    def threads(count):
        options = ["-o", tmp_path / "m.exr", "--quiet", "--threads", count]
        result = process("prefilter", tmp_path / "p.exr", "--brdf", "phong", *options, code=code)
        return int(result.out)

    scenes.write(tmp_path / "p.exr", np.ones((512, 1024, 3), np.float32), tile=64)
    assert threads(1) <= 2  # the main thread waits for a pool of one
    assert 8 < threads(16) <= 17


def test_pyproject_installs_main():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, name = scripts["shrm"].split(":")
    code = f"from {module} import {name}; {name}()"
    assert process("--version", code=code).out == f"shrm, version {__version__}\n"


def test_sigterm_unwinds():
    code = f"""
import os, signal, shrm_cli.brdf.spec as spec
def fail(*_):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    finally:
        print("cleaned up", flush=True)
spec.parse_spec = fail
{MAIN}"""
    result = process("brdf", "phong", code=code)
    assert (result.code, result.out, result.err) == (
        128 + signal.SIGTERM,
        "cleaned up\n",
        "Error: stopped by SIGTERM\n",
    )


def test_it_runs_as_a_module():
    found = subprocess.run(
        [sys.executable, "-m", "shrm_cli", "--version"],
        env=environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout == f"shrm, version {__version__}\n"


COUNTING = f"""
import atexit, sys
def tell():
    ours = [each for name, each in sys.modules.items() if name.startswith("shrm_cli")]
    full = [each for each in ours if not (each.__file__ or "").endswith("__init__.py")]
    print("loaded", len(full), file=sys.stderr)
atexit.register(tell)
{MAIN}"""


def modules_loaded(result):
    (count,) = (int(line.split()[1]) for line in result.err.splitlines() if "loaded" in line)
    return count


MOST_MODULES = 68
"""What a plain run loads of the package, without the empty modules that stand for folders.

Each of them costs time at every start, and ten times as much where Python keeps no bytecode.
Whoever raises this says why; whoever loads less lowers it.
"""


def test_a_plain_run_loads_few_modules(tmp_path):
    """The second run is counted, which takes the coefficients of the BRDF from the cache."""
    probe, target = tmp_path / "p.exr", tmp_path / "m.exr"
    done("probe", "sky", "--size", "128", "-o", str(probe))  # coarser ones are cut by more modules
    command = (
        "prefilter", str(probe), "--brdf", "microfacet:sigma=0.1", "--eps", "0.03",
        "-o", str(target),
    )  # fmt: skip
    for _ in range(2):
        result = process(*command, code=COUNTING)
    assert result.code == 0
    assert "pixels  " in result.out  # the report is printed
    assert modules_loaded(result) <= MOST_MODULES


MODELS = f"""
import atexit, sys
def tell():
    names = (name.rpartition(".") for name in sys.modules)
    print("models", *sorted(own for folder, _, own in names if folder.endswith("brdf.models")))
atexit.register(tell)
{MAIN}"""


def test_lamps_beside_a_map_do_not_load_all_models(tmp_path):
    """What writes code for lamps knows a dozen of them, of which a map has one."""
    probe, target = tmp_path / "p.exr", tmp_path / "m.exr"
    done("probe", "sky", "--size", "64", "-o", str(probe))
    command = "prefilter", str(probe), "--brdf", "phong", "--sun", "split", "-o", str(target)
    result = process(*command, code=MODELS)
    assert result.code == 0
    assert "beside the map" in result.out
    _, *models = result.out.splitlines()[-1].split()
    assert "phong" in models
    assert not {"ward", "eon", "oren_nayar", "cook_torrance", "blinn_phong"} & {*models}


@pytest.mark.parametrize("form", ["irradiance", "splitsum", "she"])
def test_a_conversion_of_what_stays_as_it_is_loads_few_modules(tmp_path, form):
    """Neither what makes such maps of probes, nor what other conversions need."""
    probe, made = tmp_path / "p.exr", tmp_path / "m.exr"
    done("probe", "sky", "--size", "32", "-o", str(probe))
    assert run("prefilter", probe, "--to", form, "-o", made).code == 0
    result = process("convert", made, "--to", form, "-o", tmp_path / "n.exr", code=COUNTING)
    assert result.code == 0
    assert modules_loaded(result) <= MOST_MODULES


FAULTS = """
import resource, sys
import numpy as np
from shrm_cli.__main__ import _keep_memory

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

if len(sys.argv) > 1:
    _keep_memory()
before = faults()
for _ in range(100):
    [np.ones(25_000) for _ in range(15)]
print(faults() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other libraries keep memory")
def test_memory_is_used_again():
    """Three megabytes of arrays were new pages from the system each time that they were made."""
    # dask's schedulers, which other tests start, set how much memory processes keep.
    own = {key: value for key, value in os.environ.items() if not key.startswith("MALLOC_")}
    before, now = (
        int(subprocess.check_output([sys.executable, "-c", FAULTS, *more], env=own))
        for more in ([], ["-"])
    )
    assert now < before / 10
