"""OpenImageIO, loaded where no signal can break it off.

Its bindings make their enumerations while they load, and abort the process if a signal's handler
raises an exception in one of these calls: no message of ours, and temporary files stay.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator

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


with undisturbed():
    import OpenImageIO as oiio

__all__ = ["oiio", "undisturbed"]
