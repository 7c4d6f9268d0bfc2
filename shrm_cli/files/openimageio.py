"""OpenImageIO, loaded where no signal can break it off, and kept from the user's terminal.

Its bindings make their enumerations while they load, and abort the process if a signal's handler
raises an exception in one of these calls: no message of ours, and temporary files stay.

libpng and others print to the process's stderr, beside the error that they return. While a library
reads, what it prints goes to a file without a name, and may be used for the message.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ShrmError
from shrm_cli.files.exr_header import MOST_CHANNELS
from shrm_cli.files.whole import scratch_folder

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

_MOST = 2**12  # bytes of noise that are looked at
_STDERR = 2


class _Catcher:
    """Redirects stderr as long as one of the threads asks for it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._kept = self._caught = -1
        self.said = ""

    def start(self) -> None:
        with self._lock:
            self._depth += 1
            if self._depth > 1:
                return
            self.said = ""
            if sys.stderr is not None:
                with contextlib.suppress(OSError, ValueError):
                    sys.stderr.flush()
            with contextlib.suppress(OSError):  # such as that there is no stderr
                self._kept = os.dup(_STDERR)
                self._caught = _nameless_file()
                os.dup2(self._caught, _STDERR)

    def stop(self) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth > 0:
                return
            with contextlib.suppress(OSError):
                if self._kept >= 0:
                    os.dup2(self._kept, _STDERR)
                if self._caught >= 0:
                    self.said = os.pread(self._caught, _MOST, 0).decode("utf-8", "replace")
            for each in (self._kept, self._caught):
                with contextlib.suppress(OSError):
                    os.close(each)
            self._kept = self._caught = -1


_catcher = _Catcher()


@contextlib.contextmanager
def caught() -> Iterator[None]:
    """Context manager within which nothing that is printed to the process's stderr is seen."""
    _catcher.start()
    try:
        yield
    finally:
        _catcher.stop()


def quiet(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a function that calls an image library, whose noise is then caught."""

    @wraps(function)
    def call(*arguments: Parameters.args, **options: Parameters.kwargs) -> Result:
        with caught():
            return function(*arguments, **options)

    return call


def last_noise() -> str:
    """Return the first line of what a library printed when noise was caught for the last time."""
    lines = [line.strip() for line in _catcher.said.splitlines() if line.strip()]
    return lines[0] if lines else ""


def _nameless_file() -> int:
    if hasattr(os, "memfd_create"):
        return os.memfd_create("noise", os.MFD_CLOEXEC)
    import tempfile  # slow to load, and rarely needed

    with tempfile.TemporaryFile() as stream:
        return os.dup(stream.fileno())


_STOPPING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Context manager at whose end signals are handled that arrive within it.

    Only the main thread handles signals, so that others need nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {each: signal.getsignal(each) for each in _STOPPING}
    handlers = {each: handler for each, handler in handlers.items() if callable(handler)}
    for each in handlers:
        signal.signal(each, lambda number, frame: arrived.append(number))
    try:
        yield
    finally:
        for each, handler in handlers.items():
            signal.signal(each, handler)
        for number in arrived[:1]:
            signal.raise_signal(number)


class _Library:
    """OpenImageIO, which is loaded when it is first used: that takes a tenth of a short run.

    Where there is none, as in browsers, what needs it is refused.
    """

    def __getattr__(self, name: str) -> Any:
        try:
            with undisturbed():
                import OpenImageIO
        except ModuleNotFoundError:
            raise ShrmError(
                "image files need OpenImageIO, which is not installed; install it, or give arrays"
            ) from None
        # The default would refuse SHRMs of high orders. Whoever reads a file must check that it
        # does not hold too many values to load, as `maps.file.open_map` does.
        OpenImageIO.attribute("limits:channels", MOST_CHANNELS)
        vars(self).update(vars(OpenImageIO))
        return getattr(OpenImageIO, name)


oiio: Any = _Library()


@quiet
def image_of(data: bytes, suffix: str) -> Array:
    """Return the red, green and blue of a file's bytes, shape (M, N, 3).

    Its Python bindings read from disk alone, hence the scratch file.
    """
    with scratch_folder() as folder:
        path = folder / f"image{suffix}"
        path.write_bytes(data)
        image = np.asarray(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT), dtype=float)
    return image[..., :3]
