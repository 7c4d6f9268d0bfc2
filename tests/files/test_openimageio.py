"""Signals while OpenImageIO loads, whose bindings abort the process if a handler raises there."""

import signal
import sys

import pytest

from shrm_cli.files.openimageio import undisturbed

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")


class Stopped(Exception):
    pass


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_handled_at_the_end(number):
    def stop(number, frame):
        raise Stopped

    seen, before = [], signal.signal(number, stop)

    def load():
        with undisturbed():
            signal.raise_signal(number)
            seen.append("the rest")

    try:
        with pytest.raises(Stopped):
            load()
        assert signal.getsignal(number) is stop
    finally:
        signal.signal(number, before)
    assert seen == ["the rest"]


def test_what_is_ignored_stays_so():
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with undisturbed():
            signal.raise_signal(signal.SIGTERM)
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)
