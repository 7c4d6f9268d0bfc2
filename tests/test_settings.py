"""Settings hold within a block, and nowhere else."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from shrm_cli import settings
from shrm_cli.errors import ArgumentError
from shrm_cli.settings import Settings
from tests.cli.helpers import environment, run


def test_the_defaults():
    assert settings.current() == Settings(threads=None, cache=True)


def test_blocks_nest_and_restore():
    with settings.using(threads=3):
        assert settings.current() == Settings(3, True)
        with settings.using(cache=Path("x")):
            assert settings.current() == Settings(3, Path("x"))
            with settings.using(threads=None, cache=False):
                assert settings.current() == Settings(None, False)
            assert settings.current() == Settings(3, Path("x"))
        assert settings.current() == Settings(3, True)
    assert settings.current() == Settings()


def test_one_may_be_used_again_and_within_itself():
    twice = settings.using(threads=2)
    with twice, settings.using(threads=5), twice:
        assert settings.current().threads == 2
    assert settings.current() == Settings()


def test_errors_restore():
    def fail():
        with settings.using(threads=2):
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert settings.current() == Settings()


@pytest.mark.parametrize("count", [0, -1])
def test_no_threads_at_all_are_refused(count):
    with pytest.raises(ArgumentError, match="one is the least"):
        settings.using(threads=count)


def test_other_threads_have_their_own():
    with settings.using(threads=2), ThreadPoolExecutor(1) as pool:
        assert pool.submit(settings.current).result() == Settings()


@pytest.mark.parametrize("options", [[], ["--threads", "0"]], ids=["done", "refused"])
def test_the_command_line_leaves_none_behind(options):
    seen = []

    def look(*arguments, **keywords):
        seen.append(settings.current())
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shrm_cli.parse_spec", look)
        run("brdf", "phong", "--no-cache", "--threads", 2, *options)
    assert seen == ([] if options else [Settings(2, False)])
    assert settings.current() == Settings()


def test_it_needs_no_numpy():
    code = "import sys, shrm_cli.settings; print('numpy' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True
    )
    assert found.stdout == "False\n"
