"""What libraries print past Python stays away from the terminal."""

import os
import threading

import numpy as np
import pytest

from shrm_cli.files.openimageio import caught, last_noise, quiet
from tests.cli.helpers import MAIN, assert_refused, process
from tests.fuzz.mutations import _png_sums
from tests.probe import scenes


def shout(text):
    """Print to the process's stderr as a library in C does."""
    os.write(2, text.encode())


def test_noise_is_caught_and_told(capfd):
    with caught():
        shout("library: bad\nmore\n")
    shout("seen\n")
    assert last_noise() == "library: bad"
    assert capfd.readouterr() == ("", "seen\n")


def test_within_each_other(capfd):
    with caught():
        with caught():
            shout("a\n")
        shout("b\n")
    assert capfd.readouterr().err == ""
    assert last_noise() == "a"


def test_an_error_gives_stderr_back(capfd):
    @quiet
    def fail():
        shout("noise\n")
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        fail()
    shout("seen\n")
    assert capfd.readouterr().err == "seen\n"


def test_threads(capfd):
    barrier = threading.Barrier(4)

    @quiet
    def work():
        barrier.wait(10)
        shout("noise\n")
        barrier.wait(10)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    shout("seen\n")
    assert capfd.readouterr().err == "seen\n"


def test_no_descriptor_is_left_open():
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    for _ in range(20):
        with caught():
            shout("noise\n")
    after = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    assert after == before


def test_without_a_stderr():
    code = """
import os
os.close(2)
from shrm_cli.files.openimageio import caught
with caught():
    pass
print("done")
"""
    assert process(code=code).out == "done\n"


def test_libpng(tmp_path):
    """The checksum of the pixels is right, but not what they unpack to."""
    path = scenes.write_png(tmp_path / "a.png", np.zeros((8, 16, 3), np.uint8))
    data = path.read_bytes()
    at = data.index(b"IDAT") + 6
    broken = bytearray(data)
    broken[at] ^= 0xFF
    path.write_bytes(with_sums(bytes(broken)))
    assert_refused(process("info", path, "--linearize", code=MAIN), 1, "damaged or truncated")


def with_sums(data):
    """Correct the checksums of a PNG, by the fuzz harness with no damage of its own."""

    class Nothing:
        def randrange(self, count):
            return 0

        def random(self):
            return 1.0

        def choice(self, ways):
            return lambda body, rng: body

    return _png_sums(data, Nothing())
